"""The flocs of a study: grown by flocsim, read from a shape library, or of a class of the user's
own; resized to the scene, or as they were measured."""

import hashlib
import json
import math
from collections.abc import Iterable, Sequence
from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs

from flocsim.compiler.disk_cache import kept
from flocsim.compiler.processor import cpu_kind, versions
from flocsim.ensembles.config.schema import BAND, CUT, ShapesConfig
from flocsim.ensembles.kind import Numbers
from flocsim.errors import ConfigError, plural
from flocsim.geometry.fit.fit import fit_mask
from flocsim.geometry.shapes.shape import Shape, Sphere
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon, resized
from flocsim.geometry.shapes.synthetic import EQUIVALENT_PIXELS, synthetic_floc
from flocsim.io.results.schema import BAND_ENDS

if TYPE_CHECKING:
    from flocsim.io.shape_library import ShapeEntry

SYNTHETIC_RATIO = 16.0
"""r_eq/r at which synthetic flocs are fitted: between the paper's small and large flocs."""

GEOMETRY = Path(__file__).parents[2] / "geometry"


@attrs.frozen(eq=False)
class Floc:
    """One floc at several numbers of vertices: ``shapes`` {N: Shape}, in a unit of its own.

    ``ratio`` is r_eq/r, ``errors`` {N: RE [%]} of the fits. ``size``: the measured r_eq [m], for
    which the shapes are in metres; None where nothing was measured. ``weight``: how many flocs it
    stands for among those of its pictures. ``own`` where the shape is the
    user's: it keeps its form at any size, its radius grows with it. ``band``: the same floc as its
    outline might have been cut, closer and wider, where a study asks for that.
    """

    name: str
    ratio: float
    shapes: dict[int, Shape]
    errors: dict[int, float] = attrs.Factory(dict)
    size: float | None = None
    own: bool = False
    weight: float = 1.0
    band: dict[str, "Floc"] = attrs.Factory(dict)

    def resized(self, vertices: int, equivalent_radius: float, radius: float) -> Shape:
        """The shape of N vertices with r_eq [m], and with the spheroradius [m] if not ``own``."""
        shape = self.shapes[vertices]
        if self.own:
            return shape.scaled(equivalent_radius / shape.equivalent_radius)
        return resized(shape, equivalent_radius, radius)

    def measured(self, vertices: int) -> Shape:
        """The shape of N vertices, scaled as a whole to the measured ``size``: a fit of few
        vertices covers some percent more or less than the floc."""
        shape = self.shapes[vertices]
        return shape.scaled(self.measured_size / shape.equivalent_radius)

    @property
    def measured_size(self) -> float:
        """The measured r_eq [m] of a floc that has one."""
        assert self.size is not None, "a floc of a library was measured"
        return self.size


def grow_floc(shapes, seed, index):
    """One synthetic floc, fitted at all the numbers of vertices that the config asks for; each fit
    is kept, for it takes a tenth of a second."""
    radius = EQUIVALENT_PIXELS / SYNTHETIC_RATIO
    grown = (seed, index), shapes.primary_particles, shapes.fractal_dimension

    mask = cache(partial(synthetic_floc, *grown))

    def fitted(vertices):
        fit = fit_mask(mask(), vertices=vertices, radius=radius)
        return json.dumps([fit.shape.core.tolist(), fit.relative_error]).encode()

    fits, errors = {}, {}
    for n in shapes.vertices:
        if n > 1:
            key = f"{grown} {radius} {n} {growth_facts()}"
            core, errors[n] = json.loads(kept("flocsim_floc", key, partial(fitted, n)))
            fits[n] = SpheroPolygon(core, radius)
    return Floc(f"synthetic#{index}", SYNTHETIC_RATIO, fits, errors)


@cache
def growth_facts() -> str:
    """What a grown and fitted floc follows from beside its numbers: code, versions, processor."""
    found = hashlib.blake2b(digest_size=16)
    for path in sorted(GEOMETRY.rglob("*.py")):
        found.update(path.read_bytes())
    return f"{found.hexdigest()} {versions()} {cpu_kind()}"


def read_flocs(shapes: ShapesConfig) -> list[Floc]:
    """The flocs of a shape library; ConfigError where it lacks a wanted number of vertices.

    Where pairs are alike in their error, at every number of vertices that the library has.
    """
    from flocsim.io.shape_library import read_library

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
        kept = [n for n in entry.fits if n > 1] if shapes.pairs_alike_in == "error" else wanted
        if shapes.outlines != CUT and not entry.is_banded:
            raise ConfigError(
                f'shapes.outlines = "{shapes.outlines}" needs outlines cut closer and wider, '
                f"which {shapes.file} does not have: fit the pictures again with `flocsim fit "
                "--band`, or leave outlines out"
            )
        first = CUT if shapes.outlines == BAND else shapes.outlines
        floc = floc_of(entry, kept, first)
        if shapes.outlines == BAND:
            ends = {name: floc_of(entry, kept, name) for name in BAND_ENDS}
            floc = attrs.evolve(floc, band=ends)
        flocs.append(floc)
    if shapes.size == "own" and len({floc.size for floc in flocs}) < 2:
        raise ConfigError(
            f'shapes.size = "own" needs flocs of at least two sizes, but {shapes.file} holds '
            f"{plural(len(flocs), 'floc')} of one size, which never meet: fit more flocs, or leave "
            "shapes.size out"
        )
    return flocs


def floc_of(entry: "ShapeEntry", counts: Iterable[int], outline: str) -> Floc:
    """The Floc of an entry of a library at these N, its outline as cut, or cut closer or wider."""
    radius, fits = {
        CUT: (entry.equivalent_radius, entry.fits),
        "closer": (entry.radius_low, entry.closer),
        "wider": (entry.radius_high, entry.wider),
    }[outline]
    found = {n: fits[n] for n in counts}
    return Floc(
        entry.floc_id, radius / entry.spheroradius, {n: fit.shape for n, fit in found.items()},
        {n: fit.relative_error for n, fit in found.items()}, radius * entry.pixel_size,
        weight=entry.weight,
    )  # fmt: skip


def load_flocs(shapes: ShapesConfig, seed: int) -> list[Floc]:
    """All flocs that the config's [shapes] stands for, in a fixed order."""
    if shapes.own is not None:
        ratio = shapes.own.equivalent_radius / shapes.own.radius
        return [Floc(shapes.label, ratio, {len(shapes.own.vertices): shapes.own}, own=True)]
    if shapes.source == "library":
        return read_flocs(shapes)
    return [grow_floc(shapes, seed, index) for index in range(shapes.pool)]


def nearest_in_ratio(values, wanted, count):
    """Places of the ``count`` values nearest to a wanted one, by their ratio, nearest first."""
    order = sorted(range(len(values)), key=lambda k: (abs(math.log(values[k] / wanted)), k))
    return order[:count]


@attrs.define(eq=False)
class FlocPool:
    """The flocs that bodies are drawn from, resized to them when first asked for.

    ``flocs``: all of a study; ``radius``: the spheroradius of its bodies [m]; ``pool``: from how
    many flocs of about its size a body is drawn. ``own_size``: nothing is resized, and of two flocs
    the larger, which settles faster, is j. ``by_error``: see `vertices_of`.
    """

    flocs: list[Floc]
    radius: float
    pool: int
    own_size: bool = False
    by_error: bool = False
    made: dict[tuple, Shape] = attrs.field(init=False, factory=dict)
    orders: dict[float, list[int]] = attrs.field(init=False, factory=dict)

    @cached_property
    def sizes(self) -> list[Any]:
        """What flocs are chosen by: their size [m], or its ratio to the spheroradius."""
        return [floc.size if self.own_size else floc.ratio for floc in self.flocs]

    def cut(self, end: str) -> "FlocPool":
        """The pool of the same flocs, cut closer or wider."""
        return attrs.evolve(self, flocs=[floc.band[end] for floc in self.flocs])

    def by_size(self, radius: float) -> list[int]:
        """Places of all flocs, those nearest in size to a body of that radius [m] first."""
        if radius not in self.orders:
            wanted = radius if self.own_size else radius / self.radius
            self.orders[radius] = nearest_in_ratio(self.sizes, wanted, None)
        return self.orders[radius]

    def near(self, radii: Sequence[float]) -> list[float]:
        """The different sizes [m], ascending, of the flocs that are drawn for bodies of about
        these radii: two at least."""
        sizes, orders = self.sizes, [self.by_size(radius) for radius in radii]
        found = {sizes[k] for order in orders for k in order[: self.pool]}
        more = next(sizes[k] for k in orders[1] if {sizes[k]} != found)
        return sorted(found | {more} if len(found) == 1 else found)

    def choose(self, numbers: Numbers, radius_i: float, radius_j: float) -> tuple[int, int]:
        """Places of the flocs of i and j for a replicate's random numbers; two, where possible."""
        sizes = self.sizes
        pool_i, pool_j = (self.by_size(radius)[: self.pool] for radius in (radius_i, radius_j))
        first = pool_i[int(numbers[2] * len(pool_i))]
        others = [k for k in pool_j if k != first] or pool_j
        if not self.own_size:
            return first, others[int(numbers[3] * len(others))]
        # Two flocs of one size settle alike and never meet.
        others = [k for k in others if sizes[k] != sizes[first]] or [
            next(k for k in self.by_size(radius_j) if sizes[k] != sizes[first])
        ]
        second = others[int(numbers[3] * len(others))]
        return (first, second) if sizes[first] < sizes[second] else (second, first)

    def vertices_of(self, first: int, second: int, vertices: int) -> tuple[int, int]:
        """Numbers of vertices of flocs i and j in a condition with N vertices.

        N for both, or with ``by_error`` N for j and for i that of its fits whose RE is nearest to
        that of j, the nearest N of several: pairs "with similar RE" (paper, section 2.5).
        """
        if not self.by_error or vertices == 1:
            return vertices, vertices
        wanted, errors = self.flocs[second].errors[vertices], self.flocs[first].errors
        return min(errors, key=lambda n: (abs(errors[n] - wanted), abs(n - vertices))), vertices

    def shape(self, place: int, vertices: int, equivalent_radius: float) -> Shape:
        """A floc with N vertices in a size, or its own; the equivalent sphere for N = 1."""
        if self.own_size:
            equivalent_radius = self.flocs[place].measured_size
        key = (place if vertices > 1 else None, vertices, equivalent_radius)
        if key not in self.made and vertices == 1:
            self.made[key] = Sphere(equivalent_radius)
        elif key not in self.made:
            floc = self.flocs[place]
            self.made[key] = (
                floc.measured(vertices)
                if self.own_size
                else floc.resized(vertices, equivalent_radius, self.radius)
            )
        return self.made[key]


def pool_of(shapes: ShapesConfig, flocs: Sequence[Floc]) -> FlocPool:
    """The FlocPool of a config's [shapes]."""
    by_error = shapes.pairs_alike_in == "error"
    return FlocPool(list(flocs), shapes.radius, shapes.pool, shapes.size == "own", by_error)
