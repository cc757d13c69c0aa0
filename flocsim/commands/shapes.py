"""`flocsim shapes`: list the flocs of shape libraries, select some of them, merge libraries; and
what other commands show of one."""

import argparse
import fnmatch
import math
import os
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import attrs

from flocsim import commands
from flocsim.commands import add_overwrite
from flocsim.ensembles.contents import Contents, Figures, Summary
from flocsim.errors import UsageError, plural
from flocsim.hydrodynamics import prism_drag
from flocsim.io.arguments import document, number
from flocsim.io.fit_report import format_errors, measures_in, one_each, population_lines
from flocsim.io.labelled import Labelled, Tables
from flocsim.io.outputs import check_outputs
from flocsim.io.plots.shapes import POPULATION_FIGURES
from flocsim.io.plots.style import MICRO, Figure
from flocsim.io.shape_library import (
    ShapeEntry,
    labelled_flocs,
    read_library,
    read_settings,
    write_library,
)
from flocsim.io.terminal import aligned

MEASURES = {
    "perim um": ("perimeter", MICRO, ".4g"),
    "Feret um": ("feret_max", MICRO, ".4g"),
    "least um": ("feret_min", MICRO, ".4g"),
    "aspect": ("aspect_ratio", 1.0, ".3f"),
    "circular": ("circularity", 1.0, ".3f"),
    "solidity": ("solidity", 1.0, ".3f"),
}
"""{head of a column: (name of a ShapeMeasures' number, its factor, its form)}."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """List, select and merge the flocs of shape libraries.

      flocsim shapes list shapes.h5
      flocsim shapes select shapes.h5 --min-radius 8e-6 --picture '02*.png' -o large.h5
      flocsim shapes select shapes.h5 --drop 023.png#7,025.png#1 -o good.h5
      flocsim shapes merge monday.h5 tuesday.h5 -o mud.h5

    r_eq is that of the measured floc, from its number of pixels and the size of a pixel.  list
    also prints the perimeter, the largest and smallest Feret diameter, aspect ratio, circularity
    4 pi A/P^2 and solidity of every floc, D10, D50 and D90 of the diameters 2 r_eq by number
    and by volume, and the perimeter-based fractal dimension.
    """
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, summary in (
        ("list", "print sizes, shape measures and errors of every floc"),
        ("select", "write the selected flocs to a library"),
        ("merge", "merge several libraries into one"),
    ):
        action = actions.add_parser(name, help=summary)
        add_libraries(action, selects=name != "merge", writes=name != "list")
        document(action, summary, add_libraries.__doc__, commands.__doc__)


def add_libraries(parser: argparse.ArgumentParser, selects: bool, writes: bool) -> None:
    """Add the arguments of an action.

    libraries LIBRARY: shape library written by flocsim fit
    --keep LIST: only these flocs, by name, separated by commas
    --drop LIST: all flocs except these, by name, separated by commas
    --picture NAME: only flocs of this picture; * stands for any characters
    --min-radius METRES: flocs of at least this r_eq
    --max-radius METRES: flocs of at most this r_eq
    --output FILE: shape library to write
    """
    add = parser.add_argument
    add("libraries", nargs="+")
    if selects:
        radius = number("a radius in metres, a number above 0", 5e-324, 1.0)
        for name in ("--keep", "--drop", "--picture"):
            add(name)
        add("--min-radius", type=radius, default=0.0)
        add("--max-radius", type=radius, default=math.inf)
    if writes:
        add("-o", "--output", required=True)
        add_overwrite(parser)


def run(args: argparse.Namespace) -> int:
    """List, select or merge; returns the exit code."""
    return run_list(args) if args.action == "list" else run_write(args)


def run_list(args: argparse.Namespace) -> int:
    """Print a line for every floc of every library."""
    for library in args.libraries:
        entries = selected(read_library(library), args, library)
        counts = [count for count in entries[0].fits if count > 1] if entries else []
        heads = ["name", "r_eq um", "pixel um", "r px", *MEASURES]
        rows = [[*heads, *(f"RE% N={count}" for count in counts)]]
        for each in entries:
            found = measures_in(each)
            sizes = (f"{MICRO * size:.4g}" for size in (each.measured_radius, each.pixel_size))
            shape = [
                f"{factor * getattr(found, name):{form}}"
                for name, factor, form in MEASURES.values()
            ]
            errors = [f"{each.fits[count].relative_error:.2f}" for count in counts]
            rows.append([each.floc_id, *sizes, f"{each.spheroradius:g}", *shape, *errors])
        print("\n".join([f"{library}: {plural(len(entries), 'floc')}", *aligned(rows, left=1)]))
        if entries:
            print("\n".join(population_lines(entries)))
    return 0


def run_write(args: argparse.Namespace) -> int:
    """Write the flocs of all libraries to one, or those of them that meet all that is asked."""
    rule, source = args.overwrite, ", ".join(args.libraries)
    check_outputs([args.output], rule, args.libraries)
    libraries = {path: read_library(path) for path in args.libraries}
    every = merged_entries(libraries)
    entries = selected(every, args, source) if args.action == "select" else every
    if not entries:
        raise UsageError(
            f"{source}: none of {plural(len(every), 'floc')} matches, nothing was written; flocsim "
            "shapes list names them"
        )
    write_library(args.output, entries, merged_settings(args.libraries), rule)
    of = len(every) if args.action == "select" else f"{len(libraries)} libraries"
    print(f"{args.output}: {plural(len(entries), 'floc')} of {of}")
    return 0


def merged_settings(paths: Sequence[str]) -> dict[str, Any]:
    """Return the settings of libraries, all values where they do not agree."""
    settings = [read_settings(path) for path in paths]
    found = {}
    for key in dict.fromkeys(key for each in settings for key in each):
        values = list(dict.fromkeys(each.get(key, "unknown") for each in settings))
        found[key] = values[0] if len(values) == 1 else ", ".join(map(str, values))
    return found


def merged_entries(libraries: dict[str, list[ShapeEntry]]) -> list[ShapeEntry]:
    """Return all entries; a name that has come before gets its library's in front.

    So does its picture's, or flocs of two pictures of one name would count as of one. UsageError
    for libraries with fits at different numbers of vertices.
    """
    merged: list[ShapeEntry] = []
    for path, entries in libraries.items():
        taken, front = {each.floc_id for each in merged}, ""
        while any(front + each.floc_id in taken for each in entries):
            front += f"{Path(path).stem}/"
        for each in entries:
            floc_id, image = front + each.floc_id, front + each.image
            merged.append(attrs.evolve(each, floc_id=floc_id, image=image))
        here, there = (", ".join(map(str, each.fits)) for each in (merged[-1], merged[0]))
        if here != there:
            raise UsageError(
                f"{path} has fits at N = {here}, {next(iter(libraries))} at N = {there}: fit both "
                "at the same --vertices"
            )
    return merged


def selected(entries: list[ShapeEntry], args: argparse.Namespace, source: str) -> list[ShapeEntry]:
    """Return the entries that --keep, --drop, --picture and the limits of r_eq let through."""
    known = set().union(*map(names_of, entries))
    keep, drop = (named(f"--{name}: {source}", getattr(args, name), known)
                  for name in ("keep", "drop"))  # fmt: skip
    return [
        each
        for each in entries
        if (args.keep is None or keep & names_of(each))
        and not drop & names_of(each)
        and fnmatch.fnmatchcase(each.image, args.picture or "*")
        and args.min_radius <= each.measured_radius <= args.max_radius
    ]


def named(source: str, text: str | None, known: set[str]) -> set[str]:
    """Return the names in a list separated by commas, all of which flocs have.

    A name may stand for a floc at all of its spheroradii: 023.png#7 for "023.png#7 r=2".
    """
    names = set(filter(None, (text or "").split(",")))
    if unknown := sorted(names - known):
        raise UsageError(f"{source} has no floc {unknown[0]!r}; flocsim shapes list names them")
    return names


def names_of(entry: ShapeEntry) -> set[str]:
    """Return the names of a floc, with its spheroradius and without."""
    return {entry.floc_id, entry.floc_id.removesuffix(f" r={entry.spheroradius:g}")}


@attrs.frozen(eq=False)
class Library(Tables):
    """The flocs of a library, and what their fits were made with."""

    entries: list[ShapeEntry]
    settings: dict[str, Any]
    indices = {"flocs": ("floc",)}  # noqa: RUF012 (of the class, as Tables wants it)

    def labelled(self, group: str = "flocs") -> Labelled:
        """Return the flocs, without their fits; UsageError for another group."""
        self.known(group)
        return labelled_flocs(self.entries)


def of_entries(draw: Callable[[Any], Figure]) -> Callable[[Library], Figure]:
    """Return a figure of flocs as one of a Library."""
    return wraps(draw)(lambda found: draw(found.entries))


FIGURES = {name: of_entries(draw) for name, draw in POPULATION_FIGURES.items()}


class LibraryFiles(Contents):
    """What commands show of a shape library."""

    title = "a shape library"

    def read(self, path: str | os.PathLike) -> Library:
        """Return all that a library holds."""
        return Library(read_library(path), read_settings(path))

    def summary(self, found: Library) -> Summary:
        """Return how many flocs of how many pictures, their sizes, and how they were fitted."""
        images = {entry.image for entry in found.entries}
        sizes = [MICRO * entry.measured_radius for entry in found.entries]
        banded = all(entry.is_banded for entry in found.entries)
        return Summary([
            ("shapes", f"{len(found.entries)} of {plural(len(images), 'picture')}"),
            ("r_eq", f"{min(sizes):.3g} to {max(sizes):.3g} µm"),
            *([("outlines", "as cut, and cut closer and wider (--band)")] if banded else []),
            *((name.replace("_", " "), str(value)) for name, value in found.settings.items()),
        ])  # fmt: skip

    def water(self, path: str | os.PathLike, allowed: object = None) -> list[str]:
        """Return lines on what slow flow makes of the flocs of a library."""
        rows = [["floc", "sinks", "at least", "turns", "B", "+- %"]]
        for entry in read_library(path):
            drag = prism_drag(entry.fits[max(entry.fits)].shape.outline())
            numbers = (*drag.mobility, drag.turning, drag.elongation)
            words = [*(f"{each:.3f}" for each in numbers), f"{100.0 * drag.error:.1f}"]
            rows.append([entry.floc_id, *words])
        heading = (
            f"Slow flow around {plural(len(rows) - 1, 'floc')}, as prisms 4/3 r_eq deep. Largest "
            "and smallest settling speed and rotation rate, relative to the equivalent sphere; B: "
            "response to strain, 1 for a line."
        )
        return [heading, *aligned(rows)]

    def table(self, found: Library) -> str:
        """Return the errors of the fits."""
        return format_errors(found.entries)

    def figures(self, found: Library) -> Figures:
        """Return the figures of a population."""
        return FIGURES

    def source(self, found: Library) -> str:
        """Return of how many flocs and pictures it is."""
        flocs, images = one_each(found.entries), {each.image for each in found.entries}
        return f"{plural(len(flocs), 'floc')} of {plural(len(images), 'picture')}"


LIBRARY = LibraryFiles()
