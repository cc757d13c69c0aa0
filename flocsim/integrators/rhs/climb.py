"""The energy that it takes to leave an attraction or a secondary minimum.

Bodies take any path. What they have to climb is their potential, a function of the distance of the
centres, of the gap of the outlines, or of both; both widen alike here, as in a straight pull.
"""

import math

from flocsim.hooks import CENTRE_FORCE, ORIENTED_ENERGY, centre_force, has, surface_force
from flocsim.integrators.rhs.outline_sum import has_outline_forces, outline_reach, outline_repulsion
from flocsim.integrators.rhs.views import pair_view

BARRIER = 20.0
"""Escape must cost at least this many k_B T: by Kramers' rate thermal motion then takes e^20 = 5e8
relaxation times."""

CLIMB_STEP, LEAST_CLIMB_STEP = 0.125, 1e-11
"""Integration step as a fraction of the gap that the force depends on, and its lower bound [m]."""


def repulsion_at(scene, work, time, a, b, distance, gap, displacement):
    """Return the repulsion of bodies a and b at rest [N], a being moved out along the line of
    centres.

    ``distance`` and ``gap`` [m] are the values there, ``displacement`` [m] is how far a was moved.
    """
    force = 0.0
    sizes = scene.bodies[a].equivalent_radius + scene.bodies[b].equivalent_radius
    if has(scene, CENTRE_FORCE):
        force += centre_force(scene, pair_view(scene, time, a, b, distance - sizes, 0.0, distance))
    if scene.surface_reach > gap:
        force += surface_force(scene, pair_view(scene, time, a, b, gap, 0.0, distance))
    if has_outline_forces(scene):
        force += outline_repulsion(scene, work, time, a, b, displacement)
    return force


def can_escape(scene, work, time, a, b, distance, gap, load, needed):
    """Return True if less than ``needed`` [J] leads out of the attraction of a pair under a pulling
    load.

    Integrates −(F + load) outwards and compares its maximum with ``needed``. ``load`` [N] pulls the
    pair apart. The answer is True, too, where forces depend on orientation: another path may be
    lower.
    """
    if not load < math.inf or has(scene, ORIENTED_ENERGY):
        return True
    sizes = scene.bodies[a].equivalent_radius + scene.bodies[b].equivalent_radius
    centres = has(scene, CENTRE_FORCE)
    # The path ends 2 (r_a + r_b) beyond the touch.
    energy, displacement = 0.0, 0.0
    end = 2.0 * sizes + max(-gap, sizes - distance, 0.0)
    while displacement < end:
        # Forces vary on the scale of the gap that they depend on.
        increment = end
        if centres:
            increment = min(increment, CLIMB_STEP * abs(distance + displacement - sizes))
        if scene.surface_reach > 0.0:
            increment = min(increment, CLIMB_STEP * abs(gap + displacement))
        if gap + displacement < outline_reach(scene):
            increment = min(increment, CLIMB_STEP * max(gap + displacement, scene.outlines[1]))
        increment = max(increment, LEAST_CLIMB_STEP)
        # Midpoint rule.
        middle = displacement + 0.5 * increment
        point = distance + middle, gap + middle, middle
        energy -= (repulsion_at(scene, work, time, a, b, *point) + load) * increment
        if energy > needed:
            return False
        displacement += increment
    return True
