"""The work of `flocsim fit`, in one process or several: pictures → flocs → fits; and what is drawn
of them over the pictures.
"""

import contextlib
import math
import os
import sys
import warnings
import webbrowser
from argparse import Namespace
from collections.abc import Collection, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.errors import FileError, FlocsimError, ImageError, ShapeError, UsageError, plural
from flocsim.geometry.fit.fit import Fit, fit_mask
from flocsim.geometry.shapes.outline import ShapeMeasures
from flocsim.io.files import Rule, write_file
from flocsim.io.fit_report import picture_line
from flocsim.io.images.background import FEWEST_FRAMES
from flocsim.io.images.masks import ARRAYS, MASK_SUFFIXES, is_mask, read_masks, segment_mask
from flocsim.io.images.paper import segment_as_paper
from flocsim.io.images.pictures import Segmentation, segment, weighed
from flocsim.io.images.reading import SUFFIXES, check_file, grey_of, read_grey, read_pixels
from flocsim.io.images.regions import Region, mask_measures, with_holes
from flocsim.io.images.review import (
    REJECT,
    Choices,
    checksum_of,
    choices_of,
    chosen,
    judged,
    misfit,
    read_choices,
)
from flocsim.io.images.stacks import Plane, pixel_size_in, planes_of, stack_of
from flocsim.io.plots.review import review_page
from flocsim.io.plots.shapes import single_fit
from flocsim.io.plots.style import save
from flocsim.io.terminal import Progress
from flocsim.tasks import Lost, workers

Fits = dict[float, dict[int, Fit]]
"""The Fit of one mask at every spheroradius [px] and N."""

Task = tuple[Path, str, np.ndarray | None, Namespace, dict[str, Choices] | None]
"""A file of pictures, its title, the background, the options, and the choices made by eye."""

MOST_ERROR, FEW = 10.0, 16
"""RE [%] above which a region is more likely several flocs, or a halo, than one, and the number of
vertices from which on this is so."""

MOST_FRAMES = 25
"""More frames than this tell hardly more about the light."""

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables of the environment that name a display."""

FILE_OF_CHOICES = "reviewed.json"
"""What the page calls the file that it saves."""


@attrs.frozen(eq=False)
class Picture:
    """One picture or mask, what was found in it, and the measures {label: ShapeMeasures} [px] of
    its flocs; pixel_size [m]; choices: which regions are flocs, and why; plane: where it is in the
    file; fits {label: [Fits]} of the flocs, of the mask and, if asked for, of both ends of its
    band."""

    path: Path
    name: str
    found: Segmentation
    measures: dict[int, ShapeMeasures]
    pixel_size: float
    choices: Choices
    plane: Plane | None = None
    fits: dict[int, list[Fits]] = attrs.Factory(dict)

    def finest(self, region: Region) -> Fit:
        """Return the fit of a region at the largest N and the smallest spheroradius."""
        first = self.fits[region.label][0]
        fits = first[min(first)]
        return fits[max(fits)]


def fit_pictures(paths: Sequence[Path], options: Namespace) -> tuple[list[Picture], list[str]]:
    """Return pictures with their fits, and the names of pictures lost.

    A file that cannot be read as a picture is reported and passed over. One that the machine has
    failed on, for want of memory or because a process was killed, is lost, with all its flocs.
    """
    by_eye = None if options.reviewed is None else read_choices(options.reviewed)
    background = find_background(paths, options)
    tasks = [
        (path, title, background, options, by_eye)
        for path, title in zip(paths, titles_of(paths), strict=True)
    ]
    lost: dict[str, str] = {}
    pictures: list[Picture] = []
    # Compiled before there are several processes that would all do it.
    compiling = partial(fit_mask, np.ones((9, 9), bool), vertices=5)
    with workers(options.jobs, compiling) as mapped:
        for (_, title, *_), result in zip(tasks, mapped(find_flocs, tasks), strict=True):
            if isinstance(result, Lost):
                lost[title] = result.reason
            elif isinstance(result, FlocsimError):
                report(result)
            else:
                for picture in result:
                    line = picture_line(picture.name, picture.found)
                    if options.pixel_size is None:
                        line += f", pixel size {1e6 * picture.pixel_size:.4g} um"
                    print(line, flush=True)
                pictures += result
        if not options.masks:
            found = weighed([e.found for e in pictures], options.segmentation["max_blur"])
            pictures = [
                attrs.evolve(each, found=one) for each, one in zip(pictures, found, strict=True)
            ]
        missing = sorted(set(by_eye or ()) - {each.name for each in pictures})
        if missing and not lost:
            raise misfit(options.reviewed, f"{missing[0]} is not among them")
        regions = [(each, region) for each in pictures for region in each.found.regions]
        masks = []
        for picture, region in regions:
            # At the ends of a band that is not known lies the mask itself.
            ends = (region.band or (region.mask, region.mask)) if options.band else ()
            masks.append((f"{picture.name}#{region.label}", (region.mask, *ends), options))
        progress = Progress(len(masks), not sys.stderr.isatty(), sys.stderr, "flocs")
        for place, fits in enumerate(mapped(fit_region, masks)):
            picture, region = regions[place]
            if isinstance(fits, Lost):
                lost.setdefault(picture.name, fits.reason)
            elif isinstance(fits, ShapeError):
                report(f"{fits}; this floc is left out")
            else:
                picture.fits[region.label] = fits
            progress.report(len(masks) - place - 1)
        progress.finish()
    for name, reason in lost.items():
        report(f"{name} was not fitted: {reason}; the other pictures were fitted")
    fitted = [each for each in pictures if each.name not in lost]
    return [without_misfits(each, error_limit(options)) for each in fitted], list(lost)


def error_limit(options: Namespace) -> float:
    """Return the RE [%] above which flocs are left out.

    Unless it is given, flocs that were chosen by eye or came as masks stay, and so do all if the
    vertices are too few to follow any floc.
    """
    if options.max_error is not None:
        return float(options.max_error)
    chosen_by_hand = options.masks or options.reviewed is not None
    return math.inf if chosen_by_hand or max(options.vertices) < FEW else MOST_ERROR


def without_misfits(picture: Picture, limit: float) -> Picture:
    """Return the Picture without the flocs that could not be fitted, or whose fit at the largest N
    has a larger RE [%]."""
    labels = {each.label for each in picture.found.regions}
    picture = without(picture, labels - set(picture.fits), "not fitted")
    bad = {
        each.label
        for each in picture.found.regions
        # A disk that does not enter the floc says nothing about its outline.
        if min(picture.fits[each.label][0]) < each.equivalent_radius
        and picture.finest(each).relative_error > limit
    }
    if bad:
        count = len(picture.finest(picture.found.regions[0]).vertices)
        report(
            f"{picture.name}: {plural(len(bad), 'floc')} left out, as RE is above {limit:g} % at "
            f"N = {count} (--max-error)"
        )
    return without(picture, bad, f"RE above {limit:g} %")


def without(picture: Picture, labels: Collection[int], reason: str) -> Picture:
    """Return the Picture without the flocs of these labels, which the table lists with a reason."""
    flocs = [
        each | {"choice": REJECT} if each["floc"] in labels else each
        for each in picture.choices["flocs"]
    ]
    choices = {**picture.choices, "flocs": flocs}
    found = chosen(picture.found, choices, reason)
    return attrs.evolve(picture, found=found, choices=choices)


def titles_of(paths: Sequence[Path]) -> list[str]:
    """Return what pictures are called in tables and libraries: all different, and all of them text.

    Pictures of one name in several folders are told apart by their paths; a byte that is no UTF-8
    is written as \\xe9.
    """
    names = [path.name for path in paths]
    plain = [path.name if names.count(path.name) == 1 else path.as_posix() for path in paths]
    return different([os.fsencode(name).decode("utf-8", "backslashreplace") for name in plain])


def different(names: Sequence[str]) -> list[str]:
    """Return the names of files; those that came before get as many primes as they need."""
    found: list[str] = []
    for name in map(Path, names):
        while str(name) in found:
            name = name.with_stem(f"{name.stem}'")
        found.append(str(name))
    return found


def files_of(names: Sequence[str], start: str, ending: str) -> list[Path]:
    """Return a file START-picture.ENDING for each of the pictures with these names."""
    plain = [Path(name.replace(":", "-").replace("/", "-")) for name in names]
    stems = [path.stem if path.suffix.lower() in MASK_SUFFIXES else path.name for path in plain]
    return [Path(name) for name in different([f"{start}{stem}{ending}" for stem in stems])]


def report(error: object) -> None:
    """Print a line on stderr."""
    print(f"flocsim: {error}", file=sys.stderr, flush=True)


def find_flocs(task: Task) -> Any:
    """Return the Pictures of a Task, or the error of its file."""
    path, title, background, options, _ = task
    picture = partial(picture_of, task, checksum_of(path))
    try:
        if options.masks:
            return [
                picture(title + inner[len(path.name) :], segment_mask(mask, **options.segmentation))
                for inner, mask in read_masks(path, options.memory)
            ]
        find: Any = partial(segment, background=background)
        if options.finder == "paper":
            find = segment_as_paper
        return [
            picture(title + page, find(grey, **options.segmentation), plane)
            for page, plane, grey in pictures_in(path, options)
        ]
    except (ImageError, FileError) as error:
        return error


def pictures_in(path: Path, options: Namespace) -> Iterator[tuple[str, Plane, np.ndarray]]:
    """Yield (what follows its name, Plane, grey) of the pictures of a file that are asked for."""
    check_file(path, "picture file")
    if path.suffix.lower() in ARRAYS:
        raise ImageError(f"{path}: {path.suffix} files hold masks, not pictures: give --masks")
    for page, plane in planes_of(path, stack_of(path), options.page, options.channel, options.crop):
        pixels = read_pixels(path, plane, options.memory)
        if is_mask(pixels):
            raise ImageError(f"{path}: was left out, as it holds masks or labels: give --masks")
        yield page, plane, grey_of(pixels, path)


def picture_of(
    task: Task, checksum: str, name: str, found: Segmentation, plane: Plane | None = None
) -> Picture:
    """Return the Picture of a Segmentation, with the flocs that were chosen by eye."""
    path, _, _, options, by_eye = task
    size = options.pixel_size or pixel_size_in(path, stack_of(path))
    if size is None:
        raise UsageError(
            f"{path}: does not state the size of a pixel, as OME-TIFF and ImageJ files do; give "
            "the length of its side, for example --pixel-size '0.95 um'"
        )
    choices = choices_of(name, checksum, found)
    if by_eye is not None:
        choices = judged(options.reviewed, choices, by_eye.get(name))
    found = chosen(found, choices)
    if options.holes and found.holes is not None:
        opened = tuple(with_holes(each, found.holes) for each in found.regions)
        found = attrs.evolve(found, regions=opened)
    found = attrs.evolve(found, holes=None)
    measures = {region.label: mask_measures(region.mask) for region in found.regions}
    return Picture(path, name, found, measures, size, choices, plane)


def fit_region(task: tuple[str, Sequence[np.ndarray], Namespace]) -> list[Fits] | ShapeError:
    """Return the Fits of each mask in (name, masks, options), or why there is no fit."""
    name, masks, options = task

    def fit(mask: np.ndarray, radius: float, count: int) -> Fit:
        # A circle of a radius above r_eq is larger than the floc already.
        keep = options.preserve_area and np.pi * radius**2 < mask.sum()
        return fit_mask(
            mask, vertices=count, radius=radius, method=options.method, preserve_area=keep,
            inscribed=options.inscribed, holes=options.holes,
        )  # fmt: skip

    with warnings.catch_warnings():
        # The library's warnings say it once, not once a floc and N.
        warnings.simplefilter("ignore", UserWarning)
        try:
            return [
                {r: {n: fit(mask, r, n) for n in options.vertices} for r in options.radii}
                for mask in masks
            ]
        except ShapeError as error:
            return ShapeError(f"{name}: {error}")


def list_pictures(names: Sequence[str], masks: bool) -> list[Path]:
    """Return the files' paths, folders replaced by the pictures in them; each path once."""
    suffixes = MASK_SUFFIXES if masks else SUFFIXES
    paths: list[Path] = []
    for path in map(Path, names):
        found = [path]
        if path.is_dir():
            found = sorted(p for p in path.iterdir() if p.suffix.lower() in suffixes)
        if not found:
            report(f"{path}: the folder holds no pictures ({', '.join(suffixes)})")
        paths += found
    return list(dict.fromkeys(paths))


def find_background(paths: Sequence[Path], options: Namespace) -> np.ndarray | None:
    """Return the median of the frames, or None where a surface is fitted to each."""
    if options.background != "median" or options.masks:
        return None
    frames = []
    for path in paths[:: max(1, len(paths) // MOST_FRAMES)]:
        # A file that cannot be read, or is a mask, is reported when its own turn comes.
        with contextlib.suppress(ImageError, MemoryError):
            frames += [grey for _, _, grey in pictures_in(path, options)]
    shapes = {frame.shape for frame in frames}
    if len(frames) < FEWEST_FRAMES or len(shapes) > 1:
        sizes = ", ".join(f"{width} × {height}" for height, width in sorted(shapes))
        raise UsageError(
            f"--background median needs at least {FEWEST_FRAMES} frames of the same size, found "
            f"{len(frames)} ({sizes}); use --background surface"
        )
    return np.median(np.stack(frames), axis=0)


def draw_fits(folder: str, pictures: Sequence[Picture], rule: Rule) -> None:
    """Write a picture of every fit at the largest N and the smallest spheroradius."""
    starts = files_of([each.name for each in pictures], os.path.join(folder, ""), "")
    for picture, start in zip(pictures, starts, strict=True):
        for region in picture.found.regions:
            name = f"{picture.name}#{region.label}"
            figure = single_fit(region.mask, picture.finest(region), name)
            save(figure, Path(f"{start}-{region.label}.png"), rule)


def draw_review(paths: Sequence[Path], pictures: Sequence[Picture], options: Namespace) -> None:
    """Write the page on which flocs are chosen by eye, if there is to be one, and show it where
    that is possible."""
    for path in paths if pictures else []:
        template = Path(__file__).with_name("templates") / "review.html"
        # What a picture is drawn from: its grey, or its mask.
        greys = (
            each.found.foreground
            if options.masks
            else read_grey(each.path, each.plane or Plane(), options.memory)
            for each in pictures
        )
        page = review_page(template.read_text("utf-8"), pictures, greys)
        write_file(path, page.encode(), options.overwrite)
        print(
            f"{path}: choose flocs on this page, save the choices, and run this command again with "
            f"--reviewed {FILE_OF_CHOICES} --overwrite instead of --review"
        )
        # Without a display a browser would take over the terminal.
        has_display = sys.platform in ("darwin", "win32") or any(map(os.environ.get, DISPLAYS))
        if has_display and sys.stdout.isatty():
            webbrowser.open(path.resolve().as_uri())
