"""A study of swarms: the bodies of any replicate, by its number."""

import math
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.ensembles.collision.flocs import Floc, FlocPool, load_flocs, nearest_in_ratio, pool_of
from flocsim.ensembles.collision.pairings import EXPONENTS, quantile
from flocsim.ensembles.config.schema import Config, ShapesConfig
from flocsim.ensembles.config.swarm_scene import SwarmScene
from flocsim.errors import ConfigError
from flocsim.geometry.shapes.shape import Shape
from flocsim.plausibility.settling import terminal_motion
from flocsim.swarms.placement import place_at_random
from flocsim.swarms.swarm import Swarm
from flocsim.swarms.walls import floor
from flocsim.system import System

SPHERE = -1
"""Place among the flocs of a body that is a sphere."""

BEYOND = 4.0
"""A floor goes on for so many bounding radii beyond the box."""


@attrs.frozen(eq=False)
class Drawn:
    """The bodies of a replicate before they are placed: place of the floc, and shape, of each."""

    flocs: np.ndarray
    shapes: list[Shape]


def scene_of(config: Config) -> SwarmScene:
    """[scene] of a config that is known to be of a swarm."""
    scene: Any = config.scene
    return scene


def flocs_of(config: Config) -> list[Floc]:
    """The flocs that a config's swarm needs: none for spheres of given sizes."""
    scene, shapes = scene_of(config), shapes_of(config)
    needed = scene.is_measured or max(shapes.vertices) > 1
    return load_flocs(shapes, config.seed) if needed else []


def shapes_of(config: Config) -> ShapesConfig:
    """[shapes], measured flocs keeping their sizes."""
    own = scene_of(config).is_measured
    return attrs.evolve(config.shapes, size="own") if own else config.shapes


@attrs.define(eq=False)
class SwarmStudy:
    """Every replicate of a config whose scene is a swarm. All that is random follows from (seed,
    replicate). ``flocs`` are grown or read unless given."""

    config: Config
    flocs: list[Floc] = attrs.field(
        default=attrs.Factory(lambda self: flocs_of(self.config), takes_self=True)
    )
    pool: FlocPool = attrs.field(init=False)

    def __attrs_post_init__(self):
        self.pool = pool_of(shapes_of(self.config), self.flocs)
        if self.scene.is_measured and not len(self.choosable):
            sizes = [1e6 * floc.measured_size for floc in self.flocs]
            raise ConfigError(
                "scene.min_radius and max_radius leave no floc of the library, which holds "
                f"{len(sizes)} of {min(sizes):.3g} to {max(sizes):.3g} um"
            )

    @property
    def scene(self) -> SwarmScene:
        return scene_of(self.config)

    @property
    def vertices(self) -> int:
        """N of all bodies."""
        return self.config.shapes.vertices[0]

    @property
    def choosable(self) -> np.ndarray:
        """Places of the measured flocs that are within the limits, in the order of their sizes."""
        sizes = np.array([floc.measured_size for floc in self.flocs])
        low, high = self.scene.min_radius or 0.0, self.scene.max_radius or math.inf
        order = np.argsort(sizes, kind="stable")
        return order[(sizes[order] >= low) & (sizes[order] <= high)]

    @property
    def stops(self) -> list[float]:
        """Times of the snapshots [s], the start first."""
        count = math.floor(self.scene.duration / self.scene.interval * (1.0 + 1e-12))
        times = [place * self.scene.interval for place in range(count + 1)]
        if self.scene.duration - times[-1] > 1e-9 * self.scene.duration:
            return [*times, self.scene.duration]
        return [*times[:-1], self.scene.duration]

    def generator(self, replicate: int) -> np.random.Generator:
        """The random numbers of a replicate."""
        stream = np.random.SeedSequence(self.config.seed, spawn_key=(replicate,))
        return np.random.Generator(np.random.Philox(stream))

    def draw(self, rng: np.random.Generator) -> Drawn:
        """The bodies of a replicate, by its random numbers."""
        numbers = rng.random((self.scene.number, 2))
        if self.scene.is_measured:
            flocs = self.draw_measured(numbers[:, 0])
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

    def draw_measured(self, numbers: np.ndarray) -> list[int]:
        """Places of measured flocs, each with its weight."""
        places = self.choosable
        sizes = np.array([self.flocs[each].measured_size for each in places])
        weights = (sizes / sizes.max()) ** EXPONENTS[self.scene.weight]
        return [int(places[quantile(weights, number)]) for number in numbers.tolist()]

    def floc_for(self, radius: float, number: float) -> int:
        """Place of a floc of the pool nearest in r_eq/r to a body of that radius [m]."""
        if not self.flocs:
            return SPHERE
        ratios = [floc.ratio for floc in self.flocs]
        near = nearest_in_ratio(ratios, radius / self.config.shapes.radius, self.pool.pool)
        return near[int(number * len(near))]

    def box_of(self, shapes: Sequence[Shape]) -> tuple[float, float]:
        """Width and height of the box [m]."""
        scene = self.scene
        if scene.box is not None:
            return scene.box
        assert scene.area_fraction is not None, "a scene has one of the two"
        area = sum(shape.area for shape in shapes) / scene.area_fraction
        width = math.sqrt(area / scene.aspect)
        return width, area / width

    def swarm(self, replicate: int) -> tuple[Swarm, Drawn, tuple[float, float]]:
        """(the Swarm of a replicate at its start, its bodies before, its box [m]).

        UsageError where bodies find no place, or the box is too small for them.
        """
        rng = self.generator(replicate)
        drawn = self.draw(rng)
        width, height = self.box_of(drawn.shapes)
        repeats = "x" in self.scene.periodic, "y" in self.scene.periodic
        places = place_at_random(drawn.shapes, (width, height), rng, repeats, self.scene.gap)
        bodies = [
            Body(shape, (x, y), angle, **self.config.body_options)
            for shape, (x, y, angle) in zip(drawn.shapes, places.tolist(), strict=True)
        ]
        forces, fluid = self.config.forces, self.config.fluid
        known = System(bodies, forces, self.config.integrator.method, fluid)
        bodies = [settling(known, body) for body in bodies]
        if self.scene.floor:
            beyond = BEYOND * max(shape.bounding_radius for shape in drawn.shapes)
            bodies.append(floor(width, 0.0, beyond=beyond))
        box = tuple(side if again else None for side, again in zip((width, height), repeats,
                                                                   strict=True))  # fmt: skip
        swarm = Swarm(
            bodies, forces, self.config.integrator.method, fluid, box=box,
            all_pairs=self.scene.all_pairs, seed=(self.config.seed, replicate),
        )  # fmt: skip
        return swarm, drawn, (width, height)


def settling(system: System, body: Body) -> Body:
    """The body at the velocity with which it settles alone."""
    velocity, _ = terminal_motion(system, body)
    return attrs.evolve(body, velocity=tuple(float(each) for each in velocity))


def lognormal(scene: SwarmScene, numbers: np.ndarray) -> np.ndarray:
    """Equivalent radii [m] of a lognormal distribution between its limits, by uniform numbers."""
    assert scene.radius is not None, "flocs of measured sizes are drawn otherwise"
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
