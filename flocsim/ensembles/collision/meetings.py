"""What brings two bodies together: settling, a flow, or thermal motion; where they start,
and how they turn.

In a flow alone weight is left out, so that rates of the mechanisms add up as in population
balances. Body i lies where the flow stands still, j comes along a way of the undisturbed flow that
passes i's centre at the least distance |b|:

- shear u = (G y, 0): y = b all along, from the left for b > 0 and from the right for b < 0;
- extension u = (s x, −s y): x y = c, b = sign(c) √(2 |c|), from above.

Neither has a way that comes back: a pair that the flow carries apart does not meet again. Flows
that turn faster than they strain have closed ways alone, no pair in them comes from afar, and
none are offered here.

In thermal motion alone weight is left out, too; j is let go at a stated distance, in any direction.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.body import Body, Fluid
from flocsim.ensembles.config.pair_scene import BROWNIAN, EXTENSION, SETTLING, SHEAR, PairScene
from flocsim.errors import ConfigError, UsageError
from flocsim.forces import Gravity
from flocsim.forces.base import Force, PairForce
from flocsim.forces.check import kernel_arguments, reach_of, sample_pairs
from flocsim.forces.drag import follows_shape
from flocsim.forces.settling import lone_view, no_force
from flocsim.geometry.shapes.shape import Shape

SLACK = 1.5
"""A flow's start is at least so many times as far as its ways are from i's centre there."""

GAPS = np.geomspace(1e-10, 1e-2, 240)
"""Gaps [m] at which forces are looked at."""

LEAST_START = 0.01
"""Start gap over r_i + r_j where hardly anything acts."""

ANGLES, FEW = 720, 7
"""Angles of a body at which its turning is looked at."""

BETWEEN = np.array([0.4, 1.9, 3.3, 5.1])
"""Angles [rad] at which it is looked at whether a strain's turning is all of it."""

FULL_TURN = 4.0 * math.pi
"""Of a sphere in shear, times its rate."""

LONGEST_TURN = 50.0
"""Time of the slowest full turn of a doublet that is waited for, times the rate."""


def gradient_of(meeting: str, rate: float) -> tuple[float, float, float, float]:
    """∂u_x/∂x, ∂u_x/∂y, ∂u_y/∂x, ∂u_y/∂y [1/s] of the flow in which bodies meet."""
    if meeting == SHEAR:
        return 0.0, rate, 0.0, 0.0
    assert meeting == EXTENSION, meeting
    return rate, 0.0, 0.0, -rate


def circumstances(
    forces: Sequence[Force], fluid: Fluid, meeting: str, rate: float | None
) -> tuple[Sequence[Force], Fluid]:
    """(forces, fluid) in which bodies meet so: but in settling without their weight."""
    if meeting == SETTLING:
        return forces, fluid
    kept = [force for force in forces if not isinstance(force, Gravity)]
    if meeting == BROWNIAN:
        return kept, fluid
    assert rate is not None, "the config refuses a flow without a rate"
    return kept, attrs.evolve(fluid, gradient=gradient_of(meeting, rate))


def start_in_flow(meeting: str, offset: float, far: float) -> tuple[float, float]:
    """Where j starts [m], i being at the origin: at a distance ``far`` on the way of ``offset``."""
    if meeting == SHEAR:
        along = math.sqrt(far * far - offset * offset)
        return (-along, offset) if offset >= 0.0 else (along, offset)
    lean = 0.5 * math.asin(math.copysign(offset * offset, offset) / (far * far))
    return far * math.sin(lean), far * math.cos(lean)


def approach_time(meeting: str, rate: float, offset: float, far: float) -> float:
    """Time [s] that the undisturbed flow takes from the start to as far on the other side."""
    share = min(max(abs(offset) / far, 1e-9), 1.0)
    if meeting == SHEAR:
        return 2.0 * math.sqrt(1.0 - share * share) / (share * rate)
    return math.log(2.0 / (share * share)) / rate


def strain_of(meeting: str, rate: float) -> float:
    """The largest rate of stretching [1/s]."""
    return 0.5 * rate if meeting == SHEAR else rate


def flow_load(meeting: str, rate: float, outer: float, bodies: Sequence[Sequence[float]]) -> float:
    """A bound of the pull on the bond of a doublet in a flow [N].

    The flow draws the centres apart by at most E d, d ≤ ``outer`` = R_i + R_j, E the strain: a
    force of E d/(µ_i + µ_j). It turns a body against the doublet with a torque of at most T E, of a
    sphere 8πγ r³ E = 4/3 r² E/µ, which on the arm r pries as T E/r. ``bodies``: (r, µ) of both, or
    (r, µ, T) [m, s/kg, N m s].
    """
    strain = strain_of(meeting, rate)
    together = sum(mobility for _, mobility, *_ in bodies)
    pries = [
        (turning[0] / r if turning else 4.0 / 3.0 * r / mobility)
        for r, mobility, *turning in bodies
    ]
    return strain * (outer / together + max(pries))


def turn_in_flow(
    meeting: str, rate: float, outer: float, bodies: Sequence[Sequence[float]]
) -> float:
    """Time [s] in which a rigid doublet of spheres, its centres ``outer`` apart, turns fully.

    In shear 4π/(G √(1 − B²)), B = M d²/(M d² + Σ 8πγ r³), 1/M = µ_i + µ_j: the balance of the
    torques of drag. In extension, where it comes to lie still, ten times 1/s. ``bodies``: (r, µ).
    """
    if meeting == EXTENSION:
        return 10.0 / rate
    arm = outer * outer / sum(mobility for _, mobility in bodies)
    turning = sum(4.0 / 3.0 * r * r / mobility for r, mobility in bodies)
    share = arm / (arm + turning)
    return min(FULL_TURN / math.sqrt(1.0 - share * share), LONGEST_TURN) / rate


def speeds_of(
    forces: Sequence[Force], fluid: Fluid, radii: Sequence[float], mobility: float
) -> np.ndarray:
    """Speeds [m/s] of two bodies against each other by their pair forces at GAPS: (all together,
    each taken for repulsive; the sum) (2, gaps).

    ``radii``: r_eq [m] of both; ``mobility``: the sum of theirs [s/kg].
    """
    r_i, r_j = radii
    size, found = r_i + r_j, np.zeros((2, len(GAPS)))
    pair = sample_pairs(math.inf)[0]._replace(
        gap_rate=0.0, radius_i=r_i, radius_j=r_j, reduced_radius=r_i * r_j / size
    )
    for force in forces:
        if not isinstance(force, PairForce) or force.absent:
            continue
        kernel, end = force.kernel_in(fluid), reach_of(force)
        arguments = kernel_arguments(force, fluid, kernel)
        views = (pair._replace(gap=gap, centre_distance=size + gap) for gap in GAPS.tolist())
        values = np.array(
            [float(kernel(view, *arguments)) if view.gap < end else 0.0 for view in views]
        )
        found[0] += np.abs(values)
        found[1] += values
    return found * mobility


def far_gap(speeds: np.ndarray, speed: float, share: float, size: float) -> float:
    """The gap [m] beyond which forces move the bodies at less than a ``share`` of their ``speed``
    against each other; ``speeds`` as of `speeds_of`, ``size`` = r_i + r_j."""
    strong = np.flatnonzero(speeds[0] > share * speed)
    gap = GAPS[min(strong[-1] + 1, len(GAPS) - 1)] if len(strong) else 0.0
    return max(float(gap), LEAST_START * size)


def attraction_width(speeds: np.ndarray, speed: float, way: float) -> float:
    """How far beyond where outlines meet anyway attraction can make them meet [m].

    A pair that passes with a least distance e is drawn sideways by at most v(g), the speed of
    attraction at a gap g ≥ what is left of e, for as long as it passes: at half its ``speed``, over
    a ``way`` [m], and at first at least. Where v is above half the speed, it is held for ever. So
    it does not come to touch where ∫ dg/v from there to e takes longer than passing.
    ``speeds`` as of `speeds_of`.
    """
    drawn = np.maximum(-speeds[1], 0.0)
    if not drawn.max() > 0.0:
        return 0.0
    held = np.flatnonzero(drawn >= 0.5 * speed)
    first = held[-1] if len(held) else 0
    passing = way / (0.5 * speed)
    with np.errstate(divide="ignore"):
        slowness = 1.0 / drawn
    steps = 0.5 * (slowness[1:] + slowness[:-1]) * np.diff(GAPS)
    taken = np.cumsum(steps[first:]) + (0.0 if len(held) else slowness[0] * GAPS[0])
    beyond = np.flatnonzero(taken > passing + 4.0 * GAPS[first + 1 :] / speed)
    place = first + 1 + beyond[0] if len(beyond) else len(GAPS) - 1
    return float(GAPS[place])


def turning_rates(system: Any, body: Body) -> np.ndarray:
    """Spins [rad/s] at which the body forces on a lone body put no torque on it, at even angles.

    Of all body forces together, so that a force under which shapes turn unevenly has its say.
    At ANGLES of them, or a FEW where these are alike; from a FEW to all where a strain turns it,
    by a + b cos 2θ + c sin 2θ. Where the drag is of shapes, turning and going along are one: at the
    velocity at which there is no force, either.
    """
    pieces: Any = system.pieces
    force = pieces.laws.get("body_force", no_force)
    scale = max(map(abs, system.fluid.gradient), default=0.0) or 1.0
    lone = lone_view(system, body)
    free = follows_shape(system.forces)

    def rates(angles: np.ndarray) -> np.ndarray:
        found = np.zeros(len(angles))
        for place, angle in enumerate(angles.tolist()):
            view = lone._replace(angle=angle)
            if free:
                found[place] = free_spin(force, view, pieces.parameters, scale)
                continue
            less, more = (
                force(view._replace(spin=spin), pieces.parameters)[2] for spin in (-scale, scale)
            )
            if less > more:
                found[place] = scale * (less + more) / (less - more)
        return found

    few_angles, angles = (2.0 * np.pi * np.arange(count) / count for count in (FEW, ANGLES))
    few = rates(few_angles)
    if is_even(few):
        return few
    waves, *_ = np.linalg.lstsq(strain_waves(few_angles), few)
    left = strain_waves(BETWEEN) @ waves - rates(BETWEEN)
    if np.abs(left).max() <= 1e-9 * np.abs(few).max():
        return strain_waves(angles) @ waves
    return rates(angles)


def strain_waves(angles: np.ndarray) -> np.ndarray:
    """1, cos 2θ and sin 2θ (k, 3)."""
    return np.column_stack([np.ones_like(angles), np.cos(2.0 * angles), np.sin(2.0 * angles)])


def free_spin(force: Callable, view: Any, parameters: Sequence[float], scale: float) -> float:
    """The spin [rad/s] of a body that no force, and no torque, of linear laws is left on."""
    steps = np.diag([scale * view.radius, scale * view.radius, scale])
    still = np.array(force(view, parameters))
    changes = [
        np.array(force(view._replace(vx=vx, vy=vy, spin=spin), parameters)) - still
        for vx, vy, spin in steps.tolist()
    ]
    return scale * float(np.linalg.solve(np.transpose(changes), -still)[2])


def is_even(rates: np.ndarray) -> bool:
    """Whether a body turns alike at all angles, or not at all."""
    return bool(np.ptp(rates) <= 1e-6 * np.abs(rates).max())


def angles_by_turning(rates: np.ndarray) -> Callable[[float], float]:
    """From a uniform number in [0, 1) to an angle [rad], as bodies that turn at these rates have
    it: with a density ∝ 1/|rate|.

    Uniform for even turning or none; bodies that come to lie still have the angles at which they
    do, each as often as angles lead there.
    """
    if is_even(rates):
        return lambda number: 2.0 * math.pi * number
    step = 2.0 * math.pi / len(rates)
    if rates.min() > 0.0 or rates.max() < 0.0:
        # Linear between the angles: time that is spent from one to the next.
        ahead = np.roll(rates, -1)
        spent = np.append(0.0, np.cumsum(0.5 * (1.0 / np.abs(rates) + 1.0 / np.abs(ahead))))
        edges = step * np.arange(len(rates) + 1)
        return lambda number: float(np.interp(number * spent[-1], spent, edges))
    ends = [step * resting_place(rates, place) for place in range(len(rates))]
    return lambda number: ends[int(number * len(ends)) % len(ends)]


def resting_place(rates: np.ndarray, place: int) -> float:
    """Where, in steps between the angles, a body comes to lie still that begins at a place."""
    way = 1 if rates[place] > 0.0 else -1
    before = float(rates[place])
    for ahead in range(1, len(rates) + 1):
        after = float(rates[(place + way * ahead) % len(rates)])
        if after * way <= 0.0:
            share = before / (before - after) if before != after else 0.0
            return (place + way * (ahead - 1 + share)) % len(rates)
        before = after
    return float(place)


def refuse_drift(drift: np.ndarray, speed: float, names: Sequence[str]) -> None:
    """UsageError where bodies move by themselves though a flow, or thermal motion, alone should
    bring them together."""
    if math.hypot(*drift) > 1e-9 * speed:
        raise UsageError(
            "without settling bodies meet without weight, but here they move against each other at "
            f"{1e3 * math.hypot(*drift):.3g} mm/s by other forces ({', '.join(names)}): leave "
            'these out, or give scene.meeting = "settling"'
        )


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
