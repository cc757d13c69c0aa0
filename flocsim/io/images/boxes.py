"""Rows and columns of a piece of a picture, and masks in such boxes."""

import numpy as np

Box = tuple[slice, slice]


def beyond(box: Box, by: int) -> Box:
    """A box that is wider by some pixels on every side, be they in the picture or not."""
    rows, columns = box
    return slice(rows.start - by, rows.stop + by), slice(columns.start - by, columns.stop + by)


def clipped(box: Box, shape: tuple[int, ...]) -> Box:
    """The part of a box that lies in a picture."""
    rows, columns = (slice(max(s.start, 0), min(s.stop, size))
                     for s, size in zip(box, shape, strict=True))  # fmt: skip
    return rows, columns


def moved(box: Box, down: int, right: int) -> Box:
    """A box that begins so many rows and columns further on."""
    rows, columns = box
    return (slice(rows.start + down, rows.stop + down),
            slice(columns.start + right, columns.stop + right))  # fmt: skip


def placed(mask: np.ndarray, box: Box, wide: Box) -> np.ndarray:
    """A mask in a wider box."""
    found = np.zeros([s.stop - s.start for s in wide], mask.dtype)
    y, x = (s.start - w.start for s, w in zip(box, wide, strict=True))
    found[y : y + mask.shape[0], x : x + mask.shape[1]] = mask
    return found


def widened(mask: np.ndarray, box: Box, by: int, shape: tuple[int, ...]) -> tuple[np.ndarray, Box]:
    """A mask in a box that is wider by some pixels, as far as the picture goes."""
    wide = clipped(beyond(box, by), shape)
    return placed(mask, box, wide), wide
