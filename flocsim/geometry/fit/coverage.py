"""The wrong pixels V of a swept polygon: counted one by one, and as a sum over its edges.

Pixel coordinates, x = column, y = row (downwards).  A polygon covers a pixel whose centre is
inside its core (odd number of edges to the right) or within the spheroradius of an edge.  Both
counts are kept per pixel, so that a moved vertex needs only its two edges recounted.

V less the mask's pixels is the sum of w over all covered pixels, w = −1 for one of the mask and 1
for another.  With running sums of w along rows that is a signed sum over the places where the
boundary of the swept polygon crosses the rows of pixel centres: + where it goes down, − where it
goes up, with the polygon on the right hand of the walk (as trace_outline walks; y is down).  The
boundary is that of the edges moved out by the spheroradius, joined by arcs at convex vertices and
cut off where they meet at reflex ones.

What an edge adds depends on its two ends alone, and on a direction at each of them, about the
bisector, up to which the joint counts as its own.  So a moved vertex costs two sums of a few
numbers, and the best of very many polygons is found by dynamic programming (global_search.py).
That is exact as long as edges that face each other across the outside are at least two spheroradii
apart (simple.edge_is_open), where the disk closes nothing.
"""

import functools
from collections.abc import Sequence

import numpy as np

from flocsim.compiler import composer
from flocsim.geometry.shapes.cores import is_near

compiled = functools.partial(composer.compiled, what="the search for polygons")
"""A kernel of a fit, compiled on first use and kept on disk."""

BARRED = 2**40
"""The sum of an edge that must not be."""

POSSIBLE = BARRED // 2
"""Sums of polygons without a barred edge are below this, others above."""

SHORTEST = 1e-9
"""Edges are longer than this [px]."""

STRAIGHTEST = 0.001
"""Cosine of the largest angle between an edge's normal and the directions at its ends: a right
angle belongs to a needle without width."""

REFLEX = 0.3
"""The same at a reflex vertex, 73°: a narrower one is a slit that the disk closes."""

AROUND = 1e-7
"""The radius is larger by this [px], so that centres just at the spheroradius are covered."""


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


def no_cover(shape: tuple[int, int], inside: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return counts per pixel (h, w) before any edge is counted: (bool, edges crossed to the right
    are odd; int32, edges within the radius); ``inside``: outside is taken for inside."""
    return np.full(shape, inside), np.zeros(shape, np.int32)


def count_edges(vertices, radius, odd, near):
    """Count the edges of a polygon, into arrays of no_cover."""
    rows, columns = odd.shape
    count = vertices.shape[0]
    for k in range(count):
        ax, ay = point(vertices, k)
        bx, by = point(vertices, (k + 1) % count)
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
    odd, near = no_cover(shape)
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
    before, after = (k - 1) % vertices.shape[0], (k + 1) % vertices.shape[0]
    return point(vertices, before), point(vertices, k), point(vertices, after)


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
    for row in range(first_pixel(top, mask.shape[0]), first_pixel(bottom, mask.shape[0])):
        a1, a2 = row_reach(before_x, before_y, old_x, old_y, row, reach)
        b1, b2 = row_reach(before_x, before_y, new_x, new_y, row, reach)
        c1, c2 = row_reach(old_x, old_y, after_x, after_y, row, reach)
        d1, d2 = row_reach(new_x, new_y, after_x, after_y, row, reach)
        first1, last1 = min(a1, b1), max(a2, b2)
        first2, last2 = min(c1, d1), max(c2, d2)
        first, last = min(first1, first2), max(last1, last2)
        more, wider = change_in_row(mask, odd, near, ends, radius, keep, row, first, last)
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


def running_sums(mask: np.ndarray, outside: int = 0) -> np.ndarray:
    """Sums (h, w + 1) of the weights of the pixels left of each column: −1 in the mask,
    1 + 2 `outside` off it (search.weighed)."""
    sums = np.zeros((mask.shape[0], mask.shape[1] + 1), np.int64)
    np.cumsum(np.where(mask, -1, 1 + 2 * outside), axis=1, out=sums[:, 1:])
    return sums


def column(place, columns):
    """A column of the sums as an index: what lies off the array counts for nothing."""
    return min(max(int(place), 0), columns - 1)


def arc_sum(sums, x, y, radius, ax, ay, bx, by):
    """The sum along the arc about (x, y) from the unit vector a to b, the shorter way round."""
    sign = 1
    if ax * by - ay * bx < 0.0:
        ax, ay, bx, by = bx, by, ax, ay
        sign = -1
    low, high = min(ay, by), max(ay, by)
    if ax < 0.0 < bx:
        low = -1.0
    elif bx < 0.0 < ax:
        high = 1.0
    rows, columns = sums.shape
    first, last = int(np.ceil(y + radius * low)), int(np.floor(y + radius * high))
    total = 0
    for row in range(max(first, 0), min(last + 1, rows)):
        down = row - y
        across = np.sqrt(max(radius * radius - down * down, 0.0))
        # Its right half goes down and has its start, its left half goes up and has its end.
        if ax * down - ay * across >= 0.0 and across * by - down * bx > 0.0:
            total += sums[row, column(np.floor(x + across) + 1.0, columns)]
        if ax * down + ay * across > 0.0 and -across * by - down * bx >= 0.0:
            total -= sums[row, column(np.ceil(x - across), columns)]
    return sign * total


def line_sum(sums, ax, ay, bx, by):
    """The sum along the line from a to b."""
    total = 0
    rows, columns = sums.shape
    first, last = max(int(np.ceil(min(ay, by))), 0), min(int(np.ceil(max(ay, by))), rows)
    if first < last:
        slope = (bx - ax) / (by - ay)
        x = ax + (first - ay) * slope
        if by > ay:
            for row in range(first, last):
                total += sums[row, column(np.floor(x) + 1.0, columns)]
                x += slope
        else:
            for row in range(first, last):
                total -= sums[row, column(np.ceil(x), columns)]
                x += slope
    return total


def edge_sum(sums, radius, a, toward_a, b, toward_b):
    """The sum along the boundary of edge a–b: from the direction at a to that at b.

    BARRED for an edge without a length, at a vertex sharper than STRAIGHTEST or REFLEX, and where
    the joints at reflex vertices take more than the whole edge.
    """
    (ax, ay), (bx, by) = a, b
    (out_ax, out_ay), (out_bx, out_by) = toward_a, toward_b
    along_x, along_y = bx - ax, by - ay
    length = np.sqrt(along_x * along_x + along_y * along_y)
    if length < SHORTEST:
        return BARRED
    share = 1.0 / length
    nx, ny = along_y * share, -along_x * share
    cosine_a, cosine_b = nx * out_ax + ny * out_ay, nx * out_bx + ny * out_by
    if min(cosine_a, cosine_b) < STRAIGHTEST:
        return BARRED
    swept, cut = radius + AROUND, 0.0
    sine = out_ax * ny - out_ay * nx
    if sine >= 0.0:
        start_x, start_y = ax + swept * nx, ay + swept * ny
        total = arc_sum(sums, ax, ay, swept, out_ax, out_ay, nx, ny)
    else:
        if cosine_a < REFLEX:
            return BARRED
        share = 1.0 / cosine_a
        cut -= sine * share
        start_x, start_y = ax + swept * share * out_ax, ay + swept * share * out_ay
        total = line_sum(sums, ax + swept * out_ax, ay + swept * out_ay, start_x, start_y)
    sine = nx * out_by - ny * out_bx
    if sine >= 0.0:
        stop_x, stop_y = bx + swept * nx, by + swept * ny
        total += arc_sum(sums, bx, by, swept, nx, ny, out_bx, out_by)
    else:
        if cosine_b < REFLEX:
            return BARRED
        share = 1.0 / cosine_b
        cut -= sine * share
        stop_x, stop_y = bx + swept * share * out_bx, by + swept * share * out_by
        total += line_sum(sums, stop_x, stop_y, bx + swept * out_bx, by + swept * out_by)
    if radius * cut > length:
        return BARRED
    return total + line_sum(sums, start_x, start_y, stop_x, stop_y)


def outward_bisector(before, here, after):
    """Unit vector between the outward normals of the edges at a vertex; the first normal where
    they are opposite, (0, 0) where an edge has no length."""
    ux, uy = here[0] - before[0], here[1] - before[1]
    wx, wy = after[0] - here[0], after[1] - here[1]
    first, second = np.sqrt(ux * ux + uy * uy), np.sqrt(wx * wx + wy * wy)
    if min(first, second) < SHORTEST:
        return 0.0, 0.0
    first, second = 1.0 / first, 1.0 / second
    x, y = uy * first + wy * second, -ux * first - wx * second
    length = np.sqrt(x * x + y * y)
    if length < 1e-6:
        return uy * first, -ux * first
    return x / length, y / length


def point(points, k):
    return points[k, 0], points[k, 1]


def copy_points(points, to):
    for k in range(points.shape[0]):
        to[k, 0], to[k, 1] = points[k, 0], points[k, 1]


def set_bisectors(vertices, out, first, last):
    """outward_bisector of the vertices first … last, counted around the polygon, into ``out``."""
    count = vertices.shape[0]
    for k in range(first, last + 1):
        k, before, after = k % count, (k - 1) % count, (k + 1) % count
        out[k, 0], out[k, 1] = outward_bisector(
            point(vertices, before), point(vertices, k), point(vertices, after)
        )


def set_edge_sums(sums, radius, vertices, out, edges, first, last):
    """edge_sum of the edges from the vertices first … last into ``edges``; the largest of them."""
    count = vertices.shape[0]
    largest = -BARRED
    for k in range(first, last + 1):
        k, after = k % count, (k + 1) % count
        a, b = point(vertices, k), point(vertices, after)
        edges[k] = edge_sum(sums, radius, a, point(out, k), b, point(out, after))
        largest = max(largest, edges[k])
    return largest


def leaves_room(shape, new, margin):
    """Whether a place is at least `margin` from the array's rim: pixels off it are not counted."""
    x, y = new
    height, width = shape
    return min(x, y) >= margin and x <= width - 1 - margin and y <= height - 1 - margin
