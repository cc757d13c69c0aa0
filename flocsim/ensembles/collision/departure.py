"""Whether two bodies have parted for good: the drift that is left cannot bring them together again.

Body j is carried along the steady drift against i, at the orientations of now, by as much at a time
as still lies between the outlines, until it has passed all of i. What is left of present velocities
and spins, until drag has used it up, must fit into what remains between them on the way. In a flow
alone, they have parted once it carries them apart beyond all reach of their outlines: in shear and
in extension it does so for ever then.
"""

import math

import flocsim.arrays as at
from flocsim.ensembles.collision.observed import (
    BODY_I,
    BODY_J,
    DRIFT_X,
    DRIFT_Y,
    ESCAPE,
    FLOW_XX,
    FLOW_XY,
    FLOW_YX,
    FLOW_YY,
    IN_FLOW,
    MOBILITY_I,
    MOBILITY_J,
)
from flocsim.geometry.contact.circle_tree import core_distance
from flocsim.geometry.contact.near_pairs import gap_between, pose_of
from flocsim.integrators.rhs.views import body_view, centre_view
from flocsim.laws import (
    CENTRE_FORCE,
    VELOCITY_DERIVATIVES,
    body_force,
    centre_force,
    has,
    velocity_derivatives,
)

MOST_ADVANCES = 200
"""Moves along the drift until the outlines count as able to meet."""

CLEARANCE = 0.25
"""The outlines must stay further apart on the way than this share of the escape gap."""


def is_parting(scene, work, observed, time, nx, ny):
    """Whether body j (1) moves away from i (0), and would at the steady drift of this place."""
    motion = work.motion
    rate = nx * (motion[at.NOW, BODY_J, at.VX] - motion[at.NOW, BODY_I, at.VX])
    rate += ny * (motion[at.NOW, BODY_J, at.VY] - motion[at.NOW, BODY_I, at.VY])
    drift = nx * observed[DRIFT_X] + ny * observed[DRIFT_Y]
    if has(scene, CENTRE_FORCE):
        repulsion = centre_force(scene, centre_view(scene, work, time, at.NOW, BODY_J, BODY_I))
        drift += repulsion * (observed[MOBILITY_I] + observed[MOBILITY_J])
    return rate > 0.0 and drift > 0.0


def is_away(scene, work, observed, distance, gap):
    """Whether the outlines are further apart than the escape gap; cheap bounds first."""
    far = (
        distance
        - scene.bodies[BODY_I, at.BOUNDING_RADIUS]
        - scene.bodies[BODY_J, at.BOUNDING_RADIUS]
    )
    if far > observed[ESCAPE]:
        return True
    return (
        gap > 0.0
        and gap > observed[ESCAPE] * 0.25
        and gap_between(scene, work, BODY_J, BODY_I) > observed[ESCAPE]
    )


def left_over(scene, work, observed):
    """How far j may still be carried off the drift against i by its present velocity [m]."""
    v, drift_time = work.motion, 0.0
    for body, mobility in ((BODY_I, observed[MOBILITY_I]), (BODY_J, observed[MOBILITY_J])):
        drift_time = max(drift_time, scene.bodies[body, at.MASS] * mobility)
    x = v[at.NOW, BODY_J, at.VX] - v[at.NOW, BODY_I, at.VX] - observed[DRIFT_X]
    y = v[at.NOW, BODY_J, at.VY] - v[at.NOW, BODY_I, at.VY] - observed[DRIFT_Y]
    return drift_time * math.hypot(x, y)


def turn_left(scene, work, time, body, passing):
    """How far an outline may still be moved by its turning [m] within the time of passing [s]."""
    outer = scene.bodies[body, at.BOUNDING_RADIUS]
    spin, damping = work.motion[at.NOW, body, at.SPIN], 0.0
    if not has(scene, VELOCITY_DERIVATIVES) or spin == 0.0:
        return outer * abs(spin) * passing
    view = body_view(scene, work, time, at.NOW, body)
    damping = -velocity_derivatives(scene, view)[8]
    if not damping > 0.0:
        return outer * abs(spin) * passing
    _, _, torque = body_force(scene, view)
    last = spin + torque / damping
    turned = abs(spin - last) * scene.bodies[body, at.INERTIA] / damping + abs(last) * passing
    return outer * turned


def can_meet_again(scene, work, observed, time):
    """Whether the outlines may come together along the drift that is left."""
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    ux, uy = observed[DRIFT_X] / drift, observed[DRIFT_Y] / drift
    x = work.motion[at.NOW, BODY_J, at.X] - work.motion[at.NOW, BODY_I, at.X]
    y = work.motion[at.NOW, BODY_J, at.Y] - work.motion[at.NOW, BODY_I, at.Y]
    along, aside = x * ux + y * uy, abs(x * uy - y * ux)
    outer = scene.bodies[BODY_I, at.BOUNDING_RADIUS] + scene.bodies[BODY_J, at.BOUNDING_RADIUS]
    clear = CLEARANCE * observed[ESCAPE] + left_over(scene, work, observed)
    if (math.hypot(x, y) if along >= 0.0 else aside) >= outer + clear:
        return False
    passing = (outer + clear + max(-along, 0.0)) / drift
    clear += turn_left(scene, work, time, BODY_I, passing)
    clear += turn_left(scene, work, time, BODY_J, passing)
    contact = scene.bodies[BODY_I, at.RADIUS] + scene.bodies[BODY_J, at.RADIUS]
    turn_c, turn_s, x, y = pose_of(scene, work, BODY_J, BODY_I)
    c, s = (
        math.cos(work.motion[at.NOW, BODY_I, at.ANGLE]),
        math.sin(work.motion[at.NOW, BODY_I, at.ANGLE]),
    )
    ux, uy = c * ux + s * uy, c * uy - s * ux
    for _ in range(MOST_ADVANCES):
        gap = core_distance(scene, BODY_J, BODY_I, (turn_c, turn_s, x, y)) - contact
        if gap <= clear:
            return True
        # No further than the outlines are apart, so that nothing is passed over.
        ahead = gap - 0.9 * clear
        x, y = x + ahead * ux, y + ahead * uy
        if x * ux + y * uy >= 0.0 and math.hypot(x, y) >= outer + clear:
            return False
    return True


def is_carried_away(scene, work, observed, time, nx, ny, distance):
    """Whether a flow alone draws the bodies apart, beyond where their outlines reach and faster
    than attraction draws them together."""
    outer = scene.bodies[BODY_I, at.BOUNDING_RADIUS] + scene.bodies[BODY_J, at.BOUNDING_RADIUS]
    if distance < outer + observed[ESCAPE]:
        return False
    stretch = nx * (observed[FLOW_XX] * nx + observed[FLOW_XY] * ny)
    stretch += ny * (observed[FLOW_YX] * nx + observed[FLOW_YY] * ny)
    speed = stretch * distance
    if has(scene, CENTRE_FORCE):
        repulsion = centre_force(scene, centre_view(scene, work, time, at.NOW, BODY_J, BODY_I))
        speed += min(repulsion, 0.0) * (observed[MOBILITY_I] + observed[MOBILITY_J])
    motion = work.motion
    rate = nx * (motion[at.NOW, BODY_J, at.VX] - motion[at.NOW, BODY_I, at.VX])
    rate += ny * (motion[at.NOW, BODY_J, at.VY] - motion[at.NOW, BODY_I, at.VY])
    return speed > 0.0 and rate > 0.0


def has_departed(scene, work, observed, time, nx, ny, distance, gap):
    """Whether the bodies have parted for good; ``gap``: the least of the listed pairs [m]."""
    if observed[IN_FLOW] != 0.0:
        return is_carried_away(scene, work, observed, time, nx, ny, distance)
    return (
        is_parting(scene, work, observed, time, nx, ny)
        and is_away(scene, work, observed, distance, gap)
        and not can_meet_again(scene, work, observed, time)
    )
