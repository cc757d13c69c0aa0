"""`flocsim fit`: pictures of flocs → a library of fitted shapes."""

import argparse
import sys
from pathlib import Path

from flocsim.commands.fit_pictures import (
    LOST,
    distinct,
    draw,
    draw_fits,
    expected_overlays,
    fit_pictures,
    list_pictures,
    pictures_beneath,
    report,
    stem_of,
    titles_of,
)
from flocsim.errors import UsageError
from flocsim.fields import read_number
from flocsim.io.files import make_folder, write_file
from flocsim.io.fit_report import (
    coarse_line,
    errors_of,
    format_errors,
    plural,
    population_lines,
    summary_text,
)
from flocsim.io.images.masks import MASK_SUFFIXES
from flocsim.io.images.paper import CUTOFF
from flocsim.io.images.pictures import label_image, read_names
from flocsim.io.images.stacks import LARGEST_PIXEL, SMALLEST_PIXEL, TIFF_SUFFIXES, page_numbers
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.plots.style import checked_format
from flocsim.io.shape_library import make_entry, write_library
from flocsim.plausibility import PIXEL_SIZE

NOT_THE_PAPERS = {
    "masks": False, "background": "surface", "threshold": None, "noise_scale": "1",
    "saturated": "0.001",
}  # fmt: skip
"""Options that --finder paper has no use for, and their defaults."""

DESCRIPTION = """\
Find the flocs in pictures, fit a spheropolygon to each at every requested number of vertices, and
write them to a shape library.  The circle of equal area (N = 1) is always stored too.  A table
beside the library lists every region, with the reason for those left out.

  flocsim fit frames/ --pixel-size 0.95e-6 --vertices 4,8,16,64 --radius 1 -o shapes.h5
  flocsim plot shapes.h5          # sizes, and errors against N: the paper's Figs 2 and 3"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    add = parser.add_argument
    add("images", nargs="+", metavar="IMAGE", help="picture, or folder of pictures")
    add("--pixel-size", metavar="LENGTH",
        help="length of a pixel's side, e.g. '0.95 um', or in metres: 0.95e-6 (default: as given "
        "in an OME-TIFF or ImageJ file)")  # fmt: skip
    add("--page", metavar="LIST",
        help="pages of a stack to use, counted from 1, separated by commas, or all")  # fmt: skip
    add("--channel", metavar="K",
        help="channel or colour to use: a number from 1, or a name")  # fmt: skip
    add("--crop", metavar="X,Y,W,H",
        help="part of every picture to use: left, top, width, height in pixels")  # fmt: skip
    add("--vertices", default="4,8,16,64", metavar="LIST",
        help="numbers of vertices, separated by commas (default: %(default)s)")  # fmt: skip
    add("--radius", default="1", metavar="LIST",
        help="spheroradius in pixels, or several, separated by commas (default: "
        "%(default)s)")  # fmt: skip
    add("--method", default="pattern", choices=("pattern", "paper", "even"),
        help="pattern: smallest error; paper: the paper's damped dynamics; even: points evenly "
        "spaced on the outline, as a baseline (default: %(default)s)")  # fmt: skip
    add(
        "--preserve-area", action="store_true", help="give every shape exactly the area of its floc"
    )
    add("--inscribed", action="store_true", help="keep every shape inside its floc")
    add("--holes", action="store_true",
        help="keep the largest holes of flocs: the vertices are shared between the outline and "
        "the holes, and area and centroid are those without the holes")  # fmt: skip
    add("--band", action="store_true",
        help="fit every floc three times, as it is cut and at both ends of its band, for "
        '[shapes] outlines = "band": the error of a probability by the cut')  # fmt: skip
    add("--jobs", default="1", metavar="K", help="number of processes (default: %(default)s)")
    add("--masks", action="store_true",
        help="treat the files as masks or labels (PNG, TIFF, .npy, .npz), not "
        "pictures")  # fmt: skip
    add("-o", "--output", default="shapes.h5", metavar="FILE",
        help="shape library to write (default: %(default)s)")  # fmt: skip
    add("--summary", metavar="FILE",
        help="table of all regions, with the reason for rejected ones (default: beside the "
        "library, ending in .csv)")  # fmt: skip
    add("--overlay", metavar="FILE",
        help="draw the outlines at the largest N over the picture (.png, .pdf, .svg), and "
        "rejected regions dashed, with the reason; with several pictures, one file each: "
        "FILE-picture.png")  # fmt: skip
    add("--fits", metavar="FOLDER",
        help="draw every fit at the largest N: mask, core, the outline swept by the disk, and the "
        "pixels that differ")  # fmt: skip
    add("--pictures", metavar="FOLDER",
        help="with --masks: folder of the pictures of the same names, so that the overlay is "
        "drawn over them and not over the masks")  # fmt: skip
    add("--masks-out", metavar="FOLDER",
        help="write a label image of every picture, 0 outside and the number of each floc inside "
        "it (16-bit PNG), which can be edited and read back by --masks")  # fmt: skip
    add("--memory", default="1.3", metavar="GB",
        help="memory that a picture may take; larger ones are refused before the work begins "
        "(default: %(default)s)")  # fmt: skip
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)
    add = parser.add_argument_group("finding flocs").add_argument
    add("--finder", default="steepest", choices=("steepest", "paper"),
        help="steepest: each floc is cut where its outline is steepest, against uneven light; "
        "paper: as in the paper, a low-pass, stretched grey and Otsu's threshold (default: "
        "%(default)s)")  # fmt: skip
    add("--cutoff", metavar="FREQUENCY",
        help="with --finder paper: cycles per pixel of which the low-pass lets half through, above "
        "0, to 0.5 (default: 0.2)")  # fmt: skip
    add("--flocs", default="auto", choices=("auto", "bright", "dark"),
        help="whether flocs are brighter or darker than the background (default: "
        "%(default)s)")  # fmt: skip
    add("--background", default="surface", choices=("surface", "median"),
        help="surface: fitted to each picture; median: of all pictures, which a fixed camera took "
        "(default: %(default)s)")  # fmt: skip
    add("--threshold", metavar="CONTRAST",
        help="contrast from which a pixel belongs to a floc, above 0 to 1: for dark flocs the "
        "share of the light that they absorb, for bright ones the grey above the background, "
        "white being 1 (default: found for each floc; the median is printed)")  # fmt: skip
    add("--noise-scale", default="1", metavar="PX",
        help="detail finer than this is noise (default: %(default)s)")  # fmt: skip
    add("--saturated", default="0.001", metavar="SHARE",
        help="share of a floc's pixels whose contrast is too high to count for its level "
        "(default: %(default)s)")  # fmt: skip
    add("--min-radius", default="4", metavar="PX",
        help="smallest r_eq of a floc (default: %(default)s)")  # fmt: skip
    add("--max-radius", metavar="PX", help="largest r_eq of a floc")
    add("--max-blur", default="0.25", metavar="SHARE",
        help="a region is out of focus where the softness of half of its outline exceeds this "
        "share of r_eq, unless it is below 3.5 px; inf: keep all (default: "
        "%(default)s)")  # fmt: skip
    add("--neck", metavar="SHARE",
        help="separate touching flocs at necks of up to this share of the smaller one's width; 0: "
        "never (default: 0.5, only where the parts are so compact that they are surely two "
        "flocs, and never in a picture of fractal aggregates)")  # fmt: skip
    add("--max-flocs", metavar="K", help="fit only the K largest flocs of every picture")
    add("--drop", metavar="LIST",
        help="flocs to leave out, by their numbers in the overlay and the table: 3,5 with one "
        "picture, 023.png#3,5 with several")  # fmt: skip
    add("--keep", metavar="LIST", help="fit only these regions, named as for --drop")
    add("--add", metavar="LIST", help="also fit these regions, which would otherwise be left out")


def run(args: argparse.Namespace) -> int:
    """Fit, print what was found and write the library; returns the exit code."""
    read_numbers(args)
    summary = args.summary or Path(args.output).with_suffix(".csv")
    if args.overlay is not None:
        checked_format(args.overlay, "--overlay ")
    paths = list_pictures(args.images, args.masks)
    if args.pixel_size is None and not any(p.suffix.lower() in TIFF_SUFFIXES for p in paths):
        raise UsageError(
            "--pixel-size is missing, and only OME-TIFF and ImageJ files give the size of a "
            "pixel; give the length of its side, for example --pixel-size '0.95 um'"
        )
    beneath = pictures_beneath(args.pictures, paths, args.masks and args.overlay is not None)
    rule, drawn = data_rule(args.overwrite), data_rule(args.overwrite)
    outputs = [Output(args.output, rule), Output(summary, rule)]
    if args.overlay is not None:
        outputs += [Output(path, drawn) for path in expected_overlays(args.overlay, paths)]
    if args.fits is not None:
        make_folder(args.fits, "--fits ")
    if args.masks_out is not None:
        make_folder(args.masks_out, "--masks-out ")
        made = label_paths(args.masks_out, titles_of(paths)).values()
        outputs += [Output(path, rule) for path in made]
    check_outputs(outputs, [*paths, *beneath.values()])
    doubt = args.pixel_size and PIXEL_SIZE.doubt("--pixel-size", args.pixel_size)
    if doubt:
        report(f"warning: {doubt}")
    try:
        pictures, lost = fit_pictures(paths, args)
    except KeyboardInterrupt:
        print("flocsim: interrupted; no shape library was written", file=sys.stderr)
        return 130
    if args.pixel_size is None:
        doubt = say_sizes(pictures)
    if args.masks_out is not None:
        write_labels(args.masks_out, pictures, titles_of(paths), rule)
    entries = [
        make_entry(picture, region, picture.fits[region.label], radius, len(args.radii) > 1)
        for radius in args.radii for picture in pictures for region in picture.regions
    ]  # fmt: skip
    table = summary_text(pictures).encode()
    if not entries:
        if args.summary:
            write_file(summary, table, rule)
        print("flocsim: nothing was fitted, no shape library was written", file=sys.stderr)
        return LOST if lost else 2
    settings = {"method": args.method, "preserve_area": args.preserve_area,
                "inscribed": args.inscribed} | ({"warning": doubt} if doubt else {})  # fmt: skip
    if args.finder == "paper":
        settings |= {"finder": "paper", "cutoff": args.segmentation["cutoff"]}
    if args.holes:
        settings["holes"] = True
    write_library(args.output, entries, settings, rule)
    write_file(summary, table, rule)
    if args.overlay is not None:
        lost += draw(Path(args.overlay), pictures, args, drawn, len(paths) > 1, beneath)
    if args.fits is not None:
        draw_fits(args.fits, pictures, args, drawn)
    print("\n".join([format_errors(entries), *population_lines(entries)]))
    if coarse := coarse_line(errors_of(entries)):
        print(f"warning: {coarse} (--vertices)")
    counts, flocs = ", ".join(map(str, args.vertices)), sum(len(each.regions) for each in pictures)
    print(f"{args.output}: {plural(flocs, 'floc')} at N = {counts}; {summary}: all regions")
    if not lost:
        return 0
    report(f"lost: {', '.join(lost)}; all else was written")
    return LOST


def read_numbers(args: argparse.Namespace) -> None:
    """Put values in the place of the texts in argparse's arguments: lengths [m or px], counts; with
    1 among the ``vertices``, ``radii`` rising, ``segmentation`` {option of `segment`: value} and a
    ``correction``. UsageError for what does not make sense."""
    if args.masks and (args.page or args.channel or args.crop):
        raise UsageError("--page, --channel and --crop apply to pictures, not to --masks")
    if args.page not in (None, "all"):
        page_numbers(args.page)
    if args.inscribed and (args.preserve_area or args.method != "pattern"):
        raise UsageError(
            "--inscribed needs --method pattern and excludes --preserve-area: a shape inside its "
            "floc has less than its area"
        )
    if args.finder == "paper":
        for option, default in NOT_THE_PAPERS.items():
            if getattr(args, option) != default:
                name = option.replace("_", "-")
                raise UsageError(
                    f"--{name} does not apply to --finder paper: leave one of them out"
                )
    elif args.cutoff is not None:
        raise UsageError("--cutoff applies to --finder paper only")
    if args.band and (args.masks or args.holes):
        raise UsageError(
            "--band excludes --masks, which do not show where else an outline might be, and --holes"
        )
    limit = float("inf") if args.max_radius is None else positive("--max-radius", args.max_radius)
    endless = args.max_blur.strip() == "inf"
    threshold, neck = args.threshold, args.neck
    if threshold is not None:
        threshold = number("--threshold", threshold, "a contrast above 0, to 1", 5e-324, 1.0)
    args.correction = {
        key: () if text is None else read_names(f"--{key}", text)
        for key, text in (("drop", args.drop), ("keep", args.keep), ("add", args.add))
    }
    args.segmentation = {
        "flocs": args.flocs,
        "min_radius": positive("--min-radius", args.min_radius),
        "max_radius": limit,
        "max_blur": float("inf") if endless else positive("--max-blur", args.max_blur, "a share"),
        "neck": None if neck is None else number("--neck", neck, "a share from 0 to 1", 0.0, 1.0),
    }
    if args.finder == "paper":
        cutoff = CUTOFF if args.cutoff is None else args.cutoff
        most = "cycles per pixel above 0, to 0.5"
        args.segmentation["cutoff"] = number("--cutoff", cutoff, most, 1e-6, 0.5)
        args.segmentation["neck"] = args.segmentation["neck"] or 0.0
    else:
        args.segmentation |= {
            "threshold": threshold,
            "noise_scale": number(
                "--noise-scale", args.noise_scale, "pixels, at least 0", 0.0, 1e3
            ),
            "saturated": number(
                "--saturated", args.saturated, "a share from 0 to below 1", 0.0, 0.999
            ),
        }
    args.memory = 1e9 * positive("--memory", args.memory, "gigabytes")
    args.pixel_size = args.pixel_size and length("--pixel-size", args.pixel_size)
    args.crop = args.crop and rectangle(args.crop)
    args.vertices = sorted({1, *(whole("--vertices", each) for each in args.vertices.split(","))})
    args.radii = sorted({positive("--radius", each, "pixels") for each in args.radius.split(",")})
    args.max_flocs = None if args.max_flocs is None else whole("--max-flocs", args.max_flocs)
    args.jobs = whole("--jobs", args.jobs)


def number(option, text, meaning, least, most):
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not least <= value <= most:
        raise UsageError(f"{option} takes {meaning}, found {text!r}")
    return value


def positive(option, text, meaning="pixels"):
    return number(option, text, f"{meaning}, a number above 0", 5e-324, 1.7e308)


def length(option, text):
    """A length above 0 [m]: "0.95 um", or a number of metres."""
    value, hint = 0.0, ""
    try:
        value = read_number(text, "m")
    except ValueError as reason:
        hint = f" ({reason})" if str(reason) else ""
    if not SMALLEST_PIXEL <= value <= LARGEST_PIXEL:
        raise UsageError(
            f"{option} takes a length above 0 such as '0.95 um', or in metres, from "
            f"{SMALLEST_PIXEL:g} to {LARGEST_PIXEL:g}, found {text!r}{hint}"
        )
    return value


def rectangle(text):
    """(x, y, width, height) [px] of --crop."""
    numbers = [each.strip() for each in text.split(",")]
    if len(numbers) != 4 or not all(each.isdecimal() and each.isascii() for each in numbers):
        raise UsageError(f"--crop takes X,Y,WIDTH,HEIGHT in pixels, found {text!r}")
    x, y, width, height = map(int, numbers)
    if not (width and height):
        raise UsageError(f"--crop takes a width and a height above 0, found {text!r}")
    return x, y, width, height


def say_sizes(pictures):
    """Print the sizes of pixels that files give; what is odd of them in words, or ""."""
    names: dict[float, str] = {}
    for picture in pictures:
        names.setdefault(picture.pixel_size, picture.name)
    for size, name in names.items():
        print(f"pixel size {1e6 * size:.4g} um, as {name} says")
    doubts = [PIXEL_SIZE.doubt(f"the pixel size of {name}", size) for size, name in names.items()]
    for doubt in filter(None, doubts):
        report(f"warning: {doubt}")
    return "; ".join(filter(None, doubts))


def whole(option, text):
    if not text.strip().isdecimal() or int(text) < 1:
        raise UsageError(f"{option} takes whole numbers from 1, found {text!r}")
    return int(text)


def label_paths(folder, names):
    """{name of a picture: path of its label image}, all different."""
    made = distinct((stem_of(name, MASK_SUFFIXES) for name in names), ".png")
    return {name: Path(folder, file) for name, file in zip(names, made, strict=True)}


def write_labels(folder, pictures, titles, rule):
    """Write the label images of --masks-out, of what is fitted; titles: of all files."""
    paths = label_paths(folder, dict.fromkeys([*titles, *(each.name for each in pictures)]))
    for picture in pictures:
        image = label_image(picture.found.foreground.shape, picture.regions, picture.name)
        write_file(paths[picture.name], image, rule)
