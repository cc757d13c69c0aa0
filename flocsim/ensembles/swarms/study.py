"""A study of swarms: the bodies of any replicate, by its number."""

import functools
import math
from collections.abc import Callable, Container, Iterable, Sequence
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.compiler.composer import is_on_disk
from flocsim.compiler.fingerprint import fingerprint, refuse_interpreter
from flocsim.ensembles.collision.flocs import Floc, FlocPool, load_flocs, nearest_in_ratio, pool_of
from flocsim.ensembles.collision.pairings import drawing_weights, quantile, within_limits
from flocsim.ensembles.config.schema import Config, ShapesConfig
from flocsim.ensembles.kind import ORDER, PHYSICS, Code, Condition, Going, Keep, StudyKind
from flocsim.ensembles.preflight import names_in
from flocsim.ensembles.storage.row_store import Parts
from flocsim.ensembles.swarms import records
from flocsim.ensembles.swarms.replicate import run_replicate
from flocsim.ensembles.swarms.scene import SwarmScene
from flocsim.errors import ConfigError, UsageError
from flocsim.forces import ContactForce
from flocsim.forces.settling import terminal_motion
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators.base import Status
from flocsim.io.results.swarm_file import ENDS, FORMAT
from flocsim.plausibility import doubts_of
from flocsim.swarms.islands import run_islands
from flocsim.swarms.placement import KEEP, Leaving, floor, place_at_random
from flocsim.swarms.swarm import Swarm, check_box, stops_of
from flocsim.system import System

SPHERE = -1
"""Place among the flocs of a body that is a sphere."""

ROW = np.dtype([(name, f"<{kind}") for name, (kind, _, _) in ENDS.items()])
"""A finished replicate: how it ended."""

TRIAL_SECONDS = 1e-6
"""For so long the first bodies are run before a study begins [s]."""

BEYOND = 4.0
"""A floor goes on for so many bounding radii beyond the box."""


CODE = (*PHYSICS, "swarms", "ensembles/swarms/study.py", "ensembles/swarms/replicate.py")
"""The modules that decide what a swarm does."""


@attrs.frozen(eq=False)
class Drawn:
    """The bodies of a replicate before they are placed: place of the floc, and shape, of each."""

    flocs: np.ndarray
    shapes: list[Shape]


def shapes_of(config: Config) -> ShapesConfig:
    """[shapes], measured flocs keeping their sizes."""
    own = config.scene.is_measured
    return attrs.evolve(config.shapes, size="own") if own else config.shapes


@attrs.define(eq=False)
class SwarmStudy(StudyKind):
    """Every replicate of a config whose scene is a swarm. All that is random follows from (seed,
    replicate). ``flocs`` are grown or read unless given."""

    config: Config
    flocs: list[Floc] = attrs.field(
        default=attrs.Factory(lambda self: self.flocs_of(self.config), takes_self=True)
    )
    pool: FlocPool = attrs.field(init=False)
    choosable: np.ndarray = attrs.field(init=False, factory=lambda: np.zeros(0, int))
    """Places of the measured flocs that bodies are drawn from."""
    scenes: ClassVar[Sequence[type]] = (SwarmScene,)
    format: ClassVar[str] = FORMAT
    code: ClassVar[Sequence[str]] = CODE
    row: ClassVar[np.dtype] = ROW
    most_rows: ClassVar[int] = 1
    noun: ClassVar[str] = "snapshots"
    in_common: ClassVar[Sequence[str]] = (*ORDER, "times", "bounds", "replicates")

    def __attrs_post_init__(self):
        self.pool = pool_of(shapes_of(self.config), self.flocs)
        if self.scene.is_measured:
            self.choosable = within_limits(self.scene, self.flocs)

    @staticmethod
    def flocs_of(config: Config) -> list[Floc]:
        """Grow or read the flocs that a config's swarm needs: none for spheres of given sizes."""
        shapes = shapes_of(config)
        needed = config.scene.is_measured or max(shapes.vertices) > 1
        return load_flocs(shapes, config.seed) if needed else []

    @staticmethod
    def check(config: Config) -> None:
        """ConfigError for a swarm whose bodies have no contact force."""
        if not any(isinstance(force, ContactForce) for force in config.forces):
            raise ConfigError(
                "bodies that meet need a contact force, found none among "
                f"{', '.join(config.force_names)}: add [forces.contact]"
            )

    def prepare(self, comm: Any) -> None:
        """UsageError on rank 0 where the bodies of a replicate find no place, or its box is too
        small for them: before the first runs for hours. Every rank looks at its share, but for the
        first replicate, which all have placed by now."""
        reach, first = self.first.reach, None
        for replicate in range(comm.rank or comm.size, self.config.replicates, comm.size):
            try:
                drawn, box, _ = self.placed(replicate)
                check_box(drawn.shapes, self.periods(box), reach)
            except UsageError as error:
                first = replicate, str(error)
                break
        found = comm.gather(first)
        if found is None:
            return
        if faults := sorted(each for each in found if each is not None):
            replicate, why = faults[0]
            raise UsageError(f"swarm {replicate} of {self.config.replicates} (from 0): {why}")
        self.check_code()

    def check_code(self) -> None:
        """Raise the FlocsimError that the laws of forces would meet when they are compiled."""
        for law in self.first.system.pieces.laws.values():
            refuse_interpreter(law)
        refuse_interpreter(run_islands, self.first.fillings())

    def largest_pair(self) -> System:
        """A System of the two largest bodies, for what is said of a swarm."""
        free = [body for body in self.first.bodies if not body.fixed]
        bodies = sorted(free, key=lambda body: -body.shape.equivalent_radius)[:2]
        return attrs.evolve(self.first.system, bodies=bodies)

    def doubts(self) -> list[str]:
        """Return lines on what is implausible."""
        return doubts_of([self.largest_pair()], names_in(self.config, self.config.forces))

    def identity_facts(self) -> dict[str, Any]:
        """Return what rows follow from besides config, flocs, code and machine."""
        pieces = self.first.system.pieces
        numbers = [*pieces.parameters, pieces.surface_reach, *pieces.smoothness, pieces.events]
        codes = [fingerprint(run_islands, self.first.fillings())]
        codes += [f"{law} {fingerprint(each, {})}" for law, each in sorted(pieces.laws.items())]
        return {
            "shapes.vertices": list(self.config.shapes.vertices),
            "numbers.the swarm": np.array(numbers, float),
            "kernels.swarms": np.array("\n".join(codes)),
        }

    @property
    def vertices(self) -> int:
        """N of all bodies."""
        return self.config.shapes.vertices[0]

    @property
    def stops(self) -> list[float]:
        """Times of the snapshots [s], the start first."""
        return [0.0, *stops_of(self.scene.duration, self.scene.interval, None)]

    @functools.cached_property
    def beginning(self) -> tuple[Swarm, Drawn, tuple[float, float]]:
        """The first replicate as `swarm` gives it: from it follows what the study is, by which it
        is checked, and it is run as it is here, since resizing its flocs takes seconds."""
        return self.make_swarm(0)

    @property
    def first(self) -> Swarm:
        """The swarm of the first replicate at its start."""
        return self.beginning[0]

    @property
    def form(self) -> records.Form:
        """What its records look like."""
        scene = self.scene
        return records.Form(len(self.first.bodies), scene.bounds, tuple(self.stops), scene.periodic)

    @property
    def pieces(self) -> int:  # type: ignore[override]
        return len(self.stops)

    @property
    def allowed(self) -> float:
        """All may end early: results say which."""
        return math.inf

    @property
    def title(self) -> str:
        number, duration = self.scene.number, self.scene.duration
        return f"{self.config.replicates} swarms of {number} bodies, {duration:g} s"

    def asked(self) -> dict[str, Any]:
        """What the study consists of, and what its records look like."""
        return super().asked() | self.form.asked()

    def compile(self, kinds: Iterable[Code]) -> None:
        """Compile all that a swarm needs, or load it, by running two bodies for no time."""
        for _ in kinds:
            run_briefly(self.first)

    def uncompiled(self, kinds: Iterable[Code]) -> list[Code]:
        """All where the engine is not on the disk: a swarm has but one."""
        return [] if is_on_disk(self.first.begin(TRIAL_SECONDS).runner.driver) else list(kinds)

    def run_task(
        self, condition: Condition, replicate: int, halted: Callable[[], bool],
        left: records.Left | None = None,
        keep: Keep | None = None, going: Going | None = None,
    ) -> tuple[dict | None, dict | None]:  # fmt: skip
        """One replicate from where it was left; its bodies and snapshots are kept as they come."""
        kept = keep or (lambda name, description, data: None)
        ended = run_replicate(
            self, replicate, lambda part: kept(*part.described()), left, halted, going
        )
        if ended is None:
            return None, None
        finished = ended["status"] == Status.FINISHED.name
        row = {name: ended.get(name, 0) for name in ROW.fields or ()}
        row |= {"finished": finished, "end_time": ended["time"]}
        if finished:
            return row, None
        why = (
            f"{ended['status'].lower()} at {ended['time']:.4g} s, in an island of bodies "
            f"{', '.join(map(str, ended['failed'][:6]))}"
        )
        return row, self.note(condition, replicate, why)

    def has_failed(self, column: Callable[[str], np.ndarray]) -> np.ndarray:
        return column("finished") == 0

    def check_whole(self, rows: np.ndarray, parts: Container[str]) -> None:
        """ValueError where bodies or snapshots of a finished replicate are not there."""
        if len(rows) > 1 or not records.has(parts, self.pieces if rows["finished"][0] else 0):
            raise ValueError("some of its snapshots are missing")

    def counts_part(self, name: str) -> bool:
        return name.startswith(records.MOMENT)

    def left_of(self, parts: Parts) -> records.Left | None:
        return records.left_of(parts)

    def generator(self, replicate: int) -> np.random.Generator:
        """The random numbers of a replicate."""
        stream = np.random.SeedSequence(self.config.seed, spawn_key=(replicate,))
        return np.random.Generator(np.random.Philox(stream))

    def draw(self, rng: np.random.Generator) -> Drawn:
        """The bodies of a replicate, by its random numbers."""
        numbers = rng.random((self.scene.number, 2))
        if self.scene.is_measured:
            places = self.choosable
            weights = drawing_weights(self.scene, [self.flocs[each] for each in places])
            flocs = [int(places[quantile(weights, each)]) for each in numbers[:, 0].tolist()]
            radii = [self.flocs[each].measured_size for each in flocs]
        else:
            radii = lognormal(self.scene, numbers[:, 0]).tolist()
            flocs = [self.floc_for(radius, u) for radius, u in zip(radii, numbers[:, 1].tolist(),
                                                                   strict=True)]  # fmt: skip
        shapes = [
            self.pool.shape(floc, self.vertices, radius)
            for floc, radius in zip(flocs, radii, strict=True)
        ]
        self.pool.made.clear()
        names = flocs if self.vertices > 1 else [SPHERE] * len(flocs)
        return Drawn(np.array(names, dtype=np.int32), shapes)

    def floc_for(self, radius: float, number: float) -> int:
        """Place of a floc of the pool nearest in r_eq/r to a body of that radius [m]."""
        if not self.flocs:
            return SPHERE
        ratios = [floc.ratio for floc in self.flocs]
        near = nearest_in_ratio(ratios, radius / self.config.shapes.radius, self.pool.pool)
        return near[int(number * len(near))]

    def placed(self, replicate: int) -> tuple[Drawn, tuple[float, float], np.ndarray]:
        """(the bodies of a replicate, its box [m], their places (n, 3)).

        UsageError where bodies find no place.
        """
        rng, scene = self.generator(replicate), self.scene
        drawn, area = self.draw(rng), scene.box
        if area is None:
            covered = sum(shape.area for shape in drawn.shapes) / scene.area_fraction
            width = math.sqrt(covered / scene.aspect)
            area = width, covered / width
        return drawn, area, place_at_random(drawn.shapes, area, rng, scene.repeats, scene.gap)

    def periods(self, area: tuple[float, float]) -> tuple[float, float]:
        """Width and height of a box [m], inf along axes along which it does not repeat itself."""
        width, height = np.where(self.scene.repeats, area, math.inf).tolist()
        return width, height

    def swarm(self, replicate: int) -> tuple[Swarm, Drawn, tuple[float, float]]:
        """(the Swarm of a replicate at its start, its bodies before, its box [m]).

        UsageError where bodies find no place, or the box is too small for them.
        """
        return self.beginning if replicate == 0 else self.make_swarm(replicate)

    def make_swarm(self, replicate: int) -> tuple[Swarm, Drawn, tuple[float, float]]:
        """Draw a replicate, place its bodies, and let them settle at their own speeds."""
        drawn, (width, height), places = self.placed(replicate)
        bodies = [
            Body(shape, (x, y), angle, **self.config.body_options(shape))
            for shape, (x, y, angle) in zip(drawn.shapes, places.tolist(), strict=True)
        ]
        forces, fluid = self.config.forces, self.config.fluid
        known = System(bodies, forces, self.config.integrator.method, fluid)
        bodies = [settling(known, body) for body in bodies]
        if self.scene.floor:
            beyond = BEYOND * max(shape.bounding_radius for shape in drawn.shapes)
            bodies.append(floor(width, 0.0, beyond=beyond))
        swarm = Swarm(
            bodies, forces, self.config.integrator.method, fluid,
            box=self.periods((width, height)), all_pairs=self.scene.all_pairs,
            seed=(self.config.seed, replicate),
        )  # fmt: skip
        return swarm, drawn, (width, height)

    def leaving(self, replicate: int, swarm: Swarm, box: tuple[float, float]) -> Leaving | None:
        """What becomes of bodies of a replicate that leave its box [m]; None: they go on."""
        scene = self.scene
        if scene.leaving == KEEP:
            return None
        key = self.config.seed, replicate
        return Leaving(scene.leaving, box, scene.repeats, scene.floor, key, swarm.gauge())


def settling(system: System, body: Body) -> Body:
    """The body at the velocity with which it settles alone."""
    velocity, _ = terminal_motion(system, body)
    xx, xy, yx, yy = system.fluid.gradient
    x, y = body.position
    # Alone it is known at the origin; Stokes's drag, being linear, adds the flow of its place.
    flow = (xx * x + xy * y, yx * x + yy * y)
    return attrs.evolve(
        body, velocity=tuple(float(own + more) for own, more in zip(velocity, flow, strict=True))
    )


def lognormal(scene: SwarmScene, numbers: np.ndarray) -> np.ndarray:
    """Equivalent radii [m] of a lognormal distribution between its limits, by uniform numbers."""
    assert scene.radius is not None, "flocs of measured sizes are drawn differently"
    if scene.spread == 0.0:
        return np.full(len(numbers), scene.radius)
    from scipy.special import ndtr, ndtri

    ends = [
        end if limit is None else float(ndtr(math.log(limit / scene.radius) / scene.spread))
        for limit, end in ((scene.min_radius, 0.0), (scene.max_radius, 1.0))
    ]
    shares = ends[0] + (ends[1] - ends[0]) * numbers
    # Uniform numbers come from 0 on, where an unlimited distribution has nothing.
    shares = np.clip(shares, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)
    return scene.radius * np.exp(scene.spread * ndtri(shares))


def run_briefly(swarm: Swarm) -> None:
    """Run two bodies of a swarm that begin next to each other for TRIAL_SECONDS."""
    free = [body for body in swarm.bodies if not body.fixed][:2]
    (x, y), reach = free[0].position, sum(body.shape.bounding_radius for body in free)
    free[1:] = [attrs.evolve(body, position=(x, y + 1.001 * reach)) for body in free[1:]]
    bodies = [*free, *(body for body in swarm.bodies if body.fixed)]
    few = Swarm(bodies, swarm.forces, swarm.integrator, swarm.fluid, box=swarm.box)
    few.gauge().neighbours(few.system.motion()[0])
    progress = few.begin(TRIAL_SECONDS)
    while progress.advance(TRIAL_SECONDS) == Status.PAUSED:
        pass
