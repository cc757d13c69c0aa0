"""What a TIFF file says of itself: its pages, its channels, the size of its pixels.

OME-TIFF and ImageJ say all three; other files have pages alone. Pages and channels count from 1.
"""

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import attrs

from flocsim.errors import ImageError
from flocsim.fields import read_number

LONGEST_TEXT = 2**22
"""Letters of a description beyond which it is not read."""

MOST_PLANES = 100_000
UNEQUAL = 1e-3
"""By this share the sides of a pixel may differ, and it counts as square."""

SMALLEST_PIXEL, LARGEST_PIXEL = 1e-15, 1e3
"""Lengths [m] beyond which areas and masses leave the range of numbers, and all optics."""

PLANES = r'\{"shape": \[([34]), (\d+), (\d+)\]'
TIFF_SUFFIXES = (".tif", ".tiff")


Crop = tuple[int, int, int, int] | None
"""A part of a picture, or all of it."""


@attrs.frozen
class Plane:
    """Which of the pictures in a file: its ``frame`` in the order of the file, the ``sample`` of
    its colours (None: all, as grey), and the part ``crop`` (x, y, width, height) [px] of it."""

    frame: int = 0
    sample: int | None = None
    crop: Crop = None


@attrs.frozen
class Stack:
    """The axes of a file beyond x and y: ``sizes`` of those of ``axes``, the one that changes first
    coming first; the names of the ``channels``; the sides of a pixel (x, y) [m], None where it does
    not say; ``planar`` where its pages are stored as colours."""

    axes: str = "Z"
    sizes: tuple[int, ...] = (1,)
    channels: tuple[str, ...] = ()
    sides: tuple[float, float] | None = None
    planar: bool = False

    @property
    def frame_count(self) -> int:
        return math.prod(self.sizes)

    @property
    def channel_count(self) -> int:
        return dict(zip(self.axes, self.sizes, strict=True)).get("C", 1)

    def frame(self, page: int, channel: int) -> int:
        """Place in the file of a page and channel, all from 0."""
        frame, stride = 0, 1
        for axis, size in zip(self.axes, self.sizes, strict=True):
            if axis == "C":
                frame += channel * stride
            else:
                frame += page % size * stride
                page //= size
            stride *= size
        return frame


def stack_of(path: Path) -> Stack:
    """The Stack of a file; of one picture where the file is no TIFF, or nobody can read it."""
    if path.suffix.lower() not in TIFF_SUFFIXES:
        return Stack()
    import tifffile

    try:
        with tifffile.TiffFile(path) as tiff:
            if len(tiff.pages) > MOST_PLANES:
                raise ImageError(f"{path}: holds more than {MOST_PLANES} pictures")
            return stack_in(tiff)
    except ImageError:
        raise
    except Exception:
        return Stack()  # whoever decodes its pixels says what is wrong


def stack_in(tiff):
    """The Stack of an open TIFF."""
    first, count = tiff.pages[0], len(tiff.pages)
    text = first.description[:LONGEST_TEXT]
    found = Stack(sizes=(count,))
    if tiff.is_ome:
        found = ome_stack(text)
    elif tiff.is_imagej:
        found = imagej_stack(first, text)
    # 3 or 4 planes that are stored as colours were an array (3, h, w): Python's tifffile says so.
    elif count == 1 and first.axes == "SYX" and re.match(PLANES, text):
        return Stack(sizes=(first.shape[0],), planar=True)
    # What it says of its axes has to fit what it has.
    fits = min(found.sizes) > 0 and found.frame_count == count
    return found if fits else Stack(sizes=(count,), sides=found.sides)


def ome_stack(text):
    """The Stack of the first image of an OME-XML text."""
    space = "{*}"
    pixels = ElementTree.fromstring(text).find(f".//{space}Image/{space}Pixels")
    if pixels is None:
        return Stack()
    axes = "".join(axis for axis in pixels.get("DimensionOrder", "XYZCT") if axis in "ZCT")
    sizes = tuple(int(pixels.get(f"Size{axis}", 1)) for axis in axes)
    channels = pixels.findall(f"{space}Channel")
    samples = int(channels[0].get("SamplesPerPixel", 1)) if channels else 1
    if samples > 1:  # colours: SizeC counts samples
        sizes = tuple(size // samples if axis == "C" else size
                      for axis, size in zip(axes, sizes, strict=True))  # fmt: skip
    names = tuple(each.get("Name", "") for each in channels)
    sides = [side_of(pixels.get(f"PhysicalSize{axis}"), pixels.get(f"PhysicalSize{axis}Unit", "µm"))
             for axis in "XY"]  # fmt: skip
    return Stack(axes, sizes, names, pair_of(sides))


def imagej_stack(page, text):
    """The Stack that ImageJ describes: channels change first, then slices, then frames."""
    said = dict(line.partition("=")[::2] for line in text.splitlines())
    sizes = [int(said.get(name, 1)) for name in ("channels", "slices", "frames")]
    if math.prod(sizes) == 1:
        sizes[1] = int(said.get("images", 1))
    sides = []
    for name in ("XResolution", "YResolution"):
        tag = page.tags.get(name)
        numerator, denominator = (0, 1) if tag is None else tag.value
        sides.append(side_of(denominator / numerator if numerator else None, said.get("unit", "")))
    return Stack("CZT", tuple(sizes), (), pair_of(sides))


def side_of(value, unit):
    """A length [m]; None where it is none above 0, or its unit none of length."""
    try:
        # Some programs write the letter as its code.
        unit = re.sub(r"\\u00b5", "µ", unit.strip(), flags=re.IGNORECASE)
        found = read_number(f"{float(value)!r} {unit}", "m")
    except (TypeError, ValueError):
        return None
    return found if unit and 0.0 < found < float("inf") else None


def pair_of(sides):
    known = [side for side in sides if side is not None]
    return (known[0], known[-1]) if known else None


def planes_of(
    path: Path, stack: Stack, pages: list[int] | None, channel: str | None, crop: Crop = None
) -> list[tuple[str, Plane]]:
    """[(what is put behind the file's name, Plane)] of the pictures that are asked for.

    ``pages``: numbers from 1, none of them for all; ``channel``: a number, or a name that the file
    gives. ImageError where the file has several and none is asked for, or has not that one.
    """
    channels = stack.channel_count
    count = stack.frame_count // channels
    if pages is None and count > 1:
        raise ImageError(
            f"{path}: holds {count} pages; choose with --page 1, --page 1,3 or --page all"
        )
    if channel is None and channels > 1:
        named = [f"{k} {name}".strip() for k, name in enumerate(stack.channels, 1)]
        words = f" ({', '.join(named)})" if any(stack.channels) else ""
        raise ImageError(f"{path}: has {channels} channels{words}; choose with --channel 1")
    wanted = [page - 1 for page in dict.fromkeys(pages or range(1, count + 1))]
    if max(wanted) >= count:
        raise ImageError(f"{path}: has no page {max(wanted) + 1}, only {count}")
    chosen = 0 if channel is None else channel_place(path, stack, channel)
    sample = chosen if channel is not None and channels == 1 else None
    place = chosen if channels > 1 else 0
    return [
        (f":{page + 1}" if count > 1 else "", Plane(stack.frame(page, place), sample, crop))
        for page in wanted
    ]


def channel_place(path, stack, text):
    """The place, from 0, of a channel that is named or numbered; of a file without channels that of
    one of its colours."""
    if text in stack.channels:
        return stack.channels.index(text)
    if not (text.isdecimal() and text.isascii() and int(text) > 0):
        named = ", ".join(filter(None, stack.channels)) or "none by name"
        raise ImageError(f"{path}: has no channel {text!r}; it has {named}")
    if int(text) > stack.channel_count > 1:
        raise ImageError(f"{path}: has no channel {text}, only {stack.channel_count}")
    return int(text) - 1


def pixel_size_in(path: Path, stack: Stack) -> float | None:
    """The side of a pixel [m] as the file says; ImageError where pixels are not square."""
    if stack.sides is None:
        return None
    x, y = stack.sides
    for side in (x, y):
        if not SMALLEST_PIXEL <= side <= LARGEST_PIXEL:
            raise ImageError(
                f"{path}: says that its pixels are {side:.4g} m wide, which is impossible; give "
                "--pixel-size"
            )
    if abs(x - y) > UNEQUAL * x:
        raise ImageError(
            f"{path}: its pixels are {x:.4g} m wide and {y:.4g} m high: make them square, or give "
            "--pixel-size"
        )
    return x
