"""Picture files → grey arrays. Pillow opens nearly all; tifffile what Pillow cannot in TIFF.

How large a picture or a mask may be is said before anything is allocated for it.
"""

import math
import warnings
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from flocsim.errors import ImageError
from flocsim.io.images.stacks import Plane, stack_of

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
"""Endings that are taken for pictures when a folder is given."""

FORMATS = ("PNG", "JPEG", "TIFF", "BMP")
"""What Pillow may take a file for, whatever its ending."""

PLAIN, DEFLATED = (1, 32773), (8, 32946)
"""How a TIFF may be packed that Pillow cannot read: not or by runs; deflated."""

ONLY = Plane()
"""The only picture of a file that has no other."""

CHOOSE = "choose with --page and --channel, or save the picture that you want as a file of its own"

LUMINANCE = np.array([0.2125, 0.7154, 0.0721])
"""Weights of red, green and blue in the luminance (ITU-R BT.709)."""

MOST_PIXELS = 2**27
"""134 million: some 4 GB while its flocs are looked for."""

PIXELS_PER_BYTE = 10_000
"""More than any packing makes of a byte of the file: the pixels are not there."""

LARGEST_FILE = 2**32
MOST_SPREAD = 20
"""Times the picture's pixels that the boxes around all labels may cover."""

MOST_ARRAYS = 10_000
LONGEST_NAME = 200


def read_grey(path: str | Path, plane: Plane = ONLY) -> np.ndarray:
    """The luminance of a picture file (PNG, JPEG, TIFF, BMP), (h, w) float64 in [0, 1].

    The full range of the file's number type maps to [0, 1]; floating-point files must already lie
    there or are divided by their maximum.  Transparent pixels take the median grey of the opaque
    ones, so that they count as background.  Raises ImageError, naming the file, when it is
    missing, damaged, no picture, or a stack of several of which ``plane`` names none.
    """
    return grey_of(read_pixels(path, plane), path)


def grey_of(pixels: np.ndarray, path: str | Path) -> np.ndarray:
    """What read_grey gives for a file's pixels as they are stored; path: for messages."""
    pixels = _to_unit_range(pixels, path)
    if pixels.ndim == 2:
        return pixels
    if pixels.ndim != 3 or pixels.shape[2] > 4:
        raise ImageError(
            f"{path}: an array of shape {pixels.shape} is not a single grey or colour picture; "
            "save the picture that you want as a file of its own"
        )
    has_alpha = pixels.shape[2] in (2, 4)
    colours = pixels[..., :-1] if has_alpha else pixels
    grey = colours[..., 0] if colours.shape[2] == 1 else colours @ LUMINANCE
    if not has_alpha:
        return grey
    alpha = pixels[..., -1]
    opaque = grey[alpha > 0.5]
    backdrop = np.median(opaque) if opaque.size else 0.0
    return alpha * grey + (1.0 - alpha) * backdrop


def _to_unit_range(pixels, path):
    if pixels.dtype == bool:
        return pixels.astype(float)
    low, high = float(pixels.min()), float(pixels.max())
    if low < 0:
        raise ImageError(f"{path}: holds negative values (least {low:g}); grey starts at 0")
    if np.issubdtype(pixels.dtype, np.floating):
        return pixels.astype(float) / max(high, 1.0)
    # 16-bit files may arrive in a 32-bit array: the smallest usual range that holds them counts.
    full = 255.0 if pixels.dtype.itemsize == 1 else 65535.0
    return pixels.astype(float) / max(full, high)


def read_pixels(path: str | Path, plane: Plane = ONLY) -> np.ndarray:
    """The pixels of a picture file as they are stored, (h, w) or (h, w, channels)."""
    path = Path(path)
    check_file(path, "picture file")
    stack = stack_of(path)
    if plane is ONLY and stack.frame_count > 1:
        raise ImageError(f"{path}: holds {stack.frame_count} pictures; {CHOOSE}")
    # Pillow takes planes that are stored as colours for colours, and those of 16 bits wrongly.
    pixels = (
        _decode_with_tifffile(path, 0)[plane.frame]
        if stack.planar else _decode(path, plane.frame)
    )  # fmt: skip
    pixels = _part(pixels, plane, path)
    if pixels.size == 0:
        raise ImageError(f"{path}: the picture is empty")
    check_shape(path, pixels.shape)
    check_array(path, pixels)
    return pixels


def _part(pixels, plane, path):
    """The colour and the part of decoded pixels that a plane names."""
    if plane.sample is not None:
        count = pixels.shape[2] if pixels.ndim == 3 else 1
        if not 0 <= plane.sample < count:
            raise ImageError(f"{path}: has no channel {plane.sample + 1}, only {count}")
        pixels = pixels if pixels.ndim == 2 else pixels[..., plane.sample]
    if plane.crop is None:
        return pixels
    x, y, width, height = plane.crop
    if x + width > pixels.shape[1] or y + height > pixels.shape[0]:
        raise ImageError(
            f"{path}: --crop {x},{y},{width},{height} reaches beyond its {pixels.shape[1]} × "
            f"{pixels.shape[0]} pixels"
        )
    return pixels[y : y + height, x : x + width]


def _decode(path, frame):
    try:
        with warnings.catch_warnings():
            # What a decoder only warns of, odd metadata, does not touch the pixels.
            warnings.simplefilter("ignore")
            return _decode_with_pillow(path, frame)
    except ImageError:
        raise
    except Exception as problem:
        if type(problem).__name__ == "DecompressionBombError":
            raise ImageError(
                f"{path}: it has more than the {MOST_PIXELS} pixels that a picture may have; cut "
                "it into smaller ones"
            ) from problem
        # Decoders raise nearly anything on damaged files; all of it means one thing to the user.
        if path.suffix.lower() in (".tif", ".tiff"):
            return _decode_with_tifffile(path, frame)
        raise ImageError(
            f"{path}: cannot be read as a picture ({one_line(problem)}); "
            "give an undamaged PNG, JPEG, TIFF or BMP"
        ) from problem


def _decode_with_pillow(path, frame):
    from PIL import Image, ImageOps

    # Only these: others run programs on what they read (EPS: Ghostscript).
    with Image.open(path, formats=FORMATS) as image:
        check_shape(path, (*image.size[::-1], len(image.getbands())))
        check_promise(path, image.width * image.height)
        if frame >= (count := getattr(image, "n_frames", 1)):
            raise ImageError(f"{path}: has no picture {frame + 1}, only {count}")
        image.seek(frame)
        check_shape(path, (*image.size[::-1], len(image.getbands())))
        check_promise(path, image.width * image.height)
        image.load()
        image = ImageOps.exif_transpose(image)
        if image.mode in ("P", "PA"):
            image = image.convert("RGBA")
        elif image.mode in ("CMYK", "YCbCr", "LAB", "HSV", "RGBX"):
            image = image.convert("RGB")
        return np.asarray(image)


def _decode_with_tifffile(path, frame):
    """The pixels of a page; ImageError for one that is too large, or unpacks to more than these."""
    import tifffile

    try:
        with tifffile.TiffFile(path) as tiff:
            if frame >= len(tiff.pages):
                raise ImageError(f"{path}: has no picture {frame + 1}, only {len(tiff.pages)}")
            page = tiff.pages[frame]
            check_shape(path, page.shape)
            check_promise(path, int(np.prod(page.shape[:2])))
            check_shape(path, (page.imagelength, page.imagewidth))
            if page.dtype is None or page.compression not in (*PLAIN, *DEFLATED):
                raise ImageError(
                    f"{path}: its packing {page.compression!s:.40} is unknown; save it "
                    "uncompressed, or as PNG"
                )
            rows, columns = page.chunks[:2] if len(page.chunks) > 1 else (page.chunks[0], 1)
            wanted = 4 * int(np.prod(page.chunks)) * page.dtype.itemsize
            if wanted > 64 * MOST_PIXELS:
                raise ImageError(f"{path}: its pieces of {rows} × {columns} pixels are too large")
            for offset, length in zip(page.dataoffsets, page.databytecounts, strict=True):
                if page.compression in DEFLATED:
                    tiff.filehandle.seek(offset)
                    packed = tiff.filehandle.read(length)
                    if len(zlib.decompressobj().decompress(packed, wanted + 1)) > wanted:
                        raise ImageError(
                            f"{path}: a part of it decompresses to more than {wanted} bytes"
                        )
            return np.asarray(page.asarray())
    except ImageError:
        raise
    except Exception as problem:
        raise ImageError(
            f"{path}: cannot be read as a TIFF ({one_line(problem)}); "
            "save it uncompressed, or as PNG"
        ) from problem


def one_line(problem: Exception) -> str:
    """What an exception of a decoder says, shortened."""
    if type(problem).__name__ == "UnidentifiedImageError":
        return "its content has no known picture format"
    if isinstance(problem, MemoryError):
        return "out of memory"
    return " ".join(str(problem).split())[:120] or type(problem).__name__


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
    """ImageError for labels in boxes, pairs of slices, so large that sorting them would take for
    ever."""
    sizes = [math.prod(side.stop - side.start for side in box) for box in boxes if box is not None]
    if sum(sizes) > MOST_SPREAD * math.prod(shape) + 2**20:
        raise ImageError(
            f"{name}: its {len(sizes)} labels are scattered over the image; give each floc its own "
            "label"
        )
