"""How much energy it takes to leave an interaction: an attraction, or a secondary minimum.

Bodies take whatever way they find. What they have to climb is their potential: of the distance of
their centres, of the gap of their outlines, or of both, which widen alike here, as in pulling
straight.
"""

import math

import numpy as np

from flocsim.arrays import EQUIVALENT_RADIUS
from flocsim.ensembles.collision.meetings import GAPS
from flocsim.ensembles.collision.observed import BODY_I, BODY_J
from flocsim.integrators.rhs.views import pair_view
from flocsim.laws import CENTRE_FORCE, centre_force, has, surface_force

RUNG, LEAST_RUNG = 0.125, 1e-11
"""A step of the climb over the gap where it is taken, and the shortest one [m]."""


def repulsion_at(scene, time, distance, gap):
    """What the pair forces push apart with [N] at rest, at a distance of the centres and a gap of
    the outlines."""
    force = 0.0
    sizes = scene.bodies[BODY_I, EQUIVALENT_RADIUS] + scene.bodies[BODY_J, EQUIVALENT_RADIUS]
    if has(scene, CENTRE_FORCE):
        force += centre_force(
            scene, pair_view(scene, time, BODY_J, BODY_I, distance - sizes, 0.0, distance)
        )
    if scene.surface_reach > gap:
        force += surface_force(scene, pair_view(scene, time, BODY_J, BODY_I, gap, 0.0, distance))
    return force


def can_climb(scene, time, distance, gap, load, needed):
    """Whether less than the energy ``needed`` [J] leads out of the pair's attraction, a load [N]
    helping: its work over the way out, at the highest place of it."""
    if not load < math.inf:
        return True
    sizes = scene.bodies[BODY_I, EQUIVALENT_RADIUS] + scene.bodies[BODY_J, EQUIVALENT_RADIUS]
    centres = has(scene, CENTRE_FORCE)
    climbed, way = 0.0, 0.0
    end = 2.0 * sizes + max(-gap, sizes - distance, 0.0)
    while way < end:
        # Forces change over as much as is left of the gap that they go by.
        rung = end
        if centres:
            rung = min(rung, RUNG * abs(distance + way - sizes))
        if scene.surface_reach > 0.0:
            rung = min(rung, RUNG * abs(gap + way))
        rung = max(rung, LEAST_RUNG)
        middle = way + 0.5 * rung
        climbed -= (repulsion_at(scene, time, distance + middle, gap + middle) + load) * rung
        if climbed > needed:
            return False
        way += rung
    return True


def cage(
    speeds: np.ndarray, mobility: float, load: float, barrier: float
) -> tuple[float, float]:  # fmt: skip
    """Between which gaps [m] more than the energy ``barrier`` [J] lies on either side of a pair
    that has not touched, a ``load`` [N] helping it out, or in; (0, 0) for no such place.

    ``speeds`` as of `speeds_of`, which took this ``mobility``; of several such places the one of
    the highest barriers.
    """
    repulsion = speeds[1] / mobility
    rises = -0.5 * (repulsion[1:] + repulsion[:-1]) * np.diff(GAPS)
    potential = np.append(0.0, np.cumsum(rises))
    outwards, inwards = potential - load * GAPS, potential + load * GAPS
    above = np.maximum.accumulate(outwards[::-1])[::-1] - outwards
    below = np.maximum.accumulate(inwards) - inwards
    least = np.minimum(above, below)
    best = int(np.argmax(least))
    if not least[best] > barrier:
        return 0.0, 0.0
    outside = np.flatnonzero(~(least > barrier))
    first = int(outside[outside < best].max(initial=-1)) + 1
    last = int(outside[outside > best].min(initial=len(GAPS))) - 1
    return float(GAPS[first]), float(GAPS[last])
