"""From outlines to flocs: necks, filters, bands, measures; what is left out has a reason."""

import attrs
import numpy as np

from flocsim.geometry.shapes.outline import ShapeMeasures, feret_diameters
from flocsim.io.images.boxes import beyond, placed, widened
from flocsim.io.images.focus import rim, square_slopes
from flocsim.io.images.outlines import (
    BAND,
    EIGHT,
    PIXEL,
    SHARP,
    Outline,
    distances,
    filled,
    pieces,
)

NECK = 0.5
SURE = 0.65
"""Least confidence with which flocs are parted unasked."""

MANY_PARTS = 4
"""Flocs that touch by chance are two, rarely three; an aggregate of beads has more necks."""

STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""From a pixel to half of its eight neighbours: every pair of neighbours once."""

ANNOTATION = "scale bar or lettering"
"""Why what a program has burnt in is left out."""

NAN = float("nan")

PIXEL_MOMENT = 1.0 / 12.0
"""Second moment of a pixel about its own centre, over its area [px²]."""


@attrs.frozen(eq=False)
class Region:
    """One floc: 8-connected, holes filled.

    label: number in the picture, counted from 1 from the top row down, or that of a label image
    that was given; centroid: (x, y) [px],
    x right and y *down*, the first pixel's centre at (0, 0); bbox: (top, left, bottom, right)
    [px], bottom and right exclusive; area [px]; equivalent_radius = √(area/π) [px]; mask: bool
    array of the bbox widened by one pixel on every side; blur: softness of its outline [px]
    (`Focus.softness`), level: contrast at which it was cut, base: contrast around it, all NaN for a
    mask that came without a picture; parted: the confidence that it is a floc apart from one that
    it touched, NaN for all others; band: masks as it would have been cut at a higher and at a lower
    level, in the bbox widened by the same on every side, None where it is not known; weight: for
    how many flocs it stands, of which the filters kept it alone (pictures.weighed); reason: why it
    is left out, "" for a floc. The labels of what is left out count on from those of the flocs.
    """

    label: int
    centroid: tuple[float, float]
    bbox: tuple[int, int, int, int]
    area: int
    equivalent_radius: float
    mask: np.ndarray
    blur: float = NAN
    level: float = NAN
    base: float = NAN
    parted: float = NAN
    band: tuple[np.ndarray, np.ndarray] | None = None
    weight: float = 1.0
    reason: str = ""

    @property
    def radius_band(self) -> tuple[float, float]:
        """r_eq [px] of the two masks of its band, of its own mask twice where there is none."""
        if self.band is None:
            return self.equivalent_radius, self.equivalent_radius
        inner, outer = (float(np.sqrt(mask.sum() / np.pi)) for mask in self.band)
        return inner, outer


@attrs.frozen
class Filters:
    """What a region must meet: radii [px], share of r_eq that its edge may be soft, the border.

    neck: share of the smaller part's width up to which a neck parts two flocs, 0 for never, None
    for NECK unless the picture shows fractal aggregates.
    """

    min_radius: float = 4.0
    max_radius: float = np.inf
    max_blur: float = 0.25
    neck: float | None = None
    clear_of_border: bool = True


def find_regions(outlines, contrast, filters, burnt_in):
    """(flocs, regions left out, number of regions with necks that were left whole) of Outlines.

    contrast: (h, w), of which they are; burnt_in: (h, w) bool, what was taken out of the picture.
    """
    whole = 0
    closed = [attrs.evolve(each, mask=filled(each.mask)) for each in outlines if not each.reason]
    if filters.neck != 0:
        closed, whole = split_touching(closed, filters.neck, filters.min_radius)
    closed.sort(key=lambda each: (each.box[0].start, each.box[1].start))
    found = sorted_out(closed, contrast.shape, filters)
    # Of what is left out, too, which may yet be added: a band reaches into no other region.
    taken = np.zeros(contrast.shape, bool)
    for each in (*found[0], *found[1]):
        top, left, bottom, right = each.bbox
        taken[top:bottom, left:right] |= each.mask[1:-1, 1:-1]
    regions, rejected = (tuple(with_band(each, taken, contrast) for each in some) for some in found)
    others = [attrs.evolve(each, mask=filled(each.mask)) for each in outlines if each.reason]
    everywhere = slice(0, burnt_in.shape[0]), slice(0, burnt_in.shape[1])
    for mask, box in pieces(filled(burnt_in), everywhere):
        others.append(Outline(box, mask, *[NAN] * 4, reason=ANNOTATION))
    first = len(regions) + len(rejected) + 1
    numbers = range(first, first + len(others))
    rejected += sum(sorted_out(others, contrast.shape, filters, numbers), ())
    return regions, rejected, whole


def sorted_out(outlines, shape, filters, numbers=None):
    """(flocs, what is left out) of Outlines in a picture of a shape, as Regions.

    numbers: of each the label; otherwise the flocs are counted, and then what is left out.
    """
    found = []
    for place, each in enumerate(outlines):
        mask, box = each.mask, each.box
        radius, label = float(np.sqrt(mask.sum() / np.pi)), 0 if numbers is None else numbers[place]
        bbox = box[0].start, box[1].start, box[0].stop, box[1].stop
        measured = label, centroid_of(mask, box), bbox, int(mask.sum()), radius
        cut = placed(mask, box, beyond(box, 1)), each.softness, each.level, each.base, each.parted
        reason = each.reason or reason_to_reject(box, shape, radius, each.softness, filters)
        found.append(Region(*measured, *cut, reason=reason))
    kept, left = ([each for each in found if bool(each.reason) == out] for out in (False, True))
    if numbers is None:
        counted = [attrs.evolve(each, label=n) for n, each in enumerate([*kept, *left], start=1)]
        kept, left = counted[: len(kept)], counted[len(kept) :]
    return tuple(kept), tuple(left)


def reason_to_reject(box, shape, radius, blur, filters):
    """Why a region is left out; "" where it meets the filters."""
    sides = zip(box, shape, strict=True)
    if radius < filters.min_radius:
        return "too small"
    if radius > filters.max_radius:
        return "too large"
    if filters.clear_of_border and any(s.start == 0 or s.stop == size for s, size in sides):
        return "at the border"
    return "out of focus" if blur > max(SHARP, filters.max_blur * radius) else ""


def with_band(region, taken, contrast):
    """The Region with its band: a level is uncertain by BAND of the step at the edge, and by what
    it changes over PIXEL."""
    top, left, bottom, right = region.bbox
    box = slice(top, bottom), slice(left, right)
    mask = region.mask[1:-1, 1:-1]
    reach = int(np.ceil(2.0 + region.blur)) if np.isfinite(region.blur) else 2
    wide, place = widened(mask, box, reach, contrast.shape)
    near = contrast[place]
    slopes = np.sqrt(square_slopes(near.astype(np.float32))[rim(wide)])
    change = np.hypot(BAND * (region.level - region.base), PIXEL * float(np.median(slopes)))
    inner = largest_piece(filled(wide & (near > region.level + change)), wide)
    around = (distances(~wide) <= reach) & ~(taken[place] & ~wide)
    outer = largest_piece(filled(wide | (around & (near > region.level - change))), wide)
    # What the picture's edge has cut off is given back, so that the margin is the same all around.
    whole = beyond(box, reach)
    return attrs.evolve(region, band=(placed(inner, place, whole), placed(outer, place, whole)))


def largest_piece(mask, otherwise):
    """The largest 8-connected part of a mask; the other one where there is none."""
    from scipy.ndimage import label

    parts, count = label(mask, EIGHT)
    if count < 2:
        return mask if count else otherwise
    return parts == 1 + np.bincount(parts.ravel())[1:].argmax()


def with_holes(region: Region, holes: np.ndarray) -> Region:
    """The Region without those of its pixels that are ``holes`` (h, w) of the picture; its softness
    stays that of its outline."""
    top, left, bottom, right = region.bbox
    mask = region.mask.copy()
    mask[1:-1, 1:-1] &= ~holes[top:bottom, left:right]
    area = int(mask.sum())
    box = slice(top, bottom), slice(left, right)
    return attrs.evolve(
        region, mask=mask, area=area, equivalent_radius=float(np.sqrt(area / np.pi)),
        centroid=centroid_of(mask[1:-1, 1:-1], box),
    )  # fmt: skip


def centroid_of(mask, box):
    rows, columns = np.nonzero(mask)
    return float(columns.mean() + box[1].start), float(rows.mean() + box[0].start)


def split_touching(outlines, neck, min_radius):
    """(Outlines, those of them that touch parted at their necks; number of those left whole).

    A neck parts two bodies if it is at most `neck` times as wide as the largest circle in the
    smaller of them, and neither would be smaller than `min_radius` [px]. For a neck of None it also
    takes a `confidence` of SURE, and nothing is parted if most of the area with necks is in what
    would become MANY_PARTS or more: then these are fractal aggregates, and so are the smaller ones
    of the same picture.
    """
    cut = {}
    for place, each in enumerate(outlines):
        if each.mask.sum() >= 2.0 * np.pi * min_radius**2:
            parts, width = bodies(each.mask, NECK if neck is None else neck, min_radius)
            if parts.max() > 1:
                cut[place] = parts, confidence(parts, width)
    areas = [np.count_nonzero(parts) for parts, _ in cut.values()]
    many = [parts.max() >= MANY_PARTS for parts, _ in cut.values()]
    fractal = 2 * np.dot(areas, many) > sum(areas)
    kept = [k for k, (_, sure) in cut.items() if neck is None and (fractal or sure < SURE)]
    found = []
    for place, each in enumerate(outlines):
        if place not in cut or place in kept:
            found.append(each)
            continue
        parts, sure = cut[place]
        for part in range(1, parts.max() + 1):
            for mask, box in pieces(parts == part, each.box):
                found.append(attrs.evolve(each, box=box, mask=mask, parted=sure))
    return found, len(kept)


def confidence(parts, width):
    """From 0 to 1, how sure it is that a region's parts are flocs that touch, and not arms of one.

    (1 − width²) × the least solidity of the parts; width: the widest neck's share of the smaller
    part's width.  Flocs that touch by chance are whole bodies with a thin neck; what a cut leaves
    of an aggregate is as ragged as the whole.
    """
    from scipy.ndimage import find_objects
    from skimage.morphology import convex_hull_image

    least = 1.0
    for number, box in enumerate(find_objects(parts), start=1):
        mask = parts[box] == number
        least = min(least, mask.sum() / convex_hull_image(mask).sum())
    return float((1.0 - width * width) * least)


def bodies(mask, neck, min_radius):
    """The mask's pixels numbered by body, from 1, 0 outside; and the width of the widest neck that
    is cut, as a share of the smaller body's."""
    from skimage.feature import peak_local_max
    from skimage.segmentation import watershed

    depth = distances(np.pad(mask, 1))[1:-1, 1:-1]
    apart = max(1, int(0.5 * min_radius))
    peaks = peak_local_max(depth, min_distance=apart, exclude_border=False)
    if not has_neck(depth, peaks, neck):
        return mask.astype(int), 1.0
    markers = np.zeros(mask.shape, int)
    markers[tuple(peaks.T)] = np.arange(1, len(peaks) + 1)
    basins = watershed(-depth, markers, connectivity=2, mask=mask)
    return joined(basins, depth, neck, min_radius)


def has_neck(depth, peaks, neck):
    """Whether any peak is cut off from all higher ones, where depth is no more than `neck` of its
    own.  Where none is, `joined` would join all basins."""
    from scipy.ndimage import label

    for count, height in enumerate(depth[tuple(peaks.T)][1:].tolist(), start=1):
        parts = label(depth > neck * height, EIGHT)[0][tuple(peaks.T)]
        if parts[count] == 0 or parts[count] not in parts[:count]:
            return True
    return False


def passes(basins, depth):
    """(K + 1, K + 1): depth of the deepest pass between each two basins [px], 0 for none."""
    count = basins.max() + 1
    deepest = np.zeros((count, count))
    height, width = basins.shape
    for down, right in STEPS:
        here = (slice(0, height - down), slice(max(0, -right), width - max(0, right)))
        there = (slice(down, height), slice(max(0, right), width - max(0, -right)))
        a, b = basins[here], basins[there]
        across = (a != b) & (a > 0) & (b > 0)
        level = np.minimum(depth[here], depth[there])[across]
        np.maximum.at(deepest, (a[across], b[across]), level)
    return np.maximum(deepest, deepest.T)


def joined(basins, depth, neck, min_radius):
    """Basins renumbered from 1, those joined that no neck parts, the widest passes first; and the
    widest neck that is left, as a share of the smaller basin's depth."""
    count = basins.max() + 1
    deepest, least = passes(basins, depth), np.pi * min_radius**2
    peak = np.array([depth[basins == k].max(initial=0.0) for k in range(count)])
    area = np.bincount(basins.ravel(), minlength=count).astype(float)
    owner = np.arange(count)
    while True:
        smaller = np.minimum.outer(peak, peak)
        small = np.minimum.outer(area, area) < least
        wide = np.where((deepest > neck * smaller) | small, deepest, 0.0)
        a, b = np.unravel_index(np.argmax(wide), wide.shape)
        if wide[a, b] == 0.0:
            break
        owner[owner == b] = a
        peak[a], area[a] = max(peak[a], peak[b]), area[a] + area[b]
        deepest[a] = deepest[:, a] = np.maximum(deepest[a], deepest[b])
        deepest[b], deepest[:, b], deepest[a, a] = 0.0, 0.0, 0.0
    numbers = np.unique(owner[1:], return_inverse=True)[1] + 1
    left = np.unique(owner[1:])
    share = deepest[np.ix_(left, left)] / np.minimum.outer(peak[left], peak[left])
    return np.concatenate([[0], numbers])[basins], float(share.max())


def mask_measures(mask: np.ndarray) -> ShapeMeasures:
    """The ShapeMeasures [px] of a mask (h, w) bool, as scikit-image's regionprops has them.

    The perimeter is Crofton's, by lines in four directions (``perimeter_crofton``): of a disc of
    8 px it is .2 % too short, where the length along pixels (``perimeter``) is up to 4 % too long.
    A row of single pixels has the aspect ratio of the rectangle that it is.
    """
    from scipy.spatial import ConvexHull
    from skimage.measure import find_contours, regionprops

    found = regionprops(np.asarray(mask, np.uint8))[0]
    perimeter = float(found.perimeter_crofton)
    # As feret_diameter_max has it: on the sides of the pixels.
    outline = np.concatenate(find_contours(np.pad(found.image_convex, 1).astype(float), 0.5))
    long, short = found.axis_major_length / 4.0, found.axis_minor_length / 4.0
    if short == 0.0:
        long, short = np.sqrt(long**2 + PIXEL_MOMENT), np.sqrt(PIXEL_MOMENT)
    return ShapeMeasures(
        perimeter, float(long / short), 4.0 * np.pi * float(found.area) / perimeter**2,
        float(found.solidity), *feret_diameters(outline[ConvexHull(outline).vertices]),
    )  # fmt: skip
