"""Whether a doublet is bound for good.

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
from flocsim.ensembles.collision.memo import (
    DRIFT_X,
    DRIFT_Y,
    MOBILITY_I,
    MOBILITY_J,
    REST_ANGLE,
    REST_SINCE,
    REST_TIME,
    REST_X,
    REST_Y,
)
from flocsim.geometry.contact.slip_transfer import contact_point
from flocsim.hooks import centre_force, has_centre_force, surface_force, surface_reach
from flocsim.integrators.rhs.views import centre_view, closest_rows, effective_mass, surface_view

BODY_I, BODY_J = range(2)
"""The two bodies of an encounter: the receiver, and the one that it meets."""

SAFETY = 3.0
"""Factor by which attraction must outweigh the load in a certificate."""

CALM = 0.02
"""A pair whose parts move at less than this share of the relative drift is calm enough for a
certificate …"""

REST = 1e-3
"""… and one that has moved by less than this share of the drift's way over the rest time rests."""

HANGING = 0.99
"""Cosine between line of centres and drift above which the load is at its worst."""


def relative_speeds(scene, work, nx, ny):
    """(along the line of centres, of any kind) speeds of j against i as a rigid doublet [m/s]."""
    v = work.motion
    ux, uy = v[NOW, BODY_J, VX] - v[NOW, BODY_I, VX], v[NOW, BODY_J, VY] - v[NOW, BODY_I, VY]
    rx, ry = v[NOW, BODY_J, X] - v[NOW, BODY_I, X], v[NOW, BODY_J, Y] - v[NOW, BODY_I, Y]
    spin = v[NOW, BODY_I, SPIN]
    shear = math.hypot(ux + spin * ry, uy - spin * rx)
    size = min(scene.bodies[BODY_I, BOUNDING_RADIUS], scene.bodies[BODY_J, BOUNDING_RADIUS])
    return abs(ux * nx + uy * ny), shear + abs(v[NOW, BODY_J, SPIN] - spin) * size


def largest_load(memo):
    """The pull on the bond of a settling doublet in its worst orientation [N]."""
    drift = math.hypot(memo[DRIFT_X], memo[DRIFT_Y])
    return drift / (memo[MOBILITY_I] + memo[MOBILITY_J])


def surface_attraction(scene, work, time):
    """Attraction at the closest points [N], 0 without surface forces."""
    if surface_reach(scene.parameters) <= 0.0 or work.tally[CANDIDATES] == 0:
        return 0.0
    _, closest = closest_rows(work, NOW, 0)
    return -surface_force(surface_view(scene, work, time, NOW, closest), scene.parameters)


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


def is_certain(scene, work, memo, time, nx, ny, distance):
    """Whether no later load can open the bond."""
    along, shear = relative_speeds(scene, work, nx, ny)
    drift = math.hypot(memo[DRIFT_X], memo[DRIFT_Y])
    spin = work.motion[NOW, BODY_I, SPIN]
    centrifugal = effective_mass(scene, BODY_I, BODY_J) * spin * spin * distance
    load = SAFETY * (largest_load(memo) + centrifugal)
    centres = 0.0
    if has_centre_force():
        view = centre_view(scene, work, time, NOW, BODY_J, BODY_I)
        centres = -centre_force(view, scene.parameters)
    surfaces = surface_attraction(scene, work, time)
    spheres = len(scene.vertices) == 2
    if spheres or surfaces > load - min(centres, 0.0):
        return along < CALM * drift and centres + surfaces > load
    if shear > CALM * drift or centres <= load:
        return False
    return arms_hold(work, centres, load, nx, ny, distance)


def outer_size(scene):
    """R_i + R_j [m]."""
    return scene.bodies[BODY_I, BOUNDING_RADIUS] + scene.bodies[BODY_J, BOUNDING_RADIUS]


def doublet_pose(work):
    """Place and angle of body 1 in the frame of body 0, which turns with it."""
    now = work.motion
    x, y = now[NOW, BODY_J, X] - now[NOW, BODY_I, X], now[NOW, BODY_J, Y] - now[NOW, BODY_I, Y]
    c, s = math.cos(now[NOW, BODY_I, ANGLE]), math.sin(now[NOW, BODY_I, ANGLE])
    return c * x + s * y, c * y - s * x, now[NOW, BODY_J, ANGLE] - now[NOW, BODY_I, ANGLE]


def start_rest(work, memo, time):
    """From now on the doublet may be resting as it is."""
    memo[REST_SINCE] = time
    memo[REST_X], memo[REST_Y], memo[REST_ANGLE] = doublet_pose(work)


def has_rested(scene, work, memo, time, nx, ny):
    """Whether the doublet has kept its pose for long enough, its load at the worst."""
    x, y, angle = doublet_pose(work)
    size = min(scene.bodies[BODY_I, BOUNDING_RADIUS], scene.bodies[BODY_J, BOUNDING_RADIUS])
    moved = math.hypot(x - memo[REST_X], y - memo[REST_Y]) + abs(angle - memo[REST_ANGLE]) * size
    drift = math.hypot(memo[DRIFT_X], memo[DRIFT_Y])
    if moved > REST * drift * memo[REST_TIME]:
        start_rest(work, memo, time)
        return False
    # A doublet that still swings passes the worst direction, but may yet be thrown open.
    swing = abs(work.motion[NOW, BODY_I, SPIN]) * outer_size(scene)
    if swing > CALM * drift:
        return False
    hanging = nx * memo[DRIFT_X] + ny * memo[DRIFT_Y] >= HANGING * drift
    hanging = hanging or scene.bodies[BODY_I, FREE] == 0.0
    return hanging and time - memo[REST_SINCE] >= memo[REST_TIME]
