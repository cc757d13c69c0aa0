"""Pictures → flocs: the image processing of the paper's section 2.1, made fit for uneven light;
and the weights that undo the filters.

A floc of h × w pixels is kept clear of the border at (H − h)(W − w) of the places where its picture
of H × W could have shown it: each stands for HW/((H − h)(W − w)) (Miles and Lantuéjoul).

A floc is kept in focus up to a softness that grows with its size, so large ones are kept from a
deeper slice of the water.  Softness does not depend on size otherwise; how it is distributed, the
flocs tell, each of which could have been seen up to its own limit (the product-limit estimator of
Lynden-Bell): a floc stands for the share of flocs, of those within the largest limit, that are
within its own.
"""

import io
from collections.abc import Iterable, Sequence

import attrs
import numpy as np

from flocsim.errors import ImageError, plural
from flocsim.io.images.annotations import without_annotations
from flocsim.io.images.background import (
    low_pass,
    robust_deviation,
    sampled,
    smooth_surface,
)
from flocsim.io.images.focus import Focus
from flocsim.io.images.outlines import (
    SHARP,
    TOO_FAINT,
    TOO_SHARP,
    Search,
    background_noise,
    filled,
    outlines_at,
    quietened,
)
from flocsim.io.images.regions import ANNOTATION, Filters, Region, find_regions

UNLIT = 0.04
"""Where the light is below this share of its maximum, a camera's black level drowns the flocs."""

MANY_PIECES, APART = 4, 3
"""Regions for one body, pieces no farther from each other than twice so many pixels, from which a
picture counts as broken up."""

UNDECIDED = 0.5
"""Share of the area of flocs between their bands' inner and outer outlines, from which levels
disagree: twice what a lens of a tenth of r_eq makes of it."""

DEGREE = 6
"""Of the polynomial surface that is the light."""

COARSE, FEWEST_MEANS = (1, 4, 8, 16, 32), 50
"""Sides of squares [px] whose means tell whether flocs are dark or bright, and how many of them at
least lie along the shorter side of the picture."""


MOST_LABEL = 65535
"""The largest number that a label image of 16 bits has."""


@attrs.frozen(eq=False)
class Segmentation:
    """What `segment` found.

    foreground: (h, w) bool, everything past the threshold, holes filled, rejected regions too;
    regions: the flocs; rejected: the others; flocs: "bright" or "dark"; threshold: the contrast,
    against the background, that separates the two (0 = background, 1 = full range), the median of
    those of all flocs where each has its own; left_whole:
    regions with necks that were taken for fractal aggregates, and not parted; holes: (h, w) bool,
    what was filled in the foreground, None where nobody asks any more.
    """

    foreground: np.ndarray
    regions: tuple[Region, ...]
    rejected: tuple[Region, ...]
    flocs: str
    threshold: float
    left_whole: int = 0
    holes: np.ndarray | None = None

    @property
    def foreground_share(self) -> float:
        return float(self.foreground.mean())

    @property
    def alarms(self) -> list[str]:
        """What speaks against the outlines, each in a few words; empty where nothing does."""
        from scipy.ndimage import binary_dilation, label

        found = []
        no_flocs = (TOO_FAINT, TOO_SHARP, ANNOTATION)
        rejected = [each for each in self.rejected if each.reason not in no_flocs]
        kept, left = (sum(each.area for each in some) for some in (self.regions, rejected))
        if left > kept:
            found.append(f"{100 * left / (kept + left):.0f} % of the area was rejected")
        pieces = len(self.regions) + len(rejected)
        if pieces >= MANY_PIECES:
            # Gaps of up to 2 APART pixels are none.
            bodies = int(label(binary_dilation(self.foreground, iterations=APART))[1])
            if pieces >= MANY_PIECES * bodies:
                found.append(f"{pieces} regions look like fragments of {plural(bodies, 'floc')}")
        bands = [each.band for each in self.regions if each.band is not None]
        undecided = sum(int(outer.sum()) - int(inner.sum()) for inner, outer in bands)
        if bands and undecided > UNDECIDED * kept:
            found.append(f"outlines are uncertain by {100 * undecided / kept:.0f} % of their area")
        return found

    def rejected_by_reason(self) -> dict[str, int]:
        """{reason: number of regions}, reasons in alphabetical order."""
        reasons = [rejection.reason for rejection in self.rejected]
        return {reason: reasons.count(reason) for reason in sorted(set(reasons))}


def segment(
    grey: np.ndarray,
    *,
    flocs: str = "auto",
    threshold: float | None = None,
    noise_scale: float = 1.0,
    background: np.ndarray | None = None,
    saturated: float = 0.001,
    min_radius: float = 4.0,
    max_radius: float = np.inf,
    max_blur: float = 0.25,
    neck: float | None = None,
) -> Segmentation:
    """Separate the flocs of a grey picture from its background.

    After the paper's section 2.1: removal of noise finer than `noise_scale` [px] in Fourier space,
    and of the background; then each floc is cut at a level of its own, that at which its outline is
    steepest, counted from outside (outlines.Search), without its `saturated` share of pixels; or
    all at one `threshold`, a contrast above 0 and to 1.  Dark flocs:
    contrast = 1 − grey/background (light is lost by a factor);
    bright flocs: contrast = grey − background.

    Regions are 8-connected with holes filled, parted at necks of up to `neck` times the width of
    the smaller part (0: never; None: 0.5, where it is sure that they are two flocs,
    `split_touching`).  Rejected are those that touch the border, with r_eq = √(area/π)
    below `min_radius` or above `max_radius` [px], or softer than `max_blur`·r_eq and 3.5 px along
    half of the outline (out of focus; inf: none).

    grey: (h, w) in [0, 1]; flocs: "bright", "dark" or "auto" (the longer tail of the contrast);
    background: (h, w), for example the median of many frames, or None for a polynomial surface of
    degree 6.  Returns a Segmentation; no floc is no error.  Raises ImageError where the background
    has another shape.  Options are not looked at: `flocsim fit` has done that.
    """
    grey, burnt_in = without_annotations(grey)
    filters = Filters(min_radius, max_radius, max_blur, neck)
    smooth = low_pass(grey, noise_scale)
    light = None
    if background is not None:
        if background.shape != grey.shape:
            raise ImageError(
                f"the background's shape {background.shape} is not the picture's {grey.shape}; "
                "make it from frames of the same size"
            )
        light = low_pass(background, noise_scale)
    if flocs == "auto":
        flocs = guess_polarity(smooth, light)
    contrast, fine = _contrast(grey, smooth, light, flocs, noise_scale)
    noise, slope = background_noise(contrast, fine, noise_scale)
    if threshold is None:
        quiet, scale = quietened(contrast, noise, noise_scale)
        if quiet is not contrast:
            contrast, (noise, slope) = quiet, background_noise(quiet, 0.0, scale)
        search = Search(contrast, noise, slope, scale, min_radius, max_blur, saturated)
        outlines = search.outlines()
    else:
        outlines = outlines_at(contrast, threshold, Focus(contrast, slope, noise_scale))
    seen = np.zeros(grey.shape, bool)
    for each in outlines:
        if not each.reason:
            seen[each.box] |= each.mask
    regions, rejected, whole = find_regions(outlines, contrast, filters, burnt_in)
    foreground = filled(seen)
    if threshold is None:
        levels = [each.level for each in regions or rejected if each.level == each.level]
        threshold = float(np.median(levels)) if levels else float("nan")
    holes = foreground & ~seen
    return Segmentation(foreground, regions, rejected, flocs, threshold, whole, holes)


def guess_polarity(smooth: np.ndarray, light: np.ndarray | None = None) -> str:
    """Return "dark" or "bright", the side of the contrast's longer tail.

    It is told at the scale at which the tail is the longest, that of the flocs: the grain of a
    faint picture has a tail of its own, which means over more pixels take away.
    """
    tails: list[float] = []
    for step in COARSE:
        if tails and min(smooth.shape) <= FEWEST_MEANS * step:
            break
        if step == 1 and min(smooth.shape) > FEWEST_MEANS * COARSE[1]:
            continue
        coarse = means(smooth, step)
        surface = smooth_surface(coarse, degree=2) if light is None else means(light, step)
        # From the light, not from their median: flocs may cover most of the picture.
        beside = coarse - surface
        spread = float(np.mean(beside * beside))
        tails.append(float(np.mean(beside**3)) / max(spread, 1e-12) ** 1.5)
    return "dark" if max(tails, key=abs) < 0.0 else "bright"


def means(picture: np.ndarray, step: int) -> np.ndarray:
    """Return the means of a picture over squares of so many pixels."""
    height, width = (size // step for size in picture.shape)
    squares = picture[: height * step, : width * step].reshape(height, step, width, step)
    return squares.mean(axis=(1, 3))


def _contrast(grey, smooth, light, flocs, noise_scale):
    """Contrast against the background, in the place of `smooth`, and the standard deviation of its
    noise."""
    # White noise of deviation s is left with s/(2√π·scale) by the low pass, and the part that is
    # taken out has nearly all of s.
    left_over = 1.0 / max(2.0 * np.sqrt(np.pi) * noise_scale, 1.0)
    fine = sampled(grey) - sampled(smooth)
    if flocs == "bright":
        smooth -= smooth_surface(smooth, DEGREE) if light is None else light
        return smooth, left_over * robust_deviation(fine)
    light = smooth_surface(smooth, DEGREE, logarithmic=True) if light is None else light
    floor = max(UNLIT * light.max(), np.finfo(np.float32).tiny)
    np.maximum(light, floor, out=light)
    smooth /= light
    np.subtract(1.0, smooth, out=smooth)
    smooth[light <= floor] = 0.0
    return smooth, left_over * robust_deviation(fine / sampled(light))


def weighed(found: Sequence[Segmentation], max_blur: float) -> list[Segmentation]:
    """The Segmentations, all of one study, with the weights of their flocs.

    max_blur: share of r_eq up to which an outline was in focus.
    """
    regions = [each for one in found for each in one.regions]
    blur = np.array([each.blur for each in regions])
    radius = np.array([each.equivalent_radius for each in regions])
    focus = iter(focus_weights(blur, np.maximum(SHARP, max_blur * radius)))
    weighted = []
    for one in found:
        borders = [border_weight(each.bbox, one.foreground.shape) for each in one.regions]
        weights = [float(next(focus)) * border for border in borders]
        pairs = zip(one.regions, weights, strict=True)
        again = tuple(attrs.evolve(each, weight=weight) for each, weight in pairs)
        weighted.append(attrs.evolve(one, regions=again))
    return weighted


def border_weight(bbox: tuple[int, int, int, int], shape: tuple[int, ...]) -> float:
    """For how many flocs of its extent one stands that does not touch the border."""
    top, left, bottom, right = bbox
    height, width = bottom - top, right - left
    # One that touches the border was added by hand, and stands for itself.
    clear = max(shape[0] - height - 1, 0) * max(shape[1] - width - 1, 0)
    touches = top == 0 or left == 0 or bottom == shape[0] or right == shape[1]
    return 1.0 if touches or not clear else shape[0] * shape[1] / clear


def focus_weights(blur: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """1/F(limit) of flocs of softness `blur` [px] that were kept up to `limit` [px].

    F(s), the share of all flocs no softer than s, is ∏ (1 − 1/(n + 1)) over the flocs softer than
    s, n the number of flocs of at most that softness that could have had it, and been kept.
    """
    weights = np.ones(len(blur))
    known = np.flatnonzero(blur <= limit)
    if not known.size or not np.isfinite(limit[known]).all():
        return weights
    blur, limit = blur[known], limit[known]
    order = np.argsort(-blur, kind="stable")
    at_risk = np.array([np.count_nonzero((blur <= s) & (limit >= s)) for s in blur[order].tolist()])
    shares = np.concatenate([[1.0], np.cumprod(1.0 - 1.0 / (at_risk + 1.0))])
    softer = np.searchsorted(-blur[order], -limit, side="left")
    weights[known] = 1.0 / shares[softer]
    return weights


def label_image(shape: tuple[int, int], regions: Iterable[Region], name: str = "") -> bytes:
    """A PNG of 16 bits: 0 outside, in every region its number; `flocsim fit --masks` reads it.

    ImageError for a number above 65535.
    """
    from PIL import Image

    labels = np.zeros(shape, np.uint16)
    for region in regions:
        if region.label > MOST_LABEL:
            raise ImageError(
                f"{name}: a label image has numbers up to {MOST_LABEL}, found {region.label}; "
                "leave out small regions with --min-radius"
            )
        top, left, bottom, right = region.bbox
        labels[top:bottom, left:right][region.mask[1:-1, 1:-1]] = region.label
    picture = io.BytesIO()
    Image.fromarray(labels).save(picture, format="PNG")
    return picture.getvalue()
