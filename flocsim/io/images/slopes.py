"""How steep a picture is along the outline of a mask, and around it.

Kernels are plain Python on scalars and arrays: of some thousands of specks in a picture each has a
few hundred pixels, for which numpy's calls cost more than what they do.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from flocsim.compiler.composer import compose

NEAR = 2
"""Steps around a mask within which the picture tells how steep its edge is."""


@cache
def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel, compiled on first use and kept on disk."""
    return compose(kernel, {})


def along(picture: np.ndarray, mask: np.ndarray, corner: tuple[int, int], reach: int) -> np.ndarray:
    """|∇| of a picture (float32) along the outline of a mask: the greatest within `reach` pixels of
    each of its pixels that has one outside beside, above or below it.

    corner: row and column in the picture of the first pixel of the mask's box.
    """
    found = np.empty(np.count_nonzero(mask), np.float32)
    count = compiled(fill_along)(picture, mask, *corner, reach, found)
    return np.sqrt(found[:count])


def around(
    picture: np.ndarray, mask: np.ndarray, corner: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """(values, squares of |∇|) of a picture (float32) at the pixels of a mask and within NEAR steps
    beside, above or below them, as far as the mask's box goes."""
    found = np.empty((2, mask.size), np.float32)
    count = compiled(fill_around)(picture, mask, *corner, found)
    return found[0, :count], found[1, :count]


def square_slope(picture, row, column):
    """The square of the slope: half the difference of the neighbours, the whole at the sides."""
    above, below = max(row - 1, 0), min(row + 1, picture.shape[0] - 1)
    left, right = max(column - 1, 0), min(column + 1, picture.shape[1] - 1)
    down = picture[below, column] - picture[above, column]
    across = picture[row, right] - picture[row, left]
    down *= np.float32(0.5 if below - above == 2 else 1.0)
    across *= np.float32(0.5 if right - left == 2 else 1.0)
    return down * down + across * across


def is_near(mask, row, column, steps):
    """Whether a mask has a pixel within so many steps beside, above or below."""
    for other in range(max(row - steps, 0), min(row + steps + 1, mask.shape[0])):
        left = steps - abs(other - row)
        for place in range(max(column - left, 0), min(column + left + 1, mask.shape[1])):
            if mask[other, place]:
                return True
    return False


def is_inside(mask, row, column):
    """Whether the four neighbours of a pixel of a mask belong to it, too."""
    return (
        0 < row < mask.shape[0] - 1
        and 0 < column < mask.shape[1] - 1
        and mask[row - 1, column]
        and mask[row + 1, column]
        and mask[row, column - 1]
        and mask[row, column + 1]
    )


def fill_along(picture, mask, top, left, reach, found):
    """The squares of the slopes along the outline; their number."""
    count = 0
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if mask[row, column] and not is_inside(mask, row, column):
                steepest = 0.0
                y, x = top + row, left + column
                for j in range(max(y - reach, 0), min(y + reach + 1, picture.shape[0])):
                    for i in range(max(x - reach, 0), min(x + reach + 1, picture.shape[1])):
                        steepest = max(steepest, square_slope(picture, j, i))
                found[count] = steepest
                count += 1
    return count


def fill_around(picture, mask, top, left, found):
    """The values, and the squares of the slopes, at a mask and beside it; their number."""
    count = 0
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if is_near(mask, row, column, NEAR):
                found[0, count] = picture[top + row, left + column]
                found[1, count] = square_slope(picture, top + row, left + column)
                count += 1
    return count
