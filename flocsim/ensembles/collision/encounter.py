"""Two bodies that meet: what all their replicates share, whatever brings them together.

How they come together, where they start and when they have parted is in `mechanisms`, one class for
each way to meet.
"""

import abc
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.bonds.certificate import SAFETY
from flocsim.bonds.escape import BARRIER
from flocsim.bonds.rest import REST_TURNS
from flocsim.compiler.by_pointer import table_of
from flocsim.compiler.composer import compiled
from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.attraction import (
    attraction_width,
    caged_between,
    far_gap,
    speeds_of,
)
from flocsim.ensembles.collision.draw import orientations
from flocsim.ensembles.collision.start import Start, place_of
from flocsim.ensembles.config.pair_scene import PairScene
from flocsim.ensembles.kind import Numbers
from flocsim.forces.body_forces import random_key, thermal_forces
from flocsim.forces.pair_resistance import PairResistance, resistance_of_pairs
from flocsim.forces.settling import largest_mobility, terminal_motion
from flocsim.geometry.shapes.shape import Shape
from flocsim.io.results.schema import SHAPE_MEASURES
from flocsim.run import Motion
from flocsim.state.scene import Scene
from flocsim.system import System

LIMIT_TURNS = 1000.0
"""Automatic time limit, in turn times."""

START = 3.0
"""Gap over r_i + r_j at which two bodies begin that move the water around each other: shapes are to
each other what spheres are there, and in a flow a strain brings them together by all but .01."""


Arrays = tuple[np.ndarray, ...]


@attrs.frozen(eq=False, slots=False)
class Encounter(abc.ABC):
    """Two shapes that meet: everything about them but orientation and displacement.

    Made once for each pair of shapes and used for all replicates that draw it. ``zone_distance``
    is D_0 [m]; ``settling`` has (velocity (2,) [m/s], mobility [s/kg]) of i and j, alone; ``first``
    is one of the same forces, whose compiled laws serve all.
    """

    system: System
    options: PairScene
    zone_distance: float
    first: "Encounter | None" = None
    settling: tuple[tuple[np.ndarray, float], ...] = attrs.field(init=False)

    meeting: ClassVar[str]
    """The word for it in a config."""

    # In studies of rates, which are of settling and of flows:
    bounds: ClassVar[Callable[..., Arrays]]
    """Gives the least and the largest offset [m] at which two may meet at angles of i and of j."""

    offsets: ClassVar[Callable[..., np.ndarray]]
    """Gives offsets [m] of such bounds and uniform numbers."""

    weights: ClassVar[Callable[..., tuple[Any, ...]]]
    """Gives, of such bounds and offsets, what points stand for, each as if all did as it does: the
    width [m], β₂ [m²/s], β₃ [m³/s]; β₂ and β₃ of spheres without forces; and β₂/(W/2)² [1/s]."""

    def __attrs_post_init__(self):
        motions = [self.alone(body) for body in self.system.bodies]
        object.__setattr__(self, "settling", tuple(motions))
        self.refuse()

    def alone(self, body: Body) -> tuple[np.ndarray, float]:
        """Return the velocity (2,) [m/s] and mobility [s/kg] of one of the bodies without the
        other."""
        key = body.shape, body.fixed
        if key not in self.motions:
            self.motions[key] = terminal_motion(self.system, body)
        return self.motions[key]

    @functools.cached_property
    def motions(self) -> dict[tuple[Shape, bool], tuple[np.ndarray, float]]:
        """{(shape, whether it is fixed): motion alone}, of all encounters under one config."""
        return self.first.motions if self.first else {}

    @abc.abstractmethod
    def refuse(self) -> None:
        """Raise UsageError where two such bodies never meet so."""

    @property
    @abc.abstractmethod
    def drift(self) -> np.ndarray:
        """Velocity (2,) [m/s] of j relative to i as they meet, from above."""

    @property
    @abc.abstractmethod
    def largest_load(self) -> float:
        """An upper bound of the pull that the surroundings put on a bond of the two [N]."""

    @abc.abstractmethod
    def longest(self, share: float) -> float:
        """Return the simulated time [s] after which a replicate is undecided, if none is given."""

    @abc.abstractmethod
    def start(self, angles: Sequence[float], share: float) -> dict[str, float]:
        """Return {field of a Start: value} of a replicate, 0 for all others: see Draw."""

    @functools.cached_property
    def laws(self) -> np.ndarray:
        """The laws of the scene, compiled."""
        if self.first is not None and self.first.system.pieces is self.system.pieces:
            return self.first.laws
        return self.system.laws()

    @functools.cached_property
    def scene(self) -> Scene:
        """The two bodies as arrays for the driver, their laws compiled."""
        return self.system.scene(laws=self.laws, near=True)

    @functools.cached_property
    def table(self) -> tuple[bytes, tuple[Any, ...]]:
        """The scene as compiled code is given it, and its types."""
        return table_of(self.scene)

    def keyed(self, *numbers: int) -> "Encounter":
        """Return the same for a replicate whose random forces go by these (seed, replicate)."""
        if not self.kick_energy:
            return self
        # The same cached values but for the key: a scene made anew would compile its laws again.
        other = object.__new__(type(self))
        scene = self.scene._replace(key=random_key(*numbers))
        vars(other).update(vars(self), scene=scene, system=self.system.changed(seed=numbers))
        vars(other).pop("table", None)
        return other

    def __getstate__(self) -> dict[str, Any]:
        # Arrays and compiled laws are made again where they are needed.
        fields = {each.name: vars(self)[each.name] for each in attrs.fields(type(self))}
        return fields | {"first": None}

    @functools.cached_property
    def kind(self) -> tuple:
        """What distinguishes compiled drivers of one method."""
        return self.system.family, tuple(self.system.reached.items())

    @functools.cached_property
    def kick_energy(self) -> float:
        """k_B T of the thermal motion [J], 0 without."""
        return max((each.energy for each in thermal_forces(self.system.forces)), default=0.0)

    @functools.cached_property
    def shapes(self) -> tuple[Shape, ...]:
        return tuple(body.shape for body in self.system.bodies)

    @functools.cached_property
    def described(self) -> dict[str, float]:
        """{column: value} of what rows of replicates say of the two: their sizes, D_0, and the
        shape measures."""
        sizes = {"r_i": self.shapes[0].equivalent_radius, "r_j": self.shapes[1].equivalent_radius}
        measures = {
            f"{name}_{body}": getattr(shape.measures, name)
            for body, shape in zip("ij", self.shapes, strict=True)
            for name in SHAPE_MEASURES
        }
        return sizes | {"D_0": self.zone_distance} | measures

    @property
    def rate(self) -> float | None:
        """The rate of the flow in which the two meet [1/s], None where there is none."""
        return None

    @functools.cached_property
    def speed(self) -> float:
        """|drift| [m/s]."""
        return math.hypot(*self.drift)

    @functools.cached_property
    def outer(self) -> float:
        """R_i + R_j, the largest centroid-to-outline distances [m]."""
        return sum(shape.bounding_radius for shape in self.shapes)

    @functools.cached_property
    def size(self) -> float:
        """r_i + r_j [m]."""
        return sum(shape.equivalent_radius for shape in self.shapes)

    @functools.cached_property
    def mobility(self) -> float:
        """µ_i + µ_j [s/kg], by which a force between the two moves them against each other."""
        return sum(mobility for _, mobility in self.settling)

    @property
    def diffusion(self) -> float:
        """D of the two against each other [m²/s]."""
        return self.kick_energy * self.mobility

    @property
    def resisting(self) -> Sequence[Sequence[float]]:
        """(r_eq [m], mobility [s/kg]) of i and j."""
        pairs = zip(self.shapes, self.settling, strict=True)
        return [(shape.equivalent_radius, mobility) for shape, (_, mobility) in pairs]

    @functools.cached_property
    def pull(self) -> np.ndarray:
        """What pair forces make of the speed of the two (2, gaps) [m/s]: attraction.speeds_of."""
        radii = [shape.equivalent_radius for shape in self.shapes]
        return speeds_of(self.system.forces, self.system.fluid, radii, self.mobility)

    @functools.cached_property
    def far_gap(self) -> float:
        """The gap [m] beyond which what acts between the two at rest hardly moves them."""
        return far_gap(self.pull, self.speed, self.options.far, self.size)

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
    def reach(self) -> float:
        """How far beyond where they meet anyway attraction makes the two meet, at most [m]."""
        return attraction_width(self.pull, self.speed, 2.0 * self.outer)

    def orientations(self, numbers: Numbers) -> tuple[float, float]:
        """Return the angles [rad] of i and j at the start, by a replicate's random numbers."""
        return orientations(numbers)

    @functools.cached_property
    def turn_time(self) -> float:
        """(r_i + r_j)/|drift| [s]."""
        return self.size / self.speed

    @property
    def full_turn(self) -> float:
        """Time [s] in which what a bond must withstand has come from all directions."""
        return REST_TURNS * self.turn_time

    @functools.cached_property
    def given(self) -> np.ndarray:
        """What the observer of every replicate is given: columns of `outcomes`."""
        options, observed = self.options, np.zeros(outcomes.OBSERVED_SIZE)
        escape, rest = options.escape_gap, options.rest_time
        if isinstance(escape, str):  # "start_gap"
            # What the water does beyond the far gap neither ends an approach nor turns one back.
            auto = isinstance(options.start_gap, str)
            escape = self.far_gap if auto else self.start_gap
        observed[outcomes.ZONE] = self.zone_distance
        observed[outcomes.ESCAPE] = escape
        observed[outcomes.REST_TIME] = self.full_turn if isinstance(rest, str) else rest
        observed[outcomes.DRIFT_X : outcomes.DRIFT_Y + 1] = self.drift
        # The largest on the way between rest and settling: what remains of a velocity dies away at
        # least as fast, and attraction carries a body no faster.
        observed[outcomes.MOBILITY_I : outcomes.MOBILITY_J + 1] = [
            largest_mobility(self.system, body, math.hypot(*velocity), mobility)
            for body, (velocity, mobility) in zip(self.system.bodies, self.settling, strict=True)
        ]
        observed[outcomes.LOAD] = self.largest_load
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
        load, barrier = SAFETY * self.largest_load, BARRIER * self.kick_energy
        return caged_between(self.pull, self.mobility, load, barrier)

    def time_limit(self, share: float = 1.0) -> float:
        """Return the simulated time [s] after which a replicate at this ``share`` is undecided."""
        limit = self.options.time_limit
        return self.longest(share) if isinstance(limit, str) else limit

    def motion(self, angles: Sequence[float], share: float) -> Motion:
        """Return positions and velocities (2, 3) at the start of a replicate: see Draw."""
        start = Start.one(**self.start(angles, share))
        x, y = compiled(place_of)(self.scene, start)
        turning = start.vx_i, start.vy_i, start.spin_i, start.vx_j, start.vy_j, start.spin_j
        place = np.array([[0.0, 0.0, start.angle_i], [x, y, start.angle_j]])
        return place, np.array(turning).reshape(2, 3)
