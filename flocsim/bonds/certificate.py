"""Two bodies that may be bound, the load on their bond, and certificates.

The bodies are i and j, j being the later one; the work lists pairs of features of these two alone,
located where they are now. A certificate says that no later load can open the bond, by attraction
alone:

- Held: the bodies lie calm, and attraction outweighs, by a safety factor, the largest load, in any
  orientation. What an attraction can bear is the most that it comes to on the way out of where the
  bodies are, contacts or not: in a well between attraction and repulsion the net force of now is
  the load, whatever the well could bear. It bears the load in pulling straight, and in prying the
  doublet open about each of the two outermost contact points, which lie on either side of the line
  of centres. Two spheres, and a surface force, which follows the contact, need the straight pull
  only.
- Trapped: to climb out of the attraction between their centres, against that load, takes more than
  all the energy that they have.
- In kicks: to climb out of their attraction, against that load, and times its leverage where it
  pries, takes the energy that they have and BARRIER k_B T besides: by Kramers' rate e^20 = 5e8
  times as long as bodies take to relax. Whatever way shapes roll, what they climb is their
  potential (integrators/rhs/climb.py).

All forces are those at rest: what resists an opening, as lubrication, holds nothing.
"""

import math
from typing import NamedTuple

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import contact_point, least_listed_gap, separation
from flocsim.hooks import (
    CENTRE_FORCE,
    CONTACT_FORCE,
    ORIENTED_ENERGY,
    centre_force,
    contact_force,
    has,
    surface_force,
)
from flocsim.integrators.rhs.climb import BARRIER, LEAST_RUNG, RUNG, can_climb
from flocsim.integrators.rhs.outline_sum import acts_along, outline_reach, outlines_apart
from flocsim.integrators.rhs.surface_gap import flag_near, surface_view
from flocsim.integrators.rhs.views import centre_line, contact_view, effective_mass, pair_view
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.views import moved_contact
from flocsim.state.work import NOW

NO_BOND, CERTIFICATE, HOOK, REST = range(4)
"""Kinds of bond."""


class Bond(NamedTuple):
    """Bodies ``i`` and ``j``; the unit vector from i's centroid to j's, and their distance [m]; the
    least gap of their features [m], and ``surface_gap``, that by which surface forces go [m]."""

    i: int
    j: int
    nx: float
    ny: float
    distance: float
    gap: float
    surface_gap: float


class Load(NamedTuple):
    """What pulls at a bond: its largest ``force`` [N]; the ``drift`` of the two against each other
    [m/s], or of the bodies of their cluster; its direction (``x``, ``y``) on j, (0, 0) where it may
    have any; ``lever``, how long an arm the cluster gives it at least [m]; ``alone``, 1.0 where the
    two are all of their cluster; ``kicks``, k_B T [J], 0.0 without."""

    force: float
    drift: float
    x: float
    y: float
    lever: float
    alone: float
    kicks: float


def bond_between(scene, work, time, i, j):
    """The Bond of two bodies whose features are listed and located."""
    nx, ny, distance = centre_line(scene, work, NOW, j, i)
    gap = least_listed_gap(work)
    surface = gap
    if scene.surface_reach > 0.0 and work.tally.candidates > 0:
        flag_near(scene, work, NOW, 0.0)
        surface = surface_view(scene, work, time, NOW, 0, work.tally.candidates).gap
    return Bond(i, j, nx, ny, distance, gap, surface)


def is_closed(work, row):
    """Whether a listed pair of features touches now."""
    return work.geometry[NOW, row].gap < 0.0


def size_of(scene, i, j):
    """The smaller bounding radius [m]: by so much outlines move as the bodies turn by one."""
    return min(scene.bodies[i].bounding_radius, scene.bodies[j].bounding_radius)


def radii_of(scene, bond):
    """r_i + r_j, equivalent radii [m]."""
    return scene.bodies[bond.i].equivalent_radius + scene.bodies[bond.j].equivalent_radius


def are_spheres(scene, bond):
    """Whether both bodies are spheres."""
    count_i = scene.first[bond.i + 1] - scene.first[bond.i]
    return count_i == 1 and scene.first[bond.j + 1] - scene.first[bond.j] == 1


def speeds_of(scene, work, bond):
    """(along the line of centres, of any kind) speeds of j against i as a rigid doublet [m/s]."""
    i, j = bond.i, bond.j
    ux, uy = (
        work.velocity[NOW, j, X] - work.velocity[NOW, i, X],
        work.velocity[NOW, j, Y] - work.velocity[NOW, i, Y],
    )
    rx, ry = bond.nx * bond.distance, bond.ny * bond.distance
    spin = work.velocity[NOW, i, ANGLE]
    shear = math.hypot(ux + spin * ry, uy - spin * rx)
    turning = abs(work.velocity[NOW, j, ANGLE] - spin) * size_of(scene, i, j)
    return abs(ux * bond.nx + uy * bond.ny), shear + turning


def doublet_pose(scene, work, state, i, j):
    """Place [m] and angle of body j in the frame of i, which turns with it, in a state."""
    x, y = separation(scene, work, state, j, i)
    turn = work.place[state, i, ANGLE]
    c, s = math.cos(turn), math.sin(turn)
    return c * x + s * y, c * y - s * x, work.place[state, j, ANGLE] - turn


def way_between(scene, i, j, pose, before):
    """By how much the outlines of two bodies have moved from one such pose to another [m]."""
    x, y, angle = pose
    was_x, was_y, was_angle = before
    return math.hypot(x - was_x, y - was_y) + abs(angle - was_angle) * size_of(scene, i, j)


def resting_contact(view, slip):
    """The ContactView of the same contact at rest, its tangential displacement given [m]."""
    return moved_contact(view, view.overlap, 0.0, slip, 0.0)


def energy_of(scene, work, bond):
    """What the bodies have to climb out with [J]: the energy of their motion against each other, of
    their spins, and twice that of their contacts' springs."""
    i, j = bond.i, bond.j
    ux, uy = (
        work.velocity[NOW, j, X] - work.velocity[NOW, i, X],
        work.velocity[NOW, j, Y] - work.velocity[NOW, i, Y],
    )
    total = 0.5 * effective_mass(scene, i, j) * (ux * ux + uy * uy)
    total += (
        0.5 * scene.bodies[i].inertia * work.velocity[NOW, i, ANGLE] * work.velocity[NOW, i, ANGLE]
    )
    total += (
        0.5 * scene.bodies[j].inertia * work.velocity[NOW, j, ANGLE] * work.velocity[NOW, j, ANGLE]
    )
    if not has(scene, CONTACT_FORCE):
        return total
    for row in range(work.tally.candidates):
        if is_closed(work, row):
            view = contact_view(scene, work, NOW, row)
            normal, tangential = contact_force(scene, resting_contact(view, view.slip))
            total += abs(normal * view.overlap) + abs(tangential * view.slip)
    return total


SAFETY = 3.0
"""Factor by which attraction must outweigh the load."""

CALM = 0.02
"""A pair whose parts move at less than this share of the drift is calm enough."""

LEANING = 0.05
"""Over this share of the distance, and over the square of the leverage, levers stay what they are
as a doublet is pried open: so far on the way out attraction between centres counts there."""

FINER = 0.125
"""A step about the highest place of the way out, over one of the whole way."""


def attraction_at(scene, work, time, bond, way):
    """(between centres, between outlines) [N] at rest, both gaps wider by a way [m]."""
    centres, surfaces = 0.0, 0.0
    distance, gap = bond.distance + way, bond.surface_gap + way
    if has(scene, CENTRE_FORCE):
        between = distance - radii_of(scene, bond)
        view = pair_view(scene, time, bond.j, bond.i, between, 0.0, distance)
        centres = -centre_force(scene, view)
    if scene.surface_reach > gap:
        surfaces = -surface_force(scene, pair_view(scene, time, bond.j, bond.i, gap, 0.0, distance))
    if acts_along(scene):
        surfaces -= outlines_apart(scene, work, time, bond.j, bond.i, way)
    return centres, surfaces


def is_enough(all_of_it, follows, pries, enough):
    """Whether a capacity is above what is asked for: all of it, and one of its two parts."""
    return all_of_it > enough[0] and (follows > enough[1] or pries > enough[2])


@apart
def most_between(scene, work, time, bond, start, end, near, share, enough):
    """What the attraction comes to at most over the ways from ``start`` to ``end`` [N], as capacity
    has it, and the way at which all of it is most [m]; ``share``: steps over the gap there."""
    sizes, best = radii_of(scene, bond), start
    all_of_it, follows, pries = 0.0, 0.0, 0.0
    way = start
    while way < end:
        centres, surfaces = attraction_at(scene, work, time, bond, way)
        if centres + surfaces > all_of_it:
            all_of_it, best = centres + surfaces, way
        follows = max(follows, surfaces + min(centres, 0.0))
        if way <= near:
            pries = max(pries, centres)
        if is_enough(all_of_it, follows, pries, enough):
            break
        # Forces change over as much as is left of the gap that they go by.
        left = end
        if has(scene, CENTRE_FORCE):
            left = min(left, abs(bond.distance + way - sizes))
        if scene.surface_reach > 0.0:
            left = min(left, abs(bond.surface_gap + way))
        if bond.gap + way < outline_reach(scene):
            left = min(left, max(bond.gap + way, scene.outlines[1]))
        way += max(share * left, LEAST_RUNG)
    return all_of_it, follows, pries, best


@apart
def lets_out(scene, work, time, bond, pull, needed):
    """Whether less than an energy [J] leads out of the attraction, a pull [N] helping."""
    known = scene, work, time, bond.j, bond.i
    return can_climb(*known, bond.distance, bond.surface_gap, pull, needed)


def capacity(scene, work, time, bond, near, enough):
    """What the attraction can bear from here outwards [N]: (all of it; that of outlines alone, less
    a repulsion of centres; that of centres alone, over a way ``near`` [m]). It is not looked for
    any further than to where it is ``enough`` (is_enough)."""
    between = scene.surface_reach > bond.surface_gap or outline_reach(scene) > bond.gap
    if not has(scene, CENTRE_FORCE) and not between:
        return 0.0, 0.0, 0.0
    sizes = radii_of(scene, bond)
    end = 2.0 * sizes + max(-bond.surface_gap, sizes - bond.distance, 0.0)
    known = scene, work, time, bond, 0.0, end, near, RUNG, enough
    most, follows, pries, best = most_between(*known)
    if is_enough(most, follows, pries, enough):
        return most, follows, pries
    # Once more about the highest place, which may be a cusp.
    around = RUNG * (abs(bond.surface_gap + best) if scene.surface_reach > 0.0 else sizes)
    if outline_reach(scene) > 0.0:
        around = min(around, RUNG * max(bond.gap + best, scene.outlines[1]))
    if has(scene, CENTRE_FORCE):
        around = min(around, RUNG * abs(bond.distance + best - sizes))
    start, end = max(best - around, 0.0), best + around
    known = scene, work, time, bond, start, end, near, FINER * RUNG, enough
    finer, follows_finer, pries_finer, _ = most_between(*known)
    return max(most, finer), max(follows, follows_finer), max(pries, pries_finer)


def leverage(work, bond, least):
    """By how much a load that pries about either outer contact outdoes one that pulls straight at
    the attraction along the centres, with an arm of at least ``least`` [m]; inf where no contact
    lies on one side of it."""
    left, right = math.inf, math.inf
    nx, ny, distance = bond.nx, bond.ny, bond.distance
    for row in range(work.tally.candidates):
        if not is_closed(work, row):
            continue
        x, y = contact_point(work, row, bond.i)
        side = nx * y - ny * x
        lever = max(math.hypot(x, y), math.hypot(x - distance * nx, y - distance * ny), least)
        if side > 0.0:
            left = min(left, lever / side)
        elif side < 0.0:
            right = min(right, -lever / side)
    return max(left, right)


def is_held(scene, work, time, bond, load):
    """Whether the bodies lie calm and attraction outweighs every later load on the bond."""
    along, shear = speeds_of(scene, work, bond)
    if not along < CALM * load.drift:
        return False
    mass, spin = effective_mass(scene, bond.i, bond.j), work.velocity[NOW, bond.i, ANGLE]
    needed = SAFETY * (load.force + mass * spin * spin * bond.distance)
    spheres = are_spheres(scene, bond)
    ratio = 1.0 if spheres else leverage(work, bond, load.lever)
    near = LEANING * bond.distance / (ratio * ratio)
    pried = needed * ratio if shear < CALM * load.drift else math.inf
    enough = needed, -1.0 if spheres else needed, pried
    all_of_it, follows, pries = capacity(scene, work, time, bond, near, enough)
    if not is_enough(all_of_it, follows, pries, enough):
        return False
    # In a well, which they might still be leaving.
    moving = 0.5 * mass * along * along
    return bond.gap < 0.0 or not lets_out(scene, work, time, bond, load.force, moving)


def is_trapped(scene, work, time, bond, load):
    """Whether the two have too little energy to leave each other's attraction between centres, in
    which they lie, against the load: its work out of it is more than SAFETY times their energy."""
    inside = has(scene, CENTRE_FORCE) and bond.distance < radii_of(scene, bond)
    if not inside or max(scene.surface_reach, outline_reach(scene)) > 0.0 or load.alone == 0.0:
        return False
    pull = SAFETY * load.force
    centres, _ = attraction_at(scene, work, time, bond, 0.0)
    if not centres > pull:
        return False
    needed = SAFETY * energy_of(scene, work, bond)
    return not lets_out(scene, work, time, bond, pull, needed)


def is_certain(scene, work, time, bond, load):
    """Whether no later load can open the bond, where nothing kicks; not known where forces ask how
    bodies are turned."""
    if has(scene, ORIENTED_ENERGY):
        return False
    return is_trapped(scene, work, time, bond, load) or is_held(scene, work, time, bond, load)


def is_certain_in_kicks(scene, work, time, bond, load):
    """Whether neither a later load nor kicks can open the bond."""
    pull = SAFETY * load.force
    if pull > 0.0 and not are_spheres(scene, bond):
        _, follows, _ = capacity(scene, work, time, bond, 0.0, (-1.0, pull, math.inf))
        if not follows > pull:
            pull *= leverage(work, bond, load.lever)
    needed = BARRIER * load.kicks + energy_of(scene, work, bond)
    return not lets_out(scene, work, time, bond, pull, needed)
