"""Two bodies under thermal motion: where they are let go, and what becomes of them.

Where random forces kick them the observer is `watch_kicked_pair`.

No proof that follows from drifts and loads alone holds where kicks act, so that each is held
against k_B T:

- Parted: against a relative drift v that carries them apart, bodies that diffuse with D against
  each other come back over a way a with a probability of exp(−v a/D) at most, exactly that of a
  line, as a half-plane has to be crossed on the way. They have parted for good where that is below
  RETURN_SHARE. The way is the farther half of what lies between their bounding circles along the
  drift; v the least there, less what attraction makes of it at the near end. Where they meet by
  thermal motion alone there is no drift, and they have parted where the study says so: once their
  centres are the stated distance apart.
- Certificate, rest and hook: by BARRIER k_B T besides what they need without kicks (flocsim.bonds).
- Held: by BARRIER k_B T on either side of a secondary minimum of spheres, or of surface forces.

What is none of these goes on until it is, or is undecided at the end. A pair that has not touched
is kept by kicks between the barriers of a secondary minimum (`caged_between`).
"""

import math
from collections.abc import Sequence

import numpy as np

import flocsim.arrays as at
from flocsim.bonds.certificate import NO_BOND, are_spheres, bond_between, radii_of
from flocsim.ensembles.collision import outcomes as seen
from flocsim.ensembles.collision.meetings import GAPS
from flocsim.ensembles.collision.outcomes import bond_in_kicks, look_at_pair
from flocsim.ensembles.config.pair_scene import PairScene
from flocsim.errors import ConfigError
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators.rhs.climb import repulsion_at

RETURN_SHARE = 1e-4
"""Of the pairs that are said to have parted, so many may come back at most."""


def drift_from(work, observed, outer):
    """(how far j is beyond i along the drift [m], the least drift at half of what is more than
    ``outer`` of that [m/s], the speed of j besides the drift)."""
    v = work.motion
    x, y = (
        v[at.NOW, seen.BODY_J, at.X] - v[at.NOW, seen.BODY_I, at.X],
        v[at.NOW, seen.BODY_J, at.Y] - v[at.NOW, seen.BODY_I, at.Y],
    )
    ux, uy = (
        v[at.NOW, seen.BODY_J, at.VX] - v[at.NOW, seen.BODY_I, at.VX],
        v[at.NOW, seen.BODY_J, at.VY] - v[at.NOW, seen.BODY_I, at.VY],
    )
    if observed[seen.IN_FLOW] != 0.0:
        # An extension draws out along x.
        ux -= observed[seen.FLOW_XX] * x + observed[seen.FLOW_XY] * y
        uy -= observed[seen.FLOW_YX] * x + observed[seen.FLOW_YY] * y
        return abs(x), observed[seen.FLOW_XX] * 0.5 * (abs(x) + outer), math.hypot(ux, uy)
    drift = math.hypot(observed[seen.DRIFT_X], observed[seen.DRIFT_Y])
    along = (x * observed[seen.DRIFT_X] + y * observed[seen.DRIFT_Y]) / drift
    return (
        along,
        drift,
        math.hypot(ux - observed[seen.DRIFT_X], uy - observed[seen.DRIFT_Y]),
    )


def return_bound(scene, work, observed, time):
    """A bound of the probability that the two ever come back against the drift."""
    outer = (
        scene.bodies[seen.BODY_I, at.BOUNDING_RADIUS]
        + scene.bodies[seen.BODY_J, at.BOUNDING_RADIUS]
    )
    along, drift, besides = drift_from(work, observed, outer)
    if along - outer <= observed[seen.ESCAPE]:
        return 1.0
    half = 0.5 * (along - outer)
    mobility = observed[seen.MOBILITY_I] + observed[seen.MOBILITY_J]
    drift += mobility * min(
        repulsion_at(scene, work, time, seen.BODY_J, seen.BODY_I, outer + half, half, -half),
        0.0,
    )
    relaxation = max(
        scene.bodies[seen.BODY_I, at.MASS] * observed[seen.MOBILITY_I],
        scene.bodies[seen.BODY_J, at.MASS] * observed[seen.MOBILITY_J],
    )
    way = half - relaxation * besides
    if drift <= 0.0 or way <= 0.0:
        return 1.0
    return math.exp(-drift * way / (observed[seen.KICK_ENERGY] * mobility))


def have_parted(scene, work, observed, time, distance):
    """Whether the two count as apart for good."""
    if observed[seen.BROWNIAN] != 0.0:
        return distance >= observed[seen.ESCAPE]
    return return_bound(scene, work, observed, time) <= RETURN_SHARE


def is_caged(scene, work, observed, time):
    """Whether two that never touched lie in a secondary minimum out of which kicks do not come."""
    if observed[seen.CAGE_HIGH] <= observed[seen.CAGE_LOW]:
        return False
    bond = bond_between(scene, work, time, seen.BODY_I, seen.BODY_J)
    between = bond.surface_gap
    if are_spheres(scene, bond):
        between = bond.distance - radii_of(scene, bond)
    return observed[seen.CAGE_LOW] < between < observed[seen.CAGE_HIGH]


def watch_kicked_pair(scene, work, observed, time):
    """The observer: 0 to go on, or BOUND, DEPARTED, MISSED, HELD."""
    _, _, distance, _ = look_at_pair(scene, work, observed, time)
    if have_parted(scene, work, observed, time, distance):
        return seen.MISSED if observed[seen.COLLIDED] == 0.0 else seen.DEPARTED
    if observed[seen.COLLIDED] == 0.0:
        return seen.HELD if is_caged(scene, work, observed, time) else 0
    observed[seen.BOND] = bond_in_kicks(scene, work, observed, time)
    return 0 if observed[seen.BOND] == NO_BOND else seen.BOUND


def caged_between(
    speeds: np.ndarray, mobility: float, load: float, barrier: float
) -> tuple[float, float]:  # fmt: skip
    """Between which gaps [m] more than the energy ``barrier`` [J] lies on either side of a pair
    that has not touched, a ``load`` [N] helping it out, or in; (0, 0) for no such place.

    ``speeds`` as of `speeds_of`, which took this ``mobility``; of several such places the one of
    the highest barriers.
    """
    repulsion = speeds[1] / mobility
    rises = -0.5 * (repulsion[1:] + repulsion[:-1]) * np.diff(GAPS)
    potential = np.append(0.0, np.cumsum(rises))
    outwards, inwards = potential - load * GAPS, potential + load * GAPS
    above = np.maximum.accumulate(outwards[::-1])[::-1] - outwards
    below = np.maximum.accumulate(inwards) - inwards
    least = np.minimum(above, below)
    best = int(np.argmax(least))
    if not least[best] > barrier:
        return 0.0, 0.0
    outside = np.flatnonzero(~(least > barrier))
    first = int(outside[outside < best].max(initial=-1)) + 1
    last = int(outside[outside > best].min(initial=len(GAPS))) - 1
    return float(GAPS[first]), float(GAPS[last])


def ends_of(options: PairScene, shapes: Sequence[Shape]) -> tuple[float, float]:
    """Distances of the centres [m] at which two bodies are let go, and at which they have missed
    each other."""
    size = sum(shape.equivalent_radius for shape in shapes)
    return options.release * size, options.escape * size


def refuse_release(
    options: PairScene, shapes: Sequence[Shape], diffusion: float = math.inf
) -> None:
    """ConfigError where two bodies do not diffuse, or their outlines may touch as they are let go.

    ``diffusion``: D of the two against each other [m²/s].
    """
    if not diffusion > 0.0:
        raise ConfigError(
            "two bodies that do not diffuse never meet: add [forces.thermal], of a temperature "
            "above 0 K"
        )
    size = sum(shape.equivalent_radius for shape in shapes)
    outer = sum(shape.bounding_radius for shape in shapes)
    if not outer < ends_of(options, shapes)[0]:
        raise ConfigError(
            f"scene.release = {options.release:g} (r_i + r_j) lets outlines touch that reach "
            f"{outer / size:.3g} (r_i + r_j): give a larger one, and scene.escape above it"
        )


def start_apart(angles: Sequence[float], direction: float, far: float) -> np.ndarray:
    """Places (2, 3) [m, m, rad] of i at the origin and j at a distance ``far``, in a direction that
    is a share of a full turn."""
    turn = 2.0 * math.pi * direction
    return np.array(
        [[0.0, 0.0, angles[0]], [far * math.cos(turn), far * math.sin(turn), angles[1]]]
    )
