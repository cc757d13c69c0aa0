"""What holds two bodies together that touch: the proofs that a pair is bound, and of which kind.

Certificate: no later load can open the bond. Either the bodies touch, do not move against each
other, and the attraction outweighs the largest load that settling can put on the bond, in any
orientation, by a safety factor: in pulling straight, and in prying the doublet open about each of
the two outermost contact points, which lie on either side of the line of centres (two spheres, and
a surface force, which follows the contact, need the straight pull only). Or they are trapped: to
climb out of the attraction between their centres, against that load, takes more than all the energy
that they have.

Rest: the bodies touch and have rested as one rigid doublet, which does not swing any more, for a
stated time, with the load at its worst: the faster settling one straight below (a fixed receiver
cannot turn, so it need not; nor need a floc that lies nested around the other's centre, or hovers
over it behind a barrier, if it rests for far longer). That shows that the doublet holds, not that
no kick could open it. In a flow alone the load is at its worst twice in every turn of the doublet,
or where it has come to lie still: there the stated time is that of a whole turn. Where attraction
alone could not even carry the load, the shapes do: such a
rest is a hook.
"""

import math

from flocsim.arrays import (
    ANGLE,
    BOUNDING_RADIUS,
    CANDIDATES,
    CLOSED,
    EQUIVALENT_RADIUS,
    FREE,
    GAP,
    INERTIA,
    NOW,
    SPIN,
    VX,
    VY,
    X,
    Y,
)
from flocsim.ensembles.collision.observed import (
    BODY_I,
    BODY_J,
    DRIFT_X,
    DRIFT_Y,
    IN_FLOW,
    LOAD,
    REST_ANGLE,
    REST_SINCE,
    REST_TIME,
    REST_X,
    REST_Y,
)
from flocsim.geometry.contact.slip_transfer import contact_point
from flocsim.integrators.rhs.surface_gap import flag_near, surface_view
from flocsim.integrators.rhs.views import centre_view, contact_view, effective_mass, pair_view
from flocsim.laws import (
    CENTRE_FORCE,
    CONTACT_FORCE,
    centre_force,
    contact_force,
    has,
    surface_force,
)

NO_BOND, CERTIFICATE, HOOK, REST = range(4)
"""Kinds of bond."""

SAFETY = 3.0
"""Factor by which attraction must outweigh the load in a certificate."""

CALM = 0.02
"""A pair whose parts move at less than this share of the relative drift is calm enough for a
certificate …"""

STILL = 1e-3
"""… and one that has moved by less than this share of the drift's way over the rest time rests."""

HANGING = 0.99
"""Cosine between line of centres and drift above which the load is at its worst."""

NEST = 0.1
"""Centres nearer than this share of r_i + r_j lie nested: the load has no lever to turn them, …"""

FAR_LONGER = 10.0
"""… and they are bound when they have rested for so many rest times."""

RUNGS = 16
"""Intervals of the climb out of the attraction."""


def relative_speeds(scene, work, nx, ny):
    """(along the line of centres, of any kind) speeds of j against i as a rigid doublet [m/s]."""
    v = work.motion
    ux, uy = v[NOW, BODY_J, VX] - v[NOW, BODY_I, VX], v[NOW, BODY_J, VY] - v[NOW, BODY_I, VY]
    rx, ry = v[NOW, BODY_J, X] - v[NOW, BODY_I, X], v[NOW, BODY_J, Y] - v[NOW, BODY_I, Y]
    spin = v[NOW, BODY_I, SPIN]
    shear = math.hypot(ux + spin * ry, uy - spin * rx)
    size = min(scene.bodies[BODY_I, BOUNDING_RADIUS], scene.bodies[BODY_J, BOUNDING_RADIUS])
    return abs(ux * nx + uy * ny), shear + abs(v[NOW, BODY_J, SPIN] - spin) * size


def at_rest(scene, view):
    """The PairView without motion: what resists an opening, as lubrication, holds nothing."""
    return pair_view(scene, view.time, BODY_J, BODY_I, view.gap, 0.0, view.centre_distance)


def centre_attraction(scene, work, time):
    """Attraction between the centres [N] at rest, 0 without such forces."""
    if not has(scene, CENTRE_FORCE):
        return 0.0
    return -centre_force(scene, at_rest(scene, centre_view(scene, work, time, NOW, BODY_J, BODY_I)))


def surface_attraction(scene, work, time):
    """Attraction at the outlines [N] at rest, 0 without surface forces."""
    if scene.surface_reach <= 0.0 or work.tally[CANDIDATES] == 0:
        return 0.0
    flag_near(scene, work, NOW, 0.0)
    view = surface_view(scene, work, time, NOW, 0, work.tally[CANDIDATES])
    return -surface_force(scene, at_rest(scene, view))


def leverage(work, nx, ny, distance):
    """By how much a load that pries about either outer contact outdoes one that pulls straight at
    the attraction along the centres; inf where no contact lies on one side of it."""
    left, right = math.inf, math.inf
    for row in range(work.tally[CANDIDATES]):
        if work.geometry[NOW, row, GAP] >= 0.0:
            continue
        x, y = contact_point(work, row, BODY_I)
        side = nx * y - ny * x
        lever = max(math.hypot(x, y), math.hypot(x - distance * nx, y - distance * ny))
        if side > 0.0:
            left = min(left, lever / side)
        elif side < 0.0:
            right = min(right, -lever / side)
    return max(left, right)


def is_held(scene, work, observed, time, nx, ny, distance):
    """Whether the bodies lie still and attraction outweighs every later load on the bond."""
    along, shear = relative_speeds(scene, work, nx, ny)
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    spin = work.motion[NOW, BODY_I, SPIN]
    centrifugal = effective_mass(scene, BODY_I, BODY_J) * spin * spin * distance
    load = SAFETY * (observed[LOAD] + centrifugal)
    centres = centre_attraction(scene, work, time)
    surfaces = surface_attraction(scene, work, time)
    spheres = len(scene.vertices) == 2
    if spheres or surfaces > load - min(centres, 0.0):
        return along < CALM * drift and centres + surfaces > load
    if shear > CALM * drift or centres <= load:
        return False
    return centres > load * leverage(work, nx, ny, distance)


def energy(scene, work):
    """What the bodies have to climb out with [J]: the energy of their motion against each other, of
    their spins, and of their contacts' springs."""
    v = work.motion
    ux, uy = v[NOW, BODY_J, VX] - v[NOW, BODY_I, VX], v[NOW, BODY_J, VY] - v[NOW, BODY_I, VY]
    total = 0.5 * effective_mass(scene, BODY_I, BODY_J) * (ux * ux + uy * uy)
    for body in range(2):
        spin = v[NOW, body, SPIN]
        total += 0.5 * scene.bodies[body, INERTIA] * spin * spin
    for row in range(work.tally[CANDIDATES]):
        if work.candidates[row, CLOSED] > 0 and has(scene, CONTACT_FORCE):
            contact = contact_view(scene, work, NOW, row)
            normal, tangential = contact_force(scene, contact)
            total += abs(normal * contact.overlap) + abs(tangential * contact.slip)
    return total


def is_trapped(scene, work, observed, time, distance):
    """Whether the bodies have too little energy to leave each other's centre attraction.

    Its work against the load, from here to where the equivalent spheres part, at least up to some
    place on the way, is more than SAFETY times their energy.
    """
    outer = scene.bodies[BODY_I, EQUIVALENT_RADIUS] + scene.bodies[BODY_J, EQUIVALENT_RADIUS]
    if not has(scene, CENTRE_FORCE) or distance >= outer or scene.surface_reach > 0.0:
        return False
    needed = SAFETY * energy(scene, work)
    load = SAFETY * observed[LOAD]
    climbed, rung = 0.0, (outer - distance) / RUNGS
    for step in range(RUNGS):
        place = distance + (step + 0.5) * rung
        view = pair_view(scene, time, BODY_J, BODY_I, place - outer, 0.0, place)
        climbed += (-centre_force(scene, view) - load) * rung
        if climbed < 0.0:
            return False
        if climbed > needed:
            return True
    return False


def doublet_pose(work):
    """Place and angle of body 1 in the frame of body 0, which turns with it."""
    now = work.motion
    x, y = now[NOW, BODY_J, X] - now[NOW, BODY_I, X], now[NOW, BODY_J, Y] - now[NOW, BODY_I, Y]
    c, s = math.cos(now[NOW, BODY_I, ANGLE]), math.sin(now[NOW, BODY_I, ANGLE])
    return c * x + s * y, c * y - s * x, now[NOW, BODY_J, ANGLE] - now[NOW, BODY_I, ANGLE]


def start_rest(work, observed, time):
    """From now on the doublet may be resting as it is."""
    observed[REST_SINCE] = time
    observed[REST_X], observed[REST_Y], observed[REST_ANGLE] = doublet_pose(work)


def rest_of(scene, work, observed, time):
    """How long the doublet has kept its pose without swinging, in rest times."""
    x, y, angle = doublet_pose(work)
    size = min(scene.bodies[BODY_I, BOUNDING_RADIUS], scene.bodies[BODY_J, BOUNDING_RADIUS])
    moved = (
        math.hypot(x - observed[REST_X], y - observed[REST_Y])
        + abs(angle - observed[REST_ANGLE]) * size
    )
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    if moved > STILL * drift * observed[REST_TIME]:
        start_rest(work, observed, time)
        return 0.0
    # A doublet that still swings passes the worst direction, but may yet be thrown open.
    outer = scene.bodies[BODY_I, BOUNDING_RADIUS] + scene.bodies[BODY_J, BOUNDING_RADIUS]
    swing = abs(work.motion[NOW, BODY_I, SPIN]) * outer
    if swing > CALM * drift and observed[IN_FLOW] == 0.0:
        return 0.0
    return (time - observed[REST_SINCE]) / observed[REST_TIME]


def rests_for_long(scene, work, observed, time):
    """Whether two bodies have kept still against each other far longer than the rest time."""
    return rest_of(scene, work, observed, time) >= FAR_LONGER


def has_rested(scene, work, observed, time, gap, nx, ny, distance):
    """Whether the doublet has kept its pose for long enough, its load at the worst."""
    rested = rest_of(scene, work, observed, time)
    sizes = scene.bodies[BODY_I, EQUIVALENT_RADIUS] + scene.bodies[BODY_J, EQUIVALENT_RADIUS]
    if (gap >= 0.0 or distance < NEST * sizes) and rested >= FAR_LONGER:
        return True
    if observed[IN_FLOW] != 0.0:
        return gap < 0.0 and rested >= 1.0
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    hanging = nx * observed[DRIFT_X] + ny * observed[DRIFT_Y] >= HANGING * drift
    hanging = hanging or scene.bodies[BODY_I, FREE] == 0.0
    return gap < 0.0 and hanging and rested >= 1.0


def bond_of(scene, work, observed, time, gap, nx, ny, distance):
    """The kind of bond of two bodies that have touched, NO_BOND where none is proved."""
    if is_trapped(scene, work, observed, time, distance):
        return CERTIFICATE
    if gap < 0.0 and is_held(scene, work, observed, time, nx, ny, distance):
        return CERTIFICATE
    if not has_rested(scene, work, observed, time, gap, nx, ny, distance):
        return NO_BOND
    attraction = centre_attraction(scene, work, time) + surface_attraction(scene, work, time)
    return REST if attraction > observed[LOAD] else HOOK
