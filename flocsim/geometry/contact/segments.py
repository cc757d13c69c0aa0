"""Distances between points and segments, on scalars. Run compiled or not."""


def closest_share(px, py, ax, ay, bx, by):
    """Where the point of segment a–b nearest to p lies: 0 at a, 1 at b; 0 for a point a = b."""
    dx = bx - ax
    dy = by - ay
    length2 = dx * dx + dy * dy
    if length2 == 0.0:
        return 0.0
    share = ((px - ax) * dx + (py - ay) * dy) / length2
    return min(max(share, 0.0), 1.0)


def segment_distance2(px, py, ax, ay, bx, by):
    """Squared distance [m²] from point p to segment a–b."""
    share = closest_share(px, py, ax, ay, bx, by)
    dx = px - (ax + share * (bx - ax))
    dy = py - (ay + share * (by - ay))
    return dx * dx + dy * dy


def edge_count(points):
    """Edges of a core of that many points: none, one, or as many as points."""
    if points < 3:
        return points - 1
    return points


def edge_end(first, points, start):
    """The core point at which the edge that begins at ``start`` ends.

    ``first`` is the first of the body's core points, ``points`` their number.
    """
    following = start + 1
    if following == first + points:
        return first
    return following
