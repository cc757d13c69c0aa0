"""Certificates: proofs that attraction alone keeps two bodies together under every later load.

The bodies are i and j, j being the later one. The work arrays list and locate pairs of features of
these two bodies only. There are three certificates.

- Held: the bodies move slowly, and attraction exceeds the largest load, in any orientation, by the
  factor SAFETY. The capacity of the attraction is its maximum along the way out from the present
  position, whether or not there is a contact. (In a well between attraction and repulsion the
  present net force equals the load and says nothing about the capacity.) It must carry the load in
  a straight pull, and in prying the doublet open about each of the two outermost contact points, on
  either side of the line of centres. For two spheres, and for a surface force, which follows the
  contact, the straight pull suffices.
- Trapped: the energy needed to climb out of the attraction between the centres, against the load,
  exceeds SAFETY times the present energy.
- In kicks (thermal motion): the energy needed to climb out, against the load times its leverage
  where it pries, exceeds the present energy plus BARRIER k_B T. By Kramers' rate escape then takes
  e^20 = 5e8 relaxation times. However shapes roll, they have to climb their potential
  (escape.py).

Only forces at rest count: resistance to opening, such as lubrication, carries no load in the long
run.
"""

import math
from typing import NamedTuple

from flocsim.bonds.escape import (
    BARRIER,
    CLIMB_STEP,
    attraction_at,
    can_escape,
    path_length,
    radii_of,
    variation_length,
)
from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import (
    contact_point,
    least_listed_gap,
    relative_velocity,
    separation,
)
from flocsim.hooks import (
    CENTRE_FORCE,
    CONTACT_FORCE,
    ORIENTED_ENERGY,
    contact_force,
    has,
)
from flocsim.integrators.rhs.outline_sum import outline_reach
from flocsim.integrators.rhs.surface_gap import flag_near, surface_view
from flocsim.integrators.rhs.views import centre_line, contact_view, effective_mass
from flocsim.state.bodies import ANGLE
from flocsim.state.views import moved_contact
from flocsim.state.work import NOW

NO_BOND, CERTIFICATE, HOOK, REST = range(4)
"""Kinds of bond: none, certified, by shape, or by a pose that was stable under the largest load."""


class Bond(NamedTuple):
    """Two bodies and their relative position.

    Bodies ``i`` and ``j``; the unit vector from i's centroid to j's and their distance [m];
    ``gap``, the smallest gap of their features [m]; ``surface_gap``, the gap that surface forces
    depend on [m].
    """

    i: int
    j: int
    nx: float
    ny: float
    distance: float
    gap: float
    surface_gap: float


class Load(NamedTuple):
    """Load on a bond.

    ``force``: largest force on it [N]; ``drift``: relative drift velocity of the two bodies [m/s],
    or of the bodies of their cluster; ``x``, ``y``: direction of the load on j, (0, 0) for any
    direction; ``lever``: smallest lever arm that the cluster provides [m]; ``alone``: 1.0 if the
    two form a cluster of their own; ``kicks``: k_B T [J], 0.0 without thermal motion.
    """

    force: float
    drift: float
    x: float
    y: float
    lever: float
    alone: float
    kicks: float


def bond_between(scene, work, time, i, j):
    """Return the Bond of two bodies whose features are listed and located."""
    nx, ny, distance = centre_line(scene, work, NOW, j, i)
    gap = least_listed_gap(work)
    surface = gap
    if scene.surface_reach > 0.0 and work.tally.candidates > 0:
        flag_near(scene, work, NOW, 0.0)
        surface = surface_view(scene, work, time, NOW, 0, work.tally.candidates).gap
    return Bond(i, j, nx, ny, distance, gap, surface)


def is_closed(work, row):
    """Return True if a listed pair of features touches in the present state."""
    return work.geometry[NOW, row].gap < 0.0


def smaller_bounding_radius(scene, i, j):
    """Return the smaller bounding radius [m]: displacement of the outline per radian of
    rotation."""
    return min(scene.bodies[i].bounding_radius, scene.bodies[j].bounding_radius)


def are_spheres(scene, bond):
    """Return True if both bodies are spheres."""
    count_i = scene.first[bond.i + 1] - scene.first[bond.i]
    return count_i == 1 and scene.first[bond.j + 1] - scene.first[bond.j] == 1


def speeds_of(scene, work, bond):
    """Return the speeds of j relative to i, as a rigid doublet [m/s]: (along the line of centres,
    any)."""
    i, j = bond.i, bond.j
    ux, uy = relative_velocity(work, NOW, j, i)
    # Subtract the rigid rotation with i's spin; the difference of the spins counts at the outline.
    rx, ry = bond.nx * bond.distance, bond.ny * bond.distance
    spin = work.velocity[NOW, i, ANGLE]
    shear = math.hypot(ux + spin * ry, uy - spin * rx)
    turning = abs(work.velocity[NOW, j, ANGLE] - spin) * smaller_bounding_radius(scene, i, j)
    return abs(ux * bond.nx + uy * bond.ny), shear + turning


def doublet_pose(scene, work, state, i, j):
    """Return the position [m] and angle of body j in the frame of i, which rotates with it."""
    x, y = separation(scene, work, state, j, i)
    turn = work.place[state, i, ANGLE]
    c, s = math.cos(turn), math.sin(turn)
    return c * x + s * y, c * y - s * x, work.place[state, j, ANGLE] - turn


def pose_change(scene, i, j, pose, before):
    """Return an upper bound of the displacement of the outlines between two such poses [m]."""
    x, y, angle = pose
    was_x, was_y, was_angle = before
    return math.hypot(x - was_x, y - was_y) + abs(angle - was_angle) * smaller_bounding_radius(
        scene, i, j
    )


def resting_contact(view, slip):
    """Return the ContactView of the same contact at rest, with a given tangential
    displacement [m]."""
    return moved_contact(view, view.overlap, 0.0, slip, 0.0)


def energy_of(scene, work, bond):
    """Return the energy available for an escape [J].

    It is the energy of relative motion and of both spins, plus twice the elastic energy of the
    contacts.
    """
    ux, uy = relative_velocity(work, NOW, bond.j, bond.i)
    total = 0.5 * effective_mass(scene, bond.i, bond.j) * (ux * ux + uy * uy)
    for body in (bond.i, bond.j):
        spin = work.velocity[NOW, body, ANGLE]
        total += 0.5 * scene.bodies[body].inertia * spin * spin
    if not has(scene, CONTACT_FORCE):
        return total
    for row in range(work.tally.candidates):
        if is_closed(work, row):
            view = contact_view(scene, work, NOW, row)
            normal, tangential = contact_force(scene, resting_contact(view, view.slip))
            # Force times displacement is twice the elastic energy of a linear spring.
            total += abs(normal * view.overlap) + abs(tangential * view.slip)
    return total


SAFETY = 3.0
"""Factor by which attraction must exceed the load."""

CALM_SPEED = 0.02
"""A pair is calm if its relative speed is below this share of the drift velocity."""

LEVER_TOLERANCE = 0.05
"""Tolerance of levers and directions, relative to the size of bodies. A contact at rest may push
from so far beside its point, over the smaller bounding radius, and has at least this friction
coefficient. As a doublet is pried open, attraction between centres counts up to
this displacement over distance and squared leverage: levers stay nearly constant there."""


def is_enough(total, outline_part, centre_part, enough):
    """Return True if a capacity suffices: its total, and one of its two parts."""
    return total > enough[0] and (outline_part > enough[1] or centre_part > enough[2])


@apart
def largest_attraction(scene, work, time, bond, start, end, near, share, enough, found):
    """Return the largest attraction [N] along the way out, as in `capacity`, and its position [m].

    ``start``, ``end``: range of displacements [m]; ``share``: step over the distance on which
    forces vary; ``found``: the largest so far.
    """
    total, outline_part, centre_part = found
    displacement, best = start, start
    while displacement < end:
        centres, surfaces = attraction_at(scene, work, time, bond, displacement)
        if centres + surfaces > total:
            total, best = centres + surfaces, displacement
        outline_part = max(outline_part, surfaces + min(centres, 0.0))
        if displacement <= near:
            # Levers stay nearly constant only within ``near`` of the start (LEVER_TOLERANCE).
            centre_part = max(centre_part, centres)
        if is_enough(total, outline_part, centre_part, enough):
            break
        length = variation_length(scene, bond, displacement, end)
        displacement += share * length
    return total, outline_part, centre_part, best


def capacity(scene, work, time, bond, near, enough):
    """Return the load that the attraction can carry [N], as three numbers.

    The total; that of outlines alone, minus any repulsion between centres; that of centres alone,
    within ``near`` [m] of the start. The search ends as soon as these are ``enough`` (is_enough).
    """
    between = scene.surface_reach > bond.surface_gap or outline_reach(scene) > bond.gap
    if not has(scene, CENTRE_FORCE) and not between:
        return 0.0, 0.0, 0.0
    start, end, found = 0.0, path_length(scene, bond), (0.0, 0.0, 0.0)
    known = scene, work, time, bond
    total, outline_part, centre_part, best = largest_attraction(
        *known, start, end, near, CLIMB_STEP, enough, found
    )
    if not is_enough(total, outline_part, centre_part, enough):
        # Refine around the maximum, which may be a cusp.
        around = CLIMB_STEP * variation_length(scene, bond, best, radii_of(scene, bond))
        start, end = max(best - around, 0.0), best + around
        found = total, outline_part, centre_part
        total, outline_part, centre_part, _ = largest_attraction(
            *known, start, end, near, CLIMB_STEP * CLIMB_STEP, enough, found
        )
    return total, outline_part, centre_part


def leverage(work, bond, least):
    """Return the factor by which a load that pries exceeds one that pulls straight.

    It pries about the outer contact on either side of the line of centres, with a lever arm of at
    least ``least`` [m]. inf if one side has no contact.
    """
    left, right = math.inf, math.inf
    nx, ny, distance = bond.nx, bond.ny, bond.distance
    for row in range(work.tally.candidates):
        if not is_closed(work, row):
            continue
        x, y = contact_point(work, row, bond.i)
        side = nx * y - ny * x
        # Moment balance about the contact: attraction acts with the arm ``side``, the load with
        # ``lever``.
        lever = max(math.hypot(x, y), math.hypot(x - distance * nx, y - distance * ny), least)
        if side > 0.0:
            left = min(left, lever / side)
        elif side < 0.0:
            right = min(right, -lever / side)
    return max(left, right)


def is_held(scene, work, time, bond, load):
    """Return True if the bodies are calm and attraction exceeds every later load on the bond."""
    along, shear = speeds_of(scene, work, bond)
    if not along < CALM_SPEED * load.drift:
        return False
    mass, spin = effective_mass(scene, bond.i, bond.j), work.velocity[NOW, bond.i, ANGLE]
    # The load, plus the centrifugal force of the rotating doublet.
    needed = SAFETY * (load.force + mass * spin * spin * bond.distance)
    spheres = are_spheres(scene, bond)
    ratio = 1.0 if spheres else leverage(work, bond, load.lever)
    # How far out the attraction between centres counts while prying, see LEVER_TOLERANCE.
    near = LEVER_TOLERANCE * bond.distance / (ratio * ratio)
    prying_load = needed * ratio if shear < CALM_SPEED * load.drift else math.inf
    enough = needed, -1.0 if spheres else needed, prying_load
    total, outline_part, centre_part = capacity(scene, work, time, bond, near, enough)
    if not is_enough(total, outline_part, centre_part, enough):
        return False
    # Without contact, in a well between attraction and repulsion: they must not have the energy to
    # leave.
    kinetic_energy = 0.5 * mass * along * along
    return bond.gap < 0.0 or not can_escape(scene, work, time, bond, load.force, kinetic_energy)


def is_trapped(scene, work, time, bond, load):
    """Return True if the bodies lack the energy to leave the attraction between their centres.

    They lie within it, and climbing out, helped by SAFETY times the load, costs more than SAFETY
    times their energy. False if the bodies belong to a larger cluster, or if forces between
    outlines act.
    """
    inside = has(scene, CENTRE_FORCE) and bond.distance < radii_of(scene, bond)
    if not inside or max(scene.surface_reach, outline_reach(scene)) > 0.0 or load.alone == 0.0:
        return False
    pull = SAFETY * load.force
    centres, _ = attraction_at(scene, work, time, bond, 0.0)
    if not centres > pull:
        return False
    needed = SAFETY * energy_of(scene, work, bond)
    return not can_escape(scene, work, time, bond, pull, needed)


def is_certain(scene, work, time, bond, load):
    """Return True if no later load can open the bond, without thermal motion.

    Unknown, hence False, for forces that depend on orientation.
    """
    if has(scene, ORIENTED_ENERGY):
        return False
    return is_trapped(scene, work, time, bond, load) or is_held(scene, work, time, bond, load)


def is_certain_in_kicks(scene, work, time, bond, load):
    """Return True if neither a later load nor thermal kicks can open the bond."""
    pull = SAFETY * load.force
    if pull > 0.0 and not are_spheres(scene, bond):
        _, outline_part, _ = capacity(scene, work, time, bond, 0.0, (-1.0, pull, math.inf))
        if not outline_part > pull:
            # If outlines do not carry the load by themselves, it may pry.
            pull *= leverage(work, bond, load.lever)
    needed = BARRIER * load.kicks + energy_of(scene, work, bond)
    return not can_escape(scene, work, time, bond, pull, needed)
