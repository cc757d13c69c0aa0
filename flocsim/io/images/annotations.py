"""What a program has burnt into a picture: scale bars, boxes around them, and writing.

An annotation is told by what no floc has. Its tone is the brightest or the darkest of the picture,
and inside of its edges it is one: resizing and JPEG blur the edges alone. It differs at once from
what lies around it. And it fills a rectangle along the axes, or it is made of strokes: much longer
than wide, with an edge that runs along an axis for a good part of its length.
"""

import numpy as np

from flocsim.io.images.background import sampled
from flocsim.io.images.boxes import beyond, widened
from flocsim.io.images.outlines import EIGHT, distances

SQUARE = np.ones((2, 2), bool)

SAME = 0.02
"""Greys that differ by less are one: packing as JPEG scatters them."""

HALF = 0.5
"""Share of the way from an extreme tone to the median grey at which a blurred edge is cut."""

CLOSE = 0.2
"""The same within which what lies inside of blurred edges is of the extreme tone."""

MOSTLY = 0.7
"""Share of the pixels inside, and of those around, that have to tell so: JPEG changes a few, and
letters have others beside them."""

CORE = 3.0
"""Distance [px] from its edge at which a mark is no longer blurred."""

NEAR, FAR = 3, 6
"""Pixels around a mark where its edge has ended, and where nothing is left of it."""

STANDING_OUT, SHARPLY = 0.1, 0.7
"""Least contrast of a mark against what lies NEAR, and share of that against what lies FAR."""

FULL = 0.97
"""Share of its box that a rectangle fills, but for a pixel at each corner."""

LONG, SLENDER = 16, 2.0
"""Least length [px], and times the width, of a bar."""

BOXED = 0.02
"""Least share of a rectangle that writing on it covers: a plain stout one may be anything."""

LARGEST = 0.25
"""Share of the picture above which a rectangle of one grey is its background."""

SMALL, SPECK = 8, 3
"""Least height of letters that are told by themselves, and of what may be a part of one [px]."""

THIN = 4.0
"""Area of strokes over that of the largest disc in them: of 1,172 letters in nine fonts 97 % have
more, of 151 real flocs none, but aggregates of beads have it, too."""

OPEN = 0.75
"""Share of their box that strokes fill at most; of a rod along an axis an ellipse has 0.79."""

SOLID = 0.75
"""Share of strokes that squares of two pixels cover."""

STRAIGHT = 0.35
"""Share of the length of strokes along which an edge follows an axis: 87 % of these letters have
more, up to 0.32 is found in drawn aggregates of 3 to 40 beads."""

AROUND, TALL = 0.8, 60
"""Writing lies within this share of a bar's length, and letters are no taller [px]."""

MARGIN = 2
"""Pixels around what is burnt in whose greys are mixed with it."""


def without_annotations(grey: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a picture with the greys around them in the place of annotations, and where they were.

    grey: (h, w) in [0, 1].  The picture itself, and (h, w) False, where there is none.
    """
    from scipy.ndimage import binary_dilation

    found = np.zeros(grey.shape, bool)
    for apart in (grey - grey.min(), grey.max() - grey):
        found |= burnt_in(apart)
    if not found.any():
        return grey, found
    found = binary_dilation(found, EIGHT, iterations=MARGIN)
    return filled_from_around(grey, found), found


def burnt_in(apart):
    """Return where annotations are, in a picture of the distance from their tone."""
    from scipy.ndimage import binary_fill_holes, find_objects, label

    contrast = float(np.median(sampled(apart)))
    close, half = max(SAME, CLOSE * contrast), HALF * contrast
    pieces = []
    for level in (SAME, half) if half > SAME else (SAME,):
        labels = label(apart <= level, EIGHT)[0]
        for number, box in enumerate(find_objects(labels), 1):
            height, width = (side.stop - side.start for side in box)
            if max(height, width) >= SPECK and height * width <= LARGEST * apart.size:
                pieces.append((box, max(height, width), labels, number, level))

    def is_plain(part, box, level):
        return is_of_one_tone(part, box, apart, close, level)

    found, near_bar, near = np.zeros(apart.shape, bool), [], []
    for box, longest, labels, number, level in pieces:
        if longest < SMALL:
            continue
        part = labels[box] == number
        bar = is_bar(part)
        if (bar or (is_straight(part) and is_strokes(part))) and is_plain(part, box, level):
            found[box] |= binary_fill_holes(part)
            near.append(beyond(box, int(np.clip(AROUND * longest, 12, 2 * TALL))))
            near_bar += near[-1:] if bar else []
    # Round letters, and those too thin to have a tone of their own, are not alone.
    for box, longest, labels, number, level in pieces if near else ():
        if longest > TALL:
            continue
        part = labels[box] == number
        by_bar = any(is_within(box, wide) for wide in near_bar)
        if (
            (by_bar and level == SAME)
            or (any(is_within(box, wide) for wide in near) and is_thin(part))
            or (near_bar and longest >= SMALL and is_strokes(part) and is_plain(part, box, level))
        ):
            found[box] |= binary_fill_holes(part)
    return found


def is_within(box, wide):
    return all(w.start <= s.start and s.stop <= w.stop for s, w in zip(box, wide, strict=True))


def is_of_one_tone(part, box, apart, close, level):
    """Return True if a piece is of the extreme tone inside, and what lies around it is not."""
    from scipy.ndimage import binary_dilation

    depth = distances(np.pad(part, 1))[1:-1, 1:-1]
    inside = depth >= min(CORE, depth.max())
    if np.mean(apart[box][inside] <= close) < MOSTLY:
        return False
    wide, place = widened(part, box, FAR, apart.shape)
    near, far = (
        apart[place][binary_dilation(wide, EIGHT, by) & ~binary_dilation(wide, EIGHT, by - 1)]
        for by in (NEAR, FAR)
    )
    least = max(level, STANDING_OUT, SHARPLY * float(np.median(far)) if far.size else 0.0)
    return bool(near.size and np.mean(near > least) >= MOSTLY)


def is_bar(part):
    """Return True if a piece is a long rectangle, or any rectangle that has been written on."""
    from scipy.ndimage import binary_fill_holes

    sides = part[0], part[-1], part[:, 0], part[:, -1]
    if max(part.shape) < LONG or any(s.sum() + 2 < MOSTLY * s.size for s in sides):
        return False
    whole = binary_fill_holes(part)
    if whole.sum() + 4 < FULL * whole.size:
        return False
    written = whole.sum() - part.sum() >= BOXED * whole.sum() and min(part.shape) >= 5
    return written or max(part.shape) >= SLENDER * min(part.shape)


def is_thin(part):
    """Return True if a piece is as thin as strokes; holes of a pixel's width are of noise."""
    from scipy.ndimage import binary_closing

    whole = binary_closing(np.pad(part, 2), SQUARE)
    return bool(whole.sum() >= THIN * np.pi * distances(whole).max() ** 2)


def is_strokes(part):
    """Return True if a piece is thin, but neither a rod nor, as clipped noise is, a lace of single
    pixels."""
    from scipy.ndimage import binary_opening

    if part.sum() > OPEN * part.size or not is_thin(part):
        return False
    return bool(binary_opening(part, SQUARE).sum() >= SOLID * part.sum())


def is_straight(part):
    """Return True if an edge of a piece runs along an axis for a good part of its length."""
    longest = 0
    for side in (part, part.T):
        steps = np.diff(np.pad(side, 1).astype(np.int8), axis=0)
        for sign in (1, -1):
            # Between rows there is a pixel without an edge: no run goes on in the next one.
            flat = np.flatnonzero(sign * steps.ravel() <= 0)
            longest = max(longest, int(np.diff(flat).max()) - 1)
    return longest >= STRAIGHT * max(part.shape)


def filled_from_around(grey, found):
    """Return the picture with the median of the pixels around it in each part of what was found."""
    from scipy.ndimage import binary_dilation, find_objects, label

    result = grey.copy()
    labels, _ = label(binary_dilation(found, iterations=MARGIN))
    for number, box in enumerate(find_objects(labels), 1):
        wide = tuple(slice(max(side.start - 6, 0), side.stop + 6) for side in box)
        ring = ~found[wide] & (labels[wide] != number)
        inside = found[wide] & (labels[wide] == number)
        values = grey[wide][ring] if ring.any() else grey[~found]
        result[wide][inside] = np.median(values) if values.size else 0.0
    return result
