"""What becomes of two bodies: missed, held, or a collision that ends bound or departed.

`watch_pair`, the observer, looks at the pair after every accepted step. Departed is a pair that
touched and has parted for good, missed one that parted so before it touched; held is one that has
not touched and rests so, one body over the other, in a secondary minimum say; bound is one that has
touched and is proved to stay together (flocsim.bonds).

They have parted for good where the drift that is left cannot bring them together again. Body j is
carried along the steady drift against i, at the orientations of now, by as much at a time as still
lies between the outlines, until it has passed all of i. What is left of present velocities and
spins, until drag has used it up, must fit into what remains between them on the way. In a flow
alone, they have parted once it carries them apart beyond all reach of their outlines: in shear and
in extension it does so for ever then.

Of a bond the observer knows the load, and how long the pair has kept its pose. The proofs are those
of flocsim.bonds. In a flow the load comes from everywhere, as the doublet turns round in it, and
the rest time is that of a whole turn.

Where random forces kick the pair no proof that follows from drifts and loads alone holds, so that
each is compared with k_B T:

- Parted: against a relative drift v that carries them apart, bodies that diffuse with D against
  each other come back over a way a with a probability of exp(−v a/D) at most, exactly that of a
  line, as a half-plane has to be crossed on the way. They have parted for good where that is below
  RETURN_SHARE. The way is the farther half of what lies between their bounding circles along the
  drift; v the least there, less what attraction makes of it at the near end. Where they meet by
  thermal motion alone there is no drift, and they have parted where the study says so: once their
  centres are the stated distance apart.
- Certificate, rest and hook: by BARRIER k_B T besides what they need without kicks (flocsim.bonds).
- Held: by BARRIER k_B T on either side of a secondary minimum of spheres, or of surface forces
  (`attraction.caged_between`).

What is none of these goes on until it is, or is undecided at the end.
"""

import math
from collections.abc import Callable

from flocsim import hooks
from flocsim.bonds.certificate import (
    CERTIFICATE,
    NO_BOND,
    Load,
    are_spheres,
    bond_between,
    doublet_pose,
    is_certain,
    is_certain_in_kicks,
    pose_change,
)
from flocsim.bonds.escape import forces_at_rest, radii_of
from flocsim.bonds.rest import NESTED_DISTANCE, STABLE_POSE, is_swinging, kind_at_rest
from flocsim.geometry.contact.near_pairs import core_distance, gap_between, pose_of
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.hooks import (
    CENTRE_FORCE,
    VELOCITY_DERIVATIVES,
    body_force,
    centre_force,
    has,
    velocity_derivatives,
)
from flocsim.integrators.rhs.views import body_view, centre_line, centre_view
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import NOW

(
    ZONE, ESCAPE, REST_TIME, DRIFT_X, DRIFT_Y, MOBILITY_I, MOBILITY_J, LOAD,
    COLLIDED, INSIDE, CROSSED, D_COLLISION, D_MAX, D_LAST, T_COLLISION, BOND,
    REST_SINCE, REST_X, REST_Y, REST_ANGLE, IN_FLOW, FLOW_XX, FLOW_XY, FLOW_YX, FLOW_YY,
    KICK_ENERGY, BROWNIAN, CAGE_LOW, CAGE_HIGH,
    OBSERVED_SIZE,
) = range(30)  # fmt: skip
"""Columns of `observed`. Given: D_0 [m], escape gap [m], rest time [s], velocity of j relative to i
in settling, or about that in a flow [m/s], largest mobilities [s/kg], the largest load that
settling, or the flow, can put on a bond [N]; whether they meet in a flow alone, and its gradient
[1/s]; k_B T [J], 0 without kicks, whether they meet by thermal motion alone, when ESCAPE is the
distance of their centres [m], and the gaps [m] of a secondary minimum between which kicks do not
let a pair out. Found: flags, centre distances [m], time [s], the kind of
bond (flocsim.bonds), and since when the doublet has been resting in which pose."""

BODY_I, BODY_J = range(2)
"""The two bodies of an encounter: the receiver, and the one that it meets."""


BOUND, DEPARTED, MISSED, HELD = 1, 2, 3, 4
"""Codes of the observer."""


def has_not_touched(observed):
    return observed[COLLIDED] == 0.0


def note_collision(observed, time, distance):
    observed[COLLIDED] = 1.0
    observed[INSIDE] = 1.0 if distance < observed[ZONE] else 0.0
    observed[D_COLLISION] = distance
    observed[D_MAX] = distance
    observed[T_COLLISION] = time


def follow(observed, distance):
    """Keep the largest and last centre distance, and whether it crossed D_0."""
    observed[D_LAST] = distance
    if observed[COLLIDED] == 1.0:
        observed[D_MAX] = max(observed[D_MAX], distance)
        inside = 1.0 if distance < observed[ZONE] else 0.0
        if inside != observed[INSIDE]:
            observed[CROSSED] = 1.0


def watch_pair(scene, work, observed, time):
    """The observer: return 0 to go on, or BOUND, DEPARTED, MISSED, HELD."""
    nx, ny, distance = centre_line(scene, work, NOW, BODY_J, BODY_I)
    gap = least_listed_gap(work)
    if observed[COLLIDED] == 0.0 and gap < 0.0:
        note_collision(observed, time, distance)
    follow(observed, distance)
    if has_parted(scene, work, observed, time, nx, ny, distance, gap):
        return MISSED if observed[COLLIDED] == 0.0 else DEPARTED
    if observed[COLLIDED] == 0.0:
        return HELD if is_held_apart(scene, work, observed, time) else 0
    observed[BOND] = bond_of(scene, work, observed, time)
    return 0 if observed[BOND] == NO_BOND else BOUND


MOST_ADVANCES = 200
"""Moves along the drift until the outlines count as able to meet."""

CLEARANCE = 0.25
"""The outlines must stay further apart on the way than this share of the escape gap."""


def apart(of, axis):
    """Return by how much j has more of a column than i."""
    return of[NOW, BODY_J, axis] - of[NOW, BODY_I, axis]


def outer_of(scene):
    """Return R_i + R_j [m]."""
    return scene.bodies[BODY_I].bounding_radius + scene.bodies[BODY_J].bounding_radius


def rate_of_parting(work, nx, ny):
    """Return the speed at which j moves away from i along the unit vector between them [m/s]."""
    return nx * apart(work.velocity, X) + ny * apart(work.velocity, Y)


def speed_by_centre_forces(scene, work, observed, time):
    """Return the speed at which forces between the centres alone push the two apart [m/s]."""
    if not has(scene, CENTRE_FORCE):
        return 0.0
    repulsion = centre_force(scene, centre_view(scene, work, time, NOW, BODY_J, BODY_I))
    return repulsion * (observed[MOBILITY_I] + observed[MOBILITY_J])


def is_parting(scene, work, observed, time, nx, ny):
    """Return True if j moves away from i, and would at the steady drift of this place."""
    drift = nx * observed[DRIFT_X] + ny * observed[DRIFT_Y]
    drift += speed_by_centre_forces(scene, work, observed, time)
    return rate_of_parting(work, nx, ny) > 0.0 and drift > 0.0


def is_away(scene, work, observed, distance, gap):
    """Return True if the outlines are further apart than the escape gap."""
    if distance - outer_of(scene) > observed[ESCAPE]:
        return True
    # Distances of listed features are known already, and bound the costly one from above.
    return gap > 0.25 * observed[ESCAPE] and (
        gap_between(scene, work, BODY_J, BODY_I) > observed[ESCAPE]
    )


def left_over(scene, work, observed):
    """Return how far j may still be carried off the drift, or the flow, by its velocity [m]."""
    ux, uy = observed[DRIFT_X], observed[DRIFT_Y]
    if observed[IN_FLOW] != 0.0:
        x, y = apart(work.place, X), apart(work.place, Y)
        ux = observed[FLOW_XX] * x + observed[FLOW_XY] * y
        uy = observed[FLOW_YX] * x + observed[FLOW_YY] * y
    ux, uy = apart(work.velocity, X) - ux, apart(work.velocity, Y) - uy
    # Drag uses a velocity u up over u times the relaxation time m µ.
    relaxation = max(
        scene.bodies[BODY_I].mass * observed[MOBILITY_I],
        scene.bodies[BODY_J].mass * observed[MOBILITY_J],
    )
    return relaxation * math.hypot(ux, uy)


def turn_left(scene, work, time, body, passing):
    """Return how far an outline may still be moved by its turning [m] within the time of passing
    [s]."""
    outer = scene.bodies[body].bounding_radius
    spin, damping = work.velocity[NOW, body, ANGLE], 0.0
    if not has(scene, VELOCITY_DERIVATIVES) or spin == 0.0:
        return outer * abs(spin) * passing
    view = body_view(scene, work, time, NOW, body)
    damping = -velocity_derivatives(scene, view)[8]
    if not damping > 0.0:
        return outer * abs(spin) * passing
    _, _, torque = body_force(scene, view)
    # ω → ω_∞ = ω + T/ζ, by exp(−ζ t/I): by |ω − ω_∞| I/ζ in all, and at ω_∞ for as long as it
    # takes.
    last = spin + torque / damping
    turned = abs(spin - last) * scene.bodies[body].inertia / damping + abs(last) * passing
    return outer * turned


def can_meet_again(scene, work, observed, time):
    """Return True if the outlines may come together along the drift that is left."""
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    ux, uy = observed[DRIFT_X] / drift, observed[DRIFT_Y] / drift
    x, y = apart(work.place, X), apart(work.place, Y)
    along, aside = x * ux + y * uy, abs(x * uy - y * ux)
    outer = outer_of(scene)
    clear = CLEARANCE * observed[ESCAPE] + left_over(scene, work, observed)
    # By the bounding circles first: past i, or beside its shadow along the drift.
    if (math.hypot(x, y) if along >= 0.0 else aside) >= outer + clear:
        return False
    # Until it is past, both may turn on, so that an arm comes in the way.
    passing = (outer + clear + max(-along, 0.0)) / drift
    clear += turn_left(scene, work, time, BODY_I, passing)
    clear += turn_left(scene, work, time, BODY_J, passing)
    contact = scene.bodies[BODY_I].radius + scene.bodies[BODY_J].radius
    turn_c, turn_s, x, y = pose_of(scene, work, BODY_J, BODY_I)
    angle = work.place[NOW, BODY_I, ANGLE]
    c, s = math.cos(angle), math.sin(angle)
    # In the frame of i: sphere tracing of j's outline along the drift.
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
    """Return True if a flow alone draws the bodies apart, beyond where their outlines reach and
    faster than attraction draws them together."""
    outer = outer_of(scene)
    if distance < outer + observed[ESCAPE]:
        return False
    # n · ∇u · n, the rate at which the flow stretches the line of centres.
    stretch = nx * (observed[FLOW_XX] * nx + observed[FLOW_XY] * ny)
    stretch += ny * (observed[FLOW_YX] * nx + observed[FLOW_YY] * ny)
    # Attraction counts in full, repulsion not at all.
    speed = stretch * distance + min(speed_by_centre_forces(scene, work, observed, time), 0.0)
    return speed > 0.0 and rate_of_parting(work, nx, ny) > 0.0


def has_parted(scene, work, observed, time, nx, ny, distance, gap):
    """Return True if the bodies have parted for good; ``gap``: the least of listed features [m]."""
    if observed[BROWNIAN] != 0.0:
        return distance >= observed[ESCAPE]
    if observed[KICK_ENERGY] > 0.0:
        return return_bound(scene, work, observed, time) <= RETURN_SHARE
    if observed[IN_FLOW] != 0.0:
        return is_carried_away(scene, work, observed, time, nx, ny, distance)
    return (
        is_parting(scene, work, observed, time, nx, ny)
        and is_away(scene, work, observed, distance, gap)
        and not can_meet_again(scene, work, observed, time)
    )


def load_on(observed):
    """Return the Load on the bond of the two."""
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    x, y = observed[DRIFT_X] / drift, observed[DRIFT_Y] / drift
    if observed[IN_FLOW] != 0.0:
        x, y = 0.0, 0.0
    return Load(observed[LOAD], drift, x, y, 0.0, 1.0, observed[KICK_ENERGY])


def start_rest(scene, work, observed, time):
    """Note that the doublet may rest as it is from now on."""
    observed[REST_SINCE] = time
    pose = doublet_pose(scene, work, NOW, BODY_I, BODY_J)
    observed[REST_X], observed[REST_Y], observed[REST_ANGLE] = pose


def rest_of(scene, work, observed, time, load):
    """Return how long the doublet has kept its pose without swinging, in rest times."""
    before = observed[REST_X], observed[REST_Y], observed[REST_ANGLE]
    pose = doublet_pose(scene, work, NOW, BODY_I, BODY_J)
    moved = pose_change(scene, BODY_I, BODY_J, pose, before)
    if moved > STABLE_POSE * load.drift * observed[REST_TIME]:
        start_rest(scene, work, observed, time)
        return 0.0
    if is_swinging(scene, work, BODY_I, BODY_J, load):
        return 0.0
    return (time - observed[REST_SINCE]) / observed[REST_TIME]


def bond_of(scene, work, observed, time):
    """Return the kind of bond of two bodies that have touched, NO_BOND where none is proved."""
    bond, load = bond_between(scene, work, time, BODY_I, BODY_J), load_on(observed)
    if observed[KICK_ENERGY] > 0.0:
        certain = is_certain_in_kicks(scene, work, time, bond, load)
    else:
        certain = is_certain(scene, work, time, bond, load)
    if certain:
        return CERTIFICATE
    rested = rest_of(scene, work, observed, time, load)
    return kind_at_rest(scene, work, time, bond, load, rested)


RETURN_SHARE = 1e-4
"""Of the pairs that are said to have parted, so many may come back at most."""


def return_bound(scene, work, observed, time):
    """Return a bound of the probability that the two ever come back against the drift.

    exp(−v a/D) over the farther half a of the path, at the least drift v there.
    """
    outer, x, y = outer_of(scene), apart(work.place, X), apart(work.place, Y)
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    along = (x * observed[DRIFT_X] + y * observed[DRIFT_Y]) / drift
    if observed[IN_FLOW] != 0.0:
        # An extension draws out along x, the slowest at the near end of the half.
        along = abs(x)
        drift = observed[FLOW_XX] * 0.5 * (along + outer)
    if along - outer <= observed[ESCAPE]:
        return 1.0
    half = 0.5 * (along - outer)
    mobility = observed[MOBILITY_I] + observed[MOBILITY_J]
    between, outlines = forces_at_rest(scene, work, time, BODY_J, BODY_I, outer + half, half, -half)
    repulsion = between + outlines
    drift += mobility * min(repulsion, 0.0)
    # By Einstein's relation D = k_B T µ.
    way = half - left_over(scene, work, observed)
    if drift <= 0.0 or way <= 0.0:
        return 1.0
    return math.exp(-drift * way / (observed[KICK_ENERGY] * mobility))


def is_held_apart(scene, work, observed, time):
    """Return True if two that never touched stay where they are: without kicks, as they have kept
    still for far longer than the rest time; in a secondary minimum, if kicks do not lead out."""
    if observed[KICK_ENERGY] == 0.0:
        return NESTED_DISTANCE * rest_of(scene, work, observed, time, load_on(observed)) >= 1.0
    if observed[CAGE_HIGH] <= observed[CAGE_LOW]:
        return False
    bond = bond_between(scene, work, time, BODY_I, BODY_J)
    between = bond.surface_gap
    if are_spheres(scene, bond):
        between = bond.distance - radii_of(scene, bond)
    return observed[CAGE_LOW] < between < observed[CAGE_HIGH]


OBSERVER: dict[Callable, Callable] = {
    hooks.awaits_touch: has_not_touched,
    hooks.observe: watch_pair,
}
"""What a binary collision puts into the driver."""
