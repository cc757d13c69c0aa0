"""Where flocs end: for each its own level, chosen among all at which it could be cut.

Above the noise a picture falls apart into islands.  In each, the level is where the outline is as
steep as it gets, counted from outside: a layer over another one, however dark, lies within the rim
of the first.  An island that is out of focus at its own level is looked into, level by level, as a
component tree is walked from its root: what is sharp in there is a floc before or behind a halo.
"""

from collections.abc import Iterator

import attrs
import numpy as np

from flocsim.io.images.background import robust_deviation, sampled, stride_of, strips
from flocsim.io.images.boxes import Box, beyond, clipped, moved, placed, widened
from flocsim.io.images.focus import Focus, around, before_filter, rim

EIGHT = np.ones((3, 3), int)
"""Diagonal pixels belong together."""

SHARP = 3.5
"""An edge this soft [px] leaves sizes from 8 px on right within 2 % in the mean. Smaller ones
come out up to 6 % too small, but are not left out for it, or they would be missing where large ones
are kept."""

SHARPEST = 0.75
"""Share of the blur that all of a picture has: nothing but noise is sharper."""

CORE = 2.0
"""The same for what lies within a soft region: softer ones are the cores of its halo."""

AROUND = 4
"""Pixels around one of several parts of an island that tell its own level."""

FRINGE, FAR = 8, 24
"""Pixels around an island between which the light beside it is told: not where the edge itself is
soft, or has a bright fringe, as under an electron microscope."""

CUT_OFF = 0.1
"""Share of an outline that may lie where its zone ends."""

LARGE = 0.15
"""Share of an island that has to stand above the level of its outline: specks tell nothing."""

FLOOR = 3.0
"""Times the noise above which there are islands."""

QUIET = 0.02
"""Noise beside which thin layers of a contrast of .15 can still be followed."""

MOST_BLUR = 2.5
"""More blur than this [px] against noise would take small flocs with it."""

LEAST = 0.01
"""Contrast below which nothing is looked for: about two levels of 8 bits."""

RATIO = 1.12
"""Between two levels that are looked at, above the base."""

STEEP = 0.8
"""Share of the steepness of an edge from which an outline is at it.  A step blurred by a Gaussian
is that steep from .25 to .75 of its height: the middle of these levels is its half."""

OUTER = 0.6
"""Share of the greatest steepness that makes an edge of a rise from which it falls again by DIP:
where layers begin at one place, they are steeper together than the rim is elsewhere."""

DIP = 0.93
"""What is left of the steepness of an edge between it and the next."""

SPAN = 3.0
"""The ratio of these two levels: what is steep beyond is another layer."""

DEEPER = 1.2
"""Ratio of levels at which a soft island is looked into."""

BAND = 0.3
"""Levels by so much lower and higher, above the base, would have been taken by another hand."""

PIXEL = 0.25
"""How far [px] a level leaves an outline undecided, at least."""

SMALLEST = 0.25
"""Share of the least area below which a piece is no region, not even one that is left out."""

TOO_FAINT, TOO_SHARP = "too faint", "too sharp"
"""Why a region is not of what the picture shows."""

FAINT = 0.25
"""Share of the typical contrast below which a region is not of what the picture shows."""


@attrs.frozen(eq=False)
class Outline:
    """A region as it is cut: box in the picture, mask (bool array of the box, holes as they are),
    level [contrast], base: the contrast around it, softness [px], contrast: the mean inside less
    the base, parted: that of Region, reason: TOO_FAINT or TOO_SHARP where it is not of what
    the picture shows, "" elsewhere."""

    box: Box
    mask: np.ndarray
    level: float
    base: float
    softness: float
    contrast: float
    parted: float = float("nan")
    reason: str = ""


def pieces(mask: np.ndarray, box: Box) -> Iterator[tuple[np.ndarray, Box]]:
    """The 8-connected parts of a mask, each with its box in the picture."""
    from scipy.ndimage import find_objects, label

    parts = label(mask, EIGHT)[0]
    for number, inner in enumerate(find_objects(parts), start=1):
        place = [slice(out.start + s.start, out.start + s.stop)
                 for out, s in zip(box, inner, strict=True)]  # fmt: skip
        yield parts[inner] == number, (place[0], place[1])


def background_noise(contrast: np.ndarray, fine: float, scale: float) -> tuple[float, float]:
    """Standard deviation of the background, and its mean square slope [1/px²].

    fine: the deviation that white noise would leave; grain, which is coarser, is told by what goes
    with a little more blur.
    """
    from scipy.ndimage import gaussian_filter1d

    stride = stride_of(contrast.shape)
    across = [gaussian_filter1d(contrast[rows], scale + 2.0, axis=1)[:, ::stride]
              for rows in strips(contrast)]  # fmt: skip
    blurred = gaussian_filter1d(np.concatenate(across), scale + 2.0, axis=0)[::stride]
    noise = max(fine, robust_deviation(sampled(contrast) - blurred))
    if min(contrast.shape) < 2:
        return noise, 0.0
    squares = []
    for rows in strips(contrast):
        above = max(rows.start - 1, 0)
        down, across = np.gradient(contrast[above : rows.stop + 1])
        square = (down * down + across * across)[rows.start - above : rows.stop - above]
        quiet = np.abs(contrast[rows]) < FLOOR * noise
        squares.append(square[quiet].astype(np.float32))
    square = np.concatenate(squares)
    # The square of two normal numbers of deviation s has the median 2 ln 2 s².
    middle = np.median(square, overwrite_input=True) if square.size else 0.0
    return noise, float(middle / np.log(2.0))


def quietened(contrast: np.ndarray, noise: float, scale: float) -> tuple[np.ndarray, float]:
    """The contrast with so much more blur that the noise is QUIET, and the blur that it has then.

    A blur of s more leaves scale/√(scale² + s²) of the noise.
    """
    from scipy.ndimage import gaussian_filter

    there = max(scale, 1.0)
    more = min(there * float(np.sqrt(max((noise / QUIET) ** 2 - 1.0, 0.0))), MOST_BLUR)
    if more == 0.0:
        return contrast, scale
    return gaussian_filter(contrast, more, mode="nearest"), float(np.hypot(there, more))


def distances(mask: np.ndarray) -> np.ndarray:
    """Return the distance [px] of every pixel of a mask from the nearest one outside, float32.

    scipy's own distances would take twice the memory, the most of all steps.
    """
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(mask, return_distances=False, return_indices=True)
    squares = np.zeros(mask.shape, np.float32)
    for axis, size in enumerate(mask.shape):
        nearest[axis] -= np.expand_dims(np.arange(size, dtype=np.int32), 1 - axis)
        along = nearest[axis].astype(np.float32)
        along *= along
        squares += along
    return np.sqrt(squares, out=squares)


class Search:
    """The outlines of a contrast (h, w).

    noise, slope: of `background_noise`; scale: blur that is there already [px]; min_radius [px];
    max_blur: share of r_eq up to which an outline is in focus; saturated: share of an island's
    pixels whose contrast is too high to count.
    """

    def __init__(self, contrast, noise, slope, scale, min_radius, max_blur, saturated=0.0):
        self.contrast, self.slope, self.scale = contrast, slope, scale
        self.noise, self.floor = noise, max(FLOOR * noise, LEAST)
        self.area, self.max_blur, self.saturated = np.pi * min_radius**2, max_blur, saturated

    def outlines(self) -> list[Outline]:
        """All regions, in focus or not. Faint are those of less than FAINT of the typical contrast:
        its median, weighted by what each takes from the light, over those that are in focus, or
        all; and large ones that hardly rise above the noise."""
        from scipy.ndimage import find_objects, label

        above = self.contrast > self.floor
        labels, count = label(above, EIGHT)
        numbers, boxes = labels[above], find_objects(labels)
        highest = np.zeros(count + 1)
        np.maximum.at(highest, numbers, self.contrast[above])
        large = np.bincount(numbers, minlength=count + 1) >= max(SMALLEST * self.area, 1.0)
        found: list[Outline] = []
        for number in np.flatnonzero(large).tolist():
            box = boxes[number - 1]
            mask = labels[box] == number
            if highest[number] >= 2.0 * self.floor:
                found += self.island(mask, box)
            else:
                mean = float(self.contrast[box][mask].mean())
                found.append(
                    Outline(box, mask, self.floor, 0.0, float("nan"), mean, reason=TOO_FAINT)
                )
        plain = [each for each in found if not each.reason]
        told = [each for each in plain if self.in_focus(each)] or plain
        order = sorted(told, key=lambda each: each.contrast)
        sums = np.cumsum([each.contrast * each.mask.sum() for each in order])
        middle = int(np.searchsorted(sums, 0.5 * sums[-1])) if order else 0
        least = FAINT * order[middle].contrast if order else 0.0
        found = [
            attrs.evolve(each, reason=each.reason or TOO_FAINT * (each.contrast < least))
            for each in found
        ]
        return [each for each in found if not each.reason or each.mask.sum() >= self.area]

    def in_focus(self, outline: Outline, sharp: float = SHARP) -> bool:
        """Whether an outline is no softer than its size, or `sharp` [px], allows."""
        radius = np.sqrt(outline.mask.sum() / np.pi)
        return outline.softness <= max(sharp, self.max_blur * radius)

    def island(self, mask, box):
        """The outlines in a region of the floor."""
        base, floor = self.light_beside(mask, box)
        place = clipped(beyond(box, 12), self.contrast.shape)
        near, top, left = self.contrast[place], place[0].start, place[1].start
        if base < 0.0:
            mask, box = self.down_to(base + floor, placed(mask, box, place), near), place
        found = self.walk(Focus(near, self.slope, self.scale), mask, moved(box, -top, -left), base)
        return [attrs.evolve(each, box=moved(each.box, top, left)) for each in found]

    def light_beside(self, mask, box):
        """The contrast of the light beside an island, and three times its noise: in a crowd the
        light that all of a picture has may be too dark for one of its corners. 0 where it is as
        bright, or the noise hides it."""
        from scipy.ndimage import gaussian_filter

        place = clipped(beyond(box, FAR), self.contrast.shape)
        near = self.contrast[place]
        lit = near <= self.floor
        corner = box[0].start - place[0].start, box[1].start - place[1].start
        if 2 * np.count_nonzero(near <= -self.floor) < lit_at_ends(lit, mask, corner):
            return 0.0, self.floor
        away = distances(~placed(mask, box, place))
        beside = lit & (away > FRINGE) & (away <= FAR)
        base = float(np.median(near[beside])) if beside.any() else 0.0
        if base > -self.floor:
            return 0.0, self.floor
        fine = (near - gaussian_filter(near, self.scale + 2.0))[beside]
        floor = max(self.floor, FLOOR * robust_deviation(fine))  # more noise where it is dark
        return (base if base <= -floor else 0.0), floor

    def down_to(self, level, mask, near):
        """An island with what stands above a lower level beside it."""
        from scipy.ndimage import label

        beside = (near <= self.floor) & (near > level) & (distances(~mask) <= FRINGE)
        parts = label(mask | beside, EIGHT)[0]
        return np.isin(parts, np.unique(parts[mask]))

    def walk(self, focus, mask, box, base):
        """The outlines in a component that stands above a base, boxes in the island."""
        mask, box = widened(mask, box, 2, focus.contrast.shape)
        level = max(self.level(focus, mask, box, base), self.floor)
        parts = self.cut(focus, mask, box, level)
        found = []
        if len(parts) > 1:  # each has a level of its own
            own, cut = np.zeros((2, *focus.contrast.shape), bool)
            own[box] = mask
            for part, place, _ in parts:
                cut[place] |= part
            parts = [each for part in parts for each in self.cut_alone(focus, own, cut, base, part)]
        for part, place, level in parts:
            whole, wide = widened(filled(part), place, 1, focus.contrast.shape)
            softness = focus.softness(whole, wide)
            mean = float(focus.contrast[place][part].mean()) - base
            reason = TOO_SHARP if softness < SHARPEST * self.scale else ""
            softness = before_filter(softness, self.scale)
            outline = Outline(place, part, level, base, softness, mean, reason=reason)
            inside = [] if self.in_focus(outline) else self.inside(focus, outline)
            found += inside or [outline]
        return found

    def cut(self, focus, mask, box, level):
        """[(part, its box, level)] of what of a mask stands above a level."""
        least = max(SMALLEST * self.area, 1.0)
        return [
            (part, place, level)
            for part, place in pieces(mask & (focus.contrast[box] > level), box)
            if part.sum() >= least
        ]

    def cut_alone(self, focus, own, cut, base, part):
        """One of several parts of a mask as it is cut at a level of its own; ``own``: the mask in
        all of the island, ``cut``: all of its parts."""
        from scipy.ndimage import binary_dilation

        zone, place = widened(part[0], part[1], AROUND, focus.contrast.shape)
        others = cut[place] & ~zone
        zone = binary_dilation(zone, EIGHT, AROUND) & ~others
        beyond = binary_dilation(own[place] & ~zone, EIGHT)
        zone &= own[place]
        level = max(self.level(focus, zone, place, base), self.floor)
        alone = self.cut(focus, zone, place, level)
        for each, where, _ in alone:
            edge = rim(each)
            within = moved(where, -place[0].start, -place[1].start)
            if (edge & beyond[within]).sum() > CUT_OFF * edge.sum():
                return [part]  # its zone would be its outline
        return alone or [part]

    def inside(self, focus, outline):
        """What is sharp within a region that is not."""
        near = focus.contrast[outline.box]
        level = max(DEEPER * outline.level, outline.level + self.noise)
        found = []
        for part, place in pieces(outline.mask & (near > level), outline.box):
            if part.sum() >= self.area:
                found += [each for each in self.walk(focus, part, place, level)
                          if not each.reason and self.in_focus(each, CORE)]  # fmt: skip
        return found

    def level(self, focus, mask, box, base):
        """The level in the middle of those of the lowest edge."""
        values, square_slopes = around(focus.contrast, mask, box)
        values -= base
        top = float(np.quantile(values, 1.0 - self.saturated))
        least = max(1e-3, 0.01 * top)
        if top <= least:
            return base
        count = int(np.log(top / least) / np.log(RATIO)) + 2
        edges = least * (top / least) ** (np.arange(count) / (count - 1))
        edges[-1] = top
        place, size = np.searchsorted(edges, values), len(edges) + 1
        pixels = np.bincount(place, minlength=size)[1:-1]
        squares = np.bincount(place, square_slopes, minlength=size)[1:-1]
        few = np.array([1.0, 2.0, 3.0, 2.0, 1.0])  # weights of levels beside each other
        summed = [np.convolve(each, few)[2 : 2 + len(each)] for each in (squares, pixels)]
        mean = summed[0] / np.maximum(summed[1], 1.0)
        steep = np.sqrt(np.maximum(mean - focus.noise, 0.0))
        above = np.cumsum(pixels[::-1])[::-1]
        middles = np.sqrt(edges[1:] * edges[:-1])
        first, last = edge_of(steep, (middles >= self.floor) & (above >= LARGE * mask.sum()))
        if last < first:
            return base
        return base + 0.5 * float(middles[first] + min(middles[last], SPAN * middles[first]))


def lit_at_ends(lit, mask, corner):
    """How many of the lit pixels (h, w) lie from FRINGE to FAR beside a mask, at least: those above
    its first row and below its last, in squares within FAR of it; corner: where its box begins."""
    across, count = int(FAR / np.sqrt(2.0)), 0
    for end, first, last in ((0, -across, -FRINGE), (len(mask) - 1, FRINGE + 1, across + 1)):
        row, column = corner[0] + end, corner[1] + int(mask[end].argmax())
        beside = lit[max(row + first, 0) : max(row + last, 0)]
        count += np.count_nonzero(beside[:, max(column - across, 0) : column + across + 1])
    return count


def edge_of(steep, told):
    """(first, last) of the levels of the lowest edge; ``told``: which of them tell where it is. Of
    none the last lies before the first."""
    seen = np.where(told, steep, 0.0)
    highest = np.maximum.accumulate(seen)
    greatest = highest[-1]
    if greatest <= 0.0:
        return 0, -1
    fallen = np.flatnonzero((steep < DIP * highest) & (highest >= OUTER * greatest))
    peak = int(np.argmax(seen[: fallen[0]] if fallen.size else seen))
    at_edge = steep >= STEEP * steep[peak]
    before, behind = np.flatnonzero(~at_edge[:peak]), np.flatnonzero(~at_edge[peak:])
    first = int(before[-1]) + 1 if before.size else 0
    return first, peak + int(behind[0]) - 1 if behind.size else len(steep) - 1


def filled(foreground: np.ndarray) -> np.ndarray:
    """The foreground with its holes filled: background that no way leads to from the border."""
    from scipy.ndimage import label

    wide = np.ones([size + 2 for size in foreground.shape], bool)
    np.logical_not(foreground, out=wide[1:-1, 1:-1])
    outside = label(wide)[0]
    return (outside != outside[0, 0])[1:-1, 1:-1]


def outlines_at(contrast: np.ndarray, threshold: float, focus: Focus) -> list[Outline]:
    """The Outlines of all that stands above one level; focus: of the whole contrast."""
    here = slice(0, contrast.shape[0]), slice(0, contrast.shape[1])
    found = []
    for mask, box in pieces(contrast > threshold, here):
        softness = focus.softness(*widened(filled(mask), box, 1, contrast.shape))
        softness = before_filter(softness, focus.scale)
        mean = float(contrast[box][mask].mean())
        found.append(Outline(box, mask, threshold, 0.0, softness, mean))
    return found
