"""How soft an outline is: the spread of the lens, told by what more blur does to its steepness.

An edge of softness σ that is blurred by s more is less steep by a factor that depends on σ, s and
the radius of the outline alone, not on how high the step is, nor on what lies farther away than s
(Elder and Zucker 1998; Zhuo and Sim 2011). So a floc of several layers is as sharp as its rim, and
a floc before a halo as sharp as its own edge.

How steep a picture is along an outline, and around it, is found by kernels on scalars and arrays:
of some thousands of specks in a picture each has a few hundred pixels, for which numpy's calls cost
more than what they do.
"""

from functools import lru_cache

import numpy as np

from flocsim.compiler.composer import compiled

STEPS = np.array([2.0, 3.0, 4.5, 6.0])
"""Blur that is added to tell softness [px]: of these the least above STEP r_eq."""

STEP = 0.12

SMOOTHINGS = (0.0, 1.5, 3.0, 5.0)
"""Smoothing [px] until an edge is clear of noise, as far as WIDEST r_eq."""

WIDEST = 0.4
CLEAR = 5.0
"""Times the slope of noise that an edge must be steep."""

SPREADS = np.geomspace(0.3, 60.0, 240)
"""Softness [px] among which that of an outline is looked up."""

NEAR = 2
"""Steps around a mask within which the picture tells how steep its edge is."""


def rim(mask):
    """The pixels of a mask that have one outside beside, above or below them."""
    from scipy.ndimage import binary_erosion

    return mask & ~binary_erosion(mask)


@lru_cache(maxsize=1000)
def left_by_blur(radius, blur, more):
    """Slopes at the rim of a disk blurred by each of SPREADS and `blur`, over those with `more`.

    A disk of radius r and height 1 that is blurred by σ has (r/σ²) exp(−x) I₁(x), x = (r/σ)²; a
    large one 1/(√(2π) σ).
    """
    from scipy.special import ive

    squares = SPREADS**2 + np.array([[blur], [more]]) ** 2
    before, after = radius / squares * ive(1, radius**2 / squares)
    return before / after


class Focus:
    """A piece of a picture, more and more blurred.

    contrast: (h, w); noise: mean square slope of the background's noise [1/px²]; scale: the blur
    that it has already [px].
    """

    def __init__(self, contrast: np.ndarray, noise: float, scale: float):
        self.contrast = contrast.astype(np.float32)
        self.noise, self.scale = noise, max(scale, 1.0)
        self.blurred = {0.0: self.contrast}

    def slopes(self, blur: float, mask: np.ndarray, box: tuple[slice, slice]) -> np.ndarray:
        """Along a mask's outline, |∇c| of the contrast blurred by so many pixels more: the greatest
        of nine pixels.  Only what is around a small box is blurred."""
        from scipy.ndimage import gaussian_filter

        rows, columns = box
        if blur not in self.blurred and 2 * mask.size <= self.contrast.size:
            margin = int(4.0 * blur) + 2
            top, left = max(rows.start - margin, 0), max(columns.start - margin, 0)
            piece = self.contrast[top : rows.stop + margin, left : columns.stop + margin]
            smooth = gaussian_filter(piece, blur, mode="nearest")
            return along(smooth, mask, (rows.start - top, columns.start - left), 1)
        if blur not in self.blurred:
            self.blurred[blur] = gaussian_filter(self.contrast, blur, mode="nearest")
        return along(self.blurred[blur], mask, (rows.start, columns.start), 1)

    def softness(self, mask: np.ndarray, box: tuple[slice, slice]) -> float:
        """Softness σ [px] that half of a region's outline does not exceed; mask: bool array of the
        box.  inf where the outline is not clear of noise."""
        radius = np.sqrt(mask.sum() / np.pi)
        step = float(STEPS[min(np.searchsorted(STEPS, STEP * radius), len(STEPS) - 1)])
        for blur in SMOOTHINGS:
            if blur > WIDEST * radius:
                break
            # The root mean square slope of the noise goes with 1/(scale² + blur²).
            noise = np.sqrt(self.noise) / (1.0 + (blur / self.scale) ** 2)
            more = float(np.hypot(blur, step))
            slope = self.slopes(blur, mask, box)
            if np.median(slope) <= CLEAR * noise:
                continue
            # Of noise alone, the steepest of nine pixels has some √2 times its slope.
            clean = np.sqrt(np.maximum(slope**2 - 2.0 * noise**2, 0.0))
            ratio = np.median(clean / np.maximum(self.slopes(more, mask, box), 1e-12))
            return float(np.interp(-ratio, -left_by_blur(float(radius), blur, more), SPREADS))
        return float("inf")


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
