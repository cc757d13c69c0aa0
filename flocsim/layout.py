"""Where things lie in the arrays that kernels and drivers share.

Few arrays with named places, because every array that a compiled function is handed costs compile
time in all of its callers.
"""

MASS, BUOYANT_MASS, INERTIA, FREE, EQUIVALENT_RADIUS, BOUNDING_RADIUS, RADIUS = range(7)
"""Columns of ``Scene.bodies``; FREE is 1 for a body that moves, 0 for a fixed one."""

NOW, FIRST, SECOND, NEW, SCRATCH, START = range(6)
"""States in ``Work.motion``; all but the last in ``geometry``, the first four in ``slip``: now,
inside the step twice, at its end; wherever something is tried out (or how wrong NEW is); where the
step began whose stages are still there."""

SLIP_RATES = 4
"""Rows of ``Work.slip`` from here on hold the rates of the displacements, one row a stage."""

STAGES = 7
"""Most stages of an integrator: places in ``Work.rates`` and behind ``SLIP_RATES``."""

LISTED, COSINE, SINE, MEMORY, CLUSTER, FRAMES, BODY_COLUMNS = 0, 3, 4, 5, 6, 7, 19
"""First columns in ``Work.bodies``, and how many there are."""

CLOSED, CLOSEST = 5, 6
"""Columns of ``Work.candidates`` that say how a listed pair acts in this step."""

DAMPING, STIFFNESS = range(2)
"""Matrices in ``Work.jacobian``: minus the derivatives of the forces by velocity and by place."""

CANDIDATES, EVALUATIONS, REBUILDS, SOLVES, KEPT, TALLY_SIZE = range(6)
"""Places in ``Work.tally``: pairs listed; forces evaluated, lists made, systems solved so far; one
more than the displacements set aside for a list that found no room (0: none are)."""

(
    TIME,
    UNTIL,
    STEP,
    TOLERANCE,
    ERROR,
    LARGEST_STEP,
    PREVIOUS_STEP,
    PREVIOUS_RATIO,
    PACE,
    STAGED_STEP,
    STAGED_AT,
    BEARABLE_STEP,
    STEP_ERROR,
    REJECTED_STEP,
    REJECTED_RATIO,
    SETTLING,
    SETTLED_STEP,
    CLOCK_SIZE,
) = range(18)
"""The ``clock`` of a run: time and end [s], next step [s], tolerance [m] (inf: fixed steps), summed
local error [m], largest step [s]; size of the step before (inf: none, 0: it was rejected) and its
error over the tolerance; by how much each of Newton's iterations shrinks the last change; size of
the step whose stages are still there (0: none are) and the time at which it began; the largest
step that is expected to work at all; the error of the step just taken [m]; size and error over
tolerance of the trial that was just rejected (0: none was); 1 from a switch until a step has been
taken behind it; the size of the last such step."""

STEPS, REJECTED, MAX_STEPS, RECORDED, PAUSE_AT, CODE, LOCATED, COUNTS_SIZE = range(8)
"""The ``counts`` of a run: steps taken and rejected, their budget, rows recorded, steps after
which to pause, the observer's last code, events located."""
