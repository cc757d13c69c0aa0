"""The flocs of a study: grown by flocsim, read from a shape library, or of a class of the user's
own; resized to the scene."""

import math
from collections.abc import Sequence

import attrs
import numpy as np

from flocsim.ensembles.config.schema import ShapesConfig
from flocsim.errors import ConfigError
from flocsim.geometry.fit.fit import fit_mask
from flocsim.geometry.shapes.resize import resized
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.sphere import Sphere
from flocsim.geometry.shapes.synthetic import EQUIVALENT_PIXELS, synthetic_floc

SYNTHETIC_RATIO = 16.0
"""r_eq/r at which synthetic flocs are fitted: between the paper's small and large flocs."""


@attrs.frozen(eq=False)
class Floc:
    """One floc at several numbers of vertices: ``shapes`` {N: Shape}, in a unit of its own.

    ``own`` where the shape is the user's: it keeps its form at any size, its radius grows with it.
    """

    name: str
    ratio: float
    shapes: dict[int, Shape]
    own: bool = False

    def resized(self, vertices: int, equivalent_radius: float, radius: float) -> Shape:
        """The shape of N vertices with r_eq [m], and with the spheroradius [m] if not ``own``."""
        shape = self.shapes[vertices]
        if self.own:
            return shape.scaled(equivalent_radius / shape.equivalent_radius)
        return resized(shape, equivalent_radius, radius)


def grow_floc(shapes, seed, index):
    """One synthetic floc, fitted at all the numbers of vertices that the config asks for."""
    mask = synthetic_floc((seed, index), shapes.primary_particles, shapes.fractal_dimension)
    radius = EQUIVALENT_PIXELS / SYNTHETIC_RATIO
    fits = {n: fit_mask(mask, vertices=n, radius=radius).shape for n in shapes.vertices if n > 1}
    return Floc(f"synthetic#{index}", SYNTHETIC_RATIO, fits)


def read_flocs(shapes: ShapesConfig) -> list[Floc]:
    """The flocs of a shape library; ConfigError where it lacks a wanted number of vertices."""
    from flocsim.io.shapes.library import read_library

    wanted = [n for n in shapes.vertices if n > 1]
    flocs = []
    assert shapes.file is not None  # the config refuses a library without a file
    for entry in read_library(shapes.file):
        lacking = [n for n in wanted if n not in entry.fits]
        if lacking:
            raise ConfigError(
                f"shapes.vertices asks for N = {lacking[0]}, but {shapes.file} holds N = "
                f"{', '.join(map(str, sorted(entry.fits)))}: fit again with `flocsim fit "
                f"--vertices …`, or change shapes.vertices"
            )
        ratio = entry.equivalent_radius / entry.spheroradius
        flocs.append(Floc(entry.floc_id, ratio, {n: entry.fits[n].shape for n in wanted}))
    return flocs


def load_flocs(shapes: ShapesConfig, seed: int) -> list[Floc]:
    """All flocs that the config's [shapes] stands for, in a fixed order."""
    if shapes.own is not None:
        ratio = shapes.own.equivalent_radius / shapes.own.radius
        return [Floc(shapes.label, ratio, {len(shapes.own.vertices): shapes.own}, own=True)]
    if shapes.source == "library":
        return read_flocs(shapes)
    return [grow_floc(shapes, seed, index) for index in range(shapes.pool)]


def nearest_in_ratio(flocs, ratio, count):
    """Places of the ``count`` flocs whose r_eq/r is nearest to a ratio, nearest first."""
    order = sorted(range(len(flocs)), key=lambda k: (abs(math.log(flocs[k].ratio / ratio)), k))
    return order[:count]


@attrs.define(eq=False)
class FlocPool:
    """The flocs that bodies are drawn from, resized to them when first asked for.

    ``flocs``: all of a study; ``radius``: the spheroradius of its bodies [m]; ``pool``: from how
    many flocs of about its size a body is drawn.
    """

    flocs: list[Floc]
    radius: float
    pool: int
    made: dict[tuple, Shape] = attrs.Factory(dict)

    def choose(
        self, numbers: Sequence[float] | np.ndarray, radius_i: float, radius_j: float
    ) -> tuple[int, int]:
        """Places of the flocs of i and j for a replicate's random numbers; two, where possible."""
        pool_i, pool_j = (
            nearest_in_ratio(self.flocs, radius / self.radius, self.pool)
            for radius in (radius_i, radius_j)
        )
        first = pool_i[int(numbers[2] * len(pool_i))]
        others = [k for k in pool_j if k != first] or pool_j
        return first, others[int(numbers[3] * len(others))]

    def shape(self, place: int, vertices: int, equivalent_radius: float) -> Shape:
        """A floc with N vertices in a size; the equivalent sphere for N = 1."""
        key = (place if vertices > 1 else None, vertices, equivalent_radius)
        if key not in self.made:
            self.made[key] = (
                self.flocs[place].resized(vertices, equivalent_radius, self.radius)
                if vertices > 1
                else Sphere(equivalent_radius)
            )
        return self.made[key]
