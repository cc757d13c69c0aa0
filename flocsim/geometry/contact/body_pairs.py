"""Which bodies may come near each other before they have moved much: the pairs that are watched.

A pair counts where one of its bodies is free: fixed ones do not act on each other, however many
there are, and may overlap. Of few bodies all such pairs are watched; of many, those whose bounding
circles are near (sweep.py). A pair that counts and is not listed lies further apart than what acts
on it reaches, and than two bodies may go until the next listing.
"""

import math

import flocsim.arrays as at
from flocsim.geometry.contact.separation import length_of
from flocsim.geometry.contact.sweep import (
    MOVES,
    PLACE_X,
    PLACE_Y,
    REACH,
    WAY_X,
    WAY_Y,
    near_pairs,
)
from flocsim.hooks import hook

WANDER = 0.25
"""How far a body may go against the mean of all, in mean bounding radii, until pairs are listed
anew."""


def watches_all(work):
    """Whether all pairs that count are watched."""
    return work.bodies.shape[0] <= at.ALL_PAIRS


def wander_of(scene):
    """How far a body may go until the pairs are listed anew [m]."""
    total, free = 0.0, 0
    for body in range(scene.bodies.shape[0]):
        if scene.bodies[body, at.FREE] == 1.0:
            total += scene.bodies[body, at.BOUNDING_RADIUS]
            free += 1
    return WANDER * total / max(free, 1)


def drift_of(scene, work, state, axis):
    """The mean way of all bodies since the listing, or their mean velocity, along an axis; none
    where one is fixed."""
    total = 0.0
    for body in range(scene.bodies.shape[0]):
        if scene.bodies[body, at.FREE] == 0.0:
            return 0.0
        total += work.motion[state, body, axis]
        if axis < at.VELOCITY:
            total -= work.bodies[body, at.LISTED + axis]
    return total / scene.bodies.shape[0]


@hook
def wandered(scene, work, state):
    """The largest share of its way that a body has gone since the listing, against the mean."""
    most, furthest = wander_of(scene), 0.0
    drift_x, drift_y = drift_of(scene, work, state, 0), drift_of(scene, work, state, 1)
    for body in range(scene.bodies.shape[0]):
        x = work.motion[state, body, 0] - work.bodies[body, at.LISTED] - drift_x
        y = work.motion[state, body, 1] - work.bodies[body, at.LISTED + 1] - drift_y
        furthest = max(furthest, length_of(x, y))
    return furthest / most


@hook
def time_to_wander(scene, work, share):
    """The time [s] in which no body goes further than a share of its way, at constant speed."""
    most, fastest = wander_of(scene), 0.0
    drift_x = drift_of(scene, work, at.NOW, at.VELOCITY)
    drift_y = drift_of(scene, work, at.NOW, at.VELOCITY + 1)
    for body in range(scene.bodies.shape[0]):
        x = work.motion[at.NOW, body, at.VELOCITY] - drift_x
        y = work.motion[at.NOW, body, at.VELOCITY + 1] - drift_y
        fastest = max(fastest, length_of(x, y))
    return share * most / fastest if fastest > 0.0 else math.inf


@hook
def list_near(scene, work, cut):
    """List the pairs whose bounding circles are nearer than a gap, sorted; False without room."""
    discs, (width, height) = work.discs, scene.box
    for body in range(work.bodies.shape[0]):
        discs[body, PLACE_X] = work.motion[at.NOW, body, 0]
        discs[body, PLACE_Y] = work.motion[at.NOW, body, 1]
        discs[body, WAY_X] = discs[body, WAY_Y] = 0.0
        discs[body, REACH] = scene.bodies[body, at.BOUNDING_RADIUS] + 0.5 * cut
        discs[body, MOVES] = scene.bodies[body, at.FREE]
    total = near_pairs(discs, work.order, width, height, work.starts, work.pairs)
    if total > work.pairs.shape[0]:
        work.tally[at.FULL], work.tally[at.PAIRS] = at.PAIRS_FULL, 0
        return False
    for pair in range(total):
        work.pairs[pair, at.ACTING] = 0
    work.tally[at.PAIRS] = total
    return True


def list_pairs(scene, work, cut):
    """List the pairs of bodies that may come nearer than a gap [m]; False without room."""
    if watches_all(work):
        return True
    return list_near(scene, work, cut + 2.0 * wander_of(scene))
