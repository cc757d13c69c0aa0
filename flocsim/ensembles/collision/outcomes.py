"""What becomes of two bodies: missed, or a collision that ends bound or departed.

``observe`` looks at the pair after every accepted step. Bound needs proof (see bonds.py).

Departed is a pair that touched, whose outlines are further apart than the escape gap, and which is
parting now and would part at the steady drift that weight and centre forces give it there.
"""

from flocsim.arrays import BOUNDING_RADIUS, NOW, VX, VY
from flocsim.ensembles.collision.bonds import BODY_I, BODY_J, has_rested, is_certain, start_rest
from flocsim.ensembles.collision.memo import (
    COLLIDED,
    CROSSED,
    D_COLLISION,
    D_LAST,
    D_MAX,
    DRIFT_X,
    DRIFT_Y,
    ESCAPE,
    INSIDE,
    MOBILITY_I,
    MOBILITY_J,
    T_COLLISION,
    ZONE,
)
from flocsim.geometry.contact.near_pairs import gap_between
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.hooks import centre_force, has_centre_force
from flocsim.integrators.rhs.views import centre_line, centre_view

BOUND, DEPARTED, MISSED = 1, 2, 3
"""Codes of the observer."""


def has_not_touched(memo):
    """Whether the pair has yet to touch."""
    return memo[COLLIDED] == 0.0


def outline_gap(scene, work):
    """Distance between the two outlines now [m], negative where they overlap."""
    return gap_between(scene, work, BODY_J, BODY_I)


def note_collision(work, memo, time, distance):
    """Write down the instant of the first touch."""
    memo[COLLIDED] = 1.0
    memo[INSIDE] = 1.0 if distance < memo[ZONE] else 0.0
    memo[D_COLLISION] = distance
    memo[D_MAX] = distance
    memo[T_COLLISION] = time


def is_parting(scene, work, memo, time, nx, ny):
    """Whether body j (1) moves away from i (0), and would at the steady drift of this place."""
    motion = work.motion
    rate = nx * (motion[NOW, BODY_J, VX] - motion[NOW, BODY_I, VX])
    rate += ny * (motion[NOW, BODY_J, VY] - motion[NOW, BODY_I, VY])
    drift = nx * memo[DRIFT_X] + ny * memo[DRIFT_Y]
    if has_centre_force():
        repulsion = centre_force(
            centre_view(scene, work, time, NOW, BODY_J, BODY_I), scene.parameters
        )
        drift += repulsion * (memo[MOBILITY_I] + memo[MOBILITY_J])
    return rate > 0.0 and drift > 0.0


def is_away(scene, work, memo, distance, gap):
    """Whether the outlines are further apart than the escape gap."""
    far = distance - scene.bodies[BODY_I, BOUNDING_RADIUS] - scene.bodies[BODY_J, BOUNDING_RADIUS]
    if far > memo[ESCAPE]:
        return True
    return gap > 0.0 and gap > memo[ESCAPE] * 0.25 and outline_gap(scene, work) > memo[ESCAPE]


def follow(scene, work, memo, distance):
    """Keep the largest and last centre distance, and whether it crossed D_0."""
    memo[D_LAST] = distance
    if memo[COLLIDED] == 1.0:
        memo[D_MAX] = max(memo[D_MAX], distance)
        inside = 1.0 if distance < memo[ZONE] else 0.0
        if inside != memo[INSIDE]:
            memo[CROSSED] = 1.0


def watch_pair(scene, work, memo, time):
    """The observer: 0 to go on, or BOUND, DEPARTED, MISSED."""
    nx, ny, distance = centre_line(work, NOW, BODY_J, BODY_I)
    gap = least_listed_gap(work)
    if memo[COLLIDED] == 0.0 and gap < 0.0:
        note_collision(work, memo, time, distance)
    follow(scene, work, memo, distance)
    if is_parting(scene, work, memo, time, nx, ny) and is_away(scene, work, memo, distance, gap):
        return MISSED if memo[COLLIDED] == 0.0 else DEPARTED
    if memo[COLLIDED] == 0.0 or gap >= 0.0:
        start_rest(work, memo, time)
        return 0
    if is_certain(scene, work, memo, time, nx, ny, distance):
        return BOUND
    return BOUND if has_rested(scene, work, memo, time, nx, ny) else 0
