"""How large a picture or a mask may be, said before anything is allocated for it."""

import math
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from flocsim.errors import ImageError

MOST_PIXELS = 2**27
"""134 million: some 4 GB while its flocs are looked for."""

PIXELS_PER_BYTE = 10_000
"""More than any packing makes of a byte of the file: the pixels are not there."""

LARGEST_FILE = 2**32
MOST_LABELS = 100_000
MOST_SPREAD = 20
"""Times the picture's pixels that the boxes around all labels may cover."""

MOST_ARRAYS = 10_000
LONGEST_NAME = 200


def check_file(path: Path, what: str) -> None:
    """ImageError unless there is an ordinary file of a bearable size at a path."""
    try:
        if not path.is_file():
            is_other = path.exists()
            raise ImageError(
                f"{path}: {'not an ordinary file' if is_other else f'no such {what}'}; "
                "check the path"
            )
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        raise ImageError(f"{path}: could not be read: {error}; check the path") from error
    if size > LARGEST_FILE:
        raise ImageError(f"{path}: larger than {LARGEST_FILE >> 30} GB; cut it into smaller ones")


def check_shape(name: object, shape: Sequence[int]) -> None:
    """ImageError for more pixels than MOST_PIXELS; further axes are counted as well."""
    pixels = math.prod(int(size) for size in shape[:2])
    if pixels > MOST_PIXELS or math.prod(int(size) for size in shape) > 4 * MOST_PIXELS:
        sizes = " × ".join(map(str, shape))
        raise ImageError(
            f"{name}: {sizes[:80]} pixels are more than the {MOST_PIXELS} that a picture may have; "
            "cut it into smaller ones"
        )


def check_promise(path: Path, pixels: int) -> None:
    """ImageError for a file that is far too small for the pixels that it promises."""
    size = path.stat().st_size
    if pixels > PIXELS_PER_BYTE * size:
        raise ImageError(f"{path}: claims {pixels} pixels in {size} bytes: it is damaged")


def check_array(name: object, array: np.ndarray) -> None:
    """ImageError for values that are no real numbers."""
    if array.dtype.kind not in "buif":
        raise ImageError(f"{name}: holds values of type {array.dtype!s:.40}, not numbers or flags")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ImageError(f"{name}: holds values that are not finite numbers")


def read_array(file: BinaryIO, size: int, name: str) -> np.ndarray:
    """The array of an open .npy file of ``size`` bytes; its head is checked before its values.

    Raises ImageError for what is none, is too large, or promises more than the file has.
    """
    form = np.lib.format
    version = form.read_magic(file)
    if version not in ((1, 0), (2, 0), (3, 0)):
        raise ImageError(f"{name}: has an unknown version of NumPy's format")
    read = form.read_array_header_1_0 if version == (1, 0) else form.read_array_header_2_0
    shape, by_columns, dtype = read(file)
    check_shape(name, shape)
    # Python objects would be code of whoever wrote the file.
    if dtype.hasobject or dtype.kind not in "buif" or any(each < 0 for each in shape):
        raise ImageError(f"{name}: holds values of type {dtype!s:.40}, not numbers or flags")
    length = math.prod(shape) * dtype.itemsize
    if length > size:
        raise ImageError(f"{name}: claims {length} bytes of values but has fewer")
    data = file.read(length)
    if len(data) < length:
        raise ImageError(f"{name}: is truncated")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if by_columns else "C")


def check_entries(path: Path, entries: Iterable[Any]) -> None:
    """ImageError for entries of a zip archive (ZipInfo) that no .npz file has."""
    entries = list(entries)
    if len(entries) > MOST_ARRAYS:
        raise ImageError(f"{path}: holds more than {MOST_ARRAYS} arrays")
    names = [entry.filename for entry in entries]
    if len({name.removesuffix(".npy") for name in names}) < len(names):
        raise ImageError(f"{path}: has two arrays of the same name")
    for entry in entries:
        name = entry.filename
        if not name.isprintable() or len(name) > LONGEST_NAME or entry.is_dir():
            raise ImageError(f"{path}: has an array with an impossible name: {name[:60]!r}")
        if entry.file_size > 8 * MOST_PIXELS:
            raise ImageError(
                f"{path}: {name} would be {entry.file_size} bytes, more than {8 * MOST_PIXELS}"
            )


def check_spread(name: object, shape: Sequence[int], boxes: Iterable[Any]) -> None:
    """ImageError for labels so many, or in boxes so large, that sorting them would take for ever.

    ``boxes``: of each label a pair of slices, or None.
    """
    count = spread = 0
    for box in boxes:
        if box is not None:
            count += 1
            spread += math.prod(side.stop - side.start for side in box)
    if count > MOST_LABELS:
        raise ImageError(f"{name}: holds {count} labels, more than {MOST_LABELS}")
    if spread > MOST_SPREAD * math.prod(shape) + 2**20:
        raise ImageError(
            f"{name}: its {count} labels are scattered over the image; give each floc its own label"
        )


def check_deflated(name: object, file: Any, places: Iterable[tuple[int, int, int]]) -> None:
    """ImageError for deflated pieces (offset, length, bytes that it should have) that have more."""
    for offset, length, wanted in places:
        file.seek(offset)
        unpacked = zlib.decompressobj().decompress(file.read(length), wanted + 1)
        if len(unpacked) > wanted:
            raise ImageError(f"{name}: a part of it decompresses to more than {wanted} bytes")
