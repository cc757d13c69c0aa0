"""From a foreground to flocs: holes, labels, necks, filters; a region left out has a reason."""

import attrs
import numpy as np

EIGHT = np.ones((3, 3), int)
"""Diagonal pixels belong together."""

SHARP = 2.0
"""An edge this soft [px] can be the lens and the pixels alone: no floc is left out for it."""

NEAR, REACH = 0.5, (2, 40)
"""Share of r_eq within which a floc's contrast counts for a place of its outline, and limits [px]
of that."""

NECK = 0.5
MANY_PARTS = 4
"""Flocs that touch by chance are two, rarely three; an aggregate of beads has more necks."""

STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""From a pixel to half of its eight neighbours: every pair of neighbours once."""


@attrs.frozen(eq=False)
class Region:
    """One floc: 8-connected, holes filled.

    label: number in the picture, counted from 1 from the top row down, or that of a label image
    that was given; centroid: (x, y) [px],
    x right and y *down*, the first pixel's centre at (0, 0); bbox: (top, left, bottom, right)
    [px], bottom and right exclusive; area [px]; equivalent_radius = √(area/π) [px]; mask: bool
    array of the bbox widened by one pixel on every side; blur: softness of its outline [px]
    (`blur_of`), NaN for a mask that came without a picture.
    """

    label: int
    centroid: tuple[float, float]
    bbox: tuple[int, int, int, int]
    area: int
    equivalent_radius: float
    mask: np.ndarray
    blur: float = float("nan")


@attrs.frozen(eq=False)
class Rejection(Region):
    """A region left out, and why; its label counts on from those of the picture's flocs."""

    reason: str = ""


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


def filled(foreground):
    """The foreground with its holes filled: background that no way leads to from the border."""
    from scipy.ndimage import label

    outside = label(np.pad(~foreground, 1, constant_values=True))[0]
    return (outside != outside[0, 0])[1:-1, 1:-1]


def find_regions(foreground, contrast, filters):
    """(Regions, Rejections, number of regions with necks that were left whole) of a bool array.

    `contrast`, of its shape, tells how sharp they are.
    """
    from scipy.ndimage import find_objects, label

    labels, count = label(foreground, EIGHT)
    whole = 0
    if filters.neck != 0:
        count, whole = split_touching(labels, find_objects(labels), filters.neck,
                                      filters.min_radius)  # fmt: skip
    boxes = list(enumerate(find_objects(labels, count), start=1))
    boxes.sort(key=lambda found: (found[1][0].start, found[1][1].start))
    masks = [(labels[box] == number, box) for number, box in boxes]
    return *sorted_out(masks, contrast, filters), whole


def sorted_out(masks, contrast, filters, numbers=None):
    """(Regions, Rejections) of pairs (bool array, its box in the picture).

    numbers: of each the label; otherwise the flocs are counted, and then what is left out.
    """
    accepted, rejected = [], []
    shape = None if contrast is None else contrast.shape
    for place, (mask, box) in enumerate(masks):
        blur = float("nan") if contrast is None else blur_of(mask, box, contrast)
        size = int(mask.sum()), float(np.sqrt(mask.sum() / np.pi))
        reason = reason_to_reject(box, shape, size[1], blur, filters)
        bbox = (box[0].start, box[1].start, box[0].stop, box[1].stop)
        number = len(accepted) + 1 if numbers is None else numbers[place]
        about = (number, centroid_of(mask, box), bbox, *size, np.pad(mask, 1), blur)
        if reason:
            rejected.append(Rejection(*about, reason))
        else:
            accepted.append(Region(*about))
    if numbers is None:
        first = len(accepted) + 1
        rejected = [attrs.evolve(each, label=first + k) for k, each in enumerate(rejected)]
    return tuple(accepted), tuple(rejected)


def reason_to_reject(box, shape, radius, blur, filters):
    if radius < filters.min_radius:
        return "too small"
    if radius > filters.max_radius:
        return "too large"
    if filters.clear_of_border:
        sides = zip(box, shape, strict=True)
        if any(side.start == 0 or side.stop == size for side, size in sides):
            return "at the border"
    if blur > max(SHARP, filters.max_blur * radius):
        return "out of focus"
    return None


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


def blur_of(mask, box, contrast):
    """Softness [px] that half of a region's outline does not exceed: the median of σ along it.

    σ = step / (√(2π) · gradient), the deviation of the Gaussian that would make a step so soft.
    The step is the greatest contrast of the region within NEAR r_eq of the outline's pixel, the
    gradient the greatest among its neighbours: both local, so that a sharp speck in a soft halo
    counts for the part of the outline that it makes, and no more.
    """
    from scipy.ndimage import binary_erosion, maximum_filter

    reach = int(np.clip(round(NEAR * np.sqrt(mask.sum() / np.pi)), *REACH))
    wide = tuple(
        slice(max(side.start - 2, 0), min(side.stop + 2, size))
        for side, size in zip(box, contrast.shape, strict=True)
    )
    near = contrast[wide]
    if min(near.shape) < 2:
        return 0.0
    top, left = (side.start - out.start for side, out in zip(box, wide, strict=True))
    edge = mask & ~binary_erosion(mask)
    steepest = maximum_filter(np.hypot(*np.gradient(near)), size=3)
    slope = steepest[top:, left:][: mask.shape[0], : mask.shape[1]][edge]
    inside = np.where(mask, contrast[box], 0.0)
    step = maximum_filter(inside, size=2 * reach + 1, mode="constant")[edge]
    return float(np.median(step / np.maximum(np.sqrt(2.0 * np.pi) * slope, 1e-12)))


def split_touching(labels, boxes, neck, min_radius):
    """Part the regions of `labels`, in place, at their necks: (highest label, regions left whole).

    A neck parts two bodies if it is at most `neck` times as wide as the largest circle in the
    smaller of them, and neither would be smaller than `min_radius` [px]. For a neck of None the
    regions stay whole if most of the area with necks is in those that would become MANY_PARTS or
    more: then these are fractal aggregates, and so are the smaller ones of the same picture.
    """
    parted = []
    for number, box in enumerate(boxes, start=1):
        mask = labels[box] == number
        if mask.sum() < 2.0 * np.pi * min_radius**2:
            continue
        parts = bodies(mask, NECK if neck is None else neck, min_radius)
        if parts.max() > 1:
            parted.append((box, parts))
    areas = [np.count_nonzero(parts) for _, parts in parted]
    many = [parts.max() >= MANY_PARTS for _, parts in parted]
    if neck is None and 2 * np.dot(areas, many) > sum(areas):
        return len(boxes), len(parted)
    highest = len(boxes)
    for box, parts in parted:
        for part in range(2, parts.max() + 1):
            highest += 1
            labels[box][parts == part] = highest
    return highest, 0


def bodies(mask, neck, min_radius):
    """The mask's pixels numbered by body, from 1; 0 outside."""
    from scipy.ndimage import distance_transform_edt
    from skimage.feature import peak_local_max
    from skimage.segmentation import watershed

    depth = distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    peaks = peak_local_max(
        depth, min_distance=max(1, int(0.5 * min_radius)), labels=mask.astype(int),
        exclude_border=False,
    )  # fmt: skip
    if len(peaks) < 2:
        return mask.astype(int)
    markers = np.zeros(mask.shape, int)
    markers[tuple(peaks.T)] = np.arange(1, len(peaks) + 1)
    basins = watershed(-depth, markers, connectivity=2, mask=mask)
    return joined(basins, depth, neck, min_radius)


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
    """Basins renumbered from 1, those joined that no neck parts: the widest passes first."""
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
    return np.concatenate([[0], numbers])[basins]
