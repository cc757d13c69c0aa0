"""The work of `flocsim fit`, in one process or several: pictures → flocs → fits; and what is drawn
of them over the pictures.
"""

import contextlib
import os
import sys
import warnings
from argparse import Namespace
from collections.abc import Iterable, Sequence
from pathlib import Path

import attrs
import numpy as np

from flocsim.commands.processes import Lost, workers
from flocsim.errors import FlocsimError, ImageError, ShapeError, UsageError
from flocsim.geometry.fit.fit import Fit, fit_mask
from flocsim.geometry.shapes.outline import ShapeMeasures
from flocsim.io.fit_report import picture_line, plural, warn_of_coarse
from flocsim.io.images.background import FEWEST_FRAMES
from flocsim.io.images.masks import ARRAYS, MASK_SUFFIXES, is_mask, read_masks, segment_mask
from flocsim.io.images.paper import segment_as_paper
from flocsim.io.images.pictures import Segmentation, check_names, corrected, segment, weighed
from flocsim.io.images.reading import (
    ANNOUNCED,
    BYTES_PER_PIXEL,
    SUFFIXES,
    check_file,
    grey_of,
    read_grey,
    read_pixels,
)
from flocsim.io.images.regions import Region, mask_measures, with_holes
from flocsim.io.images.stacks import Plane, pixel_size_in, planes_of, stack_of
from flocsim.io.plots.shapes import draw_overlay, single_fit
from flocsim.io.plots.style import save
from flocsim.io.terminal import Progress

Fits = dict[float, dict[int, Fit]]
"""The Fit of one mask at every spheroradius [px] and N."""

LOST = FlocsimError.exit_code
"""Exit code where pictures were lost; the library has the others."""

MOST_FRAMES = 25
"""More frames than this tell hardly more about the light."""

MOST_NAMES = 5
"""Files that one line names."""


@attrs.frozen(eq=False)
class Picture:
    """One picture or mask, what was found in it, the regions of that to be fitted, and the measures
    {label: ShapeMeasures} [px] of all its flocs; pixel_size [m]; plane: where it is in the file;
    fits {label: [Fits]} of the regions, of the mask and, if asked for, of both ends of its band."""

    path: Path
    name: str
    found: Segmentation
    regions: tuple[Region, ...]
    measures: dict[int, ShapeMeasures]
    pixel_size: float
    plane: Plane | None = None
    fits: dict[int, list[Fits]] = attrs.Factory(dict)


def fit_pictures(paths: Sequence[Path], options: Namespace) -> tuple[list[Picture], list[str]]:
    """Pictures with their fits, and the names of pictures lost; ``options`` as `fit.read_numbers`
    leaves them.

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
            if result is None:
                masks_found.append(task[1])
                continue
            for picture in result:
                print(picture_line(picture.name, picture.found, len(picture.regions)), flush=True)
                warn_of_coarse(picture.name, picture.regions, options.radii)
                pictures.append(picture)
        if masks_found:
            report(
                f"{plural(len(masks_found), 'file')} of masks or labels among the pictures: "
                f"{some_of(masks_found)}; left out, fit them with --masks"
            )
        if not options.masks:
            found = weighed([e.found for e in pictures], options.segmentation["max_blur"])
            pictures = [
                attrs.evolve(each, found=one, regions=largest(one.regions, options.max_flocs))
                for each, one in zip(pictures, found, strict=True)
            ]
        check_names(options.correction, [(each.name, each.found) for each in pictures])
        regions = [(each.name, region) for each in pictures for region in each.regions]
        masks = [
            # At the ends of a band that is not known lies the mask itself.
            (f"{name}#{each.label}",
             (each.mask, *((each.band or (each.mask, each.mask)) if options.band else ())), options)
            for name, each in regions
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
    results = iter(fits)
    fitted = [
        attrs.evolve(each, fits={region.label: next(results) for region in each.regions})
        for each in pictures
    ]
    return [each for each in fitted if each.name not in lost], list(lost)


def some_of(names: Sequence[str]) -> str:
    """The first names of a list, and how many more there are."""
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


def titles_of(paths: Sequence[Path]) -> list[str]:
    """What pictures are called in tables and libraries: all different, and all of them text.

    Pictures of one name in several folders are told apart by their paths; a byte that is no UTF-8
    is written as \\xe9.
    """
    names = [printable(path.name) for path in paths]
    pairs = zip(names, paths, strict=True)
    return distinct(
        (name if names.count(name) == 1 else printable(path.as_posix())) for name, path in pairs
    )


def distinct(names: Iterable[str], suffix: str = "") -> list[str]:
    """The names, of which those that have come before get as many primes as they need."""
    found: list[str] = []
    for name in names:
        while name + suffix in found:
            name += "'"
        found.append(name + suffix)
    return found


def printable(text):
    return os.fsencode(str(text)).decode("utf-8", "backslashreplace")


def compile_fit():
    """Compile before there are several processes that would all do it."""
    fit_mask(np.ones((9, 9), bool), vertices=5)


def report(error):
    print(f"flocsim: {printable(error)}", file=sys.stderr, flush=True)


def find_flocs(task):
    """[Picture] of (path, name, background, options); the error of its file, None of a mask."""
    path, name, background, options = task
    try:
        if options.masks:
            return masked(path, name, options)
        size, pictures = None, []
        for page, plane in planes_in(path, options):
            pixels = read_pixels(path, plane, options.memory)
            if is_mask(pixels):
                return None
            announce(name + page, pixels.shape)
            size = size or known_size(path, options)
            grey = grey_of(pixels, path)
            if options.finder == "paper":
                found = segment_as_paper(grey, **options.segmentation)
            else:
                found = segment(grey, background=background, **options.segmentation)
            pictures.append(chosen(path, name + page, found, options, size, plane))
        return pictures
    except FlocsimError as error:
        return error


def announce(name, shape):
    """Say before it begins what the work on a large picture takes."""
    needed = BYTES_PER_PIXEL * shape[0] * shape[1]
    if needed > ANNOUNCED:
        report(
            f"{name}: {shape[0] * shape[1] / 1e6:.3g} Mpixel may take up to {needed / 1e9:.2g} GB "
            "of memory (--memory)"
        )


def planes_in(path, options):
    """[(what is put behind its name, Plane)] of the pictures of a file that are asked for."""
    check_file(path, "picture file")
    if path.suffix.lower() in ARRAYS:
        raise ImageError(f"{path}: {path.suffix} files hold masks, not pictures: give --masks")
    return planes_of(path, stack_of(path), options.page, options.channel, options.crop)


def known_size(path, options):
    """The size of a file's pixels [m]: the one that was given, or its own; ImageError for none."""
    if options.pixel_size is not None:
        return options.pixel_size
    if (found := pixel_size_in(path, stack_of(path))) is None:
        raise ImageError(
            f"{path}: does not give the size of a pixel, as OME-TIFF and ImageJ files do; give the "
            "length of its side, for example --pixel-size '0.95 um'"
        )
    return found


def masked(path, name, options):
    limits = {key: options.segmentation[key] for key in ("min_radius", "max_radius")}
    pictures = []
    for inner, mask in read_masks(path, options.memory):
        announce(name + inner[len(path.name) :], mask.shape)
        found = segment_mask(mask, **limits)
        size = known_size(path, options)
        pictures.append(chosen(path, name + inner[len(path.name) :], found, options, size))
    return pictures


def chosen(path, name, found, options, pixel_size, plane=None):
    """A Picture of a Segmentation, corrected as the user wants it."""
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
    frames = []
    for path in paths[:: max(1, len(paths) // MOST_FRAMES)]:
        # A file that cannot be read, or is a mask, is reported when its own turn comes.
        with contextlib.suppress(ImageError, MemoryError):
            for _, plane in planes_in(path, options):
                pixels = read_pixels(path, plane, options.memory)
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


def pictures_beneath(name, paths, drawn):
    """{path of a mask: its picture in the folder of that name, None for none}.

    ``drawn``: whether overlays of masks are drawn at all. UsageError where it cannot be used.
    """
    if name is None:
        return {}
    if not drawn:
        raise UsageError("--pictures is for overlays of masks: give --masks and --overlay too")
    folder = Path(name)
    if not folder.is_dir():
        raise UsageError(f"--pictures takes a folder, found {name!r}")
    named: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in SUFFIXES:
            named.setdefault(path.stem, []).append(path)
    found = {path: named[path.stem] for path in paths if path.stem in named}
    for mask, several in found.items():
        if len(several) > 1:
            raise UsageError(
                f"--pictures {name} has {several[0].name} and {several[1].name}, so the picture of "
                f"{mask.name} is ambiguous; move one of them away"
            )
    missing = [path.name for path in paths if path not in found]
    if missing:
        report(
            f"warning: --pictures {name} has no picture of {some_of(missing)}; drawn over the mask"
        )
    return {mask: several[0] for mask, several in found.items()}


def grey_beneath(picture, beneath, options):
    """What the overlay of a picture is drawn over."""
    if not options.masks:
        return read_grey(picture.path, picture.plane, options.memory)
    mask = picture.found.foreground
    if picture.path not in beneath:
        return mask
    grey = read_grey(beneath[picture.path], memory=options.memory)
    if grey.shape == mask.shape:
        return grey
    sizes = [f"{width} × {height}" for height, width in (grey.shape, mask.shape)]
    report(
        f"warning: {beneath[picture.path]} has {sizes[0]} pixels and its mask {sizes[1]}; drawn "
        "over the mask"
    )
    return mask


def overlay_paths(overlay, names, several):
    """A path for the overlay of each of the pictures that have these (name, path of the file)."""
    if not several:
        return [overlay] * len(names)
    stems = [stem_of(name, [file.suffix.lower()]) for name, file in names]
    made = distinct((f"{overlay.stem}-{stem}" for stem in stems), overlay.suffix)
    return [overlay.with_name(name) for name in made]


def stem_of(name, suffixes):
    """The name of a picture in names of files, without one of these endings."""
    plain = Path(name.replace(":", "-").replace("/", "-"))
    return plain.stem if plain.suffix.lower() in suffixes else plain.name


def expected_overlays(overlay, paths):
    """The overlays that will be drawn, as far as it can be known before files are read."""
    names = list(zip(titles_of(paths), paths, strict=True))
    return overlay_paths(Path(overlay), names, len(paths) > 1) or [Path(overlay)]


def draw_fits(folder, pictures, options, rule):
    """Write a picture of every fit at the largest N and the smallest spheroradius."""
    for picture in pictures:
        for region in picture.regions:
            fit = finest(picture, region, options)
            figure = single_fit(region.mask, fit, f"{picture.name}#{region.label}")
            save(figure, Path(folder, f"{stem_of(picture.name, ())}-{region.label}.png"), rule)


def finest(picture, region, options):
    """The fit of a region at the largest N and the smallest spheroradius."""
    return picture.fits[region.label][0][options.radii[0]][options.vertices[-1]]


def draw(overlay, pictures, options, rule, several, beneath):
    """Write each picture with the outlines at the largest N and the smallest spheroradius.

    Returns what could not be drawn because its picture cannot be read any more.
    """
    most, radius = options.vertices[-1], options.radii[0]
    names = [(each.name, each.path) for each in pictures]
    paths, lost = overlay_paths(overlay, names, several or len(pictures) > 1), []
    for picture, path in zip(pictures, paths, strict=True):
        flocs = [(region, finest(picture, region, options)) for region in picture.regions]
        title = f"{picture.name}: {plural(len(flocs), 'floc')}, N = {most}, r = {radius:g} px"
        try:
            grey = grey_beneath(picture, beneath, options)
        except (ImageError, MemoryError) as error:
            report(str(error) or f"{picture.name}: not enough memory to draw its overlay")
            lost.append(str(path))
            continue
        figure = draw_overlay(grey, flocs, title, picture.found.rejected)
        save(figure, path, rule)
    return lost
