"""Where things lie in the arrays that kernels and drivers share.

Few arrays with named places, because every array that a compiled function is handed costs compile
time in all of its callers.
"""

MASS, BUOYANT_MASS, INERTIA, FREE, EQUIVALENT_RADIUS, BOUNDING_RADIUS, RADIUS = range(7)
"""Columns of ``Scene.bodies``; FREE is 1 for a body that moves, 0 for a fixed one."""

NOW, NEW, FULL, HALF = range(4)
"""States in ``Work.motion`` and ``Work.slip``: current, next, after one whole and one half step."""

FORCE, LISTED, COSINE, SINE = 0, 3, 6, 7
"""First columns in ``Work.bodies``."""

BASE, NEWTON = range(2)
"""Systems in ``Work.system``."""

CANDIDATES, EVALUATIONS, REBUILDS, SOLVES, KEPT, TALLY_SIZE = range(6)
"""Places in ``Work.tally``: pairs listed; forces evaluated, lists made, systems solved so far; one
more than the displacements set aside for a list that found no room (0: none are)."""

TIME, UNTIL, STEP, TOLERANCE, ERROR, LARGEST_STEP, CLOCK_SIZE = range(7)
"""The ``clock`` of a run: time and end [s], next step [s], tolerance [m] (inf: fixed steps), summed
local error [m], largest step [s]."""

STEPS, REJECTED, MAX_STEPS, RECORDED, PAUSE_AT, CODE, LOCATED, COUNTS_SIZE = range(8)
"""The ``counts`` of a run: steps taken and rejected, their budget, rows recorded, steps after
which to pause, the observer's last code, events located."""
