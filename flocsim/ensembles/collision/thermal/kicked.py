"""What becomes of two bodies under thermal motion: the observer where random forces kick them.

No proof that follows from drifts and loads alone holds where kicks act, so that each is held
against k_B T:

- Parted: against a relative drift v that carries them apart, bodies that diffuse with D against
  each other come back over a way a with a probability of exp(−v a/D) at most, exactly that of a
  line, as a half-plane has to be crossed on the way. They have parted for good where that is below
  RETURN_SHARE. The way is the farther half of what lies between their bounding circles along the
  drift; v the least there, less what attraction makes of it at the near end. Where they meet by
  thermal motion alone there is no drift, and they have parted where the study says so: once their
  centres are the stated distance apart.
- Certificate: to climb out of their attraction, against the load that a certificate asks for, takes
  the energy that they have, that of the springs in contact twice, and BARRIER k_B T besides: by
  Kramers' rate e^20 = 5e8 times as long as bodies take to relax. Whatever way shapes roll, what
  they climb is their potential (integrators/rhs/climb.py).
- Rest: spheres by such a climb against the load itself; shapes, whose hooks no potential tells of,
  where it takes BARRIER k_B T to lift one by its spheroradius against the load.
- Held: by BARRIER k_B T on either side of a secondary minimum of spheres, or of surface forces.

What is none of these goes on until it is, or is undecided at the end.
"""

import math

from flocsim.arrays import (
    BOUNDING_RADIUS,
    CANDIDATES,
    EQUIVALENT_RADIUS,
    MASS,
    NOW,
    RADIUS,
    VX,
    VY,
    X,
    Y,
)
from flocsim.ensembles.collision.bonds import (
    CERTIFICATE,
    HOOK,
    NO_BOND,
    REST,
    SAFETY,
    centre_attraction,
    energy,
    has_rested,
    leverage,
    surface_attraction,
)
from flocsim.ensembles.collision.observed import (
    BODY_I,
    BODY_J,
    BOND,
    BROWNIAN,
    CAGE_HIGH,
    CAGE_LOW,
    COLLIDED,
    DRIFT_X,
    DRIFT_Y,
    ESCAPE,
    FLOW_XX,
    FLOW_XY,
    FLOW_YX,
    FLOW_YY,
    IN_FLOW,
    KICK_ENERGY,
    LOAD,
    MOBILITY_I,
    MOBILITY_J,
)
from flocsim.ensembles.collision.outcomes import BOUND, DEPARTED, HELD, MISSED, look_at_pair
from flocsim.integrators.rhs.climb import BARRIER, can_climb, repulsion_at
from flocsim.integrators.rhs.surface_gap import flag_near, surface_view

RETURN_SHARE = 1e-4
"""Of the pairs that are said to have parted, so many may come back at most."""


def drift_from(scene, work, observed, outer):
    """(how far j is beyond i along the drift [m], the least drift at half of what is more than
    ``outer`` of that [m/s], the speed of j besides the drift)."""
    v = work.motion
    x, y = v[NOW, BODY_J, X] - v[NOW, BODY_I, X], v[NOW, BODY_J, Y] - v[NOW, BODY_I, Y]
    ux, uy = v[NOW, BODY_J, VX] - v[NOW, BODY_I, VX], v[NOW, BODY_J, VY] - v[NOW, BODY_I, VY]
    if observed[IN_FLOW] != 0.0:
        # An extension draws out along x.
        ux -= observed[FLOW_XX] * x + observed[FLOW_XY] * y
        uy -= observed[FLOW_YX] * x + observed[FLOW_YY] * y
        return abs(x), observed[FLOW_XX] * 0.5 * (abs(x) + outer), math.hypot(ux, uy)
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    along = (x * observed[DRIFT_X] + y * observed[DRIFT_Y]) / drift
    return along, drift, math.hypot(ux - observed[DRIFT_X], uy - observed[DRIFT_Y])


def return_bound(scene, work, observed, time):
    """A bound of the probability that the two ever come back against the drift."""
    outer = scene.bodies[BODY_I, BOUNDING_RADIUS] + scene.bodies[BODY_J, BOUNDING_RADIUS]
    along, drift, besides = drift_from(scene, work, observed, outer)
    if along - outer <= observed[ESCAPE]:
        return 1.0
    half = 0.5 * (along - outer)
    mobility = observed[MOBILITY_I] + observed[MOBILITY_J]
    drift += mobility * min(repulsion_at(scene, time, BODY_J, BODY_I, outer + half, half), 0.0)
    relaxation = max(
        scene.bodies[BODY_I, MASS] * observed[MOBILITY_I],
        scene.bodies[BODY_J, MASS] * observed[MOBILITY_J],
    )
    way = half - relaxation * besides
    if drift <= 0.0 or way <= 0.0:
        return 1.0
    return math.exp(-drift * way / (observed[KICK_ENERGY] * mobility))


def have_parted(scene, work, observed, time, distance):
    """Whether the two count as apart for good."""
    if observed[BROWNIAN] != 0.0:
        return distance >= observed[ESCAPE]
    return return_bound(scene, work, observed, time) <= RETURN_SHARE


def outline_gap_of(scene, work, time, gap):
    """The gap of the surface forces [m], or that of the outlines where there are none."""
    if scene.surface_reach <= 0.0 or work.tally[CANDIDATES] == 0:
        return gap
    flag_near(scene, work, NOW, 0.0)
    return surface_view(scene, work, time, NOW, 0, work.tally[CANDIDATES]).gap


def bond_in_kicks(scene, work, observed, time, gap, nx, ny, distance):
    """The kind of bond of two bodies that have touched, NO_BOND where kicks may open it."""
    barrier = BARRIER * observed[KICK_ENERGY]
    spheres = len(scene.vertices) == 2
    surfaces = surface_attraction(scene, work, time)
    apart = outline_gap_of(scene, work, time, gap)
    load, centres = SAFETY * observed[LOAD], centre_attraction(scene, work, time)
    if centres != 0.0 or surfaces != 0.0:
        pull = load
        if not spheres and load > 0.0 and surfaces <= load - min(centres, 0.0):
            pull = load * leverage(work, nx, ny, distance)
        needed = barrier + energy(scene, work)
        if not can_climb(scene, time, BODY_J, BODY_I, distance, apart, pull, needed):
            return CERTIFICATE
    if observed[LOAD] == 0.0 or not has_rested(scene, work, observed, time, gap, nx, ny, distance):
        return NO_BOND
    if spheres:
        if can_climb(scene, time, BODY_J, BODY_I, distance, apart, observed[LOAD], barrier):
            return NO_BOND
    elif observed[LOAD] * min(scene.bodies[BODY_I, RADIUS], scene.bodies[BODY_J, RADIUS]) < barrier:
        return NO_BOND
    return REST if centres + surfaces > observed[LOAD] else HOOK


def is_caged(scene, work, observed, time, distance, gap):
    """Whether two that never touched lie in a secondary minimum out of which kicks do not come."""
    if observed[CAGE_HIGH] <= observed[CAGE_LOW]:
        return False
    if len(scene.vertices) == 2:
        radii = scene.bodies[BODY_I, EQUIVALENT_RADIUS] + scene.bodies[BODY_J, EQUIVALENT_RADIUS]
        between = distance - radii
    else:
        between = outline_gap_of(scene, work, time, gap)
    return observed[CAGE_LOW] < between < observed[CAGE_HIGH]


def watch_kicked_pair(scene, work, observed, time):
    """The observer: 0 to go on, or BOUND, DEPARTED, MISSED, HELD."""
    nx, ny, distance, gap = look_at_pair(scene, work, observed, time)
    if have_parted(scene, work, observed, time, distance):
        return MISSED if observed[COLLIDED] == 0.0 else DEPARTED
    if observed[COLLIDED] == 0.0:
        return HELD if is_caged(scene, work, observed, time, distance, gap) else 0
    observed[BOND] = bond_in_kicks(scene, work, observed, time, gap, nx, ny, distance)
    return 0 if observed[BOND] == NO_BOND else BOUND
