"""`flocsim fit`: pictures of flocs → a library of fitted shapes."""

import sys
from pathlib import Path

from flocsim.errors import FileError, ImageError, UsageError

DESCRIPTION = """\
Find the flocs of pictures, fit a spheropolygon to each at every number of vertices asked for, and
write them to a shape library.  The circle of equal area (N = 1) is always stored too.

  flocsim fit frames/ --pixel-size 0.95e-6 --vertices 4,8,16,64 --radius 1 -o shapes.h5"""


def add_parser(subparsers):
    """Add the subcommand to argparse's ``subparsers``."""
    import argparse

    parser = subparsers.add_parser(
        "fit",
        help="fit spheropolygons to the flocs of pictures",
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("images", nargs="+", metavar="IMAGE", help="picture, or folder of pictures")
    add(
        "--pixel-size",
        required=True,
        metavar="METRES",
        help="length of a pixel's side in metres, e.g. 0.95e-6",
    )
    add(
        "--vertices",
        default="4,8,16,64",
        metavar="LIST",
        help="numbers of vertices with commas between them (default: %(default)s)",
    )
    add("--radius", default="1", metavar="PX", help="spheroradius in pixels (default: %(default)s)")
    add(
        "-o",
        "--output",
        default="shapes.h5",
        metavar="FILE",
        help="shape library to write (default: %(default)s)",
    )
    add(
        "--flocs",
        default="auto",
        choices=("auto", "bright", "dark"),
        help="how flocs stand out from the background (default: %(default)s)",
    )
    add(
        "--min-radius",
        default="4",
        metavar="PX",
        help="equivalent radius below which a region is no floc (default: %(default)s)",
    )
    add("--max-flocs", metavar="K", help="fit the K largest flocs of every picture only")
    add(
        "--method",
        default="pattern",
        choices=("pattern", "even"),
        help="pattern: search for the least error; even: points evenly on the outline, the plain "
        "baseline (default: %(default)s)",
    )
    add("--overlay", metavar="FILE",
        help="draw the outlines at the largest N over the picture (.png, .pdf, .svg); with several "
        "pictures, one file each: FILE-picture.png")  # fmt: skip
    parser.set_defaults(run=run)
    return parser


def run(args):
    """Fit, print what was found and write the library; returns the exit code."""
    options = read_options(args)
    check_output(args.output)
    check_overlay(args.overlay)
    try:
        entries = fit_pictures(list_pictures(args.images), args, options)
    except KeyboardInterrupt:
        print("flocsim: interrupted; no shape library was written", file=sys.stderr)
        return 130
    if not entries:
        print("flocsim: nothing was fitted, no shape library was written", file=sys.stderr)
        return 2

    from flocsim.io.fit_report import format_errors, plural
    from flocsim.io.shape_library import write_library

    write_library(args.output, entries)
    print(format_errors(entries))
    counts = ", ".join(map(str, options["vertices"]))
    print(f"{args.output}: {plural(len(entries), 'floc')} at N = {counts}")
    return 0


def read_options(args):
    """The numbers among the options, checked: UsageError for any that does not make sense."""
    return {
        "pixel_size": positive("--pixel-size", args.pixel_size, "a length in metres"),
        "radius": positive("--radius", args.radius, "pixels"),
        "min_radius": positive("--min-radius", args.min_radius, "pixels"),
        "vertices": vertex_counts(args.vertices),
        "max_flocs": None if args.max_flocs is None else whole("--max-flocs", args.max_flocs),
    }


def positive(option, text, meaning):
    """A finite number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 < value < float("inf"):
        raise UsageError(f"{option} takes {meaning}, a number above 0, found {text!r}")
    return value


def whole(option, text):
    """A whole number from 1."""
    if not text.strip().isdecimal() or int(text) < 1:
        raise UsageError(f"{option} takes whole numbers from 1, found {text!r}")
    return int(text)


def vertex_counts(text):
    """Sorted numbers of vertices without repeats, 1 among them."""
    return sorted({1, *(whole("--vertices", part) for part in text.split(","))})


def check_output(path):
    """Raise FileError before the long work if the library could not be written at its end."""
    import os

    from flocsim.io.files import ordinary_target

    folder = ordinary_target(path).parent
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise FileError(f"{path} cannot be written: {folder} is no folder that can be written to")


def check_overlay(path):
    """Raise UsageError before the long work if the overlay's name has no known ending."""
    from flocsim.io.plots import FORMATS

    if path is not None and Path(path).suffix.lower().removeprefix(".") not in FORMATS:
        raise UsageError(f"--overlay {path} must end in .{', .'.join(FORMATS)}")


def list_pictures(names):
    """The pictures' paths, folders replaced by the pictures in them; each path once."""
    from flocsim.io.image_reading import SUFFIXES

    paths = []
    for path in map(Path, names):
        inside = sorted(path.iterdir()) if path.is_dir() else [path]
        found = [p for p in inside if not path.is_dir() or p.suffix.lower() in SUFFIXES]
        if not found:
            report(ImageError(f"{path}: the folder holds no pictures ({', '.join(SUFFIXES)})"))
        paths += found
    return list(dict.fromkeys(paths))


def report(error):
    """One line on stderr, for a picture that is skipped."""
    print(f"flocsim: {error}", file=sys.stderr, flush=True)


def fit_pictures(paths, args, options):
    """ShapeEntries of all pictures; those that cannot be used are reported and skipped."""
    names = [path.name for path in paths]
    entries = []
    for path in paths:
        # Pictures of one name in several folders are told apart by their paths.
        name = path.name if names.count(path.name) == 1 else path.as_posix()
        overlay = overlay_path(args.overlay, path, several=len(paths) > 1)
        try:
            entries += fit_picture(path, name, overlay, args, options)
        except ImageError as error:
            report(error)
    return entries


def overlay_path(overlay, picture, several):
    """Where a picture's overlay goes, None for nowhere."""
    if overlay is None or not several:
        return overlay
    overlay = Path(overlay)
    return overlay.with_name(f"{overlay.stem}-{picture.stem}{overlay.suffix}")


def fit_picture(path, name, overlay, args, options):
    """ShapeEntries of one picture, its line printed, its overlay drawn."""
    from flocsim.io.fit_report import describe, show_progress, warn_of_coarse
    from flocsim.io.images import read_grey, segment
    from flocsim.io.shape_library import make_entry

    grey = read_grey(path)
    found = segment(grey, flocs=args.flocs, min_radius=options["min_radius"])
    regions = largest(found.regions, options["max_flocs"])
    fits = []
    for region in regions:
        show_progress(name, len(fits), len(regions))
        fits.append(fit_region(region, args.method, options))
    print(describe(name, found, len(regions)), flush=True)
    warn_of_coarse(name, regions, options["radius"])
    if overlay is not None:
        draw(overlay, grey, name, regions, fits, options)
    pixel_size, radius = options["pixel_size"], options["radius"]
    return [
        make_entry(name, region, fit, pixel_size, radius)
        for region, fit in zip(regions, fits, strict=True)
    ]


def largest(regions, count):
    """The `count` largest regions, in their old order; all for None."""
    by_size = sorted(regions, key=lambda region: (-region.area, region.label))[:count]
    return sorted(by_size, key=lambda region: region.label)


def fit_region(region, method, options):
    """{N: Fit} of one floc."""
    import warnings

    from flocsim.geometry.fit import fit_mask

    with warnings.catch_warnings():
        # Said once a picture, by warn_of_coarse, not once a floc and N.
        warnings.simplefilter("ignore", UserWarning)
        return {
            count: fit_mask(region.mask, vertices=count, radius=options["radius"], method=method)
            for count in options["vertices"]
        }


def draw(overlay, grey, name, regions, fits, options):
    """Write the picture with the outlines at the largest N."""
    from flocsim.io.plot_fit import draw_overlay
    from flocsim.io.plots import save

    most = options["vertices"][-1]
    flocs = [(region, fit[most]) for region, fit in zip(regions, fits, strict=True)]
    title = f"{name}: {len(flocs)} flocs, N = {most}, r = {options['radius']:g} px"
    save(draw_overlay(grey, flocs, title), overlay)
