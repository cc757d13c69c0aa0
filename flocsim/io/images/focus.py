"""How soft an outline is: the spread of the lens, told by what more blur does to its steepness.

An edge of softness σ that is blurred by s more is less steep by a factor that depends on σ, s and
the radius of the outline alone, not on how high the step is, nor on what lies farther away than s
(Elder and Zucker 1998; Zhuo and Sim 2011). So a floc of several layers is as sharp as its rim, and
a floc before a halo as sharp as its own edge.
"""

import numpy as np

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


def slope_of(contrast, blur):
    """|∇c| of a contrast that is blurred by so many pixels."""
    from scipy.ndimage import gaussian_filter

    if min(contrast.shape) < 2:
        return np.zeros_like(contrast)
    smooth = gaussian_filter(contrast, blur, mode="nearest") if blur else contrast
    down, across = np.gradient(smooth)
    down *= down
    across *= across
    down += across
    return np.sqrt(down, out=down)


class Focus:
    """The slopes of a piece of a picture, more and more blurred.

    contrast: (h, w); noise: mean square slope of the background's noise [1/px²]; scale: the blur
    that it has already [px].
    """

    def __init__(self, contrast: np.ndarray, noise: float, scale: float):
        self.contrast = contrast.astype(np.float32)
        self.noise, self.scale = noise, max(scale, 1.0)
        self.slopes: dict[float, np.ndarray] = {}

    def slope(self, blur: float) -> np.ndarray:
        """|∇c| (h, w) of the contrast blurred by so many pixels more."""
        if blur not in self.slopes:
            self.slopes[blur] = slope_of(self.contrast, blur)
        return self.slopes[blur]

    def slope_in(self, blur: float, box: tuple[slice, slice]) -> np.ndarray:
        """The same in a box of it, which is computed alone where it is small."""
        from math import prod

        size = prod(s.stop - s.start for s in box)
        if blur in self.slopes or 2 * size > self.contrast.size:
            return self.slope(blur)[box]
        margin = int(4.0 * blur) + 2
        wide = tuple(slice(max(s.start - margin, 0), s.stop + margin) for s in box)
        inner = tuple(
            slice(s.start - w.start, s.stop - w.start) for s, w in zip(box, wide, strict=True)
        )
        return slope_of(self.contrast[wide], blur)[inner]

    def noise_slope(self, blur: float) -> float:
        """Root mean square slope of the noise after so much more blur: ∝ 1/(scale² + blur²)."""
        return np.sqrt(self.noise) / (1.0 + (blur / self.scale) ** 2)

    def softness(self, mask: np.ndarray, box: tuple[slice, slice]) -> float:
        """Softness σ [px] that half of a region's outline does not exceed; mask: bool array of the
        box.  inf where the outline is not clear of noise."""
        from scipy.ndimage import maximum_filter

        radius = np.sqrt(mask.sum() / np.pi)
        step = float(STEPS[min(np.searchsorted(STEPS, STEP * radius), len(STEPS) - 1)])
        edge = rim(mask)
        for blur in SMOOTHINGS:
            if blur > WIDEST * radius:
                break
            noise, more = self.noise_slope(blur), float(np.hypot(blur, step))
            slope = maximum_filter(self.slope_in(blur, box), 3)[edge]
            if np.median(slope) <= CLEAR * noise:
                continue
            # Of noise alone, the steepest of nine pixels has some √2 times its slope.
            clean = np.sqrt(np.maximum(slope**2 - 2.0 * noise**2, 0.0))
            ratio = np.median(
                clean / np.maximum(maximum_filter(self.slope_in(more, box), 3)[edge], 1e-12)
            )
            before, after = (disk_slope(radius, np.hypot(SPREADS, s)) for s in (blur, more))
            return float(np.interp(-ratio, -before / after, SPREADS))
        return float("inf")
