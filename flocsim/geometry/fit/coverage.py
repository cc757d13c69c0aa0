"""Which pixels a swept polygon covers, and how that changes when one vertex moves.

Pixel coordinates, x = column, y = row (downwards).  A polygon covers a pixel whose centre is
inside its core (odd number of edges to the right) or within the spheroradius of an edge.  Both
counts are kept per pixel, so that a moved vertex needs only its two edges recounted.

Kernels are plain Python on scalars and arrays; ``compiled`` makes them fast.
"""

import functools
from collections.abc import Sequence

import numpy as np

from flocsim.compiler import composer
from flocsim.geometry.shapes.cores import is_near

compiled = functools.partial(composer.compiled, allocates=True)
"""A kernel of a fit, compiled on first use and kept on disk."""


def crossing(ax, ay, bx, by, y):
    """x where the edge a–b crosses the row at height y, −inf if it does not."""
    if (ay > y) == (by > y):
        return -np.inf
    # From the lower end up, so that an edge crosses at the same x whichever way it is walked.
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    return ax + (y - ay) / (by - ay) * (bx - ax)


def first_pixel(least, size):
    """The first pixel of an axis of `size` pixels at or after the coordinate `least`."""
    # Held to the axis before the conversion: infinity has no integer.
    return int(np.ceil(min(max(least, 0.0), float(size))))


def cover(vertices, radius, shape):
    """Counts per pixel: (edges crossed to the right are odd, edges within the radius)."""
    odd = np.zeros(shape, np.bool_)
    near = np.zeros(shape, np.int32)
    count_edges(vertices, radius, odd, near)
    return odd, near


def count_edges(vertices, radius, odd, near):
    """The same into arrays (h, w) of zeros."""
    rows, columns = odd.shape
    count = len(vertices)
    for k in range(count):
        ax, ay = vertices[k]
        bx, by = vertices[(k + 1) % count]
        for row in range(rows):
            for column in range(first_pixel(crossing(ax, ay, bx, by, row), columns)):
                odd[row, column] = not odd[row, column]
        top = first_pixel(min(ay, by) - radius, rows)
        bottom = first_pixel(max(ay, by) + radius + 1.0, rows)
        left = first_pixel(min(ax, bx) - radius, columns)
        right = first_pixel(max(ax, bx) + radius + 1.0, columns)
        for row in range(top, bottom):
            for column in range(left, right):
                if is_near(column, row, ax, ay, bx, by, radius * radius):
                    near[row, column] += 1


def count_wrong(mask, odd, near):
    """V, the pixels where cover and mask differ (paper, section 2.3), and covered − mask's."""
    wrong, excess = 0, 0
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            covered = odd[row, column] or near[row, column] > 0
            if covered != mask[row, column]:
                wrong += 1
                excess += 1 if covered else -1
    return wrong, excess


def crossed_and_near(
    shape: tuple[int, int], vertices: np.ndarray, radius: float
) -> tuple[np.ndarray, np.ndarray]:
    """The pixels (h, w) bool whose centres the polygon has inside, and those within the radius of
    its edges."""
    odd, near = np.zeros(shape, bool), np.zeros(shape, np.int32)
    compiled(count_edges)(np.array(vertices), radius, odd, near)
    return odd, near > 0


def wrong_pixels(mask: np.ndarray, rings: Sequence[np.ndarray], radius: float) -> tuple[int, int]:
    """(V, pixels covered outside of the mask) of a shape of several rings [px], y up, on an array
    that all of it fits in."""
    points = np.concatenate(rings) * (1.0, -1.0)
    beyond = np.maximum(-points.min(axis=0), points.max(axis=0) - mask.shape[::-1])
    margin = max(0, int(np.ceil(beyond.max() + radius))) + 2
    around = np.pad(mask, margin)
    inside, close = np.zeros(around.shape, bool), np.zeros(around.shape, bool)
    for ring in rings:
        odd, near = crossed_and_near(around.shape, ring * (1.0, -1.0) + margin, radius)
        inside ^= odd
        close |= near
    solid = inside | close
    return int(np.count_nonzero(solid != around)), int(np.count_nonzero(solid & ~around))


def padded(mask: np.ndarray, count: int, radius: float) -> tuple[np.ndarray, int]:
    """The mask with room around it for the swept polygon, and the width of that margin [px]."""
    margin = int(np.ceil(radius)) + 6 + count // 100
    return np.pad(mask, margin), margin


def neighbours(vertices, k):
    after = (k + 1) % len(vertices)
    return (
        (vertices[k - 1, 0], vertices[k - 1, 1]),
        (vertices[k, 0], vertices[k, 1]),
        (vertices[after, 0], vertices[after, 1]),
    )


def row_reach(ax, ay, bx, by, row, radius):
    """First and last x that the edge a–b swept by the radius can have in a row, or inf, −inf."""
    low, high = min(ay, by), max(ay, by)
    if row < low - radius or row > high + radius:
        return np.inf, -np.inf
    if high - low <= radius:
        return min(ax, bx) - radius, max(ax, bx) + radius
    slope = (bx - ax) / (by - ay)
    first = ax + (max(low, row - radius) - ay) * slope
    last = ax + (min(high, row + radius) - ay) * slope
    return min(first, last) - radius, max(first, last) + radius


def move_vertex(mask, odd, near, before, old, after, new, radius, keep):
    """Change of (V, pixels covered) when a vertex goes from `old` to `new`.

    The counts follow if `keep`.

    Only pixels between or near the old and the new edges before–vertex–after can change: in
    every row those at the edges to `before`, those at the edges to `after`, and those between
    the two where just one of the four edges' ends lies across the row.
    """
    reach = radius + 1e-6
    (before_x, before_y), (after_x, after_y) = before, after
    (old_x, old_y), (new_x, new_y) = old, new
    top = min(min(before_y, after_y), min(old_y, new_y)) - reach
    bottom = max(max(before_y, after_y), max(old_y, new_y)) + reach
    change, growth = 0, 0
    ends = before, old, after, new
    for row in range(first_pixel(top, len(mask)), first_pixel(bottom, len(mask))):
        a1, a2 = row_reach(before_x, before_y, old_x, old_y, row, reach)
        b1, b2 = row_reach(before_x, before_y, new_x, new_y, row, reach)
        c1, c2 = row_reach(old_x, old_y, after_x, after_y, row, reach)
        d1, d2 = row_reach(new_x, new_y, after_x, after_y, row, reach)
        first1, last1 = min(a1, b1), max(a2, b2)
        first2, last2 = min(c1, d1), max(c2, d2)
        apart = first1 > last2 or first2 > last1
        if apart and (old_y > row) == (new_y > row):
            more, wider = change_in_row(mask, odd, near, ends, radius, keep, row, first2, last2)
            change, growth = change + more, growth + wider
        else:
            first1, last1 = min(first1, first2), max(last1, last2)
        more, wider = change_in_row(mask, odd, near, ends, radius, keep, row, first1, last1)
        change, growth = change + more, growth + wider
    return change, growth


def change_in_row(mask, odd, near, ends, radius, keep, row, first, last):
    """move_vertex's share of the pixels of a row with first ≤ x ≤ last."""
    (before_x, before_y), (old_x, old_y), (after_x, after_y), (new_x, new_y) = ends
    columns = mask.shape[1]
    limit = radius * radius
    x1 = crossing(before_x, before_y, old_x, old_y, row)
    x2 = crossing(old_x, old_y, after_x, after_y, row)
    x3 = crossing(before_x, before_y, new_x, new_y, row)
    x4 = crossing(new_x, new_y, after_x, after_y, row)
    change, growth = 0, 0
    for column in range(first_pixel(first, columns), first_pixel(last, columns)):
        flip = (column < x1) ^ (column < x2) ^ (column < x3) ^ (column < x4)
        extra = 0
        if is_near(column, row, before_x, before_y, old_x, old_y, limit):
            extra -= 1
        if is_near(column, row, old_x, old_y, after_x, after_y, limit):
            extra -= 1
        if is_near(column, row, before_x, before_y, new_x, new_y, limit):
            extra += 1
        if is_near(column, row, new_x, new_y, after_x, after_y, limit):
            extra += 1
        if not flip and extra == 0:
            continue
        was_odd, was_near = odd[row, column], near[row, column]
        was = was_odd or was_near > 0
        now = (was_odd != flip) or was_near + extra > 0
        if was != now:
            change += 1 if now != mask[row, column] else -1
            growth += 1 if now else -1
        if keep:
            odd[row, column] = was_odd != flip
            near[row, column] = was_near + extra
    return change, growth
