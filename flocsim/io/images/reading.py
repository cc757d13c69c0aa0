"""Picture files → grey arrays: tifffile reads TIFF that it unpacks by itself, Pillow all else.

How much memory a picture or a mask takes is estimated before anything is allocated for it.
"""

import contextlib
import logging
import math
import os
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from flocsim.errors import ImageError
from flocsim.io.images.stacks import TIFF_SUFFIXES, Crop, Plane, stack_of

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
"""Endings that are taken for pictures when a folder is given."""

FORMATS = ("PNG", "JPEG", "TIFF", "BMP")
"""What Pillow may take a file for, whatever its ending."""

PLAIN, DEFLATED = (1, 32773), (8, 32946)
"""Compressions of TIFF that tifffile unpacks without further libraries: none or runs; deflate."""

WHITE_IS_ZERO, BLACK_IS_ZERO, RGB = 0, 1, 2
"""Photometric interpretations of TIFF that are taken as they are stored."""

ONLY = Plane()
"""The only picture of a file that has no other."""

CHOOSE = "choose with --page and --channel, or save the picture that you want as a file of its own"

LUMINANCE = np.array([0.2125, 0.7154, 0.0721])
"""Weights of red, green and blue in the luminance (ITU-R BT.709)."""

MEMORY = 1.3e9
"""Bytes that a picture may take unless --memory gives another number: 25 Mpixel of grey fit."""

BYTES_PER_PIXEL = 48
"""Peak of reading, finding flocs and measuring them where one island covers most of the picture,
which is the worst case; 25 where all flocs are small."""

LARGEST_FILE = 2**32

for _name in ("tifffile", "PIL"):
    # Their warnings about odd metadata do not concern the pixels, and would reach the terminal.
    logging.getLogger(_name).addHandler(logging.NullHandler())


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep what decoders print, warn and log from the terminal: libtiff writes to descriptor 2."""
    with warnings.catch_warnings(), tempfile.TemporaryFile() as unread:
        warnings.simplefilter("ignore")
        try:
            stderr = os.dup(2)
        except OSError:  # there is none
            yield
            return
        os.dup2(unread.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)


def read_grey(path: str | Path, plane: Plane = ONLY, memory: float = MEMORY) -> np.ndarray:
    """Return the luminance of a picture file (PNG, JPEG, TIFF, BMP), (h, w) float32 in [0, 1].

    The full range of the file's number type maps to [0, 1]; for floating-point values beyond 1 and
    integers of more than 16 bits see `full_scale`.  Transparent pixels take the median grey of the
    opaque ones, so that they count as background.  Raises ImageError, naming the file, when it is
    missing, damaged, no picture, needs more than `memory` bytes, or is a stack of several of which
    ``plane`` names none.
    """
    return grey_of(read_pixels(path, plane, memory), path)


def grey_of(pixels: np.ndarray, path: str | Path) -> np.ndarray:
    """Return what read_grey gives for a file's pixels as they are stored; path: for messages."""
    if pixels.ndim not in (2, 3) or (pixels.ndim == 3 and pixels.shape[2] > 4):
        raise ImageError(
            f"{path}: an array of shape {pixels.shape} is not a single grey or colour picture; "
            "save the picture that you want as a file of its own"
        )
    samples = pixels[..., None] if pixels.ndim == 2 else pixels
    full = full_scale(pixels, path)

    def unit(sample):
        values = samples[..., sample].astype(np.float32)
        return np.minimum(np.divide(values, full, out=values), 1.0, out=values)

    count = samples.shape[2]
    if count < 3:
        grey = unit(0)
    else:
        grey = np.zeros(samples.shape[:2], np.float32)
        for sample, weight in enumerate(LUMINANCE):
            grey += weight * unit(sample)
    if count in (1, 3):
        return grey
    alpha = unit(count - 1)
    opaque = grey[alpha > 0.5]
    backdrop = np.median(opaque) if opaque.size else np.float32(0.0)
    return alpha * grey + (1.0 - alpha) * backdrop


def full_scale(pixels: np.ndarray, path: str | Path) -> float:
    """Return the value that stands for white.

    For integers of up to 16 bits it is their largest; wider ones have often come from 16 bits.
    Values beyond that have no natural white: the brightest that two neighbours reach is taken, so
    that a single hot pixel does not turn the rest black.
    """
    if pixels.dtype == bool:
        return 1.0
    if (low := float(pixels.min())) < 0:
        raise ImageError(f"{path}: holds negative values (least {low:g}); grey starts at 0")
    if pixels.dtype.kind in "iu" and pixels.dtype.itemsize <= 2:
        return float(np.iinfo(pixels.dtype).max)
    usual = 1.0 if pixels.dtype.kind == "f" else 65535.0
    if float(pixels.max()) <= usual:
        return usual
    pairs = [(pixels[1:], pixels[:-1]), (pixels[:, 1:], pixels[:, :-1])]
    reached = [float(np.minimum(*pair).max()) for pair in pairs if pair[0].size]
    return max(usual, *reached) if reached else float(pixels.max())


def read_pixels(path: str | Path, plane: Plane = ONLY, memory: float = MEMORY) -> np.ndarray:
    """Return the pixels of a picture file as they are stored, (h, w) or (h, w, channels)."""
    path = Path(path)
    check_file(path, "picture file")
    stack = stack_of(path)
    if plane is ONLY and stack.frame_count > 1:
        raise ImageError(f"{path}: holds {stack.frame_count} pictures; {CHOOSE}")
    frame = 0 if stack.planar else plane.frame
    with quiet():
        pixels = _decode(path, frame, plane.crop, memory)
    if stack.planar:  # an array of several pictures that is stored as the colours of one
        pixels = pixels[..., plane.frame]
    pixels = _part(pixels, plane, path)
    if pixels.size == 0:
        raise ImageError(f"{path}: the picture is empty")
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


def _decode(path, frame, crop, memory):
    """Return decoded pixels.  Decoders raise nearly anything on damaged files."""
    reason, dtype = "", None
    if path.suffix.lower() in TIFF_SUFFIXES:
        found, reason = _decode_tiff(path, frame, crop, memory)
        if not reason:
            return found
        dtype = found
    try:
        pixels = _decode_with_pillow(path, frame, crop, memory)
        # Pillow has no type for some integers: it takes 8 bits for unsigned, and 32 for signed.
        if dtype is not None and pixels.ndim == 2 and {pixels.dtype.kind, dtype.kind} <= {*"iu"}:
            pixels = pixels.astype(dtype)
        return pixels
    except ImageError:
        raise
    except Exception as problem:
        if type(problem).__name__ == "DecompressionBombError":
            raise ImageError(
                f"{path}: has more than the 178 Mpixel of a single picture that are read; cut it "
                "into smaller ones"
            ) from problem
        if reason:
            raise ImageError(f"{path}: {reason}; save it uncompressed, or as PNG") from problem
        raise ImageError(
            f"{path}: cannot be read as a picture ({one_line(problem)}); "
            "give an undamaged PNG, JPEG, TIFF or BMP"
        ) from problem


def _decode_with_pillow(path, frame, crop, memory):
    from PIL import Image, ImageOps

    # Only these: others run programs on what they read (EPS: Ghostscript).
    with Image.open(path, formats=FORMATS) as image:
        if frame >= (count := getattr(image, "n_frames", 1)):
            raise ImageError(f"{path}: has no picture {frame + 1}, only {count}")
        image.seek(frame)
        size = image.size[::-1]
        stored = math.prod(size) * max(len(image.getbands()), 4 if image.mode in "IF" else 1)
        # Twice: Pillow's own image, and the array that is made of it.
        check_memory(path, 2 * stored, size, crop, memory)
        image.load()
        image = ImageOps.exif_transpose(image)
        if image.mode in ("P", "PA"):
            image = image.convert("RGBA")
        elif image.mode in ("CMYK", "YCbCr", "LAB", "HSV", "RGBX"):
            image = image.convert("RGB")
        return np.asarray(image)


def _decode_tiff(path, frame, crop, memory):
    """Return (pixels, "") of a page of a TIFF that tifffile unpacks by itself, or (the type of its
    samples, why it is left to Pillow); ImageError where Pillow would read wrong values, too."""
    import tifffile

    try:
        with tifffile.TiffFile(path) as tiff:
            if frame >= len(tiff.pages):
                raise ImageError(f"{path}: has no picture {frame + 1}, only {len(tiff.pages)}")
            page = tiff.pages[frame]
            size = page.imagelength, page.imagewidth
            check_memory(path, page.nbytes, size, crop, memory)
            if reason := left_to_pillow(page):
                # Pillow swaps bytes that libtiff has swapped already, and inverts bytes only.
                wide = page.dtype not in (None, bool, np.uint8)
                swapped = tiff.byteorder == ">" and page.dtype != np.uint16
                if wide and (swapped or page.photometric == WHITE_IS_ZERO):
                    raise ImageError(f"{path}: {reason}; save it uncompressed, or as PNG")
                return page.dtype, reason
            pixels = np.asarray(page.asarray())
            if page.axes == "SYX":
                pixels = np.moveaxis(pixels, 0, -1)
            if page.photometric == WHITE_IS_ZERO:
                if pixels.dtype.kind not in "bu":
                    raise ImageError(
                        f"{path}: 0 is white, but of {pixels.dtype} values no value is known as "
                        "black"
                    )
                pixels = np.invert(pixels)
            return pixels, ""
    except ImageError:
        raise
    except Exception as problem:
        return None, f"cannot be read as a TIFF ({one_line(problem)})"


def left_to_pillow(page):
    """Return why tifffile cannot read a page by itself, or ""; page: tifffile.TiffPage."""
    bits, kind = page.bitspersample, getattr(page.sampleformat, "name", page.sampleformat)
    mixed = bits == 1 and page.samplesperpixel > 1
    if page.dtype is None or bits not in (1, 8, 16, 32, 64) or mixed:
        return f"its samples of {bits} bits ({kind}) are not read"
    if page.compression not in (*PLAIN, *DEFLATED) or page.predictor not in (1, 2):
        packing = getattr(page.compression, "name", page.compression)
        return f"its packing {packing} of {page.dtype} is not read"
    colours = getattr(page.photometric, "name", page.photometric)
    if page.photometric not in (WHITE_IS_ZERO, BLACK_IS_ZERO, RGB) or page.axes not in (
        "YX", "YXS", "SYX"
    ):  # fmt: skip
        return f"its colours {colours} of {page.dtype}, axes {page.axes}, are not read"
    orientation = page.tags.get("Orientation")
    turned = orientation is not None and orientation.value != 1
    return "it is stored turned" if turned else ""


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


def check_memory(
    name: object, stored: int, shape: Sequence[int], crop: Crop = None, memory: float = MEMORY
) -> None:
    """ImageError for a picture or mask that needs more bytes than it may take.

    stored: bytes of its decoded pixels; shape: (h, w, …), worked on but for what is cropped.
    """
    pixels = math.prod(shape[:2])
    used = pixels if crop is None else min(pixels, crop[2] * crop[3])
    needed = stored + BYTES_PER_PIXEL * used
    if needed > memory:
        raise ImageError(
            f"{name}: {pixels / 1e6:.3g} Mpixel need about {needed / 1e9:.2g} GB, more than the "
            f"{memory / 1e9:.2g} GB that a picture may take: crop or bin it, or give --memory "
            f"{math.ceil(needed / 1e8) / 10:g}"
        )


def check_array(name: object, array: np.ndarray) -> None:
    """ImageError for values that are no real numbers."""
    if array.dtype.kind not in "buif":
        raise ImageError(f"{name}: holds values of type {array.dtype!s:.40}, not numbers or flags")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ImageError(f"{name}: holds values that are not finite numbers")
