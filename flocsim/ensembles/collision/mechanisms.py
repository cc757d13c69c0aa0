"""What brings two bodies together: settling, shear, extension, or thermal motion.

One class for each. In a flow alone weight is left out, so that rates of the mechanisms add up as in
population balances. Body i lies where the flow stands still, j comes along a path of the
undisturbed flow that passes i's centre at the least distance |b|:

- shear u = (G y, 0): y = b all along, from the left for b > 0 and from the right for b < 0;
- extension u = (s x, −s y): x y = c, b = sign(c) √(2 |c|), from above.

Neither has a path that comes back: a pair that the flow carries apart does not meet again. Flows
that turn faster than they strain have closed paths alone, no pair in them comes from afar, and none
are offered here.

In thermal motion alone weight is left out, too; j is released at a stated distance, in any
direction.

In studies of rates pairs come at offsets b that stand for all at which they are brought. A settling
pair touches exactly where the shadows of the two outlines overlap, as nothing turns them on their
way: offsets are even between. In a flow bodies turn as they come, and offsets are b = ± b_max √u,
as often as the flow, whose speed is ∝ |b|, brings pairs there.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.encounter import LIMIT_TURNS, Arrays, Encounter
from flocsim.ensembles.collision.start import half_widths
from flocsim.ensembles.collision.turning import angles_by_turning, turning_rates
from flocsim.ensembles.config.pair_scene import BROWNIAN, EXTENSION, SETTLING, SHEAR
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import Numbers
from flocsim.errors import ConfigError, UsageError
from flocsim.forces import Gravity
from flocsim.forces.drag import body_resistance, follows_shape, resistance_matrices
from flocsim.forces.settling import least_mobility, nonrotating_mobility, terminal_motion
from flocsim.geometry.shapes.shape import Shape
from flocsim.hydrodynamics import SpherePair, bend, bend_in_flow
from flocsim.hydrodynamics.pair import interpolation_weights, node_radii
from flocsim.hydrodynamics.two_spheres import FADES_FROM
from flocsim.integrators.loop.kicks import seen_escape
from flocsim.system import System

SAME_SPEED = 5e-4
"""Relative difference up to which settling speeds count as one: radii are not known so well, and
bodies would fall thousands of radii before they meet."""

SLACK = 1.5
"""In a flow bodies start at least so many times as far apart as the offset of their path."""

STRESSLET = 6.116 / 3.0
"""By how much more a strain pulls at the bond of two equal spheres in the water between them than
by the drag of each alone; at that of unequal ones by less."""

FULL_TURN = 4.0 * math.pi
"""Time of a sphere's full turn in shear, times the rate."""

LONGEST_TURN = 50.0
"""Time of the slowest full turn of a doublet that is waited for, times the rate."""

LEAST_OFFSET = 1e-4
"""In a flow, over the largest: what is nearer takes as long as this to come along, and the share of
pairs that is, its square, is negligible."""

LIMIT_ESCAPES = 100.0
"""Automatic time limit of a brownian meeting, in times escape²/D: e^-578 of those that nothing
holds are still there."""


class Settling(Encounter):
    """Two bodies of which the upper one, j, settles faster."""

    meeting: ClassVar[str] = SETTLING

    def refuse(self) -> None:
        if follows_shape(self.system.forces):
            raise UsageError(
                'settling pairs cannot have the drag law "shape": such bodies drift sideways and '
                "rotate as they fall, so their initial offset does not say where they meet, and a "
                "pair that has passed may meet again; give another law, or let a flow bring the "
                "bodies together"
            )
        # Along the drift: across it, something else may carry both.
        fastest = max(abs(velocity @ self.drift) for velocity, _ in self.settling)
        if not self.speed**2 > SAME_SPEED * fastest:
            raise UsageError(
                "the two bodies settle at the same speed and never meet, as their speeds differ by "
                f"less than {100.0 * SAME_SPEED:g} %: give scene.pairs two different radii, set "
                "scene.receiver = 'fixed', or add a missing [forces.gravity]"
            )

    @functools.cached_property
    def drift(self) -> np.ndarray:
        return self.settling[1][0] - self.settling[0][0]

    @functools.cached_property
    def largest_load(self) -> float:
        """|drift|/(µ_i + µ_j), of a doublet in its worst orientation; where drag is not linear, at
        the least mobilities up to the speed of the faster one, which bounds it from above."""
        fastest = max(math.hypot(*velocity) for velocity, _ in self.settling)
        least = [
            least_mobility(self.system, body, fastest, mobility)
            for body, (_, mobility) in zip(self.system.bodies, self.settling, strict=True)
        ]
        return self.speed / sum(least)

    def longest(self, share: float) -> float:
        return self.start_gap / self.speed + LIMIT_TURNS * self.turn_time

    def start(self, angles: Sequence[float], share: float) -> dict[str, float]:
        turned = {"angle_i": angles[0], "angle_j": angles[1], "share": share * self.bent}
        return self.falling | turned

    @functools.cached_property
    def falling(self) -> dict[str, float]:
        """What all replicates have in common at their start."""
        (first, second), automatic = self.settling, isinstance(self.options.start_gap, str)
        return {
            "vx_i": first[0][0], "vy_i": first[0][1], "vx_j": second[0][0], "vy_j": second[0][1],
            "gap": self.start_gap,
            # Forces between the centres do not know how thin the outlines are.
            "clear": self.size + self.start_gap if automatic else 0.0,
            "largest": self.outer if self.options.delta_max == "radius" else 0.0,
            "reach": self.outer,
            "radius_i": self.shapes[0].radius, "radius_j": self.shapes[1].radius,
        }  # fmt: skip

    @functools.cached_property
    def bent(self) -> float:
        """Offset of settling bodies where they start over that far away, from where the water
        between them, taken for that of spheres, has pushed them aside."""
        if self.water is None:
            return 1.0
        first, second = (shape.equivalent_radius for shape in self.shapes)
        slower, faster = (float(velocity[1]) for velocity, _ in self.settling)
        gap = min(self.start_gap / self.size, FADES_FROM * self.water.cut)
        # Flocs of one size differ in it by rounding.
        return offset_near(*(round(each, 9) for each in (second / first, slower / faster, gap)))

    def bounds(self, angles_i: np.ndarray, angles_j: np.ndarray) -> Arrays:
        # Forces between centres act as far as the equivalent spheres reach.
        least = self.size if "centre_force" in self.system.pieces.laws else 0.0
        return settling_interval(self.shapes, angles_i, angles_j, self.reach, least)

    def offsets(self, low: np.ndarray, high: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        return low + numbers * (high - low)

    def weights(self, low: np.ndarray, high: np.ndarray, offset: np.ndarray) -> tuple[Any, ...]:
        width = high - low
        # Spheres: |Δw| 2R in the plane, |Δw| π R² in space.
        plane, space = self.speed * width, self.speed * width * math.pi * np.abs(offset)
        spheres = 2.0 * self.size * self.speed, math.pi * self.size * self.size * self.speed
        return width, plane, space, *spheres, math.nan


class Weightless(Encounter):
    """Two bodies that do not settle: a flow, or thermal motion, brings them together."""

    def refuse(self) -> None:
        motions = self.settling
        if follows_shape(self.system.forces):
            # Strain moves a shape, too, around its place in the flow.
            fluid = attrs.evolve(self.system.fluid, gradient=(0.0,) * 4)
            system = attrs.evolve(self.system, fluid=fluid)
            motions = tuple(terminal_motion(system, body) for body in system.bodies)
        drift = math.hypot(*(motions[1][0] - motions[0][0]))
        if drift > 1e-9 * self.speed:
            names = ", ".join(type(force).__name__ for force in self.system.forces)
            raise UsageError(
                'unless scene.meeting = "settling", bodies have no weight, but here other forces '
                f"({names}) move them relative to each other at {1e3 * drift:.3g} mm/s: leave "
                "these forces out, or give that meeting"
            )


class InFlow(Weightless):
    """Two bodies that a flow of constant gradient brings together."""

    strain: ClassVar[float]
    """The largest rate of stretching, over the rate."""

    flux: ClassVar[float]
    """β₂ over rate · b², of all paths within the offset b."""

    gradient: ClassVar[tuple[float, float, float, float]]
    """∂u_x/∂x, ∂u_x/∂y, ∂u_y/∂x, ∂u_y/∂y over the rate."""

    upstream: ClassVar[Callable[..., tuple[float, float]]]
    """Gives where j starts [m], i at the origin: on the path of an offset, so far away."""

    offset_there: ClassVar[Callable[..., float]]
    """Gives the offset [m] of the undisturbed path through the start of a pair that comes from
    infinity at another one."""

    approach: ClassVar[Callable[..., float]]
    """Gives the time [s] that the undisturbed flow takes from a start to as far on the other side,
    on a path whose offset is this share of the distance."""

    @property
    def rate(self) -> Any:
        return self.options.rate

    @property
    def drift(self) -> np.ndarray:
        """About as fast as the two meet: the rate times r_i + r_j."""
        return np.array([0.0, -self.rate * self.size])

    @functools.cached_property
    def largest_load(self) -> float:
        """The flow draws the centres apart by at most E d, d ≤ R_i + R_j, E the strain: a force of
        E d/(µ_i + µ_j). It turns a body against the doublet with a torque of at most T E, of a
        sphere 8πγ r³ E = 4/3 r² E/µ, which on the arm r pries as T E/r."""
        bodies = [(mobility, 4.0 / 3.0 * r / mobility) for r, mobility in self.resisting]
        if follows_shape(self.system.forces):
            bodies = [yield_of(self.system, body) for body in self.system.bodies]
        mobilities, pries = zip(*bodies, strict=True)
        load = self.strain * self.rate * (self.outer / sum(mobilities) + max(pries))
        return load if self.water is None else STRESSLET * load

    @functools.cached_property
    def given(self) -> np.ndarray:
        observed = super().given
        observed[outcomes.IN_FLOW] = 1.0
        observed[outcomes.FLOW_XX : outcomes.FLOW_YY + 1] = self.system.fluid.gradient
        return observed

    @functools.cached_property
    def far(self) -> float:
        """Distance of the centres where they start [m]."""
        return max(self.outer + self.start_gap, SLACK * (self.outer + self.reach))

    @functools.cached_property
    def turning(self) -> tuple[Callable[[float], float], ...]:
        """From uniform numbers to the angles [rad] of i and j at the start."""
        return tuple(
            angles_by_turning(turning_rates(self.system, body)) for body in self.system.bodies
        )

    def orientations(self, numbers: Numbers) -> tuple[float, float]:
        turn_i, turn_j = self.turning
        return turn_i(float(numbers[0])), turn_j(float(numbers[1]))

    def longest(self, share: float) -> float:
        passed = min(max(abs(share * self.outer) / self.far, 1e-9), 1.0)
        return self.approach(passed) + LIMIT_TURNS * self.turn_time

    @functools.cached_property
    def bent(self) -> tuple[float, float]:
        """φ and ψ [m²] where they start, as `bend_in_flow` has them, the water between bodies taken
        for that of spheres; 1 and 0 without water."""
        if self.water is None:
            return 1.0, 0.0
        first, second = (shape.equivalent_radius for shape in self.shapes)
        gap = min(self.far / self.size - 1.0, FADES_FROM * self.water.cut)
        # Flocs of one size differ in it by rounding.
        log, square = bent_in_flow(round(second / first, 9), round(gap, 9))
        return math.exp(log), square * self.size**2

    def start(self, angles: Sequence[float], share: float) -> dict[str, float]:
        x, y = self.upstream(self.offset_there(share * self.outer), self.far)
        # Both go along with the flow.
        xx, xy, yx, yy = self.system.fluid.gradient
        spin = 0.5 * (yx - xy)
        return {
            "angle_i": angles[0], "angle_j": angles[1], "x": x, "y": y, "spin_i": spin,
            "vx_j": xx * x + xy * y, "vy_j": yx * x + yy * y, "spin_j": spin,
        }  # fmt: skip

    def bounds(self, angles_i: np.ndarray, angles_j: np.ndarray) -> Arrays:
        largest = np.full(len(angles_i), self.outer + self.reach)
        return -largest, largest

    def offsets(self, low: np.ndarray, high: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        # b = ± b_max √u, u = |2 n − 1|, below n = ½ on the negative side.
        largest = float(high[0])
        centred = 2.0 * numbers - 1.0
        offsets = np.copysign(largest * np.sqrt(np.abs(centred)), centred)
        least = LEAST_OFFSET * largest
        return np.where(np.abs(offsets) < least, np.copysign(least, offsets), offsets)

    def weights(self, low: np.ndarray, high: np.ndarray, offset: np.ndarray) -> tuple[Any, ...]:
        # Of spheres f R² and 4/3 f R³; that of a point at b is 2 |b| times its own β₂.
        factor = self.rate * self.flux
        plane, size = factor * high * high, self.size
        spheres = factor * size * size, 4.0 / 3.0 * factor * size**3
        return math.nan, plane, 2.0 * plane * np.abs(offset), *spheres, factor


class Shear(InFlow):
    """Two bodies in u = (G y, 0)."""

    meeting: ClassVar[str] = SHEAR
    gradient = (0.0, 1.0, 0.0, 0.0)
    strain = 0.5
    flux = 1.0

    @staticmethod
    def upstream(offset: float, far: float) -> tuple[float, float]:
        along = math.sqrt(far * far - offset * offset)
        return (-along, offset) if offset >= 0.0 else (along, offset)

    def offset_there(self, offset: float) -> float:
        scale, square = self.bent
        return math.copysign(scale * math.sqrt(offset * offset + square), offset)

    def approach(self, share: float) -> float:
        return 2.0 * math.sqrt(1.0 - share * share) / (share * self.rate)

    @property
    def full_turn(self) -> float:
        """Time [s] of a rigid doublet of spheres, their centres ``outer`` apart.

        4π/(G √(1 − B²)), B = M d²/(M d² + Σ 8πγ r³), 1/M = µ_i + µ_j: the balance of the torques of
        drag.
        """
        arm = self.outer * self.outer / self.mobility
        share = arm / (arm + sum(4.0 / 3.0 * r * r / mobility for r, mobility in self.resisting))
        return min(FULL_TURN / math.sqrt(1.0 - share * share), LONGEST_TURN) / self.rate


class Extension(InFlow):
    """Two bodies in u = (s x, −s y)."""

    meeting: ClassVar[str] = EXTENSION
    gradient = (1.0, 0.0, 0.0, -1.0)
    strain = 1.0
    flux = 2.0

    @staticmethod
    def upstream(offset: float, far: float) -> tuple[float, float]:
        # The distance is ``far`` where sin 2φ = 2c/far², φ the angle from the y axis.
        lean = 0.5 * math.asin(math.copysign(offset * offset, offset) / (far * far))
        return far * math.sin(lean), far * math.cos(lean)

    def offset_there(self, offset: float) -> float:
        return self.bent[0] * offset

    def approach(self, share: float) -> float:
        return math.log(2.0 / (share * share)) / self.rate

    @property
    def full_turn(self) -> float:
        """Ten times 1/s [s]: a doublet comes to lie still along x."""
        return 10.0 / self.rate


class Brownian(Weightless):
    """Two bodies that diffuse; ``share`` is the direction of j, over a full turn."""

    meeting: ClassVar[str] = BROWNIAN

    def refuse(self) -> None:
        release, size = self.options.release, self.size
        if not self.outer < release * size:
            raise ConfigError(
                f"scene.release = {release:g} (r_i + r_j) is too near: outlines can touch at "
                f"{self.outer / size:.3g} (r_i + r_j); give a larger release, and scene.escape "
                "above it"
            )
        super().refuse()

    @property
    def drift(self) -> np.ndarray:
        """A speed of D/(r_i + r_j)."""
        return np.array([0.0, -self.diffusion / self.size])

    largest_load = 0.0

    @property
    def ends(self) -> tuple[float, float]:
        """Distances of the centres [m] at which the two are released, and have missed."""
        return self.options.release * self.size, self.options.escape * self.size

    @functools.cached_property
    def given(self) -> np.ndarray:
        observed = super().given
        observed[outcomes.BROWNIAN] = 1.0
        observed[outcomes.ESCAPE] = seen_escape(self.scene.kicks, self.size, *self.ends)
        return observed

    def longest(self, share: float) -> float:
        return LIMIT_ESCAPES * self.ends[1] ** 2 / self.diffusion

    def start(self, angles: Sequence[float], share: float) -> dict[str, float]:
        far, turn = self.ends[0], 2.0 * math.pi * share
        apart = {"x": far * math.cos(turn), "y": far * math.sin(turn)}
        return {"angle_i": angles[0], "angle_j": angles[1]} | apart


MECHANISMS: dict[str, type[Encounter]] = {
    each.meeting: each for each in (Settling, Shear, Extension, Brownian)
}


def settling_interval(
    shapes: Sequence[Shape], angles_i: np.ndarray, angles_j: np.ndarray, reach: float, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return offsets [m] of j from i between which settling may bring them together.

    Where the shadows of the outlines overlap, ``reach`` further on either side, and at least up to
    ``least`` and the reach.
    """
    left_i, right_i = half_widths(shapes[0], angles_i)
    left_j, right_j = half_widths(shapes[1], angles_j)
    low = np.maximum(left_i + right_j, least) + reach
    high = np.maximum(right_i + left_j, least) + reach
    return -low, high


@functools.lru_cache(maxsize=1024)
def offset_near(ratio: float, speeds: float, gap: float) -> float:
    """Return the offset of two settling spheres at a gap over r_i + r_j, over that far away, of
    r_j/r_i and w_i/w_j."""
    # By nodes of the ratio, as the tables: functions of any other take half a second.
    bends = sum(
        weight * bend(SpherePair(node_radii(place)), (speeds, 1.0), 2.0 * (1.0 + gap))
        for place, weight in interpolation_weights(ratio)
    )
    return math.exp(-bends)


@functools.cache
def bent_in_flow(ratio: float, gap: float) -> tuple[float, float]:
    """Return (ln φ, ψ over (r_i + r_j)²) of `bend_in_flow`, of r_j/r_i, at a gap over r_i + r_j."""
    log, square = 0.0, 0.0
    for place, weight in interpolation_weights(ratio):
        bends = bend_in_flow(SpherePair(node_radii(place)), 2.0 * (1.0 + gap))
        log, square = log + weight * bends[0], square + 0.25 * weight * bends[1]
    return log, square


def yield_of(system: System, body: Body) -> tuple[float, float]:
    """Return the least mobility [s/kg] of a body whose drag follows its shape, and the force [N] on
    the arm r that balances the torque of a strain of 1/s."""
    resistance, strain = resistance_matrices(body_resistance(body))
    torque = system.fluid.viscosity * max(resistance[2, 2], math.hypot(*strain[2]))
    return nonrotating_mobility(system, body), torque / body.shape.equivalent_radius


def make_encounter(
    config: Config, shapes: Sequence[Shape], zone: float, meeting: str = SETTLING,
    first: Encounter | None = None,
) -> Encounter:  # fmt: skip
    """Return the Encounter of two shapes under a config; ``zone`` is D_0 [m].

    ``meeting``: what brings the two together; ``first``: one of other shapes under the same config.
    """
    bodies = [
        Body(shape, fixed=fixed, **config.body_options(shape))
        for shape, fixed in zip(shapes, (config.scene.receiver == "fixed", False), strict=True)
    ]
    kind, scene = MECHANISMS[meeting], config.scene
    if first is not None:
        return kind(first.system.changed(bodies=tuple(bodies)), scene, zone, first)
    forces, fluid = list(config.forces), config.fluid
    if issubclass(kind, Weightless):
        forces = [force for force in forces if not isinstance(force, Gravity)]
    if issubclass(kind, InFlow):
        rate: Any = scene.rate  # the config refuses a flow without
        xx, xy, yx, yy = kind.gradient
        fluid = attrs.evolve(fluid, gradient=(rate * xx, rate * xy, rate * yx, rate * yy))
    return kind(System(bodies, forces, config.integrator.method, fluid=fluid), scene, zone)
