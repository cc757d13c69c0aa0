"""How finely touching is told from not touching, and where in a step a pair switches."""

import math

from flocsim.arrays import CANDIDATES, GAP, NEW, NOW, TOLERANCE
from flocsim.constants import SHALLOWEST_TOUCH
from flocsim.geometry.contact.points import locate_contacts
from flocsim.hooks import awaits_touch
from flocsim.integrators.events.crossings import first_switch
from flocsim.integrators.events.law_events import law_event_share
from flocsim.integrators.events.resolution import furthest_place
from flocsim.integrators.rhs.error import step_tolerance

GRAIN = 1e-3
"""A switch is located to this share of the tolerance, …"""

GRAIN_OF_OVERLAP = 0.02
"""… and to this share of the deepest overlap, …"""

ROUNDING = 4e-16
"""… but not finer than this share of the places that the gap is the difference of."""


def deepest_overlap(work):
    """The largest overlap of a listed pair now [m], at least 0."""
    deepest = 0.0
    for row in range(work.tally[CANDIDATES]):
        deepest = max(deepest, -work.geometry[NOW, row, GAP])
    return deepest


def grain_of(work, clock):
    """How far a pair may go behind its switch unnoticed [m]."""
    grain = GRAIN * step_tolerance(work, clock) if clock[TOLERANCE] < math.inf else 1e-13
    deepest = deepest_overlap(work)
    if deepest > 0.0:
        grain = min(grain, GRAIN_OF_OVERLAP * deepest)
    return max(grain, ROUNDING * furthest_place(work, NEW))


def switch_share(scene, work, observed, clock, step):
    """The share of the step at which the first pair switches; above 1 where none does."""
    locate_contacts(scene, work, NEW)
    if clock[TOLERANCE] < math.inf or awaits_touch(observed):
        grain = grain_of(work, clock)
        shallowest = min(SHALLOWEST_TOUCH, clock[TOLERANCE])
        depth = grain if deepest_overlap(work) > 0.0 else max(grain, shallowest)
        share = first_switch(scene, work, step, grain, depth)
        return law_event_share(scene, work, share) if share > 1.0 else share
    return math.inf
