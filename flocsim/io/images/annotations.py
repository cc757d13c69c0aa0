"""What a microscope's program has burnt into a picture: scale bars, their text, boxes around it.

A bar is told by what no floc has: all its pixels are of one grey, the brightest or the darkest of
the picture, they fill a rectangle along the axes, and the picture changes at once at its sides.
"""

import numpy as np

SAME = 0.02
"""Greys that differ by less are one: packing as JPEG scatters them."""

STEP = 0.1
"""Least contrast of a bar against what lies beside it."""

FULL = 0.97
"""Share of its box that a rectangle fills."""

LONG, SLENDER = 16, 4.0
"""Least length [px], and times the width, of a bar."""

BOXED = 0.02
"""Least share of a rectangle that writing on it covers: a plain stout one may be anything."""

LARGEST = 0.25
"""Share of the picture above which a rectangle of one grey is its background."""

AROUND, TALL = 0.6, 60
"""Writing lies within this share of a bar's length, and letters are no taller [px]."""

MARGIN = 2
"""Pixels around what is burnt in whose greys are mixed with it."""


def without_annotations(grey: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(the picture with the greys around them in the place of scale bars and their writing, (h, w)
    bool of what was replaced).

    grey: (h, w) in [0, 1]. The picture itself, and nothing replaced, where there is none.
    """
    from scipy.ndimage import binary_dilation, label

    found = np.zeros(grey.shape, bool)
    labels = np.empty(grey.shape, np.int32)
    for flat in (grey <= grey.min() + SAME, grey >= grey.max() - SAME):
        label(flat, np.ones((3, 3), int), output=labels)
        found |= burnt_in(grey, labels)
    if not found.any():
        return grey, found
    found = binary_dilation(found, np.ones((3, 3), bool), iterations=MARGIN)
    return filled_from_around(grey, found), found


def burnt_in(grey, labels):
    """What of the numbered pieces (h, w), all of one grey, is a bar or writing beside it."""
    from scipy.ndimage import binary_fill_holes, find_objects

    boxes = find_objects(labels)
    found = np.zeros(grey.shape, bool)
    for number, box in enumerate(boxes, 1):
        height, width = (side.stop - side.start for side in box)
        if max(height, width) < LONG or height * width > LARGEST * grey.size:
            continue
        part = labels[box] == number
        if part.sum() < 0.3 * part.size:
            continue
        whole = binary_fill_holes(part)
        slender = max(height, width) >= SLENDER * min(height, width)
        written = whole.sum() - part.sum() >= BOXED * whole.sum() and min(height, width) >= 5
        if whole.sum() < FULL * whole.size or not (slender or written):
            continue
        if min(height, width) < 2 or not stands_out(grey, box):
            continue
        found[box] |= whole
        if slender:
            found |= writing(labels, boxes, box, grey.shape)
    return found


def stands_out(grey, box):
    """Whether a rectangle differs at once from what lies two pixels beside its long sides."""
    top, left, bottom, right = box[0].start, box[1].start, box[0].stop, box[1].stop
    inside = np.median(grey[box])
    wide = right - left >= bottom - top
    lines = []
    if wide:
        lines = [grey[row, left:right] for row in (top - 3, bottom + 2) if 0 <= row < len(grey)]
    else:
        lines = [grey[top:bottom, column] for column in (left - 3, right + 2)
                 if 0 <= column < grey.shape[1]]  # fmt: skip
    return bool(lines) and all(np.mean(np.abs(line - inside) > STEP) > 0.9 for line in lines)


def writing(labels, boxes, bar, shape):
    """Pixels of the bar's grey in pieces no larger than letters, above, below or beside it."""
    length = max(side.stop - side.start for side in bar)
    reach = int(np.clip(AROUND * length, 12, 2 * TALL))
    near = tuple(slice(max(side.start - reach, 0), min(side.stop + reach, size))
                 for side, size in zip(bar, shape, strict=True))  # fmt: skip
    found = np.zeros(shape, bool)
    for number in np.unique(labels[near]):
        if number == 0:
            continue
        box = boxes[number - 1]
        inside = all(
            a.start <= b.start and b.stop <= a.stop for a, b in zip(near, box, strict=True)
        )
        if inside and max(side.stop - side.start for side in box) <= min(TALL, reach):
            found[box] |= labels[box] == number
    return found


def filled_from_around(grey, found):
    """The picture with the median of the pixels around it in each part of what was found."""
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
