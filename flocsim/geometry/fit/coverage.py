"""Which pixels a swept polygon covers, and how that changes when one vertex moves.

Pixel coordinates, x = column, y = row (downwards).  A polygon covers a pixel whose centre is
inside its core (odd number of edges to the right) or within the spheroradius of an edge.  Both
counts are kept per pixel, so that a moved vertex needs only its two edges recounted.

Plain Python on scalars and arrays; flocsim.geometry.fit.search compiles it.
"""

import numpy as np


def squared_distance(x, y, ax, ay, bx, by):
    """Squared distance of the point (x, y) from the segment a–b."""
    ux, uy = bx - ax, by - ay
    wx, wy = x - ax, y - ay
    length = ux * ux + uy * uy
    share = (wx * ux + wy * uy) / length if length > 0.0 else 0.0
    share = min(1.0, max(0.0, share))
    dx, dy = wx - share * ux, wy - share * uy
    return dx * dx + dy * dy


def is_near(x, y, ax, ay, bx, by, limit):
    """Whether (x, y) is within √limit of the segment a–b; squared_distance without dividing."""
    ux, uy = bx - ax, by - ay
    wx, wy = x - ax, y - ay
    along = wx * ux + wy * uy
    if along <= 0.0:
        return wx * wx + wy * wy <= limit
    length = ux * ux + uy * uy
    if along >= length:
        wx, wy = x - bx, y - by
        return wx * wx + wy * wy <= limit
    across = wx * uy - wy * ux
    return across * across <= limit * length


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
    count = len(vertices)
    for k in range(count):
        ax, ay = vertices[k]
        bx, by = vertices[(k + 1) % count]
        for row in range(shape[0]):
            for column in range(first_pixel(crossing(ax, ay, bx, by, row), shape[1])):
                odd[row, column] = not odd[row, column]
        add_edge(near, ax, ay, bx, by, radius)
    return odd, near


def add_edge(near, ax, ay, bx, by, radius):
    """Count the edge a–b at every pixel within the radius of it."""
    rows, columns = near.shape
    for row in range(
        first_pixel(min(ay, by) - radius, rows), first_pixel(max(ay, by) + radius + 1.0, rows)
    ):
        for column in range(
            first_pixel(min(ax, bx) - radius, columns),
            first_pixel(max(ax, bx) + radius + 1.0, columns),
        ):
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


def count_errors(mask, vertices, radius):
    """V of the polygon `vertices` (N, 2) swept by `radius` [px], against a (h, w) bool mask."""
    odd, near = cover(vertices, radius, mask.shape)
    return count_wrong(mask, odd, near)[0]


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
    top = min(min(before[1], after[1]), min(old[1], new[1])) - reach
    bottom = max(max(before[1], after[1]), max(old[1], new[1])) + reach
    change, growth = 0, 0
    ends = before, old, after, new
    for row in range(first_pixel(top, len(mask)), first_pixel(bottom, len(mask))):
        a1, a2 = row_reach(before[0], before[1], old[0], old[1], row, reach)
        b1, b2 = row_reach(before[0], before[1], new[0], new[1], row, reach)
        c1, c2 = row_reach(old[0], old[1], after[0], after[1], row, reach)
        d1, d2 = row_reach(new[0], new[1], after[0], after[1], row, reach)
        first1, last1 = min(a1, b1), max(a2, b2)
        first2, last2 = min(c1, d1), max(c2, d2)
        apart = first1 > last2 or first2 > last1
        if apart and (old[1] > row) == (new[1] > row):
            one = change_in_row(mask, odd, near, ends, radius, keep, row, first1, last1)
            two = change_in_row(mask, odd, near, ends, radius, keep, row, first2, last2)
            change, growth = change + one[0] + two[0], growth + one[1] + two[1]
        else:
            first, last = min(first1, first2), max(last1, last2)
            one = change_in_row(mask, odd, near, ends, radius, keep, row, first, last)
            change, growth = change + one[0], growth + one[1]
    return change, growth


def change_in_row(mask, odd, near, ends, radius, keep, row, first, last):
    """move_vertex's share of the pixels of a row with first ≤ x ≤ last."""
    before, old, after, new = ends
    columns = mask.shape[1]
    limit = radius * radius
    x1 = crossing(before[0], before[1], old[0], old[1], row)
    x2 = crossing(old[0], old[1], after[0], after[1], row)
    x3 = crossing(before[0], before[1], new[0], new[1], row)
    x4 = crossing(new[0], new[1], after[0], after[1], row)
    change, growth = 0, 0
    for column in range(first_pixel(first, columns), first_pixel(last, columns)):
        flip = (column < x1) ^ (column < x2) ^ (column < x3) ^ (column < x4)
        extra = 0
        if is_near(column, row, before[0], before[1], old[0], old[1], limit):
            extra -= 1
        if is_near(column, row, old[0], old[1], after[0], after[1], limit):
            extra -= 1
        if is_near(column, row, before[0], before[1], new[0], new[1], limit):
            extra += 1
        if is_near(column, row, new[0], new[1], after[0], after[1], limit):
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
