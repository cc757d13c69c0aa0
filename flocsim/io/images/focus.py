"""How soft an outline is: the spread of the lens, told by what more blur does to its steepness.

An edge of softness σ that is blurred by s more is less steep by a factor that depends on σ, s and
the radius of the outline alone, not on how high the step is, nor on what lies farther away than s
(Elder and Zucker 1998; Zhuo and Sim 2011). So a floc of several layers is as sharp as its rim, and
a floc before a halo as sharp as its own edge.
"""

from functools import lru_cache

import numpy as np

from flocsim.io.images.boxes import Box, beyond, clipped, moved

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
        self.steepest: dict[float, np.ndarray] = {}

    def slopes(self, blur: float, mask: np.ndarray, box: Box) -> np.ndarray:
        """Along a mask's outline, |∇c| of the contrast blurred by so many pixels more: the greatest
        of nine pixels.  Only what is around a small box is blurred."""
        from scipy.ndimage import gaussian_filter, maximum_filter

        found, inner = self.steepest.get(blur), box
        if found is None:
            small = 2 * mask.size <= self.contrast.size
            piece = self.contrast
            if small:
                piece, inner = surroundings(self.contrast, box, int(4.0 * blur) + 2)
            smooth = gaussian_filter(piece, blur, mode="nearest")
            found = np.sqrt(maximum_filter(square_slopes(smooth), 3, mode="nearest"))
            if not small:
                self.steepest[blur] = found
        return found[inner][rim(mask)]

    def softness(self, mask: np.ndarray, box: Box) -> float:
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


def before_filter(softness: float, scale: float) -> float:
    """Return the softness [px] of an outline before a filter of so many pixels, of at least 1.

    Of two blurs in a row the squares add up. The blur of 1 px of the usual filter stays: limits of
    softness hold with it.
    """
    return float(np.sqrt(max(softness**2 - max(scale, 1.0) ** 2 + 1.0, SPREADS[0] ** 2)))


def surroundings(picture: np.ndarray, box: Box, margin: int) -> tuple[np.ndarray, Box]:
    """What a picture has in a box and so many pixels around it, and where the box lies in that."""
    place = clipped(beyond(box, margin), picture.shape)
    return picture[place], moved(box, -place[0].start, -place[1].start)


def square_slopes(picture: np.ndarray) -> np.ndarray:
    """|∇|² of a picture (float32): by half the difference of the neighbours, at the sides by the
    whole."""
    found = np.zeros_like(picture)
    for axis, size in enumerate(picture.shape):
        if size > 1:
            found += np.gradient(picture, axis=axis) ** 2
    return found


def around(picture: np.ndarray, mask: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """(values, squares of |∇|) of a picture (float32) at the pixels of a mask and within NEAR steps
    beside, above or below them, as far as the mask's box goes."""
    from scipy.ndimage import binary_dilation

    near = binary_dilation(mask, iterations=NEAR)
    piece, inner = surroundings(picture, box, 1)
    return picture[box][near], square_slopes(piece)[inner][near]
