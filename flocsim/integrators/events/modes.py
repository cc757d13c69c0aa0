"""Which listed pairs act: the flags that an adaptive step keeps frozen.

A pair is closed where its outlines overlap; of all pairs of two bodies one is the closest. Inside a
step the flags stay as they are, so that the forces are smooth functions of the state; the driver
ends the step where a flag would change (see crossings.py).
"""

from flocsim.arrays import CANDIDATES, CLOSED, CLOSEST, GAP, NOW
from flocsim.integrators.rhs.views import closest_rows

SAME, OTHER_CLOSEST, OTHER_CONTACTS = range(3)
"""What changed when pairs were flagged: nothing; only which pair is the closest, and that perhaps
by rounding, where two share a corner; which pairs touch."""


def set_modes(scene, work, state=NOW):
    """Flag every listed pair by its geometry in a state; what changed (see SAME)."""
    wanted = 1 if scene.surface_reach > 0.0 else 0
    changed = SAME
    row = 0
    while row < work.tally[CANDIDATES]:
        end, closest = closest_rows(work, state, row)
        if work.candidates[closest, CLOSEST] != wanted:
            changed = max(changed, OTHER_CLOSEST)
        for each in range(row, end):
            closed = 1 if work.geometry[state, each, GAP] < 0.0 else 0
            if work.candidates[each, CLOSED] != closed:
                changed = OTHER_CONTACTS
            work.candidates[each, CLOSED] = closed
            work.candidates[each, CLOSEST] = 0
        work.candidates[closest, CLOSEST] = wanted
        row = end
    return changed
