"""`flocsim shapes`: list the flocs of shape libraries, select some of them, merge libraries; and
what other commands show of one."""

import argparse
import fnmatch
import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import attrs

from flocsim.commands.fit import number
from flocsim.ensembles.contents import Contents, Summary
from flocsim.errors import UsageError, visible
from flocsim.hydrodynamics import prism_drag
from flocsim.io.fit_report import (
    coarse_line,
    errors_of,
    format_errors,
    measures_in,
    plural,
    population_lines,
)
from flocsim.io.labelled import Labelled, Tables
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.plots.shapes import POPULATION_FIGURES
from flocsim.io.plots.style import Figure
from flocsim.io.shape_library import (
    ShapeEntry,
    labelled_flocs,
    read_library,
    read_settings,
    write_library,
)
from flocsim.io.terminal import aligned

DESCRIPTION = """\
  flocsim shapes list shapes.h5
  flocsim shapes select shapes.h5 --min-radius 8e-6 --picture '02*.png' -o large.h5
  flocsim shapes select shapes.h5 --drop 023.png#7,025.png#1 -o good.h5
  flocsim shapes merge monday.h5 tuesday.h5 -o mud.h5

r_eq is that of the floc as it was measured: its pixels times the size of a pixel.  list also prints
the perimeter, the largest and least Feret diameter, aspect ratio, circularity 4 pi A/P^2 and
solidity of every floc, D10, D50 and D90 of the diameters 2 r_eq by number and by volume, and the
perimeter-based fractal dimension."""

MICRO = 1e6
MEASURES = ("perim um", "Feret um", "least um", "aspect", "circular", "solidity")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    listed = actions.add_parser("list", help="print sizes, shape measures and errors of every floc")
    chosen = actions.add_parser("select", help="write the selected flocs to a library")
    merged = actions.add_parser("merge", help="merge several libraries into one")
    for action in (listed, chosen, merged):
        action.add_argument("libraries", nargs="+", metavar="LIBRARY",
            help="shape library written by flocsim fit")  # fmt: skip
    for action in (listed, chosen):
        add = action.add_argument
        add("--keep", metavar="LIST", help="these flocs only, by name, separated by commas")
        add("--drop", metavar="LIST", help="all but these flocs")
        add("--picture", metavar="NAME",
            help="flocs of this picture only; * stands for any characters")  # fmt: skip
        add("--min-radius", metavar="METRES", help="flocs of at least this r_eq")
        add("--max-radius", metavar="METRES", help="flocs of at most this r_eq")
    for action in (chosen, merged):
        add = action.add_argument
        add("-o", "--output", required=True, metavar="FILE", help="shape library to write")
        add("--overwrite", action="store_true", help=OVERWRITE_HELP)


def run(args: argparse.Namespace) -> int:
    """List, select or merge; returns the exit code."""
    return run_list(args) if args.action == "list" else run_write(args)


def run_list(args: argparse.Namespace) -> int:
    """Print a line for every floc of every library."""
    for library in args.libraries:
        entries = selected(read_library(library), args, library)
        counts = [count for count in entries[0].fits if count > 1] if entries else []
        rows = [["name", "r_eq um", "pixel um", "r px", *MEASURES,
                 *(f"RE% N={count}" for count in counts)]]  # fmt: skip
        for each in entries:
            found = measures_in(each)
            lengths = (each.measured_radius, each.pixel_size)
            sizes = (found.perimeter, found.feret_max, found.feret_min)
            shares = (found.aspect_ratio, found.circularity, found.solidity)
            rows.append([
                visible(each.floc_id, keep=""), *(f"{MICRO * length:.4g}" for length in lengths),
                f"{each.spheroradius:g}", *(f"{MICRO * length:.4g}" for length in sizes),
                *(f"{share:.3f}" for share in shares),
                *(f"{each.fits[count].relative_error:.2f}" for count in counts),
            ])  # fmt: skip
        print("\n".join([f"{library}: {plural(len(entries), 'floc')}", *aligned(rows, left=1)]))
        if entries:
            print("\n".join(population_lines(entries)))
        if coarse := coarse_line(errors_of(entries)):
            print(f"warning: {coarse}: fit again with more --vertices")
        if any(each.measures is None for each in entries):
            print("shape measures of the finest fit where the library has none of the picture")
    return 0


def run_write(args: argparse.Namespace) -> int:
    """Write the flocs of all libraries to one, or those of them that meet all that is asked."""
    rule = data_rule(args.overwrite)
    check_outputs([Output(args.output, rule)], args.libraries)
    libraries, settings = read_all(args.libraries)
    every = merged_entries(libraries)
    selects = args.action == "select"
    entries = selected(every, args, ", ".join(args.libraries)) if selects else every
    if not entries:
        raise UsageError(
            f"{', '.join(args.libraries)}: none of {plural(len(every), 'floc')} matches, nothing "
            "was written; flocsim shapes list names them"
        )
    write_library(args.output, entries, settings, rule)
    of = len(every) if selects else f"{len(libraries)} libraries"
    print(f"{args.output}: {plural(len(entries), 'floc')} of {of}")
    return 0


def read_all(paths):
    """[(path, entries)] of libraries, and their settings, all values where they do not agree."""
    libraries = [(path, read_library(path)) for path in paths]
    first = tuple(libraries[0][1][0].fits)
    for path, entries in libraries:
        if tuple(entries[0].fits) != first:
            here, there = (", ".join(map(str, counts)) for counts in (entries[0].fits, first))
            raise UsageError(
                f"{path} has fits at N = {here}, {paths[0]} at N = {there}: fit both at the same "
                "--vertices"
            )
    settings = [read_settings(path) for path in paths]
    keys = dict.fromkeys(key for each in settings for key in each)
    found = {
        key: list(dict.fromkeys(each.get(key, "unknown") for each in settings)) for key in keys
    }
    return libraries, {
        key: each[0] if len(each) == 1 else ", ".join(map(str, each)) for key, each in found.items()
    }


def merged_entries(libraries):
    """The entries of [(path, entries)]; a name that has come before gets its library's in front.

    So does its picture's, or flocs of two pictures of one name would count as of one.
    """
    taken: set[str] = set()
    merged: list[ShapeEntry] = []
    for path, entries in libraries:
        front = ""
        while any(front + each.floc_id in taken for each in entries):
            front += f"{Path(path).stem}/"
        for each in entries:
            merged.append(
                attrs.evolve(each, floc_id=front + each.floc_id, image=front + each.image)
            )
            taken.add(front + each.floc_id)
    return merged


def selected(entries, args, source):
    """The entries that --keep, --drop, --picture and the limits of r_eq let through."""
    least, most = (
        float(unset) if text is None
        else number(option, text, "a radius in metres, a number above 0", 5e-324, 1.0)
        for option, text, unset in (
            ("--min-radius", args.min_radius, 0), ("--max-radius", args.max_radius, "inf"),
        )
    )  # fmt: skip
    keep, drop = (named(option, getattr(args, option), entries, source)
                  for option in ("keep", "drop"))  # fmt: skip
    return [
        each
        for each in entries
        if (keep is None or keep & names_of(each))
        and not (drop and drop & names_of(each))
        and (args.picture is None or fnmatch.fnmatchcase(each.image, args.picture))
        and least <= each.measured_radius <= most
    ]


def named(option, text, entries, source):
    """The names in a list, all of which flocs have; None for no list.

    A name may stand for a floc at all of its spheroradii: 023.png#7 for "023.png#7 r=2".
    """
    if text is None:
        return None
    known = set().union(*(names_of(each) for each in entries))
    names, begun = set(), ""
    for piece in text.split(","):
        begun += piece
        if begun.strip() in known:
            names.add(begun.strip())
            begun = ""
        else:
            begun += ","  # a name with a comma in it
    if begun:
        raise UsageError(
            f"--{option}: {source} has no floc {begun.rstrip(',')!r}; flocsim shapes list names "
            "them"
        )
    return names


def names_of(entry):
    return {entry.floc_id, entry.floc_id.removesuffix(f" r={entry.spheroradius:g}")}


INDICES = {"flocs": ("floc",)}


@attrs.frozen(eq=False)
class Library(Tables):
    """The flocs of a library, and what their fits were made with."""

    entries: list[ShapeEntry]
    settings: dict[str, Any]
    indices = INDICES

    def labelled(self, group: str = "flocs") -> Labelled:
        """The flocs, without their fits; UsageError for another group."""
        self.known(group)
        return labelled_flocs(self.entries)


def read(path: str | os.PathLike) -> Library:
    """All that a library holds."""
    return Library(read_library(path), read_settings(path))


def summary(found: Library) -> Summary:
    """How many flocs of how many pictures, their sizes, and how they were fitted."""
    images = sorted({entry.image for entry in found.entries})
    sizes = [1e6 * entry.measured_radius for entry in found.entries]
    facts = [
        ("shapes", f"{len(found.entries)} of {len(images)} pictures"),
        ("r_eq", f"{min(sizes):.3g} to {max(sizes):.3g} µm"),
        *(
            [("outlines", "as cut, and at both ends of their bands (--band)")]
            if all(entry.is_banded for entry in found.entries)
            else []
        ),
        *((name.replace("_", " "), str(value)) for name, value in found.settings.items()),
    ]
    return Summary(facts)


def water(path: str | os.PathLike, allowed: object = None) -> list[str]:
    """What slow flow makes of the flocs of a library."""
    entries = read_library(path)
    rows: list[tuple[str, ...]] = [("floc", "sinks", "at least", "turns", "B", "+- %")]
    for entry in entries:
        count = max(entry.fits)
        drag = prism_drag(entry.fits[count].shape.outline())
        rows.append((
            visible(entry.floc_id, ""), *(f"{each:.3f}" for each in drag.mobility),
            f"{drag.turning:.3f}", f"{drag.elongation:.3f}", f"{100.0 * drag.error:.1f}",
        ))  # fmt: skip
    heading = (
        f"prisms of {len(entries)} outlines, 4/3 r_eq deep: largest and least settling speed, and "
        "rate of turning, over those of the equivalent spheres; B, the response to strain, over "
        "that of a line"
    )
    return [heading, *aligned(rows)]


def of_entries(draw: Callable[[Any], Figure]) -> Callable[[Library], Figure]:
    """A figure of flocs as one of a Library."""
    return wraps(draw)(lambda found: draw(found.entries))


FIGURES = {name: of_entries(draw) for name, draw in POPULATION_FIGURES.items()}

LIBRARY = Contents(
    title="a shape library",
    read=read,
    summary=summary,
    table=lambda found: format_errors(found.entries),
    figures=lambda found: FIGURES,
    source=lambda found: (
        f"{plural(len(found.entries), 'floc')} of "
        f"{plural(len({each.image for each in found.entries}), 'picture')}"
    ),
    drawn={"a shape library written by flocsim fit": FIGURES},
    water=water,
)
