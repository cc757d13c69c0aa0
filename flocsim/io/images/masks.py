"""Masks that are given directly: PNG, TIFF, BMP or JPEG pictures, NumPy .npy and .npz files.

Whether a file is a photograph or a mask is told by its values: in labels, neighbouring pixels
nearly always agree.
"""

from pathlib import Path

import numpy as np

from flocsim.errors import ImageError
from flocsim.io.images import reading
from flocsim.io.images.outlines import EIGHT, Outline, filled, pieces
from flocsim.io.images.pictures import Segmentation
from flocsim.io.images.regions import NAN, Filters, sorted_out

ARRAYS = (".npy", ".npz")
MOST_LABELS = 100_000

PLAIN_INSIDE = (1, 255, 65535)
"""What alone beside 0 means "inside", not one floc of that number."""

LARGEST_KEPT = 2**31 - 1
"""Labels above this number are numbered anew."""

MASK_SUFFIXES = (*reading.SUFFIXES, *ARRAYS)
"""Endings that are taken for masks when a folder is given."""

AGREEING = 0.75
"""Least share of like neighbours, in the median over labels.

Of ten photographs, listed in docs/images.md, the median grey level has .25 at most, and .70
smoothed by 2 px or more; labels have 1 where flocs lie apart, and .8 where squares of 5 px cover
everything.
"""

BETWEEN = 0.02
"""Share of pixels that are neither black nor white, away from all edges, that no JPEG mask has."""

EDGE = 2
"""Pixels on either side of an edge that packing as JPEG makes grey."""

WAY = "fit it without --masks, or give a mask of two values or labels, one value for each floc"


def read_masks(path: str | Path, memory: float = reading.MEMORY) -> list[tuple[str, np.ndarray]]:
    """The masks of a file: [(name, (h, w) integer array)], 0 outside.

    Two values are a mask of any number of flocs, the greater one inside; integers of more values
    are labels, one floc each; a JPEG is cut at half its range.  An .npz holds one mask per array,
    or bits packed by np.packbits under their names with `shapes` (n, 2) in the order of the names.
    Raises ImageError for anything else.
    """
    path = Path(path)
    if path.suffix.lower() in ARRAYS:
        return [(f"{path.name}:{key}" if key else path.name, _mask(array, f"{path} {key}"))
                for key, array in _arrays(path, memory)]  # fmt: skip
    pixels = reading.read_pixels(path, memory=memory)
    flat = pixels if pixels.ndim == 2 else pixels[..., :3].max(axis=2)
    if path.suffix.lower() in (".jpg", ".jpeg"):
        check_halves(path, flat)
        flat = flat > 0.5 * flat.max()
    return [(path.name, _mask(flat, str(path)))]


def _arrays(path, memory):
    """Return [(key, array)] of an .npy or .npz file."""
    reading.check_file(path, "file of masks")
    try:
        if path.suffix.lower() == ".npy":
            array = np.load(path, mmap_mode="r")  # not read before its size is known
            reading.check_memory(path, array.nbytes, array.shape, memory=memory)
            return [("", np.array(array))]
        with np.load(path) as archive:
            if sum(entry.file_size for entry in archive.zip.infolist()) > memory:
                raise ImageError(
                    f"{path}: would be more than {memory:.3g} bytes after decompression; give "
                    "--memory"
                )
            arrays = {key: archive[key] for key in sorted(archive.files)}
        if "shapes" not in arrays:
            for key, array in arrays.items():
                reading.check_memory(f"{path} {key}", array.nbytes, array.shape, memory=memory)
            return list(arrays.items())
        # Stored as bits. A byte a pixel, and four of the labels made of it, are kept of all.
        shapes = np.array(arrays.pop("shapes"), int).reshape(-1, 2)
        sizes = shapes.astype(float).prod(axis=1)
        reading.check_memory(path, int(5 * sizes.sum()), (int(sizes.max()),), memory=memory)
        return [
            (key, np.unpackbits(bits)[: height * width].reshape(height, width))
            for (key, bits), (height, width) in zip(arrays.items(), shapes.tolist(), strict=True)
        ]
    except ImageError:
        raise
    except Exception as problem:
        reason = reading.one_line(problem)
        raise ImageError(f"{path}: cannot be read as NumPy arrays ({reason})") from problem


def _mask(array, name):
    if array.ndim != 2 or array.size == 0:
        raise ImageError(f"{name}: a mask is an (h, w) array, found shape {array.shape}")
    reading.check_array(name, array)
    if array.dtype == bool:
        return array.astype(np.int32)
    values = np.unique(array)
    is_whole = np.issubdtype(array.dtype, np.integer)
    if len(values) == 2 and not (is_whole and values[0] == 0):
        return (array > values[0]).astype(np.int32)
    if len(values) == 1:
        return (array > 0).astype(np.int32)
    if not is_whole or values[0] < 0:
        raise ImageError(
            f"{name}: a mask holds two values, or labels from 0; found {len(values)} values of "
            f"type {array.dtype}"
        )
    if len(values) > MOST_LABELS:
        raise ImageError(f"{name}: holds {len(values)} labels, more than {MOST_LABELS}")
    # Numbered anew from 1: a label may be any number, and a table as long as the largest is made.
    labels = (np.searchsorted(values, array) + (values[0] > 0)).astype(np.int32)
    if (share := agreement(labels)) < AGREEING:
        raise ImageError(
            f"{name}: is a photograph, not a mask: {len(values)} grey levels, and only "
            f"{100 * share:.0f} % of neighbouring pixels agree; {WAY}"
        )
    return labels if values[-1] > LARGEST_KEPT else array.astype(np.int32)


def segment_mask(
    mask: np.ndarray, *, min_radius: float = 4.0, max_radius: float = np.inf
) -> Segmentation:
    """The flocs of a mask or label image as a Segmentation: holes filled, by size only.

    What touches the border stays, and nothing is parted: who gives a mask has decided that. A floc
    has the number of its label; further parts of one label, and the parts of a mask, are counted.
    """
    from scipy.ndimage import find_objects, label

    levels, labels = np.unique(mask, return_inverse=True)
    labels = labels.reshape(mask.shape).astype(np.int32) + (levels[0] > 0)
    values: list[int] = levels[levels > 0].tolist()
    if len(values) < 2:
        labels, count = label(filled(labels > 0), EIGHT)
        if count != 1 or values[0] in PLAIN_INSIDE:
            values = list(range(1, count + 1))
    found, numbers, spare = [], [], max(values, default=0)
    for place, box in enumerate(find_objects(labels), start=1):
        others = (labels[box] != place) & (labels[box] > 0)
        parts = list(pieces(filled(labels[box] == place) & ~others, box))
        found += [Outline(where, part, NAN, NAN, NAN, NAN) for part, where in parts]
        numbers += [values[place - 1], *range(spare + 1, spare + len(parts))]
        spare += len(parts) - 1
    filters = Filters(min_radius, max_radius, clear_of_border=False)
    regions, rejected = sorted_out(found, mask.shape, filters, numbers)
    seen = mask > 0
    holes = filled(seen) & ~seen
    return Segmentation(labels > 0, regions, rejected, "masked", float("nan"), holes=holes)


def agreement(labels: np.ndarray) -> float:
    """Median over the values of (h, w) whole numbers ≥ 0, but 0, of their share of like neighbours.

    The neighbours of a pixel are those beside, above and below it, those of value 0 left out: a
    floc whose outline touches no other has 1.  NaN where there is no pair of neighbours.
    """
    length = int(labels.max(initial=0)) + 1
    like, unlike = np.zeros(length), np.zeros(length)
    for one, other in ((labels[:, 1:], labels[:, :-1]), (labels[1:], labels[:-1])):
        inside = (one > 0) & (other > 0)
        one, other = one[inside], other[inside]
        same = one == other
        like += 2 * np.bincount(one[same], minlength=length)
        unlike += np.bincount(one[~same], minlength=length)
        unlike += np.bincount(other[~same], minlength=length)
    pairs = like + unlike
    return float(np.median(like[pairs > 0] / pairs[pairs > 0])) if pairs.any() else float("nan")


def check_halves(name: object, grey: np.ndarray) -> None:
    """ImageError for a JPEG, (h, w), that is more than black and white."""
    from scipy.ndimage import binary_dilation

    least, most = float(grey.min()), float(grey.max())
    level = (grey - least) / max(most - least, 1.0)
    inside = level > 0.5
    near = binary_dilation(inside, iterations=EDGE) & binary_dilation(~inside, iterations=EDGE)
    between = int(((level > 0.25) & (level < 0.75) & ~near).sum())
    smaller = min(int(inside.sum()), int((~inside).sum()))
    if between > BETWEEN * max(smaller, 1):
        raise ImageError(
            f"{name}: is a photograph, not a mask: {between} pixels are neither black nor white; "
            f"{WAY} (JPEG does not preserve labels: use PNG)"
        )


def is_mask(pixels: np.ndarray) -> bool:
    """Whether the pixels of a picture file are a mask or labels: 0 outside, flocs of one value.

    A picture of two values of which neither is 0 counts as a photograph, however odd.
    """
    flat = pixels
    if pixels.ndim == 3:
        flat = pixels[..., 0]
        if not (pixels[..., :3] == flat[..., None]).all():  # an alpha channel says nothing
            return False
    if flat.dtype == bool:
        return bool(flat.any() and not flat.all())
    if flat.dtype.kind not in "iu" or flat.min(initial=1) != 0:
        return False
    if flat.dtype.itemsize > 2:
        flat = np.unique(flat, return_inverse=True)[1].reshape(flat.shape)
    return agreement(flat) >= AGREEING
