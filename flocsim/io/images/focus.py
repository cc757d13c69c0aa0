"""How soft an outline is: the spread of the lens, told by what more blur does to its steepness.

An edge of softness σ that is blurred by s more is less steep by a factor that depends on σ, s and
the radius of the outline alone, not on how high the step is, nor on what lies farther away than s
(Elder and Zucker 1998; Zhuo and Sim 2011). So a floc of several layers is as sharp as its rim, and
a floc before a halo as sharp as its own edge.
"""

from functools import lru_cache

import numpy as np

from flocsim.io.images.slopes import along

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


def disk_slope(radius, spread):
    """Slope at the rim of a disk (radius [px], height 1) blurred by spreads [px] [1/px].

    (r/σ²) exp(−x) I₁(x), x = (r/σ)²; for a large disk 1/(√(2π) σ).
    """
    from scipy.special import ive

    return radius / spread**2 * ive(1, (radius / spread) ** 2)


def rim(mask):
    """The pixels of a mask that have one outside beside, above or below them."""
    from scipy.ndimage import binary_erosion

    return mask & ~binary_erosion(mask)


@lru_cache(maxsize=1000)
def left_by_blur(radius, blur, more):
    """Slopes at the rim of a disk blurred by each of SPREADS and `blur`, over those with `more`."""
    before, after = (disk_slope(radius, np.hypot(SPREADS, s)) for s in (blur, more))
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

    def noise_slope(self, blur: float) -> float:
        """Root mean square slope of the noise after so much more blur: ∝ 1/(scale² + blur²)."""
        return np.sqrt(self.noise) / (1.0 + (blur / self.scale) ** 2)

    def softness(self, mask: np.ndarray, box: tuple[slice, slice]) -> float:
        """Softness σ [px] that half of a region's outline does not exceed; mask: bool array of the
        box.  inf where the outline is not clear of noise."""
        radius = np.sqrt(mask.sum() / np.pi)
        step = float(STEPS[min(np.searchsorted(STEPS, STEP * radius), len(STEPS) - 1)])
        for blur in SMOOTHINGS:
            if blur > WIDEST * radius:
                break
            noise, more = self.noise_slope(blur), float(np.hypot(blur, step))
            slope = self.slopes(blur, mask, box)
            if np.median(slope) <= CLEAR * noise:
                continue
            # Of noise alone, the steepest of nine pixels has some √2 times its slope.
            clean = np.sqrt(np.maximum(slope**2 - 2.0 * noise**2, 0.0))
            ratio = np.median(clean / np.maximum(self.slopes(more, mask, box), 1e-12))
            return float(np.interp(-ratio, -left_by_blur(float(radius), blur, more), SPREADS))
        return float("inf")
