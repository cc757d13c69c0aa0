"""Steps in which a surface force goes over from one contact of two bodies to another.

Where outlines attract each other, the attraction acts through their deepest contact, for the length
over which it is shared out (rhs/surface_gap.py) is far below an overlap, and presses that deeper
still. Two contacts thus have two places of rest, one with either of them pressed, and bodies go
from one to the other only if they are driven there. A step that is long against the vibrations of a
contact ends at whichever it is led to by damping that is not the bodies', and its estimate, of
what both are apart, may be below the tolerance: the bodies then roll on the wrong way. Such a step
is taken anew, until it is short against the vibrations, or the contacts change by little.
"""

import flocsim.arrays as at
from flocsim.integrators.rhs.stated_error import pressed_stiffness
from flocsim.integrators.rhs.surface_gap import least_row, run_end
from flocsim.integrators.rhs.views import contact_view

LARGE = 0.25
"""One contact overtakes another one by much where it comes from above it, and goes below it, by
this share of both their overlaps."""

RESOLVED = 1.0
"""A step of so many times 1/ω0 follows a contact's vibration."""


def deepest_of(work, state, row, end):
    """The row of the least gap in a state, of those that touch; −1 without."""
    deepest = -1
    for each in range(row, end):
        gap = work.geometry[state, each, at.GAP]
        if work.candidates[each, at.CLOSED] == at.TOUCHES and (
            deepest < 0 or gap < work.geometry[state, deepest, at.GAP]
        ):
            deepest = each
    return deepest


def overtaken(work, row, end, closed):
    """The row of the two bodies that has been the deepest before and is overtaken by much; −1
    without."""
    if closed:
        old, new = deepest_of(work, at.NOW, row, end), deepest_of(work, at.NEW, row, end)
    else:
        old, new = least_row(work, at.NOW, row, end), least_row(work, at.NEW, row, end)
    if old < 0 or old == new:
        return -1
    g = work.geometry
    deep, deeper = -g[at.NOW, old, at.GAP], -g[at.NEW, new, at.GAP]
    if not (deep > 0.0 and deeper > 0.0):
        return -1
    way = min(g[at.NOW, new, at.GAP], 0.0) + deep + min(g[at.NEW, old, at.GAP], 0.0) + deeper
    return old if way > LARGE * (deep + deeper) else -1


def overtakes(scene, work, clock, step):
    """Whether a contact has overtaken another one of the same bodies from NOW to NEW, and the step
    is too long to tell. Only pairs that are closed count where steps end at switches."""
    row, closed = 0, clock[at.ACROSS] == 0.0
    while row < work.tally[at.CANDIDATES]:
        end = run_end(work, row)
        old = overtaken(work, row, end, closed)
        if old >= 0:
            view = contact_view(scene, work, at.NOW, old)
            stiffness = pressed_stiffness(scene, view, clock[at.TOLERANCE])
            if step * step * stiffness > RESOLVED * RESOLVED * view.effective_mass:
                return True
        row = end
    return False
