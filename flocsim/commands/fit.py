"""`flocsim fit`: pictures of flocs → a library of fitted shapes."""

import sys
from pathlib import Path

from flocsim.commands import fit_work
from flocsim.commands.fit_options import add_options, add_output, add_segmentation, read_options
from flocsim.errors import FileError, FlocsimError, UsageError

DESCRIPTION = """\
Find the flocs of pictures, fit a spheropolygon to each at every number of vertices asked for, and
write them to a shape library.  The circle of equal area (N = 1) is always stored too.  Every
region, also those left out and why, goes to a table beside the library.

  flocsim fit frames/ --pixel-size 0.95e-6 --vertices 4,8,16,64 --radius 1 -o shapes.h5
  flocsim plot shapes.h5          # sizes, and errors against N: the paper's Figs 2 and 3"""


def add_parser(subparsers):
    """Add the subcommand to argparse's ``subparsers``."""
    import argparse

    parser = subparsers.add_parser(
        "fit",
        help="fit spheropolygons to the flocs of pictures",
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_options(parser.add_argument)
    add_output(parser.add_argument)
    add_segmentation(parser.add_argument_group("finding the flocs").add_argument)
    parser.set_defaults(run=run)
    return parser


def run(args):
    """Fit, print what was found and write the library; returns the exit code."""
    options = read_options(args)
    summary = args.summary or Path(args.output).with_suffix(".csv")
    for output in (args.output, summary):
        check_output(output)
    check_overlay(args.overlay)
    try:
        pictures, fits = fit_pictures(args.images, options)
    except KeyboardInterrupt:
        print("flocsim: interrupted; no shape library was written", file=sys.stderr)
        return 130
    entries = make_entries(pictures, fits, options)
    if not entries:
        write_summary(summary, pictures, fits, options)
        print("flocsim: nothing was fitted, no shape library was written", file=sys.stderr)
        return 2
    write(args, summary, pictures, fits, entries, options)
    return 0


def check_output(path):
    """Raise FileError before the long work if a file could not be written at its end."""
    import os

    from flocsim.io.files import ordinary_target

    folder = ordinary_target(path).parent
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise FileError(f"{path} cannot be written: {folder} is no folder that can be written to")


def check_overlay(path):
    """Raise UsageError before the long work if the overlay's name has no known ending."""
    from flocsim.io.plots.figures import FORMATS

    if path is not None and Path(path).suffix.lower().removeprefix(".") not in FORMATS:
        raise UsageError(f"--overlay {path} must end in .{', .'.join(FORMATS)}")


def report(error):
    """One line on stderr, for a picture that is skipped."""
    print(f"flocsim: {error}", file=sys.stderr, flush=True)


def fit_pictures(names, options):
    """Pictures, and for each of their regions {radius: {N: Fit}}."""
    from flocsim.io.terminal import Progress

    paths = fit_work.list_pictures(names, options.masks, report)
    background = fit_work.find_background(paths, options)
    repeated = [path.name for path in paths]
    # Pictures of one name in several folders are told apart by their paths.
    titles = [p.name if repeated.count(p.name) == 1 else p.as_posix() for p in paths]
    tasks = [(p, t, background, options) for p, t in zip(paths, titles, strict=True)]
    with fit_work.workers(options.jobs) as mapped:
        pictures = list(found_pictures(mapped(fit_work.find_flocs, tasks), options))
        regions = [(each.name, region) for each in pictures for region in each.regions]
        masks = [(f"{name}#{region.label}", region.mask, options) for name, region in regions]
        progress = Progress(len(masks), not sys.stderr.isatty(), sys.stderr, "flocs")
        fits = []
        for fit in mapped(fit_work.fit_region, masks):
            fits.append(fit)
            progress.report(len(masks) - len(fits))
        progress.finish()
    return pictures, fits


def found_pictures(results, options):
    """The pictures among the results, each with its line printed; errors are reported."""
    from flocsim.io.shapes.fit_report import describe, warn_of_coarse

    for result in results:
        if isinstance(result, FlocsimError):
            report(result)
            continue
        for picture in result:
            print(describe(picture.name, picture.found, len(picture.regions)), flush=True)
            warn_of_coarse(picture.name, picture.regions, options.radii)
            yield picture


def make_entries(pictures, fits, options):
    """ShapeEntries of all flocs, for every spheroradius."""
    from flocsim.io.shapes.library import make_entry

    flocs = [(picture, region) for picture in pictures for region in picture.regions]
    several = len(options.radii) > 1
    return [
        make_entry(picture.name, region, fit[radius], options.pixel_size, radius, several)
        for radius in options.radii
        for (picture, region), fit in zip(flocs, fits, strict=True)
    ]


def write(args, summary, pictures, fits, entries, options):
    """Write library, table and overlays; print the table of errors."""
    from flocsim.io.shapes.fit_report import format_errors, plural
    from flocsim.io.shapes.library import write_library

    settings = {"method": options.method, "preserve_area": options.preserve_area,
                "inscribed": options.inscribed}  # fmt: skip
    write_library(args.output, entries, settings)
    write_summary(summary, pictures, fits, options)
    if args.overlay is not None:
        draw(args.overlay, pictures, fits, options)
    print(format_errors(entries))
    counts = ", ".join(map(str, options.vertices))
    print(f"{args.output}: {plural(len(fits), 'floc')} at N = {counts}; {summary}: all regions")


def write_summary(path, pictures, fits, options):
    """Write the table of all regions."""
    from flocsim.io.files import replace_file
    from flocsim.io.shapes.fit_summary import summary_text

    replace_file(path, summary_text(pictures, fits, options.pixel_size).encode())


def draw(overlay, pictures, fits, options):
    """Write each picture with the outlines at the largest N and the smallest spheroradius."""
    from flocsim.io.images.pictures import read_grey
    from flocsim.io.plots.figures import save
    from flocsim.io.plots.fit import draw_overlay
    from flocsim.io.shapes.fit_report import plural

    most, radius, results = options.vertices[-1], options.radii[0], iter(fits)
    for picture in pictures:
        flocs = [(region, next(results)[radius][most]) for region in picture.regions]
        title = f"{picture.name}: {plural(len(flocs), 'floc')}, N = {most}, r = {radius:g} px"
        grey = picture.found.foreground if options.masks else read_grey(picture.path)
        figure = draw_overlay(grey, flocs, title, picture.found.rejected)
        save(figure, overlay_path(overlay, picture, several=len(pictures) > 1))


def overlay_path(overlay, picture, several):
    """Where a picture's overlay goes."""
    overlay = Path(overlay)
    stem = Path(picture.name.replace(":", "-").replace("/", "-"))
    stem = stem.stem if stem.suffix.lower() == picture.path.suffix.lower() else stem.name
    return overlay.with_name(f"{overlay.stem}-{stem}{overlay.suffix}") if several else overlay
