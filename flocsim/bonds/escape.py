"""The energy that it takes to leave an attraction or a secondary minimum.

Bodies take any path. What they have to climb is their potential, a function of the distance of the
centres, of the gap of the outlines, or of both; both widen alike here, as in a straight pull.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.constants import MINIMUM_GAP
from flocsim.hooks import CENTRE_FORCE, ORIENTED_ENERGY, centre_force, has, surface_force
from flocsim.integrators.rhs.outline_sum import has_outline_forces, outline_reach, outline_repulsion
from flocsim.integrators.rhs.views import pair_view

BARRIER = 20.0
"""Escape must cost at least this many k_B T: by Kramers' rate thermal motion then takes e^20 = 5e8
relaxation times."""

CLIMB_STEP = 0.125
"""Step along the path as a fraction of the length over which forces vary."""


def forces_at_rest(scene, work, time, a, b, distance, gap, displacement):
    """Return the repulsion of two bodies at rest (between centres, between outlines) [N], a being
    moved out along the line of centres.

    ``distance`` of the centres and ``gap`` of the outlines [m] are the values there,
    ``displacement`` [m] is how far a was moved.
    """
    # At rest: all rates are zero, so that drag and lubrication do not count.
    centres, outlines = 0.0, 0.0
    sizes = scene.bodies[a].equivalent_radius + scene.bodies[b].equivalent_radius
    if has(scene, CENTRE_FORCE):
        view = pair_view(scene, time, a, b, distance - sizes, 0.0, distance)
        centres = centre_force(scene, view)
    if scene.surface_reach > gap:
        outlines = surface_force(scene, pair_view(scene, time, a, b, gap, 0.0, distance))
    if has_outline_forces(scene):
        outlines += outline_repulsion(scene, work, time, a, b, displacement)
    return centres, outlines


def radii_of(scene, bond):
    """Return r_i + r_j of the equivalent radii [m]."""
    return scene.bodies[bond.i].equivalent_radius + scene.bodies[bond.j].equivalent_radius


def attraction_at(scene, work, time, bond, displacement):
    """Return the attraction (between centres, between outlines) [N] at rest, both gaps wider by
    ``displacement`` [m]."""
    distance, gap = bond.distance + displacement, bond.surface_gap + displacement
    known = scene, work, time, bond.j, bond.i
    centres, outlines = forces_at_rest(*known, distance, gap, displacement)
    return -centres, -outlines


def path_length(scene, bond):
    """Return the length of the path outwards [m], to two mean diameters beyond contact."""
    radii = radii_of(scene, bond)
    return 2.0 * radii + max(-bond.surface_gap, radii - bond.distance, 0.0)


def variation_length(scene, bond, displacement, longest):
    """Return the length over which these forces vary [m]: the smallest of the gaps that they depend
    on, all wider by a displacement, or MINIMUM_GAP, below which laws are held constant."""
    length = longest
    if has(scene, CENTRE_FORCE):
        length = min(length, abs(bond.distance + displacement - radii_of(scene, bond)))
    if scene.surface_reach > 0.0:
        length = min(length, abs(bond.surface_gap + displacement))
    if bond.gap + displacement < outline_reach(scene):
        length = min(length, max(bond.gap + displacement, scene.outlines[1]))
    return max(length, MINIMUM_GAP)


@apart
def can_escape(scene, work, time, bond, load, needed):
    """Return True if less than ``needed`` [J] leads out of the attraction of a pair under a pulling
    load.

    Integrates the attraction less the load outwards and compares its maximum with ``needed``.
    ``load`` [N] pulls the pair apart. The answer is True, too, where forces depend on orientation:
    another path may be lower.
    """
    if not load < math.inf or has(scene, ORIENTED_ENERGY):
        return True
    # Work done along the way out, of which the load does a part; its maximum is the barrier.
    energy, displacement, end = 0.0, 0.0, path_length(scene, bond)
    while displacement < end:
        # Increments grow with the gap, as attraction varies over a distance of its order.
        increment = CLIMB_STEP * variation_length(scene, bond, displacement, end)
        # Midpoint rule.
        centres, outlines = attraction_at(scene, work, time, bond, displacement + 0.5 * increment)
        energy += (centres + outlines - load) * increment
        if energy > needed:
            return False
        displacement += increment
    return True
