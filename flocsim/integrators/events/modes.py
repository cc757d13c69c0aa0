"""Which listed pairs are closed and which slide: the flags that an adaptive step keeps frozen.

Inside a step the flags stay as they are, so that the forces are smooth functions of the state; the
driver ends the step where a flag would change (see crossings.py).
"""

import flocsim.arrays as at
from flocsim.hooks import hook
from flocsim.integrators.rhs.friction import set_sliding

SAME, OTHER_FRICTION, OTHER_CONTACTS = range(3)
"""What changed when pairs were flagged: nothing; what sticks and slides, by which no force jumps;
which pairs touch."""


def set_closed(work, state=at.NOW):
    """Flag every listed pair by its gap in a state, but for those that graze; whether
    any has changed."""
    changed = False
    for row in range(work.tally[at.CANDIDATES]):
        if work.candidates[row, at.CLOSED] == at.GRAZES:
            continue
        closed = at.TOUCHES if work.geometry[state, row, at.GAP] < 0.0 else at.OPEN
        changed = changed or work.candidates[row, at.CLOSED] != closed
        work.candidates[row, at.CLOSED] = closed
    return changed


@hook
def leave_at_once(scene, work, clock, step):
    """Let pairs cease to graze that do so right behind the start of a step; whether any has."""
    return False


@hook
def settle_grazes(scene, work, clock, step):
    """Let pairs begin and cease to graze behind a step, where a method has that;
    whether any has."""
    return False


def set_modes(scene, work):
    """Flag every listed pair as it is now; what changed (see SAME)."""
    contacts, friction = set_closed(work), set_sliding(scene, work)
    if contacts:
        return OTHER_CONTACTS
    return OTHER_FRICTION if friction else SAME
