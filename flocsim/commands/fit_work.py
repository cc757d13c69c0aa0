"""The work of `flocsim fit`, in one process or several: pictures → regions → fits."""

import contextlib
import sys
from pathlib import Path

import attrs

from flocsim.errors import FlocsimError, ImageError, ShapeError, UsageError


@attrs.frozen(eq=False)
class Picture:
    """One picture or mask and what was found in it: `found` is a Segmentation."""

    path: Path
    name: str
    found: object
    regions: tuple


@contextlib.contextmanager
def workers(jobs):
    """A map over tasks, in order, as results come in; by `jobs` processes if more than one."""
    if jobs == 1:
        yield map
        return
    import multiprocessing

    prepare()
    # Linux processes inherit what is compiled and loaded; elsewhere forking is not safe.
    context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    with context.Pool(jobs, ignore_interrupts) as pool:
        yield pool.imap


def prepare():
    """Compile before there are several processes that would all do it."""
    import numpy as np

    from flocsim.geometry.fit.fit import fit_mask

    fit_mask(np.ones((9, 9), bool), vertices=5)


def ignore_interrupts():
    """Ctrl-C is the parent's to handle."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)


def find_flocs(task):
    """[Picture] of (path, name, background, Options), or the error that its file gives."""
    path, name, background, options = task
    try:
        if options.masks:
            return masked(path, name, options)
        from flocsim.io.images.pictures import read_grey, segment

        found = segment(read_grey(path), background=background, **options.segmentation)
        return [picture(path, name, found, options)]
    except FlocsimError as error:
        return error


def masked(path, name, options):
    """[Picture] of the masks in a file."""
    from flocsim.io.images.masks import read_masks, segment_mask

    limits = {key: options.segmentation[key] for key in ("min_radius", "max_radius")}
    return [
        picture(path, name + inner[len(path.name) :], segment_mask(mask, **limits), options)
        for inner, mask in read_masks(path)
    ]


def picture(path, name, found, options):
    """A Picture with the regions that are to be fitted."""
    return Picture(path, name, found, largest(found.regions, options.max_flocs))


def largest(regions, count):
    """The `count` largest regions, in their old order; all for None."""
    by_size = sorted(regions, key=lambda region: (-region.area, region.label))[:count]
    return tuple(sorted(by_size, key=lambda region: region.label))


def fit_region(task):
    """{radius: {N: Fit}} of (name, mask, Options); ShapeError, with the name, for none."""
    import warnings

    name, mask, options = task
    with warnings.catch_warnings():
        # Said once a picture, by warn_of_coarse, not once a floc and N.
        warnings.simplefilter("ignore", UserWarning)
        try:
            return {
                radius: {count: fit_one(mask, count, radius, options) for count in options.vertices}
                for radius in options.radii
            }
        except ShapeError as error:
            raise ShapeError(f"{name}: {error}, or leave small flocs out by --min-radius") from None


def fit_one(mask, count, radius, options):
    """The Fit of a mask by the Options."""
    from flocsim.geometry.fit.fit import fit_mask

    return fit_mask(
        mask, vertices=count, radius=radius, method=options.method, inscribed=options.inscribed,
        preserve_area=options.preserve_area and is_fine(mask, radius),
    )  # fmt: skip


def is_fine(mask, radius):
    """Whether the spheroradius is below the floc's equivalent radius."""
    return 3.141592653589793 * radius**2 < mask.sum()


def list_pictures(names, masks, report):
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


MOST_FRAMES = 25
"""More frames than this tell hardly more about the light."""


def find_background(paths, options):
    """The median of the frames, or None where a surface is fitted to each."""
    if options.background == "surface" or options.masks:
        return None
    from flocsim.io.images.background import FEWEST_FRAMES, median_frame
    from flocsim.io.images.pictures import read_grey

    frames = []
    for path in paths[:: max(1, len(paths) // MOST_FRAMES)]:
        # A file that cannot be read is reported when its own turn comes.
        with contextlib.suppress(ImageError):
            frames.append(read_grey(path))
    shapes = {frame.shape for frame in frames}
    if len(frames) < FEWEST_FRAMES or len(shapes) > 1:
        sizes = ", ".join(f"{width} × {height}" for height, width in sorted(shapes))
        raise UsageError(
            f"--background median needs at least {FEWEST_FRAMES} frames of one size, found "
            f"{len(frames)} ({sizes}); use --background surface"
        )
    return median_frame(frames)
