"""What the overlap of a pressed contact may be wrong by at the end of a long step.

A contact whose vibrations a step does not resolve only holds what presses on it: its overlap is an
algebraic variable, k_n times it the multiplier of a constraint. For those Radau IIA has a lower
order (Hairer & Wanner II, 1996, section VII.4), so that a step whose motion is right to the
tolerance may hold by a force that is wrong by several times itself where little presses, which
decides when the contact opens. The stages show it: their overlaps lie on no line.
"""

from flocsim.arrays import FIRST_STAGE, GAP
from flocsim.integrators.radau.tableau import NODES, SECOND_STAGE, THIRD_STAGE
from flocsim.integrators.rhs.stated_error import unresolved

SHARE_OF_SCATTER = 2.0
"""The end's overlap is wrong by about half of how far it lies off the line of the other two, and
where a contact lets go slowly by a few times as much (tests/verification/test_slow_release.py)."""


def overlap_error(scene, work, clock, row):
    """By how much the overlap of a contact is likely to be wrong [m]."""
    g, span = work.geometry, NODES[1] - NODES[0]
    slope = (g[SECOND_STAGE, row, GAP] - g[FIRST_STAGE, row, GAP]) / span
    scatter = g[THIRD_STAGE, row, GAP] - g[SECOND_STAGE, row, GAP] - slope * (1.0 - NODES[1])
    return SHARE_OF_SCATTER * abs(scatter) * unresolved(scene, work, clock, row)
