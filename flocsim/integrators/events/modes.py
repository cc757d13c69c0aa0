"""Which listed pairs are closed: the flags that an adaptive step keeps frozen.

Inside a step the flags stay as they are, so that the forces are smooth functions of the state; the
driver ends the step where a flag would change (see crossings.py).
"""

from flocsim.arrays import CANDIDATES, CLOSED, GAP, NOW


def set_modes(work, state=NOW):
    """Flag every listed pair by its gap in a state; whether any has changed."""
    changed = False
    for row in range(work.tally[CANDIDATES]):
        closed = 1 if work.geometry[state, row, GAP] < 0.0 else 0
        changed = changed or work.candidates[row, CLOSED] != closed
        work.candidates[row, CLOSED] = closed
    return changed
