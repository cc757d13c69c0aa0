"""A study of swarms: the bodies of any replicate by its number, and how a replicate runs.

While a replicate runs, parts of it are saved: its bodies, every snapshot, and now and then the
state from which it resumes. A part is arrays by name, those of a snapshot named like the columns
of the results file that they become.
"""

import functools
import math
import time
from collections.abc import Callable, Container, Iterable, Sequence
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.compiler.composer import is_on_disk
from flocsim.compiler.fingerprint import fingerprint
from flocsim.ensembles.collision.flocs import Floc, FlocPool, load_flocs, nearest_in_ratio, pool_of
from flocsim.ensembles.collision.pairings import drawing_weights, quantile, within_limits
from flocsim.ensembles.config.schema import Config, ShapesConfig
from flocsim.ensembles.diagnose.preflight import config_warnings, require_contact, warning_lines
from flocsim.ensembles.kind import ORDER, PHYSICS, Code, Condition, Overseer, StudyKind
from flocsim.ensembles.swarms.results import (
    BODIES,
    STATE,
    Arrays,
    decoded,
    encoded,
    has,
    moment_name,
)
from flocsim.ensembles.swarms.scene import SwarmScene
from flocsim.errors import UsageError, plural
from flocsim.explain import force_lines, scale_lines
from flocsim.forces.settling import terminal_motion
from flocsim.geometry.shapes.cores import table_of
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators.base import Status
from flocsim.io.results.swarm_file import ENDS, GONE, ROW, SWARMS, WALL
from flocsim.io.terminal import duration
from flocsim.plausibility import settled
from flocsim.swarms.islands import run_islands
from flocsim.swarms.placement import KEEP, Leaving, floor, place_at_random
from flocsim.swarms.progress import Progress
from flocsim.swarms.swarm import Swarm, stops_of
from flocsim.swarms.together.bonds import Bonds
from flocsim.swarms.together.clusters import Clusters, Gauge
from flocsim.system import System

SPHERE = -1
"""Index among the flocs of a body that is a sphere."""

TRIAL_SECONDS = 1e-6
"""For so long two bodies are run before a study begins, to compile [s]."""

BEYOND = 4.0
"""A floor goes on for so many bounding radii beyond the box."""

MOST_NAMED = 6
"""Bodies of an island that failed which are named."""


@attrs.frozen(eq=False)
class Drawn:
    """The bodies of a replicate before they are placed: index of the floc, and shape, of each, the
    ``box`` [m], and the random numbers that place them."""

    flocs: np.ndarray
    shapes: list[Shape]
    box: tuple[float, float]
    rng: np.random.Generator


def shapes_of(config: Config) -> ShapesConfig:
    """[shapes], measured flocs keeping their sizes."""
    own = config.scene.is_measured
    return attrs.evolve(config.shapes, size="own") if own else config.shapes


@attrs.define(eq=False)
class SwarmStudy(StudyKind):
    """Every replicate of a config whose scene is a swarm; ``flocs`` are grown or read unless
    given."""

    config: Config
    flocs: list[Floc] = attrs.field(
        default=attrs.Factory(lambda self: self.flocs_of(self.config), takes_self=True)
    )
    scenes: ClassVar[Sequence[type]] = (SwarmScene,)
    format: ClassVar[str] = SWARMS.name
    code: ClassVar[Sequence[str]] = (*PHYSICS, "swarms", "ensembles/swarms/study.py")
    row: ClassVar[np.dtype] = ROW
    most_rows: ClassVar[int] = 1
    noun: ClassVar[str] = "snapshots"
    check = staticmethod(require_contact)
    in_common: ClassVar[Sequence[str]] = (*ORDER, "times", "bounds", "replicates")
    pool: FlocPool = attrs.field(init=False)
    choosable: np.ndarray = attrs.field(init=False, factory=lambda: np.zeros(0, int))
    """Indices of the measured flocs that bodies are drawn from."""

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

    def prepare(self) -> None:
        """Raise the FlocsimError that the first swarm, or the laws of its forces, would meet."""
        for law in self.first.system.pieces.laws.values():
            fingerprint(law, {})
        fingerprint(run_islands, self.first.fillings())

    def doubts(self) -> list[str]:
        """Return lines on what is implausible."""
        return config_warnings(self.config, [self.largest_pair()], self.config.forces)

    def largest_pair(self) -> System:
        """Return a System of the two largest bodies, for what is said of a swarm."""
        free = [body for body in self.first.bodies if not body.fixed]
        bodies = sorted(free, key=lambda body: -body.shape.equivalent_radius)[:2]
        return attrs.evolve(self.first.system, bodies=bodies)

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

    @property
    def pieces(self) -> int:  # type: ignore[override]
        return len(self.stops)

    @property
    def allowed(self) -> float:
        """All may end early: results say which."""
        return math.inf

    @property
    def title(self) -> str:
        bodies = plural(self.scene.number, "body", "bodies")
        swarms = plural(self.config.replicates, "swarm")
        return f"{swarms} of {bodies}, {self.scene.duration:g} s"

    def asked(self) -> dict[str, Any]:
        """Return what the study consists of, and what its snapshots are like."""
        scene = self.scene
        return super().asked() | {
            "times": list(map(float, self.stops)), "bounds": list(map(float, scene.bounds)),
            "periodic": scene.periodic,
        }  # fmt: skip

    def compile(self, kinds: Iterable[Code]) -> None:
        """Compile all that a swarm needs, or load it, by running two bodies for no time."""
        for _ in kinds:
            run_briefly(self.first)

    def uncompiled(self, kinds: Iterable[Code]) -> list[Code]:
        """Return all where the engine is not on the disk: a swarm has but one."""
        return [] if is_on_disk(self.first.begin(TRIAL_SECONDS).runner.driver) else list(kinds)

    def has_failed(self, column: Callable[[str], np.ndarray]) -> np.ndarray:
        """Return flags of the swarms that ended early."""
        return column("finished") == 0

    def check_whole(self, rows: np.ndarray, parts: Container[str]) -> None:
        """Raise ValueError where bodies or snapshots of a finished replicate are not there."""
        if len(rows) > 1 or not has(parts, self.pieces if rows["finished"][0] else 0):
            raise ValueError("some of its snapshots are missing")

    def counts_part(self, name: str) -> bool:
        """Return True for a snapshot."""
        return name.startswith("moment")

    def left_of(self, parts: Any) -> dict[str, np.ndarray] | None:
        """Return the state from which a replicate resumes; None where it begins anew."""
        state = decoded(parts.read(STATE)[1]) if STATE in parts else None
        return state if state is not None and has(parts, int(state["moments"])) else None

    # The bodies of a replicate.

    @functools.cached_property
    def beginning(self) -> tuple[Swarm, Drawn]:
        """The first replicate as `swarm` gives it, by which the study is known and checked; it is
        run as it is here, since resizing its flocs takes seconds."""
        return self.make_swarm(0)

    @property
    def first(self) -> Swarm:
        """The swarm of the first replicate at its start."""
        return self.beginning[0]

    def swarm(self, replicate: int) -> tuple[Swarm, Drawn]:
        """Return the Swarm of a replicate at its start, and what was drawn for it.

        UsageError where bodies find no place, or the box is too small for them.
        """
        return self.beginning if replicate == 0 else self.make_swarm(replicate)

    def make_swarm(self, replicate: int) -> tuple[Swarm, Drawn]:
        """Draw a replicate, place its bodies, and let them settle at their own speeds."""
        drawn, scene, forces = self.drawn(replicate), self.scene, self.config.forces
        method, fluid = self.config.integrator.method, self.config.fluid
        places = place_at_random(drawn.shapes, drawn.box, drawn.rng, scene.repeats, scene.gap)
        placed = self.bodies(drawn, places.tolist())
        known = System([body for body in placed if not body.fixed], forces, method, fluid)
        width, height = np.where(scene.repeats, drawn.box, math.inf).tolist()
        swarm = Swarm(
            [body if body.fixed else settling(known, body) for body in placed], forces, method,
            fluid, box=(width, height), all_pairs=scene.all_pairs,
            seed=(self.config.seed, replicate),
        )  # fmt: skip
        return swarm, drawn

    def bodies(self, drawn: Drawn, places: Sequence[Sequence[float]]) -> list[Body]:
        """Return the bodies of a replicate at these places, and after them the floor of its box."""
        bodies = [
            Body(shape, (x, y), angle, **self.config.body_options(shape))
            for shape, (x, y, angle) in zip(drawn.shapes, places, strict=True)
        ]
        beyond = BEYOND * max(shape.bounding_radius for shape in drawn.shapes)
        return bodies + [floor(drawn.box[0], 0.0, beyond=beyond)] * self.scene.floor

    def drawn(self, replicate: int) -> Drawn:
        """Return the bodies of a replicate, and its box."""
        stream = np.random.SeedSequence(self.config.seed, spawn_key=(replicate,))
        rng, scene = np.random.Generator(np.random.Philox(stream)), self.scene
        numbers = rng.random((scene.number, 2))
        if scene.is_measured:
            weights = drawing_weights(scene, [self.flocs[each] for each in self.choosable])
            flocs = [int(self.choosable[quantile(weights, u)]) for u in numbers[:, 0].tolist()]
            radii = [self.flocs[each].measured_size for each in flocs]
        else:
            radii = lognormal(scene, numbers[:, 0]).tolist()
            flocs = [
                self.floc_for(*each) for each in zip(radii, numbers[:, 1].tolist(), strict=True)
            ]
        shapes = [
            self.pool.shape(floc, self.vertices, radius)
            for floc, radius in zip(flocs, radii, strict=True)
        ]
        self.pool.made.clear()
        if (box := scene.box) is None:
            covered = sum(shape.area for shape in shapes) / scene.area_fraction
            width = math.sqrt(covered / scene.aspect)
            box = width, covered / width
        names = flocs if self.vertices > 1 else [SPHERE] * len(flocs)
        return Drawn(np.array(names, dtype=np.int32), shapes, box, rng)

    def floc_for(self, radius: float, number: float) -> int:
        """Return the index of a floc of the pool nearest in r_eq/r to a body of that radius [m]."""
        if not self.flocs:
            return SPHERE
        ratios = [floc.ratio for floc in self.flocs]
        near = nearest_in_ratio(ratios, radius / self.config.shapes.radius, self.pool.pool)
        return near[int(number * len(near))]

    # How a replicate runs.

    def run_task(
        self, condition: Condition, replicate: int, overseer: Overseer, left: Any = None
    ) -> tuple[dict | None, dict | None]:
        """Run a replicate from its start, or from the state that is ``left`` of it, to its end.

        ``overseer.keep`` takes its parts as they come. ``overseer.halted()``, looked at between
        windows and now and then within long ones, makes it leave off, its state kept.
        """

        def save(name: str, arrays: Arrays) -> None:
            if overseer.keep is not None:
                overseer.keep(name, {}, encoded(arrays))

        def look(tried: int) -> bool:
            if overseer.going is not None:
                overseer.going(f"swarm {replicate} at {progress.time:.4g} s, {tried} steps further")
            return overseer.halted()

        scene, stops = self.scene, self.stops
        try:
            swarm, drawn = self.swarm(replicate)
        except UsageError as error:  # its bodies find no place in the box
            drawn = self.drawn(replicate)
            bodies = self.bodies(drawn, [(0.0, 0.0, 0.0)] * len(drawn.shapes))
            save(BODIES, bodies_part(bodies, drawn))
            return dict.fromkeys(ENDS, 0), self.note(condition, replicate, str(error))
        gauge, bond_gauge = swarm.gauge(), swarm.bond_gauge()
        swarm.check_overlaps(gauge)
        leaving = None
        if scene.leaving != KEEP:
            key = self.config.seed, replicate
            leaving = Leaving(
                scene.leaving, drawn.box, scene.repeats, scene.floor, key, swarm.gauge()
            )
        progress = swarm.begin(
            scene.duration, max_steps=self.config.integrator.max_steps, leaving=leaving
        )
        if left is None:
            save(BODIES, bodies_part(swarm.bodies, drawn))
            seen = progress.swarm.motion.copy()
            bonds = bond_gauge.bonds(0.0, seen, gauge.neighbours(seen[:, :3]))
            save(moment_name(0), moment_part(scene, swarm, gauge, progress, bonds))
            moments = 1
        else:
            progress.restore(left)
            moments, seen = int(left["moments"]), left["seen"]

        def save_state(moments: int) -> None:
            """Save what the rest follows from; ``seen``: the motion at the last snapshot."""
            save(STATE, progress.state() | {"seen": seen, "moments": np.array(moments)})

        saved_at, status = time.monotonic(), Status.FINISHED
        for place in range(moments, len(stops)):
            while (status := progress.advance(stops[place], look)) in (
                Status.PAUSED,
                Status.STOPPED,
            ):
                stopped = status == Status.STOPPED or look(0)
                if stopped or time.monotonic() - saved_at > scene.checkpoint:
                    save_state(place)
                    saved_at = time.monotonic()
                if stopped:
                    return None, None
            if status != Status.FINISHED:
                break
            motion = progress.swarm.motion.copy()
            near = gauge.neighbours(motion[:, :3])
            bonds = bond_gauge.bonds(stops[place], motion, near, (stops[place - 1], seen))
            save(moment_name(place), moment_part(scene, swarm, gauge, progress, bonds))
            seen = motion
            if place + 1 < len(stops) and overseer.halted():
                save_state(place + 1)
                return None, None
        row = {name: getattr(progress.effort, name, 0) for name in ENDS}
        row |= {"finished": status == Status.FINISHED, "end_time": progress.time}
        if row["finished"]:
            return row, None
        failed = [] if progress.failed is None else progress.failed.tolist()[:MOST_NAMED]
        why = f"{status.name.lower()} at {progress.time:.4g} s, in an island of bodies "
        return row, self.note(condition, replicate, why + ", ".join(map(str, failed)))


def bodies_part(bodies: Sequence[Body], drawn: Drawn) -> Arrays:
    """Return what is the same at all times: the bodies, a wall the last of them, and the box."""
    shapes = [body.shape for body in bodies]
    tables = [table_of(shape.parts) for shape in shapes]
    walls = len(shapes) - len(drawn.flocs)
    counts = np.array([len(each.place) for each in tables])
    return {
        "r_eq": np.array([shape.equivalent_radius for shape in shapes]),
        "spheroradius": np.array([shape.radius for shape in shapes]),
        "mass": np.array([body.mass for body in bodies]),
        "floc": np.append(drawn.flocs, np.full(walls, WALL)).astype(np.int32),
        "first_point": np.cumsum(counts) - counts,
        "point_count": counts,
        "points": np.concatenate([each.place for each in tables]),
        **{f"point_{name}": np.concatenate([getattr(each, name) for each in tables])
           for name in ("part", "ring", "radius")},
        "box": np.array(drawn.box),
    }  # fmt: skip


def moment_part(
    scene: SwarmScene, swarm: Swarm, gauge: Gauge, progress: Progress, bonds: Bonds
) -> Arrays:
    """Return a snapshot, with its clusters and bonds."""
    _, motion, error = progress.seen()
    # What is gone lies so far outside that it is nobody's neighbour.
    position, velocity = progress.swarm.motion[:, :3], progress.swarm.motion[:, 3:]
    near = gauge.neighbours(position, scene.link)
    found = Clusters.of(swarm.bodies, position, velocity, near, ~progress.gone)
    facts = {"error": error, "median_error": progress.median_error} | summary_of(found)
    facts |= {"removed": int(progress.gone.sum()), "reentered": int(progress.returns.sum())}
    facts |= {f"bonds_{kind}": count for kind, count in bonds.counts.items()}
    label = np.where(progress.gone, GONE, found.label).astype(np.int32)
    motion = np.where(progress.gone[:, None], np.nan, motion)
    pairs = np.column_stack([bonds.pairs, bonds.kind]).astype(np.int32)
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    later, earlier = found.label[bonds.pairs].T
    inside = later[(later == earlier) & (later >= 0)]
    clusters = {
        "mass": found.mass, "gyration": found.gyration, "hydrodynamic": found.hydrodynamic,
        "speed": -found.velocity[:, 1], "porosity": found.porosity,
        "bonds": np.bincount(inside, minlength=len(found)), "number": np.arange(len(found)),
        "bodies": np.bincount(label[label >= 0], minlength=len(found)),
    }  # fmt: skip
    bounds = np.array([0.0, *scene.bounds, np.inf])
    return (
        {name: np.array(float(value)) for name, value in facts.items()}
        | {"n_class": found.counts(bounds).astype(float)}
        | {"position": motion[:, :3], "velocity": motion[:, 3:], "cluster": label}
        | dict(zip(("bond_later", "bond_earlier", "bond_kind"), pairs.T, strict=True))
        | {f"cluster_{name}": values for name, values in clusters.items()}
    )


def summary_of(clusters: Clusters) -> dict[str, float]:
    """Return numbers on all clusters: of a body's cluster in the mean over mass, but for the first
    three; over the mass of those that have the quantity."""
    if not len(clusters):
        return {"clusters": 0, "largest": 0, "percolating": 0}
    share = clusters.mass / clusters.mass.sum()

    def mean(values: np.ndarray) -> float:
        known = np.isfinite(values)
        return float(share[known] @ values[known] / share[known].sum()) if known.any() else math.nan

    return {
        "clusters": len(clusters),
        "largest": int(clusters.size.max()),
        "percolating": int(clusters.percolates.sum()),
        "mean_size": clusters.mean_size,
        "gyration": mean(clusters.gyration),
        "porosity": mean(clusters.porosity),
        "fractal_dimension": clusters.fractal_dimension(),
        "settling": float(-share @ clusters.velocity[:, 1]),
    }


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


BODY_BYTES = 8 * 6 + 4
"""Bytes of a body in a snapshot."""


def dry_run(config: Config, ranks: int, pilot: bool = False, verbose: bool = False) -> str:
    """Return what is known of a study before it is run; ``verbose``: its forces and time scales."""
    study = SwarmStudy(config)
    study.prepare()
    scene, (swarm, drawn), pair = study.scene, study.beginning, study.largest_pair()
    radii = 1e6 * np.array([shape.equivalent_radius for shape in drawn.shapes])
    width, height = 1e6 * np.array(drawn.box)
    area = 1e12 * sum(shape.area for shape in drawn.shapes)
    largest, speed = settled(pair, pair.bodies[0]), ""
    if largest is not None:
        speed = (
            f"; the largest settles alone at {1e3 * largest.speed:.4g} mm/s, Re = "
            f"{largest.reynolds:.2g}, St = {largest.stokes:.2g}"
        )
    size = config.replicates * study.pieces * len(swarm.bodies) * BODY_BYTES
    lines = [
        f"{plural(config.replicates, 'swarm')} of {plural(scene.number, 'body', 'bodies')}, "
        f"N = {study.vertices}, seed {config.seed}, on {plural(ranks, 'rank')}; results in "
        f"{config.output.file}",
        f"  r_eq {radii.min():.4g} to {radii.max():.4g} um, median {np.median(radii):.4g}",
        f"  box {width:.5g} x {height:.5g} um, periodic: {scene.periodic}"
        f"{', with a floor' if scene.floor else ''}; bodies cover {area / (width * height):.4f}",
        f"  {scene.duration:g} s{speed}",
        f"  {study.pieces} snapshots, one every {scene.interval:g} s; a state to resume from every "
        f"{duration(scene.checkpoint)}; results file about {size / 1e6:.3g} MB",
        f"  {config.fluid.words}",
        f"  method: {config.integrator.label}, tolerance {config.integrator.method.tolerance:g} m",
        *warning_lines(study.doubts()),
    ]
    if verbose:
        lines += ["forces:", *(f"  {line}" for line in force_lines(pair))]
        lines += ["time scales of the two largest:", *(f"  {line}" for line in scale_lines(pair))]
    lines.append(f"nothing was run (--dry-run){'' if verbose else '; --verbose shows forces'}")
    return "\n".join(filter(str.strip, lines))


KINDS = (SwarmStudy,)
