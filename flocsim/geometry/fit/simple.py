"""Keeping a polygon simple while its vertices move: kernels, and what calls them compiled."""

import numpy as np

from flocsim.geometry.fit.coverage import compiled, neighbours, point
from flocsim.geometry.shapes.cores import segment_distance2, segments_cross

CLEARANCE = 0.01
"""Least distance [px] between a vertex and an edge not its own: simple polygons stay simple."""


def edge_is_clear(vertices, start, stop, moved, x, y):
    """Whether the edge between the neighbours `start` and `stop` keeps clear of all others.

    The vertex `moved`, one of the two, counts as being at (x, y).
    """
    limit = CLEARANCE * CLEARANCE
    count = vertices.shape[0]
    ax, ay = (x, y) if start == moved else point(vertices, start)
    bx, by = (x, y) if stop == moved else point(vertices, stop)
    if (bx - ax) ** 2 + (by - ay) ** 2 < limit:
        return False
    for k in range(count):
        cx, cy = point(vertices, k)
        if k in (start, stop):
            continue
        if segment_distance2(cx, cy, ax, ay, bx, by) < limit:
            return False
        following = (k + 1) % count
        if following in (start, stop):
            continue
        dx, dy = point(vertices, following)
        if segment_distance2(x, y, cx, cy, dx, dy) < limit:
            return False
        if segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
            return False
    return True


def stays_simple(vertices, k, x, y):
    count = vertices.shape[0]
    before, after = (k - 1) % count, (k + 1) % count
    return edge_is_clear(vertices, before, k, k, x, y) and edge_is_clear(
        vertices, k, after, k, x, y
    )


def all_clear(vertices):
    """Whether no edges cross and every vertex is clear of the edges that are not its own."""
    for k in range(vertices.shape[0]):
        if not stays_simple(vertices, k, vertices[k, 0], vertices[k, 1]):
            return False
    return True


def edge_is_open(vertices, k, gap):
    """Whether edge k keeps clear of all others, and by `gap` of those that face it outside.

    The polygon lies on the right hand of its walk.  Edges that meet are not facing each other.
    """
    count = vertices.shape[0]
    before, after = (k - 1) % count, (k + 1) % count
    clear, limit = CLEARANCE * CLEARANCE, gap * gap
    ax, ay = vertices[k, 0], vertices[k, 1]
    bx, by = vertices[after, 0], vertices[after, 1]
    nx, ny = by - ay, ax - bx
    if nx * nx + ny * ny < clear:
        return False
    left, right = min(ax, bx) - gap, max(ax, bx) + gap
    top, bottom = min(ay, by) - gap, max(ay, by) + gap
    for i in range(count):
        j = i + 1 if i < count - 1 else 0
        cx, cy = vertices[i, 0], vertices[i, 1]
        dx, dy = vertices[j, 0], vertices[j, 1]
        if i == k or max(cx, dx) < left or min(cx, dx) > right:
            continue
        if max(cy, dy) < top or min(cy, dy) > bottom:
            continue
        c, d = segment_distance2(cx, cy, ax, ay, bx, by), segment_distance2(dx, dy, ax, ay, bx, by)
        a, b = segment_distance2(ax, ay, cx, cy, dx, dy), segment_distance2(bx, by, cx, cy, dx, dy)
        if i in (before, after):
            # Of two neighbours the far ends; in a triangle all edges are neighbours.
            far = min(b, c) if i == before else min(a, d)
            if far < clear:
                return False
            continue
        if min(min(a, b), min(c, d)) < clear or segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
            return False
        mx, my = dy - cy, cx - dx
        if nx * mx + ny * my >= 0.0:
            continue
        ends_in_front = (
            (c < limit and nx * (cx - ax) + ny * (cy - ay) > 0.0)
            or (d < limit and nx * (dx - ax) + ny * (dy - ay) > 0.0)
            or (a < limit and mx * (ax - cx) + my * (ay - cy) > 0.0)
            or (b < limit and mx * (bx - cx) + my * (by - cy) > 0.0)
        )
        if ends_in_front:
            return False
    return True


def is_open(vertices, gap):
    """Whether the polygon is simple, and no two of its edges face each other outside by < gap."""
    for k in range(vertices.shape[0]):
        if not edge_is_open(vertices, k, gap):
            return False
    return True


def reverse(vertices, first, last):
    while first < last:
        for axis in range(2):
            kept = vertices[first, axis]
            vertices[first, axis] = vertices[last, axis]
            vertices[last, axis] = kept
        first += 1
        last -= 1


def untangle(vertices):
    """Reorder the vertices, in place, until no edges cross, as far as that is found.

    Of every crossing pair of edges the part between is reversed, which shortens the polygon.
    Points on one line can seem to cross for ever, by rounding: the rounds are counted.
    """
    count = vertices.shape[0]
    for _ in range(count):
        crossed = False
        for first in range(count - 2):
            for second in range(first + 2, count - (first == 0)):
                ax, ay = point(vertices, first)
                bx, by = point(vertices, first + 1)
                cx, cy = point(vertices, second)
                dx, dy = point(vertices, (second + 1) % count)
                if segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
                    reverse(vertices, first + 1, second)
                    crossed = True
        if not crossed:
            break


def bisector(vertices, k):
    """Unit bisector of the corner k, to the right hand of a walk: inwards for trace_outline's."""
    (last_x, last_y), (x, y), (next_x, next_y) = neighbours(vertices, k)
    ux, uy = x - last_x, y - last_y
    wx, wy = next_x - x, next_y - y
    before, after = max(np.hypot(ux, uy), 1e-12), max(np.hypot(wx, wy), 1e-12)
    nx, ny = -uy / before - wy / after, ux / before + wx / after
    length = max(np.hypot(nx, ny), 1e-12)
    return nx / length, ny / length


def draw_in(vertices, depth, inwards):
    """Move every vertex by `depth` [px] along its bisector, in place; the bisectors go into
    ``inwards`` (N, 2).

    Where the polygon would not stay simple, by half of it, or not at all.
    """
    count = vertices.shape[0]
    for k in range(count):
        inwards[k, 0], inwards[k, 1] = bisector(vertices, k)
    for k in range(count):
        for share in (1.0, 0.5):
            x = vertices[k, 0] + share * depth * inwards[k, 0]
            y = vertices[k, 1] + share * depth * inwards[k, 1]
            if stays_simple(vertices, k, x, y):
                vertices[k, 0], vertices[k, 1] = x, y
                break


def untangle_and_draw_in(vertices, depth, inwards):
    """Do what simple_inset does; ``inwards`` (N, 2) is overwritten."""
    if not all_clear(vertices):
        untangle(vertices)
        if not all_clear(vertices):
            return False
    draw_in(vertices, depth, inwards)
    return True


def simple_inset(vertices: np.ndarray, depth: float) -> bool:
    """Untangle the polygon and draw it in by `depth` [px], in place; whether that succeeded."""
    return bool(compiled(untangle_and_draw_in)(vertices, float(depth), np.empty_like(vertices)))


def is_simple(vertices: np.ndarray) -> bool:
    """Whether no edges cross or nearly touch: simple_inset leaves such a polygon as it is."""
    drawn = np.array(vertices)
    return simple_inset(drawn, 0.0) and np.array_equal(drawn, vertices)
