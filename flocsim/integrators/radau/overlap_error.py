"""What the overlap of a pressed contact may be wrong by at the end of a long step.

A contact whose vibrations a step does not resolve only holds what presses on it: its overlap is an
algebraic variable, k_n times it the multiplier of a constraint. For those Radau IIA has a lower
order (Hairer & Wanner II, 1996, section VII.4), so that a step whose motion is right to the
tolerance may hold by a force that is wrong by several times itself where little presses, which
decides when the contact opens. The stages show it: their overlaps lie on no line.
"""

import flocsim.arrays as at
from flocsim.integrators.events.resolution import above_rounding
from flocsim.integrators.radau.tableau import NODES, SECOND_STAGE, THIRD_STAGE
from flocsim.integrators.rhs.stated_error import unresolved

SHARE_OF_SCATTER = 2.0
"""The end's overlap is wrong by about half of how far it lies off the line of the other two, and
where a contact lets go slowly by a few times as much (tests/verification/test_slow_release.py)."""


MOST_SCATTER = 0.4
"""A step in which a contact is relieved is too long where its overlap scatters by more than this
share of itself: it may hold where it would have let go."""

ABOVE = 30.0
"""Overlaps below so many times what places can be told apart by scatter by chance."""


def scatter_of(scene, work, clock, step, row):
    """How far the overlap of a contact at the end of a step lies off the line of those at the other
    stages, as far as the step does not resolve its vibrations [m]."""
    g, span = work.geometry, NODES[1] - NODES[0]
    slope = (g[SECOND_STAGE, row, at.GAP] - g[at.FIRST_STAGE, row, at.GAP]) / span
    scatter = g[THIRD_STAGE, row, at.GAP] - g[SECOND_STAGE, row, at.GAP] - slope * (1.0 - NODES[1])
    return abs(scatter) * unresolved(scene, work, clock, step, row)


def overlap_error(scene, work, clock, row):
    """By how much the overlap of a contact is likely to be wrong [m]."""
    return SHARE_OF_SCATTER * scatter_of(scene, work, clock, clock[at.STAGED_STEP], row)


def doubt_of_release(scene, work, clock, step):
    """By how much it is in doubt whether contacts that are relieved in a step still press, over
    what is allowed; it goes with the square of the step."""
    largest, g = 0.0, work.geometry
    least = ABOVE * above_rounding(work, at.NOW, 0.0)
    for row in range(work.tally[at.CANDIDATES]):
        if work.candidates[row, at.CLOSED] == at.TOUCHES:
            before, after = -g[at.NOW, row, at.GAP], -g[THIRD_STAGE, row, at.GAP]
            if after < before and before > 0.0:
                scatter = scatter_of(scene, work, clock, step, row)
                largest = max(largest, scatter / (MOST_SCATTER * max(before, -after, least)))
    return largest
