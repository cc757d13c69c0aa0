"""The shape library: flocs fitted at several numbers of vertices, in one HDF5 file.

- ``flocs``              each floc in its picture (FLOC_COLUMNS), in the order of writing; of
                         several spheroradii each has a row, e.g. "023.png#7 r=2"
- ``fits/N``             for every N, so that between conditions nothing changes but N: the relative
                         error, and of every vertex its place, part, ring and radius
- ``measures``           of their masks (MEASURE_COLUMNS)
- ``population``         what the picture leaves open (POPULATION_COLUMNS)
- ``closer/N, wider/N``  as ``fits/N``, of the outlines cut closer and wider, about the centroid of
                         the floc as it was cut, where these were fitted as well

Attributes of the file say its kind, its schema version and what the fits were made with, as far as
given; those of every dataset `units` and `long_name`.  The file ends in flocsim's checksum and is
the same from run to run.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from flocsim.errors import UsageError
from flocsim.geometry.shapes.cores import Part, Parts, PointTable, parts_in, table_of
from flocsim.geometry.shapes.outline import ShapeMeasures
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.spheropolygon import shape_of_parts
from flocsim.io.files import Rule
from flocsim.io.groups import Dataset, FileFormat, Group, Stored, declared, facts_of
from flocsim.io.labelled import Column, Labelled
from flocsim.io.results.schema import BAND_ENDS

if TYPE_CHECKING:
    from flocsim.geometry.fit.fit import Fit

NAME_OF_SHIPPED = "synthetic"
"""What a config calls the library that ships with flocsim."""

SHIPPED = Path(__file__).with_name("synthetic.h5")
"""Its place; tests/helpers/shipped_library.py made it."""

LIBRARY = FileFormat(
    "flocsim shape library", 3, "shape library", {}, ("measures", "population"), oldest=1,
    attribute="kind", remedy="make it again with flocsim fit",
)  # fmt: skip
"""Its groups are those of `groups_of`."""

LARGEST = 1.0
"""Metres beyond which nothing of a floc lies."""
MOST_PIXELS = 1e12
LEAST = 5e-324
"""The least number above 0."""

OF_FLOC = {
    "id": ("text", "", "picture and region"),
    "image": ("text", "", "file name of the picture"),
    "pixel_size": ("f8", "m", "side of a pixel"),
    "centroid": ("f8", "px", "centroid in the picture, x right and y down"),
    "area": ("i8", "px", "number of pixels of the mask"),
    "equivalent_radius": ("f8", "px", "radius of the circle of equal area"),
    "spheroradius": ("f8", "px", "requested spheroradius"),
}
FLOC_COLUMNS = declared(OF_FLOC, ("floc",), low=LEAST, high=MOST_PIXELS)
FLOC_COLUMNS["centroid"] = attrs.evolve(
    FLOC_COLUMNS["centroid"], axes=("floc", 2), low=-MOST_PIXELS
)

OF_MASK = {
    "perimeter": ("f8", "px", "length of the outline"),
    "aspect_ratio": ("f8", "1", "long over short axis of the ellipse with equal moments"),
    "circularity": ("f8", "1", "4 pi area / perimeter^2"),
    "solidity": ("f8", "1", "area over that of the convex hull"),
    "feret_max": ("f8", "px", "largest distance between two parallel tangents"),
    "feret_min": ("f8", "px", "smallest distance between two parallel tangents"),
}
MEASURE_COLUMNS = declared(OF_MASK, ("floc",))
"""The measures of the masks."""

OF_POPULATION = {
    "weight": ("f8", "1", "number of flocs that this one represents after filtering"),
    "radius_low": ("f8", "px", "equivalent radius of the outline cut closer"),
    "radius_high": ("f8", "px", "equivalent radius of the outline cut wider"),
}
POPULATION_COLUMNS = declared(OF_POPULATION, ("floc",), low=LEAST, high=MOST_PIXELS)
"""What the picture leaves open."""

VERTICES = {"vertices": ("f8", "m", "vertices around the floc's centroid, x right and y up")}
NUMBERS = {
    "part": ("i4", "", "part of the floc that a vertex belongs to"),
    "ring": ("i4", "", "ring of the part: 0 its outline, from 1 its holes"),
}
RADII = {"point_radius": ("f8", "m", "spheroradius of the part")}
ERRORS = {
    "relative_error": ("f8", "percent", "differing pixels, in percent of the pixels of the mask")
}
"""Columns of fits, of each vertex and of the whole."""

ATTRIBUTES = {
    "id": "floc_id", "vertices": "table.place", "part": "table.part", "ring": "table.ring",
    "point_radius": "table.radius",
}  # fmt: skip
"""Column → attribute of a ShapeEntry or a StoredFit, where that has another name."""


def groups_of(kinds: Iterable[str], counts: Sequence[int]) -> dict[str, Group]:
    """Return the groups of a library of fits at these numbers of vertices.

    ``kinds``: "fits", and the ends of bands where these were fitted.
    """
    groups = {"flocs": Group(FLOC_COLUMNS, {}), "measures": Group(MEASURE_COLUMNS, {}),
              "population": Group(POPULATION_COLUMNS, {})}  # fmt: skip
    for count in counts:
        points = ("floc", count)
        columns = declared(VERTICES, (*points, 2), low=-LARGEST, high=LARGEST)
        columns |= declared(NUMBERS, points, low=0) | declared(RADII, points, low=0.0, high=LARGEST)
        columns |= declared(ERRORS, ("floc",), low=0.0)
        groups |= {f"{kind}/{count}": Group(columns, {}) for kind in kinds}
    return groups


def earlier_groups(groups: Mapping[str, Group], version: int) -> dict[str, Group]:
    """Return the groups as version 1 or 2 has them: fits have one spheroradius, and parts and rings
    are stored in version 2 alone, of libraries with holes or several parts."""
    found = dict(groups)
    for name in (each for each in groups if "/" in each):
        columns = dict(groups[name].columns)
        for column in ("part", "ring"):
            columns[column] = attrs.evolve(columns[column], type="i8")
        if version == 1:
            columns = {each: columns[each] for each in ("vertices", "relative_error")}
        radius = {"radius": ("f8", "m", "spheroradius")}
        columns |= declared(radius, ("floc",), low=0.0, high=LARGEST)
        found[name] = Group(columns, {})
    return found


@attrs.frozen(eq=False)
class StoredFit:
    """One fit: its parts, cores of vertices [m] about the floc's centroid, y up, which disks
    sweep; RE [%]."""

    parts: Parts
    relative_error: float

    @property
    def shape(self) -> Shape:
        """The Sphere (N = 1), SpheroPolygon or Composite [m], around its own centroid."""
        return shape_of_parts(self.parts)

    @property
    def table(self) -> PointTable:
        """Its vertices, with the parts and rings that they belong to."""
        return table_of(self.parts)


def own_radius() -> Any:
    """Return the default of an end of a floc's band: its own radius."""
    return attrs.field(
        kw_only=True,
        default=attrs.Factory(lambda entry: entry.equivalent_radius, takes_self=True),
    )


def measures_of_fit(entry: "ShapeEntry") -> ShapeMeasures:
    """Return the measures [px] of the finest fit of a floc."""
    shape = entry.fits[max(entry.fits)].shape
    return scaled_measures(shape.measures, 1.0 / entry.pixel_size)


def scaled_measures(measures: ShapeMeasures, factor: float) -> ShapeMeasures:
    """Return measures whose lengths are ``factor`` times as large."""
    lengths = ("perimeter", "feret_max", "feret_min")
    return attrs.evolve(measures, **{name: factor * getattr(measures, name) for name in lengths})


@attrs.frozen(eq=False)
class ShapeEntry:
    """One floc: where it comes from, its size in the picture, and its fits {N: StoredFit}.

    floc_id: text such as "023.png#7"; pixel_size [m]; centroid (x, y) [px, y down]; area [px];
    equivalent_radius and spheroradius [px]; measures [px] of its mask, or of its finest fit;
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
    measures: ShapeMeasures = attrs.Factory(measures_of_fit, takes_self=True)
    weight: float = 1.0
    radius_low: float = own_radius()
    radius_high: float = own_radius()
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


def make_entry(
    picture: Any, region: Any, fits: "Sequence[Mapping[float, Mapping[int, Fit]]]",
    spheroradius: float, name_radius: bool = False,
) -> ShapeEntry:  # fmt: skip
    """Return the ShapeEntry of a Region (flocsim.io.images) of a picture.

    picture: it has a name, pixel_size [m] and measures {label: ShapeMeasures}; fits: {r: {N: Fit}}
    [px] of its mask, and of the two masks of its band, where they were made; name_radius: its id
    names the spheroradius, for libraries with several of one floc.
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
        picture.measures[region.label],
        weight=region.weight, radius_low=low, radius_high=high, **ends,
    )  # fmt: skip


def stored_fit(fit: "Fit", centroid: np.ndarray, pixel_size: float) -> StoredFit:
    """Return the StoredFit of a Fit in a mask with the floc's centroid at ``centroid`` [px]."""
    [(rings, radius)] = fit.parts
    moved = tuple((ring - centroid) * pixel_size for ring in rings)
    return StoredFit((Part(moved, radius * pixel_size),), fit.relative_error)


def write_library(
    path: str | Path,
    entries: Iterable[ShapeEntry],
    settings: Mapping[str, Any] | None = None,
    rule: Rule = False,
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

    kinds = ("fits", *(BAND_ENDS if all(entry.is_banded for entry in entries) else ()))
    groups = {}
    for name, group in groups_of(kinds, sorted(entries[0].fits)).items():
        kind, _, count = name.partition("/")
        owners: list[Any] = entries
        if count:
            owners = [getattr(entry, kind)[int(count)] for entry in entries]
        elif name == "measures":
            owners = [entry.measures for entry in entries]
        groups[name] = labelled(group.columns, owners)
    LIBRARY.write(path, groups, attributes=settings, rule=rule)


def labelled(columns: Mapping[str, Dataset], owners: Sequence[Any]) -> Labelled:
    """Return columns of attributes of some owners: flocs, fits or measures."""
    found = {}
    for name, each in columns.items():
        value = attrgetter(ATTRIBUTES.get(name, name))
        found[name] = each.column([value(owner) for owner in owners])
    return Labelled({}, found)


def labelled_flocs(entries: Sequence[ShapeEntry]) -> Labelled:
    """Return all that is known of each floc but its fits, with the axes ``floc`` and ``2``."""
    columns = labelled(FLOC_COLUMNS | POPULATION_COLUMNS, entries).columns
    axes = {"floc": columns.pop("id"), "2": Column(("2",), np.array(["x", "y"], object))}
    measures = labelled(MEASURE_COLUMNS, [entry.measures for entry in entries])
    return Labelled(axes, columns | measures.columns)


def reach_of(entry: ShapeEntry) -> float:
    """Return the largest coordinate or radius of a floc's fits [m]."""
    tables = [fit.table for fit in entry.fits.values()]
    return max(max(np.abs(table.place).max(), table.radius.max()) for table in tables)


def read_settings(path: str | os.PathLike) -> dict[str, Any]:
    """Return {name: value} of what the fits of a shape library were made with."""
    with LIBRARY.opened(path) as file:
        return facts_of(file)


def read_library(path: str | os.PathLike) -> list[ShapeEntry]:
    """Return the flocs of a shape library, in the order of writing.

    Raises FileError for a file that is missing, damaged, of another kind or another version, or
    that has impossible values.
    """
    with LIBRARY.opened(path) as file:
        kinds = [kind for kind in ("fits", *BAND_ENDS) if kind in file]
        counts = sorted(map(int, file.names("fits")))
        groups, version = groups_of(kinds, counts), file.attributes["schema_version"]
        if version < LIBRARY.version:
            groups = earlier_groups(groups, version)
        stored = attrs.evolve(LIBRARY, groups=groups).contents(file)
        return entries_in(stored, kinds, counts)


def entries_in(stored: Stored, kinds: Sequence[str], counts: Sequence[int]) -> list[ShapeEntry]:
    """Return the ShapeEntries of what a library holds."""
    columns = stored.groups["flocs"] | stored.groups.get("population", {})
    flocs = {ATTRIBUTES.get(name, name): values.tolist() for name, values in columns.items()}
    flocs["centroid"] = [tuple(centroid) for centroid in flocs["centroid"]]
    if "measures" in stored.groups:
        measures = (values.tolist() for values in stored.groups["measures"].values())
        flocs["measures"] = [ShapeMeasures(*row) for row in zip(*measures, strict=True)]
    for kind in kinds:
        fits = [fits_in(stored.groups[f"{kind}/{count}"]) for count in counts]
        flocs[kind] = [dict(zip(counts, own, strict=True)) for own in zip(*fits, strict=True)]
    entries = [dict(zip(flocs, row, strict=True)) for row in zip(*flocs.values(), strict=True)]
    for entry in entries:
        # Versions 1 and 2 have NaN of a floc that nobody has measured: its finest fit is.
        if "measures" in entry and np.isnan(entry["measures"].perimeter):
            del entry["measures"]
    return [ShapeEntry(**entry) for entry in entries]


def fits_in(columns: Mapping[str, np.ndarray]) -> list[StoredFit]:
    """Return the StoredFits of all flocs at one number of vertices."""
    if "part" not in columns:  # version 1
        alone = np.zeros(columns["vertices"].shape[:2], int)
        radius = np.broadcast_to(columns["radius"][:, None], alone.shape)
        columns = {**columns, "part": alone, "ring": alone, "point_radius": radius}
    points = (columns[name] for name in ("vertices", "part", "ring", "point_radius"))
    return [
        StoredFit(parts_in(PointTable(*table)), error)
        for *table, error in zip(*points, columns["relative_error"].tolist(), strict=True)
    ]
