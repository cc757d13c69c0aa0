"""Cores as arrays of points: edges, area, distances, inside or outside."""

import numpy as np


def edges_of(vertices):
    """(starts, ends) of the core's edges: none for a point, one for a segment, N for a polygon."""
    if len(vertices) == 2:
        return vertices[:1], vertices[1:]
    if len(vertices) == 1:
        return vertices[:0], vertices[:0]
    return vertices, np.roll(vertices, -1, axis=0)


def unit_edges(vertices):
    """(starts, unit directions, lengths) of the core's edges."""
    starts, ends = edges_of(vertices)
    lengths = np.hypot(*(ends - starts).T)
    return starts, (ends - starts) / lengths[:, None], lengths


def cross(a, b):
    """The z component of the cross product of plane vectors, elementwise."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def signed_area(vertices):
    """Area of the core polygon [m²], positive when its vertices run counter-clockwise."""
    return 0.5 * np.sum(cross(vertices, np.roll(vertices, -1, axis=0)))


def distance_to_edges(points, starts, ends):
    """Distances (k, edges) from points (k, 2) to each edge."""
    along = ends - starts
    relative = points[:, None, :] - starts[None]
    share = np.einsum("kej,ej->ke", relative, along) / np.einsum("ej,ej->e", along, along)
    gap = relative - np.clip(share, 0.0, 1.0)[..., None] * along[None]
    return np.hypot(gap[..., 0], gap[..., 1])


def inside_polygon(points, vertices):
    """Which of the points (k, 2) lie inside the core polygon (crossing number)."""
    if len(vertices) < 3:
        return np.zeros(len(points), dtype=bool)
    a, b = vertices, np.roll(vertices, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    straddles = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    crossing = a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return np.count_nonzero(straddles & (x < crossing), axis=1) % 2 == 1
