"""`flocsim fit`: pictures of flocs → a library of fitted shapes."""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from flocsim.commands import add_overwrite
from flocsim.commands.fit_pictures import (
    draw_fits,
    draw_review,
    files_of,
    fit_pictures,
    list_pictures,
    report,
    titles_of,
)
from flocsim.errors import FlocsimError, UsageError, plural
from flocsim.fields import read_number
from flocsim.io.arguments import number, positive, several, whole
from flocsim.io.files import make_folder, write_file
from flocsim.io.fit_report import format_errors, population_lines, summary_text
from flocsim.io.images.paper import CUTOFF
from flocsim.io.images.pictures import label_image
from flocsim.io.images.stacks import LARGEST_PIXEL, SMALLEST_PIXEL
from flocsim.io.outputs import check_outputs
from flocsim.io.shape_library import make_entry, write_library
from flocsim.plausibility import PIXEL_SIZE

OF_MASKS = ("min_radius", "max_radius")
OF_PICTURES = (*OF_MASKS, "flocs", "max_blur", "neck")
OF_STEEPEST = ("threshold", "noise_scale", "saturated")
"""Options of `segment_mask`; of `segment` and `segment_as_paper`; of `segment` alone, as is
--background."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Find the flocs in pictures, fit a spheropolygon to each at every requested number of
    vertices, and write them to a shape library.  The circle of equal area (N = 1) is always
    stored too.  A table beside the library lists every region, and says why a region was left
    out.

      flocsim fit frames/ --pixel-size 0.95e-6 --vertices 4,8,16,64 --radius 1 -o shapes.h5
      flocsim plot shapes.h5          # sizes, and errors against N: the paper's Figs 2 and 3

    images IMAGE: picture, or folder of pictures
    --pixel-size LENGTH: side of a pixel, e.g. '0.95 um', or in metres: 0.95e-6 (default: as given
        in an OME-TIFF or ImageJ file)
    --page LIST: pages of a stack to use, counted from 1, separated by commas, or all
    --channel K: channel or colour to use: a number from 1, or a name
    --crop X,Y,W,H: part of every picture to use: left, top, width, height in pixels
    --vertices LIST: numbers of vertices, separated by commas (default: %(default)s)
    --radius LIST: spheroradius in pixels, or several, separated by commas (default: %(default)s)
    --method: pattern: smallest error; paper: the paper's damped dynamics; even: points evenly
        spaced on the outline, as a baseline (default: %(default)s)
    --preserve-area: give every shape exactly the area of its floc
    --inscribed: keep every shape inside its floc
    --max-error PERCENT: leave out flocs whose relative error of area at the largest N is above this
        (default: 10 for flocs found in pictures, from N = 16 on; otherwise none are left out)
    --holes: keep the largest holes of flocs: the vertices are shared between the outline and the
        holes, and area and centroid are those without the holes
    --band: fit every floc three times, to its outline and to the tightest and the widest outline
        that its edge allows, for [shapes] outlines = "band": how uncertain outlines change a
        probability
    --masks: treat the files as masks or labels (PNG, TIFF, .npy, .npz), not pictures
    --jobs K: number of processes (default: %(default)s)
    --output FILE: shape library to write (default: %(default)s)
    --fits FOLDER: draw every fit at the largest N: mask, core, the outline swept by the disk, and
        the pixels that differ
    --masks-out FOLDER: write a label image of every picture, 0 outside and the number of each floc
        inside it (16-bit PNG), which can be edited and read back by --masks
    --review: also write a page, shapes-review.html for shapes.h5, with all outlines over the
        pictures, to choose flocs by eye; it saves the choices in a file for --reviewed
    --reviewed FILE: fit the flocs that were chosen on the page that --review wrote
    --memory GB: memory that a picture may take; larger ones are refused before any work is done
        (default: %(default)s)
    --finder: steepest: place each outline where the grey changes most steeply, even in uneven
        light; paper: as in the paper, a low-pass filter, stretched contrast and Otsu's threshold
        (default: %(default)s)
    --cutoff FREQUENCY: with --finder paper: frequency at which the low-pass filter halves the
        amplitude, up to 0.5 cycles per pixel (default: 0.2)
    --flocs: whether flocs are brighter or darker than the background (default: %(default)s)
    --background: surface: fitted to each picture; median: of all pictures, if a fixed camera took
        them (default: surface)
    --threshold CONTRAST: contrast from which a pixel belongs to a floc, from 0 to 1: of dark flocs
        the fraction of light that they absorb, of bright ones the grey above the background,
        where white is 1 (default: found for each floc; the median is printed)
    --noise-scale PX: detail finer than this is noise (default: 1)
    --saturated FRACTION: fraction of a floc's pixels whose contrast is too high to count for its
        level (default: 0.001)
    --min-radius PX: smallest r_eq of a floc (default: %(default)s)
    --max-radius PX: largest r_eq of a floc
    --max-blur FRACTION: reject a region as out of focus if at least half of its edge is blurred
        over more than this fraction of r_eq, and over more than 3.5 px; inf: keep all (default:
        %(default)s)
    --neck FRACTION: separate touching flocs at necks of up to this fraction of the smaller one's
        width; 0: never (default: 0.5, but only where the parts are compact enough to be clearly
        two flocs, and never in a picture of fractal aggregates)
    """
    add = parser.add_argument
    add("images", nargs="+")
    add("--pixel-size", type=length)
    add("--page", type=lambda text: [] if text == "all" else several(whole)(text))
    add("--channel")
    add("--crop", type=rectangle)
    add("--vertices", type=several(whole), default="4,8,16,64")
    add("--radius", type=several(positive), default="1", dest="radii")
    add("--method", default="pattern", choices=("pattern", "paper", "even"))
    for flag in ("--preserve-area", "--inscribed", "--holes", "--band", "--masks"):
        add(flag, action="store_true")
    add("--max-error", type=positive)
    add("--jobs", type=whole, default=1)
    add("-o", "--output", default="shapes.h5")
    for name in ("--fits", "--masks-out"):
        add(name)
    add("--review", action="store_true")
    add("--reviewed")
    add("--memory", type=lambda text: 1e9 * positive(text), default="1.3")
    add_overwrite(parser)
    add = parser.add_argument_group("finding flocs").add_argument
    add("--finder", default="steepest", choices=("steepest", "paper"))
    add("--cutoff", type=number("cycles per pixel above 0, to 0.5", 1e-6, 0.5))
    add("--flocs", default="auto", choices=("auto", "bright", "dark"))
    add("--background", choices=("surface", "median"))
    add("--threshold", type=number("a contrast above 0, to 1", 5e-324, 1.0))
    add("--noise-scale", type=number("pixels, at least 0", 0.0, 1e3))
    add("--saturated", type=number("a fraction from 0 to below 1", 0.0, 0.999))
    add("--min-radius", type=positive, default="4")
    add("--max-radius", type=positive)
    add("--max-blur", type=number("a fraction above 0", 5e-324, float("inf")), default="0.25")
    add("--neck", type=number("a fraction from 0 to 1", 0.0, 1.0))


def length(text: str) -> float:
    """Read a length above 0 [m], "0.95 um", or a number of metres."""
    value, hint = 0.0, ""
    try:
        value = read_number(text, "m")
    except ValueError as reason:
        hint = f" ({reason})" if str(reason) else ""
    if not SMALLEST_PIXEL <= value <= LARGEST_PIXEL:
        raise argparse.ArgumentTypeError(
            f"takes a length such as '0.95 um', or a number of metres, from {SMALLEST_PIXEL:g} to "
            f"{LARGEST_PIXEL:g}, found {text!r}{hint}"
        )
    return value


def rectangle(text: str) -> tuple[int, ...]:
    """Read (x, y, width, height) [px]."""
    numbers = text.replace(" ", "").split(",")
    if len(numbers) != 4 or not all(map(str.isdecimal, numbers)) or "0" in numbers[2:]:
        raise argparse.ArgumentTypeError(
            f"takes X,Y,WIDTH,HEIGHT in pixels with width and height above 0, found {text!r}"
        )
    return tuple(map(int, numbers))


def check(args: argparse.Namespace) -> None:
    """UsageError for options that exclude each other."""
    paper = args.finder == "paper"
    foreign = [name for name in ("background", *OF_STEEPEST) if getattr(args, name) is not None]
    for wrong, message in (
        (args.masks and (args.page is not None or args.channel or args.crop),
         "--page, --channel and --crop apply to pictures, not to --masks"),
        (args.inscribed and (args.preserve_area or args.method != "pattern"),
         "--inscribed needs --method pattern and excludes --preserve-area: a shape inside its "
         "floc has a smaller area"),
        (paper and (args.masks or foreign),
         f"--{'masks' if args.masks else ''.join(foreign[:1]).replace('_', '-')} does not apply to "
         "--finder paper: leave one of them out"),
        (not paper and args.cutoff is not None, "--cutoff applies to --finder paper only"),
        (args.band and (args.masks or args.holes),
         "--band excludes --holes, and --masks, which do not show where else an outline might be"),
    ):  # fmt: skip
        if wrong:
            raise UsageError(message)


def run(args: argparse.Namespace) -> int:
    """Fit, print what was found and write the library; returns the exit code."""
    check(args)
    args.vertices, args.radii = sorted({1, *args.vertices}), sorted(set(args.radii))
    own = (*OF_PICTURES, "cutoff") if args.finder == "paper" else (*OF_PICTURES, *OF_STEEPEST)
    options = {name: getattr(args, name) for name in (OF_MASKS if args.masks else own)}
    # What is not given is as `segment`, or `segment_as_paper`, has it by default.
    args.segmentation = {name: each for name, each in options.items() if each is not None}
    paths = list_pictures(args.images, args.masks)
    for option in ("fits", "masks_out"):
        if (folder := getattr(args, option)) is not None:
            make_folder(folder, f"--{option.replace('_', '-')} ")
    table, rule = Path(args.output).with_suffix(".csv"), args.overwrite
    labels = label_files(args.masks_out, titles_of(paths))
    pages = [table.with_name(f"{table.stem}-review.html")] if args.review else []
    inputs = paths if args.reviewed is None else [*paths, args.reviewed]
    check_outputs([args.output, table, *pages, *labels], rule, inputs)

    pictures, lost = fit_pictures(paths, args)
    entries = [
        make_entry(picture, region, picture.fits[region.label], radius, len(args.radii) > 1)
        for radius in args.radii for picture in pictures for region in picture.found.regions
    ]  # fmt: skip
    if not entries:
        # Regions that the filters have left out can be added on the page.
        draw_review(pages, pictures, args)
        problem = FlocsimError if lost else UsageError
        raise problem("nothing was fitted, so no shape library was written")
    settings = {
        "method": args.method, "preserve_area": args.preserve_area, "inscribed": args.inscribed,
    }  # fmt: skip
    sizes = [PIXEL_SIZE.warning("the pixel size", picture.pixel_size) for picture in pictures]
    if doubts := list(dict.fromkeys(filter(None, sizes))):
        report(f"warning: {'; '.join(doubts)}")
    # Said of each picture as it was read; the library and flocsim study say it once more.
    alarms = ((each.name, alarm) for each in pictures for alarm in each.found.alarms)
    doubts += [f"check the outlines of {name}: {alarm}" for name, alarm in alarms]
    read = {picture.path for picture in pictures}
    if left := ", ".join(str(path) for path in paths if path not in read):
        doubts.append(f"left out: {left}")
    if doubts:
        settings["warning"] = "; ".join(doubts)
    if args.finder == "paper":
        settings |= {"finder": "paper", "cutoff": args.cutoff or CUTOFF}
    if args.holes:
        settings["holes"] = True
    if args.reviewed is not None:
        settings["chosen"] = "by eye"
    write_library(args.output, entries, settings, rule)
    write_file(table, summary_text(pictures).encode(), rule)
    print("\n".join([format_errors(entries), *population_lines(entries)]))
    counts = ", ".join(map(str, args.vertices))
    flocs = plural(len(entries) // len(args.radii), "floc")
    end = f"; left out: {left}" if left else ""
    print(f"{args.output}: {flocs} at N = {counts}; {table}: all regions{end}")

    # A file may hold several pictures, which have names of their own.
    labels = label_files(args.masks_out, [each.name for each in pictures])
    for picture, path in zip(pictures, labels, strict=False):
        found = picture.found
        write_file(path, label_image(found.foreground.shape, found.regions, picture.name), rule)
    if args.fits is not None:
        draw_fits(args.fits, pictures, rule)
    draw_review(pages, pictures, args)
    if lost:
        raise FlocsimError(f"not fitted: {', '.join(lost)}; everything else was written")
    return 0


def label_files(folder: str | None, names: Sequence[str]) -> list[Path]:
    """Return the label images in a folder of pictures with these names; none without a folder."""
    return [] if folder is None else files_of(names, os.path.join(folder, ""), ".png")
