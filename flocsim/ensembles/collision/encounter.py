"""The binary collision scene: two shapes that meet, and where a replicate of them starts."""

import contextlib
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim import hooks
from flocsim.arrays import Scene, Work, begin_anew, work_of
from flocsim.body import Body
from flocsim.bonds.certificate import SAFETY
from flocsim.bonds.rest import REST_TURNS
from flocsim.compiler.by_pointer import keep
from flocsim.ensembles.collision import meetings, outcomes
from flocsim.ensembles.collision.draw import orientations
from flocsim.ensembles.collision.start import largest_displacement, place_pair
from flocsim.ensembles.config.pair_scene import BROWNIAN, FLOWS, SETTLING, PairScene
from flocsim.ensembles.config.schema import Config
from flocsim.errors import UsageError
from flocsim.forces.body_forces import key_of, thermal_in
from flocsim.forces.drag import body_resistance, follows_shape, resistance_matrices
from flocsim.forces.pair_resistance import PairResistance, resistance_of_pairs
from flocsim.forces.settling import (
    held_mobility,
    largest_mobility,
    least_mobility,
    terminal_motion,
)
from flocsim.geometry.contact.compounds import Outlines, outlines_of
from flocsim.geometry.shapes.shape import Shape
from flocsim.hydrodynamics import SpherePair, bend
from flocsim.hydrodynamics.pair import node_radii, slots
from flocsim.hydrodynamics.two_spheres import FADES_FROM
from flocsim.integrators.base import Integrator
from flocsim.integrators.rhs.climb import BARRIER
from flocsim.io.results.schema import SHAPE_MEASURES
from flocsim.system import System

OBSERVER: dict[Callable, Callable] = {
    hooks.awaits_touch: outcomes.has_not_touched,
    hooks.observe: outcomes.watch_pair,
}
"""What a binary collision puts into the driver."""

KICKED: dict[Callable, Callable] = OBSERVER | {hooks.observe: outcomes.watch_kicked_pair}
"""The same for one under thermal motion."""

LEAST_ROOM = 256
"""Pairs of features that a run has room for at first."""

LIMIT_TURNS = 1000.0
"""Automatic time limit, in turn times."""

START = 3.0
"""Gap over r_i + r_j at which two bodies begin that move the water around each other: shapes are to
each other what spheres are there, and in a flow a strain brings them together by all but .01."""

STRESSLET = 6.116 / 3.0
"""By how much more a strain pulls at the bond of two equal spheres in the water between them than
by the drag of each alone; at that of unequal ones by less."""

LIMIT_ESCAPES = 100.0
"""The same of a brownian meeting, in times escape²/D: e^-578 of those that nothing holds are still
there."""


@attrs.frozen(eq=False, slots=False)
class Encounter:
    """Two shapes that meet: everything about them but orientation and displacement.

    Made once for each pair of shapes and used for all replicates that draw it. ``zone_distance``
    is D_0 [m]; ``settling`` has (velocity (2,) [m/s], mobility [s/kg]) of i and j, alone;
    ``meeting`` says what brings them together (flocsim.ensembles.collision.meetings); ``first`` is
    one of the same forces, whose compiled laws serve all.
    """

    system: System
    options: PairScene
    zone_distance: float
    meeting: str = SETTLING
    first: "Encounter | None" = None
    settling: tuple[tuple[np.ndarray, float], ...] = attrs.field(init=False)

    def __attrs_post_init__(self):
        motions = [terminal_motion(self.system, body) for body in self.system.bodies]
        object.__setattr__(self, "settling", tuple(motions))
        if self.meeting == BROWNIAN:
            meetings.refuse_release(self.options, self.shapes, self.diffusion)
        if self.meeting != SETTLING:
            names = [type(force).__name__ for force in self.system.forces]
            if follows_shape(self.system.forces):
                # Strain moves a shape, too, around its place in the flow.
                fluid = attrs.evolve(self.system.fluid, gradient=(0.0,) * 4)
                system = attrs.evolve(self.system, fluid=fluid)
                motions = [terminal_motion(system, body) for body in system.bodies]
            meetings.refuse_drift(motions[1][0] - motions[0][0], -self.drift[1], names)
            return
        if follows_shape(self.system.forces):
            raise UsageError(
                'two bodies that meet by settling cannot have the drag law "shape": they fall '
                "aslant and turn as they fall, so that no offset at the start says where they meet "
                "and none has passed for good: give another law, or let a flow bring them together"
            )
        if not math.hypot(*self.drift) > 0.0:
            raise UsageError(
                "the two bodies settle at the same speed and never meet: give scene.pairs two "
                "different radii, set scene.receiver = 'fixed', or add a missing [forces.gravity]"
            )

    @functools.cached_property
    def laws(self) -> np.ndarray:
        """The laws of the scene, compiled."""
        if self.first is not None and self.first.system.pieces is self.system.pieces:
            return self.first.laws
        return self.system.laws()

    @functools.cached_property
    def room(self) -> list[int]:
        """[for how many pairs of features runs so far have had to find room], at most: those to
        come begin with as much."""
        return self.first.room if self.first else [LEAST_ROOM]

    @functools.cached_property
    def spare(self) -> list[Work]:
        """Work arrays of runs that have ended, in which those to come begin."""
        return self.first.spare if self.first else []

    @functools.cached_property
    def scene(self) -> Scene:
        """The two bodies as arrays for the driver, their laws compiled."""
        scene = self.system.scene(laws=self.laws)
        keep(scene, self)
        return scene

    @functools.cached_property
    def outlines(self) -> Outlines:
        """Those of i and j."""
        outlines = outlines_of(self.shapes)
        keep(outlines, self)
        return outlines

    def keyed(self, *numbers: int) -> "Encounter":
        """The same for a replicate whose random forces go by these numbers (seed, replicate)."""
        # By the forces, for a scene compiles their laws, and another part of a study comes first.
        if not self.kick_energy:
            return self
        other = object.__new__(Encounter)
        scene = self.scene._replace(key=key_of(*numbers))
        vars(other).update(vars(self), scene=scene, system=self.system.changed(seed=numbers))
        return other

    def __getstate__(self) -> dict[str, Any]:
        # Arrays and compiled laws are made again where they are needed.
        fields = {each.name: vars(self)[each.name] for each in attrs.fields(Encounter)}
        return fields | {"first": None}

    @functools.cached_property
    def kind(self) -> tuple:
        """What tells compiled drivers apart, of one method."""
        reached = tuple(self.system.reached.items())
        return self.system.family, reached, bool(self.kick_energy)

    @functools.cached_property
    def kick_energy(self) -> float:
        """k_B T of the thermal motion [J], 0 without."""
        return max((each.energy for each in thermal_in(self.system.forces)), default=0.0)

    @property
    def observer(self) -> dict[Callable, Callable]:
        """What the encounter puts into the driver."""
        return KICKED if self.kick_energy else OBSERVER

    @property
    def diffusion(self) -> float:
        """D of the two against each other [m²/s]."""
        return self.kick_energy * sum(mobility for _, mobility in self.settling)

    @functools.cached_property
    def ends(self) -> tuple[float, float]:
        """Distances of the centres [m] at which a brownian meeting begins, and is missed."""
        return meetings.ends_of(self.options, self.shapes)

    @property
    def shapes(self) -> tuple[Shape, ...]:
        return tuple(body.shape for body in self.system.bodies)

    @functools.cached_property
    def measures(self) -> dict[str, float]:
        """{column: value} of the shape measures of i and j."""
        return {
            f"{name}_{body}": getattr(shape.measures, name)
            for body, shape in zip("ij", self.shapes, strict=True)
            for name in SHAPE_MEASURES
        }

    @property
    def rate(self) -> float | None:
        """That of the flow in which the two meet [1/s], None where there is none."""
        return self.options.rate if self.meeting in FLOWS else None

    @property
    def drift(self) -> np.ndarray:
        """Settling velocity of j relative to i (2,) [m/s]; in a flow one of about the speed at
        which they meet, its rate times r_i + r_j, and in thermal motion D/(r_i + r_j)."""
        if self.meeting != SETTLING:
            speed = self.diffusion / self.size if self.rate is None else self.rate * self.size
            return np.array([0.0, -speed])
        return self.settling[1][0] - self.settling[0][0]

    @property
    def outer(self) -> float:
        """R_i + R_j, the largest centroid-to-outline distances [m]."""
        return sum(shape.bounding_radius for shape in self.shapes)

    @functools.cached_property
    def pull(self) -> np.ndarray:
        """What pair forces make of the speed of the two (2, gaps) [m/s]: meetings.speeds_of."""
        radii, mobilities = zip(*self.yielding, strict=True)
        system = self.system
        return meetings.speeds_of(system.forces, system.fluid, radii, sum(mobilities))

    @property
    def size(self) -> float:
        """r_i + r_j [m]."""
        return sum(shape.equivalent_radius for shape in self.shapes)

    @functools.cached_property
    def far_gap(self) -> float:
        """The gap [m] beyond which what acts between the two at rest hardly moves them."""
        share = self.options.far
        return meetings.far_gap(self.pull, math.hypot(*self.drift), share, self.size)

    @functools.cached_property
    def start_gap(self) -> float:
        """Distance of the outlines at the start [m]."""
        if not isinstance(self.options.start_gap, str):
            return self.options.start_gap
        return max(self.far_gap, START * self.size if self.water else 0.0)

    @property
    def water(self) -> PairResistance | None:
        """What acts between the two through the water, None where nothing does."""
        return resistance_of_pairs(self.system.forces)

    @functools.cached_property
    def bent(self) -> float:
        """Offset of settling bodies where they start over that far away, whence the water between
        them, taken for that of spheres, has pushed them aside."""
        if self.water is None:
            return 1.0
        first, second = (shape.equivalent_radius for shape in self.shapes)
        slower, faster = (float(velocity[1]) for velocity, _ in self.settling)
        gap = min(self.start_gap / self.size, FADES_FROM * self.water.cut)
        # Flocs of one size differ in it by rounding.
        return offset_near(*(round(each, 9) for each in (second / first, slower / faster, gap)))

    @functools.cached_property
    def reach(self) -> float:
        """How far beyond where they meet anyway attraction makes the two meet, at most [m]."""
        return meetings.attraction_width(self.pull, math.hypot(*self.drift), 2.0 * self.outer)

    @functools.cached_property
    def far(self) -> float:
        """Distance of the centres where they start in a flow [m]."""
        return max(self.outer + self.start_gap, meetings.SLACK * (self.outer + self.reach))

    @functools.cached_property
    def turning(self) -> tuple[Callable[[float], float], ...]:
        """From uniform numbers to the angles [rad] of i and j at the start in a flow."""
        return tuple(
            meetings.angles_by_turning(meetings.turning_rates(self.system, body))
            for body in self.system.bodies
        )

    def orientations(self, numbers: Sequence[float] | np.ndarray) -> tuple[float, float]:
        """Angles [rad] of i and j at the start, by a replicate's random numbers."""
        if self.rate is None:
            return orientations(numbers)
        turn_i, turn_j = self.turning
        return turn_i(float(numbers[0])), turn_j(float(numbers[1]))

    @functools.cached_property
    def turn_time(self) -> float:
        """(r_i + r_j)/|drift| [s]."""
        return self.size / math.hypot(*self.drift)

    @functools.cached_property
    def mobilities(self) -> tuple[float, ...]:
        """The largest of each body on its way between rest and settling [s/kg]: what is left of a
        velocity dies away at least as fast, and attraction carries it no faster."""
        return tuple(
            largest_mobility(self.system, body, math.hypot(*velocity), mobility)
            for body, (velocity, mobility) in zip(self.system.bodies, self.settling, strict=True)
        )

    @functools.cached_property
    def largest_load(self) -> float:
        """The pull on the bond of a settling doublet in its worst orientation [N].

        |drift|/(µ_i + µ_j); where drag is not linear, at the least mobilities up to the speed of
        the faster one, which bounds it from above. In a flow that of meetings.flow_load; in
        thermal motion alone none.
        """
        if self.meeting == BROWNIAN:
            return 0.0
        if self.rate is not None:
            bodies: Sequence[Sequence[float]] = self.yielding
            if follows_shape(self.system.forces):
                bodies = [resisting(self.system, body) for body in self.system.bodies]
            load = meetings.flow_load(self.meeting, self.rate, self.outer, bodies)
            return load if self.water is None else STRESSLET * load
        fastest = max(math.hypot(*velocity) for velocity, _ in self.settling)
        least = [
            least_mobility(self.system, body, fastest, mobility)
            for body, (_, mobility) in zip(self.system.bodies, self.settling, strict=True)
        ]
        return math.hypot(*self.drift) / sum(least)

    @property
    def yielding(self) -> list[tuple[float, float]]:
        """(r_eq [m], mobility [s/kg]) of i and j."""
        pairs = zip(self.shapes, self.settling, strict=True)
        return [(shape.equivalent_radius, mobility) for shape, (_, mobility) in pairs]

    def rest_time(self) -> float:
        """How long a doublet must rest as a rigid body to count as bound [s]."""
        if not isinstance(self.options.rest_time, str):  # "auto"
            return self.options.rest_time
        if self.rate is None:
            return REST_TURNS * self.turn_time
        return meetings.turn_in_flow(self.meeting, self.rate, self.outer, self.yielding)

    def observed(self) -> np.ndarray:
        """Fresh numbers for the observer: what it is given, and room for what it finds."""
        return self.given.copy()

    @functools.cached_property
    def given(self) -> np.ndarray:
        """What the observer of every replicate is given."""
        options = self.options
        observed = np.zeros(outcomes.OBSERVED_SIZE)
        given = options.escape_gap
        # "start_gap": what the water does from there on ends no way and turns none back.
        auto = isinstance(given, str) and isinstance(options.start_gap, str)
        escape = self.far_gap if auto else self.start_gap if isinstance(given, str) else given
        observed[outcomes.ZONE] = self.zone_distance
        observed[outcomes.ESCAPE] = escape
        observed[outcomes.REST_TIME] = self.rest_time()
        observed[outcomes.DRIFT_X : outcomes.DRIFT_Y + 1] = self.drift
        observed[outcomes.MOBILITY_I], observed[outcomes.MOBILITY_J] = self.mobilities
        observed[outcomes.LOAD] = self.largest_load
        if self.rate is not None:
            observed[outcomes.IN_FLOW] = 1.0
            flow = slice(outcomes.FLOW_XX, outcomes.FLOW_YY + 1)
            observed[flow] = self.system.fluid.gradient
        if self.meeting == BROWNIAN:
            observed[outcomes.BROWNIAN], observed[outcomes.ESCAPE] = 1.0, self.ends[1]
        if self.kick_energy:
            observed[outcomes.KICK_ENERGY] = self.kick_energy
            observed[outcomes.CAGE_LOW : outcomes.CAGE_HIGH + 1] = self.cage
        return observed

    @functools.cached_property
    def cage(self) -> tuple[float, float]:
        """Gaps [m] of a secondary minimum between which kicks do not let the two out."""
        if not self.system.spheres_only and "centre_force" in self.system.pieces.laws:
            # Shapes come round what acts between their centres.
            return 0.0, 0.0
        mobility = sum(each for _, each in self.yielding)
        load, barrier = SAFETY * self.largest_load, BARRIER * self.kick_energy
        return meetings.caged_between(self.pull, mobility, load, barrier)

    def time_limit(self, share: float = 1.0) -> float:
        """Simulated time [s] after which a replicate at δ = share · δ_max is undecided."""
        if isinstance(self.options.time_limit, str):  # "auto"
            if self.meeting == BROWNIAN:
                return LIMIT_ESCAPES * self.ends[1] ** 2 / self.diffusion
            if self.rate is not None:
                offset = share * self.outer
                approach = meetings.approach_time(self.meeting, self.rate, offset, self.far)
            else:
                approach = self.start_gap / math.hypot(*self.drift)
            return approach + LIMIT_TURNS * self.turn_time
        return self.options.time_limit

    def start(self, angles: Sequence[float], share: float) -> Work:
        """Work arrays of a replicate with these angles [rad] at δ = share · δ_max.

        In a brownian meeting ``share`` is the direction of j, over a full turn.
        """
        if self.meeting == BROWNIAN:
            place = meetings.start_apart(angles, share, self.ends[0])
            return self.work_at(place, np.zeros((2, 3)))
        if self.rate is not None:
            return self.start_in_flow(angles, share)
        shapes = self.shapes
        largest = largest_displacement(
            self.options.delta_max, shapes[0], angles[0], shapes[1], angles[1]
        )
        offset = share * largest * self.bent
        place = place_pair(shapes, angles, offset, self.start_gap, self.outlines)
        if isinstance(self.options.start_gap, str):
            # Forces between the centres do not know how thin the outlines are.
            clear = self.size + self.start_gap
            x = float(place[1, 0])
            place[1, 1] = max(place[1, 1], math.sqrt(max(clear * clear - x * x, 0.0)))
        velocity = np.zeros((2, 3))
        velocity[0, :2], velocity[1, :2] = self.settling[0][0], self.settling[1][0]
        return self.work_at(place, velocity)

    def work_at(self, place: np.ndarray, velocity: np.ndarray) -> Work:
        """Work arrays of the two at places and velocities (2, 3)."""
        fits = self.room[0], len(self.scene.pieces) + 1
        with contextlib.suppress(IndexError):  # none is left, or another thread has taken it
            while True:
                work = self.spare.pop()
                if (len(work.candidates), work.near.shape[1]) == fits:
                    begin_anew(work, self.scene, place, velocity)
                    return work
        return work_of(self.scene, place, velocity, self.room[0])

    def take_back(self, work: Work) -> None:
        """Let a run to come begin in the work arrays of one that has ended."""
        self.room[0] = max(self.room[0], len(work.candidates))
        keep(work, self.first or self)
        self.spare.append(work)

    def start_in_flow(self, angles: Sequence[float], share: float) -> Work:
        """Work arrays where both go along with the flow, j on the way of share · (R_i + R_j)."""
        assert self.rate is not None
        x, y = meetings.start_in_flow(self.meeting, share * self.outer, self.far)
        xx, xy, yx, yy = self.system.fluid.gradient
        spin = 0.5 * (yx - xy)
        place = np.array([[0.0, 0.0, angles[0]], [x, y, angles[1]]])
        velocity = np.array([[0.0, 0.0, spin], [xx * x + xy * y, yx * x + yy * y, spin]])
        return self.work_at(place, velocity)


@functools.lru_cache(maxsize=1024)
def offset_near(ratio: float, speeds: float, gap: float) -> float:
    """Offset of two settling spheres at a gap over r_i + r_j over that far away, of r_j/r_i and
    w_i/w_j."""
    # By nodes of the ratio, as the tables: functions of any other take half a second.
    found = sum(
        weight * bend(SpherePair(node_radii(place)), (speeds, 1.0), 2.0 * (1.0 + gap))
        for place, weight in slots(ratio)
    )
    return math.exp(-found)


def resisting(system: System, body: Body) -> tuple[float, float, float]:
    """(r_eq [m], least mobility [s/kg], torque [N m s] by a strain of 1/s) of a body whose drag
    follows its shape."""
    resistance, strain = resistance_matrices(body_resistance(body))
    turning = max(resistance[2, 2], math.hypot(*strain[2]))
    least = held_mobility(system, body)
    return body.shape.equivalent_radius, least, system.fluid.viscosity * turning


def make_encounter(
    config: Config, shapes: Sequence[Shape], zone: float, integrator: Integrator | None = None,
    meeting: str = SETTLING, first: Encounter | None = None,
) -> Encounter:  # fmt: skip
    """The Encounter of two shapes under a config; ``zone`` is D_0 [m].

    ``integrator``: instead of the config's, where a pilot has chosen it; ``meeting``: what brings
    the two together; ``first``: one of other shapes under the same config, met by the same method.
    """
    bodies = [
        Body(
            shape,
            fixed=(config.scene.receiver == "fixed" and place == 0),
            **config.body_options(shape),
        )
        for place, shape in enumerate(shapes)
    ]
    if first is not None:
        system = first.system.changed(bodies=tuple(bodies))
        return Encounter(system, config.scene, zone, meeting, first)
    method = integrator or config.integrator.method
    forces, fluid = meetings.circumstances(config.forces, config.fluid, meeting, config.scene.rate)
    system = System(bodies, forces, method, fluid=fluid)
    return Encounter(system, config.scene, zone, meeting)
