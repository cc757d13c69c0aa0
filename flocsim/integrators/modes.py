"""Which listed pairs act: the flags that an adaptive step keeps frozen.

A pair is closed where its outlines overlap; of all pairs of two bodies one is the closest. Inside a
step the flags stay as they are, so that the forces are smooth functions of the state; the driver
ends the step where a flag would change (see switches.py).
"""

from flocsim.integrators.views import closest_rows
from flocsim.layout import CANDIDATES, CLOSED, CLOSEST, NOW
from flocsim.slots import surface_reach


def set_modes(scene, work, state=NOW):
    """Flag every listed pair by its geometry in a state."""
    wanted = 1 if surface_reach(scene.parameters) > 0.0 else 0
    row = 0
    while row < work.tally[CANDIDATES]:
        end, closest = closest_rows(work, state, row)
        for each in range(row, end):
            work.candidates[each, CLOSED] = 1 if work.geometry[state, each, 2] < 0.0 else 0
            work.candidates[each, CLOSEST] = 0
        work.candidates[closest, CLOSEST] = wanted
        row = end
