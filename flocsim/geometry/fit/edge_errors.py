"""The wrong pixels V of a swept polygon as a sum over its edges.

V less the mask's pixels is the sum of w over all covered pixels, w = −1 for one of the mask and 1
for another.  With running sums of w along rows that is a signed sum over the places where the
boundary of the swept polygon crosses the rows of pixel centres: + where it goes down, − where it
goes up, with the polygon on the right hand of the walk (as trace_outline walks; y is down).  The
boundary is that of the edges moved out by the spheroradius, joined by arcs at convex vertices and
cut off where they meet at reflex ones.

What an edge adds depends on its two ends alone, and on a direction at each of them, about the
bisector, up to which the joint counts as its own.  So a moved vertex costs two sums of a few
numbers, and the best of very many polygons is found by dynamic programming (splits.py).

Exact as long as edges that face each other across the outside are at least two spheroradii apart
(simple.edge_is_open), where the disk closes nothing.
"""

import numpy as np

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


def set_bisectors(vertices, out, first, last):
    """outward_bisector of the vertices first … last, counted around the polygon, into ``out``."""
    count = len(vertices)
    for k in range(first, last + 1):
        k, before, after = k % count, (k - 1) % count, (k + 1) % count
        out[k, 0], out[k, 1] = outward_bisector(
            point(vertices, before), point(vertices, k), point(vertices, after)
        )


def set_edge_sums(sums, radius, vertices, out, edges, first, last):
    """edge_sum of the edges from the vertices first … last into ``edges``; the largest of them."""
    count = len(vertices)
    largest = -BARRED
    for k in range(first, last + 1):
        k, after = k % count, (k + 1) % count
        edges[k] = edge_sum(
            sums, radius, point(vertices, k), point(out, k), point(vertices, after),
            point(out, after),
        )  # fmt: skip
        largest = max(largest, edges[k])
    return largest


def leaves_room(shape, new, margin):
    """Whether a place is at least `margin` from the array's rim: pixels off it are not counted."""
    x, y = new
    height, width = shape
    return min(x, y) >= margin and x <= width - 1 - margin and y <= height - 1 - margin
