"""Pictures → flocs: the image processing of the paper's section 2.1, made fit for uneven light."""

import attrs
import numpy as np

from flocsim.errors import ImageError, UsageError
from flocsim.io.image_background import (
    light_surface,
    low_pass,
    robust_deviation,
    smooth_surface,
)
from flocsim.io.image_reading import read_grey

__all__ = ["Region", "Rejection", "Segmentation", "read_grey", "segment"]

UNLIT = 0.04
"""Where the light is below this share of its maximum, a camera's black level drowns the flocs."""

NOISE_MARGIN = 5.0
"""A floc stands out by this many standard deviations of the noise, or it is not one."""


@attrs.frozen(eq=False)
class Region:
    """One floc: 8-connected, holes filled, clear of the border.

    label: number in the picture, counted from 1 from the top row down; centroid: (x, y) [px],
    x right and y *down*, the first pixel's centre at (0, 0); bbox: (top, left, bottom, right)
    [px], bottom and right exclusive; area [px]; equivalent_radius = √(area/π) [px]; mask: bool
    array of the bbox widened by one pixel on every side.
    """

    label: int
    centroid: tuple
    bbox: tuple
    area: int
    equivalent_radius: float
    mask: np.ndarray


@attrs.frozen
class Rejection:
    """A region left out: its centroid (x, y) [px, y down], area [px], radius [px] and reason."""

    centroid: tuple
    area: int
    equivalent_radius: float
    reason: str


@attrs.frozen(eq=False)
class Segmentation:
    """What `segment` found.

    foreground: (h, w) bool, everything past the threshold, holes filled, rejected regions too;
    regions: the flocs; rejected: the others; flocs: "bright" or "dark"; threshold: the contrast,
    against the background, that separates the two (0 = background, 1 = full range).
    """

    foreground: np.ndarray
    regions: tuple
    rejected: tuple
    flocs: str
    threshold: float

    @property
    def foreground_share(self):
        """Share of the picture's pixels that are foreground [-]."""
        return float(self.foreground.mean())

    def rejected_by_reason(self):
        """{reason: number of regions}, reasons in alphabetical order."""
        reasons = [rejection.reason for rejection in self.rejected]
        return {reason: reasons.count(reason) for reason in sorted(set(reasons))}


def segment(
    grey,
    *,
    flocs="auto",
    noise_scale=1.0,
    background_degree=6,
    saturated=0.001,
    min_radius=4.0,
):
    """Separate the flocs of a grey picture from its background.

    In the paper's order (section 2.1): removal of noise finer than `noise_scale` [px] and of the
    background (polynomial surface of `background_degree`) in Fourier and real space; contrast
    stretch between two thresholds, the median and the top `saturated` share; Otsu's threshold.
    Dark flocs: contrast = 1 − grey/background (light is lost by a factor); bright flocs: contrast
    = grey − background.  Regions are 8-connected with holes filled; those that touch the border
    or have r_eq = √(area/π) < `min_radius` [px] are rejected.

    grey: (h, w) in [0, 1]; flocs: "bright", "dark" or "auto" (the longer tail of the contrast).
    Returns a Segmentation; no floc is no error.  Raises ImageError for an array that is no
    picture, UsageError for a wrong option.
    """
    grey = _checked(grey)
    _check_options(flocs, noise_scale, background_degree, saturated, min_radius)
    smooth = low_pass(grey, noise_scale)
    if flocs == "auto":
        flocs = _guess_polarity(smooth)
    contrast, noise = _contrast(grey, smooth, flocs, noise_scale, background_degree)
    threshold = _threshold(contrast, noise, saturated)
    foreground, regions, rejected = _regions(contrast > threshold, min_radius)
    return Segmentation(foreground, regions, rejected, flocs, threshold)


def _checked(grey):
    grey = np.asarray(grey, dtype=float)
    if grey.ndim != 2 or grey.size == 0 or not np.all(np.isfinite(grey)):
        raise ImageError(
            f"a picture is a filled (h, w) array of finite numbers, found shape {grey.shape}"
        )
    return grey


def _check_options(flocs, noise_scale, background_degree, saturated, min_radius):
    allowed = [
        (flocs in ("auto", "bright", "dark"), "flocs", flocs, "'auto', 'bright' or 'dark'"),
        (0 <= noise_scale < np.inf, "noise_scale", noise_scale, "at least 0 px"),
        (background_degree in range(13), "background_degree", background_degree, "0 to 12"),
        (0 <= saturated < 1, "saturated", saturated, "a share from 0 to below 1"),
        (0 <= min_radius < np.inf, "min_radius", min_radius, "at least 0 px"),
    ]
    for right, name, found, wanted in allowed:
        if not right:
            raise UsageError(f"{name} must be {wanted}, found {found!r}")


def _guess_polarity(smooth):
    residual = smooth - smooth_surface(smooth, degree=2)
    skewness = np.mean((residual - np.median(residual)) ** 3)
    return "dark" if skewness < 0 else "bright"


def _contrast(grey, smooth, flocs, noise_scale, degree):
    """Contrast against the background, and the standard deviation of its noise."""
    # White noise of deviation s is left with s/(2√π·scale) by the low pass, and the part that is
    # taken out has nearly all of s.
    left_over = 1.0 / max(2.0 * np.sqrt(np.pi) * noise_scale, 1.0)
    if flocs == "bright":
        contrast = smooth - smooth_surface(smooth, degree)
        return contrast, left_over * robust_deviation(grey - smooth)
    light = light_surface(smooth, degree)
    floor = max(UNLIT * light.max(), np.finfo(float).tiny)
    contrast = np.where(light > floor, 1.0 - smooth / np.maximum(light, floor), 0.0)
    return contrast, left_over * robust_deviation((grey - smooth) / np.maximum(light, floor))


def _threshold(contrast, noise, saturated):
    from skimage.filters import threshold_otsu

    low = np.median(contrast)
    high = np.quantile(contrast, 1.0 - saturated)
    if high <= low:
        high = contrast.max()
    if high <= low:
        return float(low)
    stretched = np.clip((contrast - low) / (high - low), 0.0, 1.0)
    otsu = low + threshold_otsu(stretched) * (high - low)
    return float(max(otsu, low + NOISE_MARGIN * noise))


def _regions(raw, min_radius):
    from scipy.ndimage import binary_fill_holes
    from skimage.measure import label, regionprops

    foreground = binary_fill_holes(raw)
    accepted, rejected = [], []
    for found in regionprops(label(foreground, connectivity=2)):
        reason = _reason_to_reject(found, foreground.shape, min_radius)
        if reason:
            rejected.append(Rejection(_centroid(found), *_size(found), reason))
        else:
            accepted.append(_region(found, len(accepted) + 1))
    return foreground, tuple(accepted), tuple(rejected)


def _reason_to_reject(found, shape, min_radius):
    top, left, bottom, right = found.bbox
    if _size(found)[1] < min_radius:
        return "too small"
    if top == 0 or left == 0 or bottom == shape[0] or right == shape[1]:
        return "at the border"
    return None


def _centroid(found):
    return float(found.centroid[1]), float(found.centroid[0])


def _size(found):
    return int(found.area), float(np.sqrt(found.area / np.pi))


def _region(found, label):
    bbox = tuple(int(bound) for bound in found.bbox)
    return Region(label, _centroid(found), bbox, *_size(found), np.pad(found.image, 1))
