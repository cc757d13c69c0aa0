"""What becomes of two bodies: missed, or a collision that ends bound or departed.

`watch_pair`, the observer, looks at the pair after every accepted step.

Departed is a pair that touched, whose outlines are further apart than the escape gap, and which is
parting now and would part at the steady drift that weight and centre forces give it there.

Bound needs one of two proofs.

Certificate: the bodies touch, do not move against each other, and the attraction outweighs the
largest load that settling can put on the bond, in any orientation, by a safety factor: in pulling
straight, and in prying the doublet open about each of the two outermost contact points, which lie
on either side of the line of centres. Two spheres, and a surface force, which follows the contact,
need the straight pull only.

Rest: the bodies touch and have rested as one rigid doublet, which does not swing any more, for a
stated time, with the load at its worst: the faster settling one straight below (a fixed receiver
cannot turn, so it need not).
"""

import math

from flocsim.arrays import ANGLE, BOUNDING_RADIUS, CANDIDATES, FREE, GAP, NOW, SPIN, VX, VY, X, Y
from flocsim.geometry.contact.near_pairs import gap_between
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.geometry.contact.slip_transfer import contact_point
from flocsim.integrators.rhs.views import (
    centre_line,
    centre_view,
    closest_rows,
    effective_mass,
    surface_view,
)
from flocsim.laws import CENTRE_FORCE, centre_force, has, surface_force

BOUND, DEPARTED, MISSED = 1, 2, 3
"""Codes of the observer."""

(
    ZONE, ESCAPE, REST_TIME, DRIFT_X, DRIFT_Y, MOBILITY_I, MOBILITY_J,
    COLLIDED, INSIDE, CROSSED, D_COLLISION, D_MAX, D_LAST, T_COLLISION,
    REST_SINCE, REST_X, REST_Y, REST_ANGLE, OBSERVED_SIZE,
) = range(19)  # fmt: skip
"""Columns of `observed`, the observer's numbers. Given: D_0 [m], escape gap [m], rest time [s],
settling velocity of j relative to i [m/s], mobilities [s/kg]. Found: flags, centre distances [m],
times [s]."""

SAFETY = 3.0
"""Factor by which attraction must outweigh the load in a certificate."""

CALM = 0.02
"""A pair whose parts move at less than this share of the relative drift is calm enough for a
certificate …"""

REST = 1e-3
"""… and one that has moved by less than this share of the drift's way over the rest time rests."""

HANGING = 0.99
"""Cosine between line of centres and drift above which the load is at its worst."""

BODY_I, BODY_J = range(2)
"""The two bodies of an encounter: the receiver, and the one that it meets."""


def has_not_touched(observed):
    return observed[COLLIDED] == 0.0


def outline_gap(scene, work):
    """Distance between the two outlines now [m], negative where they overlap."""
    return gap_between(scene, work, BODY_J, BODY_I)


def note_collision(work, observed, time, distance):
    observed[COLLIDED] = 1.0
    observed[INSIDE] = 1.0 if distance < observed[ZONE] else 0.0
    observed[D_COLLISION] = distance
    observed[D_MAX] = distance
    observed[T_COLLISION] = time


def is_parting(scene, work, observed, time, nx, ny):
    """Whether body j (1) moves away from i (0), and would at the steady drift of this place."""
    motion = work.motion
    rate = nx * (motion[NOW, BODY_J, VX] - motion[NOW, BODY_I, VX])
    rate += ny * (motion[NOW, BODY_J, VY] - motion[NOW, BODY_I, VY])
    drift = nx * observed[DRIFT_X] + ny * observed[DRIFT_Y]
    if has(scene, CENTRE_FORCE):
        repulsion = centre_force(scene, centre_view(scene, work, time, NOW, BODY_J, BODY_I))
        drift += repulsion * (observed[MOBILITY_I] + observed[MOBILITY_J])
    return rate > 0.0 and drift > 0.0


def is_away(scene, work, observed, distance, gap):
    """Whether the outlines are further apart than the escape gap; cheap bounds first."""
    far = distance - scene.bodies[BODY_I, BOUNDING_RADIUS] - scene.bodies[BODY_J, BOUNDING_RADIUS]
    if far > observed[ESCAPE]:
        return True
    return (
        gap > 0.0 and gap > observed[ESCAPE] * 0.25 and outline_gap(scene, work) > observed[ESCAPE]
    )


def follow(scene, work, observed, distance):
    """Keep the largest and last centre distance, and whether it crossed D_0."""
    observed[D_LAST] = distance
    if observed[COLLIDED] == 1.0:
        observed[D_MAX] = max(observed[D_MAX], distance)
        inside = 1.0 if distance < observed[ZONE] else 0.0
        if inside != observed[INSIDE]:
            observed[CROSSED] = 1.0


def watch_pair(scene, work, observed, time):
    """The observer: 0 to go on, or BOUND, DEPARTED, MISSED."""
    nx, ny, distance = centre_line(work, NOW, BODY_J, BODY_I)
    gap = least_listed_gap(work)
    if observed[COLLIDED] == 0.0 and gap < 0.0:
        note_collision(work, observed, time, distance)
    follow(scene, work, observed, distance)
    if is_parting(scene, work, observed, time, nx, ny) and is_away(
        scene, work, observed, distance, gap
    ):
        return MISSED if observed[COLLIDED] == 0.0 else DEPARTED
    if observed[COLLIDED] == 0.0 or gap >= 0.0:
        start_rest(work, observed, time)
        return 0
    if is_certain(scene, work, observed, time, nx, ny, distance):
        return BOUND
    return BOUND if has_rested(scene, work, observed, time, nx, ny) else 0


def relative_speeds(scene, work, nx, ny):
    """(along the line of centres, of any kind) speeds of j against i as a rigid doublet [m/s]."""
    v = work.motion
    ux, uy = v[NOW, BODY_J, VX] - v[NOW, BODY_I, VX], v[NOW, BODY_J, VY] - v[NOW, BODY_I, VY]
    rx, ry = v[NOW, BODY_J, X] - v[NOW, BODY_I, X], v[NOW, BODY_J, Y] - v[NOW, BODY_I, Y]
    spin = v[NOW, BODY_I, SPIN]
    shear = math.hypot(ux + spin * ry, uy - spin * rx)
    size = min(scene.bodies[BODY_I, BOUNDING_RADIUS], scene.bodies[BODY_J, BOUNDING_RADIUS])
    return abs(ux * nx + uy * ny), shear + abs(v[NOW, BODY_J, SPIN] - spin) * size


def largest_load(observed):
    """The pull on the bond of a settling doublet in its worst orientation [N]."""
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    return drift / (observed[MOBILITY_I] + observed[MOBILITY_J])


def surface_attraction(scene, work, time):
    """Attraction at the closest points [N], 0 without surface forces."""
    if scene.surface_reach <= 0.0 or work.tally[CANDIDATES] == 0:
        return 0.0
    _, closest = closest_rows(work, NOW, 0)
    return -surface_force(scene, surface_view(scene, work, time, NOW, closest))


def arms_hold(work, attraction, load, nx, ny, distance):
    """Whether the attraction along the centres holds against prying about both outer contacts."""
    left_holds, right_holds = False, False
    for row in range(work.tally[CANDIDATES]):
        if work.geometry[NOW, row, GAP] >= 0.0:
            continue
        x, y = contact_point(work, row, BODY_I)
        side = nx * y - ny * x
        lever = max(math.hypot(x, y), math.hypot(x - distance * nx, y - distance * ny))
        holds = attraction * abs(side) > load * lever
        left_holds = left_holds or (holds and side > 0.0)
        right_holds = right_holds or (holds and side < 0.0)
    return left_holds and right_holds


def is_certain(scene, work, observed, time, nx, ny, distance):
    """Whether no later load can open the bond."""
    along, shear = relative_speeds(scene, work, nx, ny)
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    spin = work.motion[NOW, BODY_I, SPIN]
    centrifugal = effective_mass(scene, BODY_I, BODY_J) * spin * spin * distance
    load = SAFETY * (largest_load(observed) + centrifugal)
    centres = 0.0
    if has(scene, CENTRE_FORCE):
        view = centre_view(scene, work, time, NOW, BODY_J, BODY_I)
        centres = -centre_force(scene, view)
    surfaces = surface_attraction(scene, work, time)
    spheres = len(scene.vertices) == 2
    if spheres or surfaces > load - min(centres, 0.0):
        return along < CALM * drift and centres + surfaces > load
    if shear > CALM * drift or centres <= load:
        return False
    return arms_hold(work, centres, load, nx, ny, distance)


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


def has_rested(scene, work, observed, time, nx, ny):
    """Whether the doublet has kept its pose for long enough, its load at the worst."""
    x, y, angle = doublet_pose(work)
    size = min(scene.bodies[BODY_I, BOUNDING_RADIUS], scene.bodies[BODY_J, BOUNDING_RADIUS])
    moved = (
        math.hypot(x - observed[REST_X], y - observed[REST_Y])
        + abs(angle - observed[REST_ANGLE]) * size
    )
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    if moved > REST * drift * observed[REST_TIME]:
        start_rest(work, observed, time)
        return False
    # A doublet that still swings passes the worst direction, but may yet be thrown open.
    outer = scene.bodies[BODY_I, BOUNDING_RADIUS] + scene.bodies[BODY_J, BOUNDING_RADIUS]
    swing = abs(work.motion[NOW, BODY_I, SPIN]) * outer
    if swing > CALM * drift:
        return False
    hanging = nx * observed[DRIFT_X] + ny * observed[DRIFT_Y] >= HANGING * drift
    hanging = hanging or scene.bodies[BODY_I, FREE] == 0.0
    return hanging and time - observed[REST_SINCE] >= observed[REST_TIME]
