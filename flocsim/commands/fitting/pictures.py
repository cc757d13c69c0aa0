"""The work of `flocsim fit`, in one process or several: pictures → flocs → fits."""

import contextlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from flocsim.commands.fitting.processes import Lost, workers
from flocsim.errors import FlocsimError, ImageError, ShapeError, UsageError
from flocsim.io.images.selection import Correction, check_names, corrected
from flocsim.io.shapes.fit_report import picture_line, plural, warn_of_coarse
from flocsim.io.terminal import Progress

if TYPE_CHECKING:
    from flocsim.geometry.fit.fit import Fit
    from flocsim.geometry.shapes.measures import ShapeMeasures
    from flocsim.io.images.pictures import Segmentation
    from flocsim.io.images.regions import Region
    from flocsim.io.images.stacks import Plane

    Fits = dict[float, dict[int, Fit]]
    """The Fit of one mask at every spheroradius [px] and N."""

LOST = FlocsimError.exit_code
"""Exit code where pictures were lost; the library has the others."""

MOST_FRAMES = 25
"""More frames than this tell hardly more about the light."""

MOST_NAMES = 5
"""Files that one line names."""


@attrs.frozen
class Options:
    """What to look for and what to fit, ready to be handed to other processes.

    Radii, blur and saturation as in flocsim.io.images.pictures.segment; vertices with 1 among them;
    radii: spheroradii [px], rising; pixel_size [m], None: that of each file; pages, channel, crop:
    which part of a file; band: fit the ends of every outline's band as well.
    """

    pixel_size: float | None
    vertices: tuple[int, ...]
    radii: tuple[float, ...]
    method: str
    preserve_area: bool
    inscribed: bool
    holes: bool
    max_flocs: int | None
    masks: bool
    background: str
    jobs: int
    segmentation: dict[str, Any]
    correction: Correction
    pages: str | None = None
    channel: str | None = None
    crop: tuple[int, int, int, int] | None = None
    band: bool = False


@attrs.frozen(eq=False)
class Picture:
    """One picture or mask, what was found in it, the regions of that to be fitted, and the measures
    {label: ShapeMeasures} [px] of all its flocs; pixel_size [m]; plane: where it is in the file."""

    path: Path
    name: str
    found: "Segmentation"
    regions: "tuple[Region, ...]"
    measures: "dict[int, ShapeMeasures]"
    pixel_size: float
    plane: "Plane | None" = None


@attrs.frozen
class MaskFile:
    """What stands for a file among the pictures that is a mask or a label image."""

    name: str


def fit_pictures(
    paths: Sequence[Path], options: Options
) -> "tuple[list[Picture], list[Fits], list[tuple[Fits, ...]], list[str]]":
    """Pictures, the Fits of each of their regions, those of the two masks of its band (none unless
    ``options.band``), and the names of pictures lost.


    A file that cannot be read as a picture is told and passed over. One that the machine has
    failed on, for want of memory or because a process was killed, is lost, with all its flocs.
    """
    background = find_background(paths, options)
    tasks = [(p, t, background, options) for p, t in zip(paths, titles_of(paths), strict=True)]
    lost: dict[str, None] = {}

    def lose(name, result):
        if name not in lost:
            report(f"{name} was not fitted: {result.reason}; the other pictures were")
        lost[name] = None

    with workers(options.jobs, compile_fit) as mapped:
        pictures: list[Picture] = []
        masks_found: list[str] = []
        for task, result in zip(tasks, mapped(find_flocs, tasks), strict=True):
            if isinstance(result, Lost):
                lose(task[1], result)
                continue
            if isinstance(result, FlocsimError):
                report(result)
                continue
            if isinstance(result, MaskFile):
                masks_found.append(result.name)
                continue
            for picture in result:
                print(picture_line(picture.name, picture.found, len(picture.regions)), flush=True)
                warn_of_coarse(picture.name, picture.regions, options.radii)
                pictures.append(picture)
        report_masks(masks_found)
        pictures = pictures if options.masks else weighted(pictures, options)
        check_names(options.correction, [(each.name, each.found) for each in pictures])
        regions = [(each.name, region) for each in pictures for region in each.regions]
        masks = [
            (f"{name}#{region.label}", (region.mask, *(bands_of(region) if options.band else ())),
             options)
            for name, region in regions
        ]  # fmt: skip
        progress = Progress(len(masks), not sys.stderr.isatty(), sys.stderr, "flocs")
        fits = []
        for fit in mapped(fit_region, masks):
            fits.append(fit)
            progress.report(len(masks) - len(fits))
        progress.finish()
    for (name, _), fit in zip(regions, fits, strict=True):
        if isinstance(fit, Lost):
            lose(name, fit)
    fits = [fit for (name, _), fit in zip(regions, fits, strict=True) if name not in lost]
    firsts, bands = [fit[0] for fit in fits], [fit[1:] for fit in fits]
    return [each for each in pictures if each.name not in lost], firsts, bands, list(lost)


def bands_of(region):
    """The two masks at the ends of a region's band; its own where nothing is known."""
    return region.band or (region.mask, region.mask)


def weighted(pictures, options):
    """The Pictures with the weights of their flocs among all of them."""
    from flocsim.io.images.selection import weighed

    max_blur = options.segmentation["max_blur"]
    found = weighed([each.found for each in pictures], max_blur)
    return [
        attrs.evolve(each, found=one, regions=largest(one.regions, options.max_flocs))
        for each, one in zip(pictures, found, strict=True)
    ]


def titles_of(paths: Sequence[Path]) -> list[str]:
    """What pictures are called in tables and libraries: all different, and all of them text.

    Pictures of one name in several folders are told apart by their paths; a byte that is no UTF-8
    is written as \\xe9.
    """
    names = [printable(path.name) for path in paths]
    titles: list[str] = []
    for name, path in zip(names, paths, strict=True):
        title = name if names.count(name) == 1 else printable(path.as_posix())
        while title in titles:
            title += "'"
        titles.append(title)
    return titles


def printable(text):
    return os.fsencode(str(text)).decode("utf-8", "backslashreplace")


def compile_fit():
    """Compile before there are several processes that would all do it."""
    from flocsim.geometry.fit.fit import fit_mask

    fit_mask(np.ones((9, 9), bool), vertices=5)


def report(error):
    print(f"flocsim: {printable(error)}", file=sys.stderr, flush=True)


def report_masks(names):
    """One line on all masks that lay among the pictures."""
    if names:
        shown = ", ".join(names[:MOST_NAMES])
        more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
        report(
            f"{plural(len(names), 'file')} of masks or labels among the pictures: {shown}{more}; "
            "left out, fit them with --masks"
        )


def find_flocs(task):
    """[Picture] of (path, name, background, Options), or MaskFile, or the error of its file."""
    path, name, background, options = task
    try:
        if options.masks:
            return masked(path, name, options)
        from flocsim.io.images.masks import is_mask
        from flocsim.io.images.pictures import segment
        from flocsim.io.images.reading import grey_of, read_pixels

        size, pictures = None, []
        for page, plane in planes_in(path, options):
            pixels = read_pixels(path, plane)
            if is_mask(pixels):
                return MaskFile(name)
            size = size or known_size(path, options)
            found = segment(grey_of(pixels, path), background=background, **options.segmentation)
            pictures.append(chosen(path, name + page, found, options, size, plane))
        return pictures
    except FlocsimError as error:
        return error


def planes_in(path, options):
    """[(what is put behind its name, Plane)] of the pictures of a file that are asked for."""
    from flocsim.io.images.reading import check_file
    from flocsim.io.images.stacks import planes_of, stack_of

    check_file(path, "picture file")
    return planes_of(path, stack_of(path), options.pages, options.channel, options.crop)


def known_size(path, options):
    """The size of a file's pixels [m]: the one that was given, or its own; ImageError for none."""
    from flocsim.io.images.stacks import pixel_size_in, stack_of

    if options.pixel_size is not None:
        return options.pixel_size
    if (found := pixel_size_in(path, stack_of(path))) is None:
        raise ImageError(
            f"{path}: does not give the size of a pixel, as OME-TIFF and ImageJ files do; give the "
            "length of its side, for example --pixel-size '0.95 um'"
        )
    return found


def masked(path, name, options):
    from flocsim.io.images.masks import read_masks, segment_mask

    limits = {key: options.segmentation[key] for key in ("min_radius", "max_radius")}
    pictures = []
    for inner, mask in read_masks(path):
        found = segment_mask(mask, **limits)
        size = known_size(path, options)
        pictures.append(chosen(path, name + inner[len(path.name) :], found, options, size))
    return pictures


def chosen(path, name, found, options, pixel_size, plane=None):
    """A Picture of a Segmentation, corrected as the user wants it."""
    from flocsim.io.images.regions import mask_measures, with_holes

    found = corrected(name, found, options.correction)
    if options.holes:
        opened = tuple(with_holes(each, found.holes) for each in found.regions)
        found = attrs.evolve(found, regions=opened)
    found = attrs.evolve(found, holes=None)
    measures = {region.label: mask_measures(region.mask) for region in found.regions}
    regions = largest(found.regions, options.max_flocs)
    return Picture(path, name, found, regions, measures, pixel_size, plane)


def largest(regions, count):
    """The `count` largest regions, in their old order; all for None."""
    by_size = sorted(regions, key=lambda region: (-region.area, region.label))[:count]
    return tuple(sorted(by_size, key=lambda region: region.label))


def fit_region(task):
    """The Fits of each mask in (name, masks, Options); ShapeError, with the name, for none."""
    import warnings

    from flocsim.geometry.fit.fit import fit_mask

    name, masks, options = task
    with warnings.catch_warnings():
        # Said once a picture, by warn_of_coarse, not once a floc and N.
        warnings.simplefilter("ignore", UserWarning)
        try:
            return [
                {
                    radius: {
                        count: fit_mask(
                            mask, vertices=count, radius=radius, method=options.method,
                            # A circle of a radius above r_eq is larger than the floc already.
                            preserve_area=options.preserve_area and np.pi * radius**2 < mask.sum(),
                            inscribed=options.inscribed, holes=options.holes,
                        )
                        for count in options.vertices
                    }
                    for radius in options.radii
                }
                for mask in masks
            ]  # fmt: skip
        except ShapeError as error:
            raise ShapeError(
                f"{name}: {error}, or leave out small flocs with --min-radius"
            ) from None


def list_pictures(names: Sequence[str], masks: bool) -> list[Path]:
    """The files' paths, folders replaced by the pictures in them; each path once."""
    from flocsim.io.images.masks import MASK_SUFFIXES
    from flocsim.io.images.reading import SUFFIXES

    suffixes = MASK_SUFFIXES if masks else SUFFIXES
    paths = []
    for path in map(Path, names):
        inside = sorted(path.iterdir()) if path.is_dir() else [path]
        found = [p for p in inside if not path.is_dir() or p.suffix.lower() in suffixes]
        if not found:
            report(ImageError(f"{path}: the folder holds no pictures ({', '.join(suffixes)})"))
        paths += found
    return list(dict.fromkeys(paths))


def find_background(paths, options):
    """The median of the frames, or None where a surface is fitted to each."""
    if options.background == "surface" or options.masks:
        return None
    from flocsim.io.images.background import FEWEST_FRAMES
    from flocsim.io.images.masks import is_mask
    from flocsim.io.images.reading import grey_of, read_pixels

    frames = []
    for path in paths[:: max(1, len(paths) // MOST_FRAMES)]:
        # A file that cannot be read, or is a mask, is reported when its own turn comes.
        with contextlib.suppress(ImageError, MemoryError):
            for _, plane in planes_in(path, options):
                pixels = read_pixels(path, plane)
                if not is_mask(pixels):
                    frames.append(grey_of(pixels, path))
    shapes = {frame.shape for frame in frames}
    if len(frames) < FEWEST_FRAMES or len(shapes) > 1:
        sizes = ", ".join(f"{width} × {height}" for height, width in sorted(shapes))
        raise UsageError(
            f"--background median needs at least {FEWEST_FRAMES} frames of the same size, found "
            f"{len(frames)} ({sizes}); use --background surface"
        )
    return np.median(np.stack(frames), axis=0)
