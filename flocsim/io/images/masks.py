"""Masks that are given directly: PNG, TIFF, BMP or JPEG pictures, NumPy .npy and .npz files."""

from pathlib import Path

import numpy as np

from flocsim.errors import ImageError
from flocsim.io.images.pictures import Segmentation
from flocsim.io.images.reading import SUFFIXES, read_pixels
from flocsim.io.images.regions import EIGHT, Filters, filled, sorted_out

ARRAYS = (".npy", ".npz")
MASK_SUFFIXES = (*SUFFIXES, *ARRAYS)
"""Endings that are taken for masks when a folder is given."""


def read_masks(path: str | Path) -> list[tuple[str, np.ndarray]]:
    """The masks of a file: [(name, (h, w) integer array)], 0 outside.

    Two values are a mask of any number of flocs, the greater one inside; integers of more values
    are labels, one floc each; a JPEG is cut at half its range.  An .npz holds one mask per array,
    or bits packed by np.packbits under their names with `shapes` (n, 2) in the order of the names.
    Raises ImageError for anything else.
    """
    path = Path(path)
    if path.suffix.lower() in ARRAYS:
        return [(f"{path.name}:{key}" if key else path.name, _mask(array, f"{path} {key}"))
                for key, array in _arrays(path)]  # fmt: skip
    pixels = read_pixels(path)
    flat = pixels if pixels.ndim == 2 else pixels[..., :3].max(axis=2)
    if path.suffix.lower() in (".jpg", ".jpeg"):
        flat = flat > 0.5 * flat.max()
    return [(path.name, _mask(flat, str(path)))]


def _arrays(path):
    """[(key, array)] of an .npy or .npz file."""
    if not path.is_file():
        raise ImageError(f"{path}: no such file of masks; check the path")
    try:
        content = np.load(path, allow_pickle=False)
        if path.suffix.lower() == ".npy":
            return [("", content)]
        arrays = {key: content[key] for key in sorted(content.files)}
    except Exception as problem:
        reason = " ".join(str(problem).split())[:120]
        raise ImageError(f"{path}: cannot be read as NumPy arrays ({reason})") from problem
    if "shapes" not in arrays:
        return list(arrays.items())
    shapes = arrays.pop("shapes")
    return [
        (key, np.unpackbits(bits)[: int(shape.prod())].reshape(shape))
        for (key, bits), shape in zip(arrays.items(), shapes, strict=True)
    ]


def _mask(array, name):
    if array.ndim != 2 or array.size == 0:
        raise ImageError(f"{name}: a mask is an (h, w) array, found shape {array.shape}")
    if array.dtype == bool:
        return array.astype(np.int64)
    values = np.unique(array)
    if len(values) <= 2:
        return (array > values[0]).astype(np.int64) if len(values) == 2 else (array > 0) * 1
    if not np.issubdtype(array.dtype, np.integer) or values[0] < 0:
        raise ImageError(
            f"{name}: a mask holds two values, or labels from 0; found {len(values)} values of "
            f"type {array.dtype}"
        )
    return array.astype(np.int64)


def segment_mask(
    mask: np.ndarray, *, min_radius: float = 4.0, max_radius: float = np.inf
) -> Segmentation:
    """The flocs of a mask or label image as a Segmentation: holes filled, by size only.

    What touches the border stays, and nothing is parted: who gives a mask has decided that.
    """
    from scipy.ndimage import find_objects, label

    labels = label(filled(mask > 0), EIGHT)[0] if mask.max() <= 1 else mask
    boxes = enumerate(find_objects(labels), start=1)
    found = [
        piece
        for number, box in boxes
        if box is not None
        for piece in _pieces(filled(labels[box] == number), box)
    ]
    filters = Filters(min_radius, max_radius, clear_of_border=False)
    regions, rejected = sorted_out(found, None, filters)
    return Segmentation(labels > 0, regions, rejected, "masked", float("nan"))


def _pieces(mask, box):
    """The connected parts of one label, each with its box: a label may be in several places."""
    from scipy.ndimage import find_objects, label

    parts = label(mask, EIGHT)[0]
    for number, inner in enumerate(find_objects(parts), start=1):
        place = tuple(
            slice(outer.start + part.start, outer.start + part.stop)
            for outer, part in zip(box, inner, strict=True)
        )
        yield parts[inner] == number, place
