"""How much energy it takes to leave an interaction: an attraction, or a secondary minimum.

Bodies take whatever way they find. What they have to climb is their potential: of the distance of
their centres, of the gap of their outlines, or of both, which widen alike here, as in pulling
straight.
"""

import math

from flocsim.hooks import CENTRE_FORCE, ORIENTED_ENERGY, centre_force, has, surface_force
from flocsim.integrators.rhs.outline_sum import acts_along, outline_reach, outlines_apart
from flocsim.integrators.rhs.views import pair_view

BARRIER = 20.0
"""Thermal energies k_B T that hold a pair: by Kramers' rate kicks take e^20 = 5e8 times as long to
lift it out as bodies take to relax."""

RUNG, LEAST_RUNG = 0.125, 1e-11
"""A step of the climb over the gap where it is taken, and the shortest one [m]."""


def repulsion_at(scene, work, time, a, b, distance, gap, way):
    """What the pair forces push bodies a and b apart with [N] at rest, at a distance of the centres
    and a gap of the outlines; ``way``: how far from where they are [m]."""
    force = 0.0
    sizes = scene.bodies[a].equivalent_radius + scene.bodies[b].equivalent_radius
    if has(scene, CENTRE_FORCE):
        force += centre_force(scene, pair_view(scene, time, a, b, distance - sizes, 0.0, distance))
    if scene.surface_reach > gap:
        force += surface_force(scene, pair_view(scene, time, a, b, gap, 0.0, distance))
    if acts_along(scene):
        force += outlines_apart(scene, work, time, a, b, way)
    return force


def can_climb(scene, work, time, a, b, distance, gap, load, needed):
    """Whether less than the energy ``needed`` [J] leads out of the pair's attraction, a load [N]
    helping: its work over the way out, at the highest place of it. Nothing is known where forces
    ask how bodies are turned: another way may be lower."""
    if not load < math.inf or has(scene, ORIENTED_ENERGY):
        return True
    sizes = scene.bodies[a].equivalent_radius + scene.bodies[b].equivalent_radius
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
        if gap + way < outline_reach(scene):
            rung = min(rung, RUNG * max(gap + way, scene.outlines[1]))
        rung = max(rung, LEAST_RUNG)
        middle = way + 0.5 * rung
        there = distance + middle, gap + middle, middle
        climbed -= (repulsion_at(scene, work, time, a, b, *there) + load) * rung
        if climbed > needed:
            return False
        way += rung
    return True
