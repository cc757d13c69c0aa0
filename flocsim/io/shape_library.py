"""The shape library: flocs fitted at several numbers of vertices, in one HDF5 file.

- ``flocs``              each floc in its picture (FLOC_COLUMNS), in the order of writing; of
                         several spheroradii each has a row, e.g. "023.png#7 r=2"
- ``fits/N``             for every N, so that between conditions nothing changes but N
                         (FIT_COLUMNS); in version 2, of holes or several parts, POINT_COLUMNS too
- ``measures``           of flocs that have been measured (MEASURE_COLUMNS); NaN for one without
- ``population``         of flocs from pictures (POPULATION_COLUMNS)
- ``closer/N, wider/N``  as ``fits/N``, of the outlines cut closer and wider, about the centroid of
                         the floc as it was cut, where these were fitted as well

Attributes of the file say its kind, its schema version and what the fits were made with, as far as
given; those of every dataset `units` and `long_name`.  The file ends in flocsim's checksum and is
the same from run to run.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from itertools import product
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from flocsim.errors import FileError, UsageError
from flocsim.geometry.shapes.cores import Part, PointTable, is_compound, parts_in, table_of
from flocsim.geometry.shapes.outline import ShapeMeasures
from flocsim.geometry.shapes.shape import Shape, Sphere
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon, shape_of_parts
from flocsim.io.files import Rule, keep
from flocsim.io.groups import (
    Declared,
    check_version,
    column_of,
    declared,
    hold_against,
    opened_file,
    text_of,
    write_groups,
)
from flocsim.io.hdf5 import File, Node
from flocsim.io.labelled import Column, Labelled
from flocsim.io.results.schema import BAND_ENDS

if TYPE_CHECKING:
    from flocsim.geometry.fit.fit import Fit

NAME_OF_SHIPPED = "synthetic"
"""What a config calls the library that ships with flocsim."""

SHIPPED = Path(__file__).with_name("synthetic.h5")
"""Its place; tests/helpers/shipped_library.py made it."""

KIND = "flocsim shape library"
SCHEMA_VERSION, COMPOUND_VERSION = 1, 2
"""Of libraries of polygons, and of those with holes or parts."""

MOST_VERTICES = 10_000
LARGEST = 1.0
"""Metres beyond which nothing of a floc lies."""
MOST_PIXELS = 1e12

FLOC_COLUMNS = declared(
    {
        "id": ("text", "", "picture and region"),
        "image": ("text", "", "file name of the picture"),
        "pixel_size": ("f8", "m", "length of a pixel's side"),
        "centroid": ("f8", "px", "centroid in the picture, x right and y down"),
        "area": ("i8", "px", "pixels of the mask"),
        "equivalent_radius": ("f8", "px", "radius of the circle of equal area"),
        "spheroradius": ("f8", "px", "spheroradius asked for"),
    },
    ("floc",),
)
FLOC_COLUMNS["centroid"] = attrs.evolve(FLOC_COLUMNS["centroid"], axes=("floc", 2))

FIT_COLUMNS = {
    "vertices": ("f8", "m", "vertices around the floc's centroid, x right and y up"),
    "radius": ("f8", "m", "spheroradius"),
    "relative_error": ("f8", "percent", "pixels that differ, in percent of the mask's pixels"),
}
POINT_COLUMNS = {
    "part": ("i8", "", "part of the floc that a vertex belongs to"),
    "ring": ("i8", "", "ring of the part: 0 its outline, from 1 its holes"),
    "point_radius": ("f8", "m", "spheroradius of the part"),
}

MEASURE_COLUMNS = declared(
    {
        "perimeter": ("f8", "px", "length of the outline"),
        "aspect_ratio": ("f8", "1", "long over short axis of the ellipse of equal moments"),
        "circularity": ("f8", "1", "4 pi area / perimeter^2"),
        "solidity": ("f8", "1", "area over that of the convex hull"),
        "feret_max": ("f8", "px", "largest distance of two parallel tangents"),
        "feret_min": ("f8", "px", "smallest distance of two parallel tangents"),
    },
    ("floc",),
)
"""The measures of the masks."""

UNMEASURED = ShapeMeasures(*[float("nan")] * len(MEASURE_COLUMNS))

POPULATION_COLUMNS = declared(
    {
        "weight": (
            "f8",
            "1",
            "number of flocs that it represents, of which the filters kept only this one",
        ),
        "radius_low": ("f8", "px", "equivalent radius as it would have been cut closer"),
        "radius_high": ("f8", "px", "equivalent radius as it would have been cut wider"),
    },
    ("floc",),
)
"""What the picture leaves open."""

ATTRIBUTES = {
    "id": "floc_id", "part": "points.part", "ring": "points.ring",
    "point_radius": "points.radius",
}  # fmt: skip
"""What a column holds of a ShapeEntry or a StoredFit, where that has another name."""


def fits_at(count: int, compound: bool) -> dict[str, Declared]:
    """The columns of fits with so many vertices; ``compound``: of flocs with holes or parts."""
    columns = declared(FIT_COLUMNS, ("floc",))
    columns["vertices"] = attrs.evolve(columns["vertices"], axes=("floc", count, 2))
    return columns | (declared(POINT_COLUMNS, ("floc", count)) if compound else {})


@attrs.frozen(eq=False)
class StoredFit:
    """One fit: vertices (N, 2) [m] about the floc's centroid, y up; radius [m], the smallest of
    its parts; RE [%]; of a core with holes, or of several parts, the ``table`` of its points."""

    vertices: np.ndarray
    radius: float
    relative_error: float
    table: PointTable | None = None

    @property
    def shape(self) -> Shape:
        """The Sphere (N = 1), SpheroPolygon or Composite [m], around its own centroid."""
        if len(self.vertices) == 1:
            return Sphere(self.radius)
        if self.table is not None:
            return shape_of_parts(parts_in(self.table))
        return SpheroPolygon(self.vertices, self.radius)

    @property
    def points(self) -> PointTable:
        """Its core points, with the parts and rings that they belong to."""
        if self.table is not None:
            return self.table
        return table_of((Part((self.vertices,), self.radius),))


def own_radius(entry):
    return entry.equivalent_radius


@attrs.frozen(eq=False)
class ShapeEntry:
    """One floc: where it comes from, its size in the picture, and its fits {N: StoredFit}.

    floc_id: text such as "023.png#7"; pixel_size [m]; centroid (x, y) [px, y down]; area [px];
    equivalent_radius and spheroradius [px]; measures [px] of its mask, None where nobody took them;
    weight: that of Region; radius_low, radius_high: r_eq [px] at the ends of its band, its own
    where nothing is known; closer, wider: the fits there, none where nobody made them.
    """

    floc_id: str
    image: str
    pixel_size: float
    centroid: tuple[float, float]
    area: int
    equivalent_radius: float
    spheroradius: float
    fits: dict[int, StoredFit]
    measures: ShapeMeasures | None = None
    weight: float = 1.0
    radius_low: float = attrs.field(
        kw_only=True, default=attrs.Factory(own_radius, takes_self=True)
    )
    radius_high: float = attrs.field(
        kw_only=True, default=attrs.Factory(own_radius, takes_self=True)
    )
    closer: dict[int, StoredFit] = attrs.field(kw_only=True, factory=dict)
    wider: dict[int, StoredFit] = attrs.field(kw_only=True, factory=dict)

    @property
    def measured_radius(self) -> float:
        """r_eq [m] of the floc in its picture."""
        return self.equivalent_radius * self.pixel_size

    @property
    def is_banded(self) -> bool:
        """Whether the ends of its band were fitted."""
        return bool(self.closer and self.wider)


def measures_in(columns: dict[str, np.ndarray]) -> dict[str, list]:
    """The ShapeMeasures of all flocs, None for those without; ValueError for what cannot be."""
    table = np.stack(list(columns.values()))
    known = np.isfinite(table) & (table > 0.0)
    if not np.all(known.all(axis=0) | np.isnan(table).all(axis=0)):
        raise ValueError("measures has values that a floc cannot have")
    rows = table.T.tolist()
    return {"measures": [ShapeMeasures(*row) if row[0] == row[0] else None for row in rows]}


def population_in(columns: dict[str, np.ndarray]) -> dict[str, list]:
    """What the picture leaves open of all flocs; ValueError for what cannot be."""
    for name, values in columns.items():
        if not np.all((values > 0.0) & (values <= MOST_PIXELS)):
            raise ValueError(f"population/{name} has values that a floc cannot have")
    return {name: values.tolist() for name, values in columns.items()}


OPTIONAL = {
    "measures": (MEASURE_COLUMNS, measures_in), "population": (POPULATION_COLUMNS, population_in)
}  # fmt: skip
"""Groups that a library may lack: their columns, and the attributes of entries that these give,
once they were checked."""


def make_entry(
    picture: Any, region: Any, fits: "Sequence[Mapping[float, Mapping[int, Fit]]]",
    spheroradius: float, name_radius: bool = False,
) -> ShapeEntry:  # fmt: skip
    """The ShapeEntry of a Region (flocsim.io.images) of a picture, which has a name, pixel_size [m]
    and measures {label: ShapeMeasures}.

    fits: {r: {N: Fit}} [px] of its mask, and of the two masks of its band, where they were made;
    name_radius: its id names the spheroradius, for libraries with several of one floc.
    """
    top, left = region.bbox[:2]

    def stored(found, margin):
        # y counts downwards in the picture, from the margin of its mask.
        x, y = region.centroid[0] - left + margin, -(region.centroid[1] - top + margin)
        return {
            count: stored_fit(fit, np.array([x, y]), picture.pixel_size)
            for count, fit in found[spheroradius].items()
        }

    own, *band = fits
    # The masks of a band have a wider margin, the same on every side.
    ends = {
        name: stored(each, 1 + (len(mask) - len(region.mask)) // 2)
        for name, each, mask in zip(BAND_ENDS, band, region.band or (), strict=bool(band))
    }
    floc_id = f"{picture.name}#{region.label}" + (f" r={spheroradius:g}" if name_radius else "")
    low, high = region.radius_band
    return ShapeEntry(
        floc_id, picture.name, float(picture.pixel_size), region.centroid, region.area,
        region.equivalent_radius, float(spheroradius), stored(own, 1),
        picture.measures.get(region.label),
        weight=region.weight, radius_low=low, radius_high=high, **ends,
    )  # fmt: skip


def stored_fit(fit: "Fit", centroid: np.ndarray, pixel_size: float) -> StoredFit:
    """The StoredFit of a Fit in a mask where the floc's centroid lies at ``centroid`` [px]."""
    vertices, radius = (fit.vertices - centroid) * pixel_size, fit.radius * pixel_size
    table = None
    if fit.hole_sizes:
        table = table_of(fit.parts)._replace(place=vertices, radius=np.full(len(vertices), radius))
    return StoredFit(vertices, radius, fit.relative_error, table)


def write_library(
    path: str | Path,
    entries: Iterable[ShapeEntry],
    settings: Mapping[str, Any] | None = None,
    rule: Rule = keep,
) -> None:
    """Write entries, all with fits at the same N, to `path`, whole or not at all.

    settings: {name: text or number}, what the fits were made with; rule: what becomes of a file
    that is there. The ends of bands are written where all entries have them.

    Raises UsageError if there are none, ids repeat or the N differ; FileError if it cannot be
    written.
    """
    entries = list(entries)
    if not entries:
        raise UsageError("a shape library needs at least one floc, found none")
    ids = [entry.floc_id for entry in entries]
    repeated = next((name for name in ids if ids.count(name) > 1), None)
    if repeated is not None:
        raise UsageError(f"floc id {repeated!r} occurs twice: give every floc its own")
    if len({tuple(sorted(entry.fits)) for entry in entries}) > 1 or not entries[0].fits:
        raise UsageError("every floc in a library needs fits at the same numbers of vertices")
    largest = max(entries, key=reach_of)
    if reach_of(largest) > LARGEST:
        raise UsageError(
            f"floc {largest.floc_id} reaches {reach_of(largest):.3g} m, and no floc in a library "
            f"may reach beyond {LARGEST:g} m: are its pixels really {largest.pixel_size:g} m? Give "
            "the size of one, as in '0.95 um'"
        )

    compound = any(fit.table is not None for entry in entries for fit in entry.fits.values())
    groups = {"flocs": labelled(FLOC_COLUMNS, entries)}
    kinds = ("fits", *(BAND_ENDS if all(entry.is_banded for entry in entries) else ()))
    for kind, count in product(kinds, sorted(entries[0].fits)):
        fits = [getattr(entry, kind)[count] for entry in entries]
        groups[f"{kind}/{count}"] = labelled(fits_at(count, compound), fits)
    if any(entry.measures is not None for entry in entries):
        groups["measures"] = labelled_measures(entries)
    if any(each.radius_low < each.radius_high or each.weight != 1.0 for each in entries):
        groups["population"] = labelled(POPULATION_COLUMNS, entries)
    version = COMPOUND_VERSION if compound else SCHEMA_VERSION
    attributes = {"kind": KIND, "schema_version": version, **(settings or {})}
    write_groups(path, attributes, groups, rule=rule)


def labelled(columns, owners):
    """What columns hold of some owners."""
    found = {}
    for name, each in columns.items():
        value = attrgetter(ATTRIBUTES.get(name, name))
        found[name] = column_of(each, [value(owner) for owner in owners])
    return Labelled({}, found)


def labelled_measures(entries):
    """The measures of all flocs, NaN for one without."""
    return labelled(MEASURE_COLUMNS, [entry.measures or UNMEASURED for entry in entries])


def labelled_flocs(entries: Sequence[ShapeEntry]) -> Labelled:
    """Return all that is known of each floc but its fits, with the axes ``floc`` and ``2``."""
    columns = labelled(FLOC_COLUMNS | POPULATION_COLUMNS, entries).columns
    axes = {"floc": columns.pop("id"), "2": Column(("2",), np.array(["x", "y"], object))}
    return Labelled(axes, columns | labelled_measures(entries).columns)


def reach_of(entry):
    """The largest coordinate or radius of a floc's fits [m]."""
    return max(
        max(np.abs(fit.vertices).max(), fit.points.radius.max()) for fit in entry.fits.values()
    )


def read_settings(path: str | os.PathLike) -> dict[str, Any]:
    """{name: value} of what the fits of a shape library were made with."""
    with opened(path) as file:
        named = file.attributes.items()
        return {name: value for name, value in named if name not in ("kind", "schema_version")}


def read_library(path: str | os.PathLike) -> list[ShapeEntry]:
    """The flocs of a shape library, in the order of writing.

    Raises FileError for a file that is missing, damaged, of another kind or another version, or
    that has impossible values.
    """
    with opened(path) as file:
        if text_of(file, "kind") != KIND:
            raise FileError(f"{path} is not a shape library: name a file written by flocsim fit")
        remedy = "make it again with flocsim fit"
        version = check_version(path, file, SCHEMA_VERSION, COMPOUND_VERSION, remedy)
        check_structure(file, version == COMPOUND_VERSION)
        return _entries(file)


def opened(path: str | os.PathLike) -> AbstractContextManager[File]:
    """An open file, once checksum and structure were found right."""
    return opened_file(
        path,
        lambda reason: (
            f"{path} is not a complete shape library ({reason}): make it again with flocsim fit"
        ),
    )


def check_structure(nodes: Mapping[str, Node], compound: bool = False) -> None:
    """ValueError unless the groups and datasets of a file are those of a shape library."""
    banded = "closer" in nodes or "wider" in nodes
    kinds = ("fits", *(BAND_ENDS if banded else ()))
    groups: dict[str, Mapping[str, Declared]] = {"flocs": FLOC_COLUMNS} | {k: {} for k in kinds}
    counts: dict[str, set[str]] = {kind: set() for kind in kinds}
    for path in nodes:
        group, _, count = path.rpartition("/")
        if group in kinds:
            if not (count.isdecimal() and count.isascii() and 0 < int(count) <= MOST_VERTICES):
                raise ValueError(f"{path} is not a number of vertices up to {MOST_VERTICES}")
            groups[path] = fits_at(int(count), compound)
            counts[group].add(count)
    optional = {name: columns for name, (columns, _) in OPTIONAL.items()}
    lengths = hold_against(nodes, groups | optional, groups)
    if lengths["floc"] < 1 or not counts["fits"]:
        raise ValueError("there are no flocs")
    if any(each != counts["fits"] for each in counts.values()):
        raise ValueError("the ends of its bands have different numbers of vertices from its fits")
    for name, value in nodes[""].attributes.items():
        if not isinstance(value, str | bool | int | float):
            raise ValueError(f"its attribute {name} is neither text nor a number")


def _entries(file):
    """The ShapeEntries of an open library; ValueError for values that cannot be."""
    flocs = {}
    for name, declared_as in FLOC_COLUMNS.items():
        values = file.read(f"flocs/{name}")
        if declared_as.type != "text":
            least = -MOST_PIXELS if name == "centroid" else 0.0
            most = LARGEST if name == "pixel_size" else MOST_PIXELS
            inside = (values >= least) & (values <= most) & (values != 0 if least == 0.0 else True)
            if not inside.all():
                raise ValueError(f"flocs/{name} has values that a floc cannot have")
        flocs[ATTRIBUTES.get(name, name)] = values.tolist()
    flocs["centroid"] = [tuple(centroid) for centroid in flocs["centroid"]]
    if len(set(flocs["floc_id"])) < len(flocs["floc_id"]):
        raise ValueError("two flocs have the same id")
    for name, (columns, read) in OPTIONAL.items():
        if name in file:
            flocs |= read({each: file.read(f"{name}/{each}") for each in columns})
    for kind in ("fits", *BAND_ENDS):
        if kind in file:
            counts = sorted(map(int, file.names(kind)))
            fits = {n: _fits(n, file, f"{kind}/{n}") for n in counts}
            flocs[kind] = [
                dict(zip(fits, each, strict=True)) for each in zip(*fits.values(), strict=True)
            ]
    return [
        ShapeEntry(**dict(zip(flocs, row, strict=True)))
        for row in zip(*flocs.values(), strict=True)
    ]


def _fits(count, file, group):
    """The StoredFits of all flocs at N = ``count``, in a group."""
    vertices, radius, error = (file.read(f"{group}/{name}") for name in FIT_COLUMNS)
    for name, values, most in (
        ("vertices", np.abs(vertices), LARGEST),
        ("radius", radius, LARGEST),
        ("relative_error", error, np.inf),
    ):
        if not (np.isfinite(values).all() and np.all(values >= 0.0) and np.all(values <= most)):
            raise ValueError(f"{group}/{name} has values that a floc cannot have")
    if count == 1 and not np.all(radius > 0.0):
        raise ValueError("fits/1/radius holds circles without a size")
    tables = _tables(file, group, vertices, radius)
    columns = vertices, radius.tolist(), error.tolist(), tables
    return [StoredFit(*each) for each in zip(*columns, strict=True)]


def _tables(file, group, vertices, radius):
    """The PointTables of all flocs in a group; None for those of one ring."""
    if f"{group}/part" not in file:
        return [None] * len(vertices)
    columns = {
        ATTRIBUTES[name].removeprefix("points."): file.read(f"{group}/{name}")
        for name in POINT_COLUMNS
    }
    wide = columns["radius"]
    if not np.all((wide > 0.0) & (wide <= LARGEST)) or np.any(wide.min(axis=1) != radius):
        raise ValueError(f"{group}/point_radius has values that are not radii")
    tables = []
    for row, place in enumerate(vertices):
        table = PointTable(place, **{name: values[row] for name, values in columns.items()})
        tables.append(table if is_compound(parts_in(table)) else None)
    return tables
