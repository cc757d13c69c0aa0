"""Area, centroid and second moment of a swept outline, exact to round-off, convex or not.

The outline of core ⊕ disk is made of offset edges and of arcs around vertices. Each such piece is
cut wherever another piece crosses it; what lies nearer than the radius to some other part of the
core is dropped; Green's theorem over what remains gives the moments, holes included.
"""

import numpy as np

QUADRATURE_NODES, QUADRATURE_WEIGHTS = np.polynomial.legendre.leggauss(16)
"""Sixteen nodes integrate a quartic on a chord, and its like on an arc up to π, to round-off."""

COVERED = 1.0 - 1e-9
"""A point nearer to the core than this share of the radius is inside the swept shape."""


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


def beside(along, lengths):
    """Which distances along an edge lie on the edge, with a rounding's margin."""
    return (along > -1e-9 * lengths) & (along < lengths * (1.0 + 1e-9))


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


def exposed(points, vertices, radius):
    """Which of the points lie on the swept outline, not inside the swept shape."""
    starts, ends = edges_of(vertices)
    seen = np.empty(len(points), dtype=bool)
    for rows in np.array_split(np.arange(len(points)), 1 + len(points) * len(starts) // 200_000):
        near = distance_to_edges(points[rows], starts, ends).min(axis=1) < COVERED * radius
        seen[rows] = ~near & ~inside_polygon(points[rows], vertices)
    return seen


def circle_cuts(origins, directions, vertices, radius):
    """Where lines (rows) cross the circles around the vertices: row numbers and places."""
    to_centre = vertices[None] - origins[:, None]
    along = np.einsum("pkj,pj->pk", to_centre, directions)
    half = radius**2 - (np.einsum("pkj,pkj->pk", to_centre, to_centre) - along**2)
    rows, columns = np.nonzero(half > 0.0)
    root = np.sqrt(half[rows, columns])
    middle = along[rows, columns]
    return np.tile(rows, 2), np.concatenate([middle - root, middle + root])


def offset_cuts(origins, directions, vertices, radius):
    """Where lines (rows) cross the offsets of the edges, on both sides: row numbers and places."""
    starts, units, lengths = unit_edges(vertices)
    slope = cross(directions[:, None], units[None])
    rows, edges = np.nonzero(np.abs(slope) > 1e-12)
    offset = cross(starts[edges] - origins[rows], units[edges])
    found = []
    for side in (-radius, radius):
        place = (offset + side) / slope[rows, edges]
        met = origins[rows] + place[:, None] * directions[rows] - starts[edges]
        on_edge = beside(np.einsum("ij,ij->i", met, units[edges]), lengths[edges])
        found.append((rows[on_edge], place[on_edge]))
    return joined(*found)


def arc_circle_cuts(vertices, radius):
    """Where the circles around vertices (rows) cross each other: row numbers and angles."""
    to_centre = vertices[None] - vertices[:, None]
    distance = np.hypot(to_centre[..., 0], to_centre[..., 1])
    rows, columns = np.nonzero((distance > 0.0) & (distance < 2.0 * radius))
    across = to_centre[rows, columns]
    bearing = np.arctan2(across[:, 1], across[:, 0])
    half = np.arccos(distance[rows, columns] / (2.0 * radius))
    return np.tile(rows, 2), np.concatenate([bearing - half, bearing + half])


def arc_offset_cuts(vertices, radius):
    """Where the circles around vertices (rows) cross the offsets of edges: rows and angles."""
    starts, units, lengths = unit_edges(vertices)
    normals = np.column_stack([units[:, 1], -units[:, 0]])
    facing = np.arctan2(normals[:, 1], normals[:, 0])
    level = np.einsum("pej,ej->pe", starts[None] - vertices[:, None], normals)
    # Where the arc meets its own edges tangentially, the normals themselves are the cuts.
    own, edges = np.nonzero(np.abs(level) < 1e-9 * radius)
    found = [(own, facing[edges]), (own, facing[edges] + np.pi)]
    for side in (-radius, radius):
        cosine = (level + side) / radius
        rows, edges = np.nonzero((np.abs(cosine) < 1.0) & (np.abs(level) >= 1e-9 * radius))
        opening = np.arccos(cosine[rows, edges])
        for angle in (facing[edges] - opening, facing[edges] + opening):
            met = vertices[rows] - starts[edges]
            met = met + radius * np.column_stack([np.cos(angle), np.sin(angle)])
            on_edge = beside(np.einsum("ij,ij->i", met, units[edges]), lengths[edges])
            found.append((rows[on_edge], angle[on_edge]))
    return joined(*found)


def joined(*parts):
    """Tuples of arrays, put together part by part."""
    return tuple(np.concatenate(same) for same in zip(*parts, strict=True))


def pieces(rows, cuts, lasts):
    """Intervals that cover [0, last] of every row, cut at the given places.

    Returns row numbers, starts and ends, in order.
    """
    count = len(lasts)
    rows = np.concatenate([rows, np.arange(count), np.arange(count)])
    cuts = np.concatenate([cuts, np.zeros(count), lasts])
    within = (cuts >= 0.0) & (cuts <= lasts[rows])
    rows, cuts = rows[within], cuts[within]
    order = np.lexsort((cuts, rows))
    rows, cuts = rows[order], cuts[order]
    whole = (rows[1:] == rows[:-1]) & (cuts[1:] > cuts[:-1])
    return rows[:-1][whole], cuts[:-1][whole], cuts[1:][whole]


def nodes_on(starts, ends):
    """Quadrature places (k, 16) and weights (k, 16) of intervals."""
    middle, half = 0.5 * (starts + ends), 0.5 * (ends - starts)
    return middle[:, None] + half[:, None] * QUADRATURE_NODES, half[:, None] * QUADRATURE_WEIGHTS


def chord_nodes(vertices, radius):
    """Points, tangents and weights of the exposed parts of the edges' offsets."""
    starts, units, lengths = unit_edges(vertices)
    if len(vertices) == 2:
        starts, units, lengths = vertices, np.vstack([units, -units]), np.tile(lengths, 2)
    origins = starts + radius * np.column_stack([units[:, 1], -units[:, 0]])
    by_circles = circle_cuts(origins, units, vertices, radius)
    by_offsets = offset_cuts(origins, units, vertices, radius)
    rows, low, high = pieces(*joined(by_circles, by_offsets), lengths)
    seen = exposed(origins[rows] + (0.5 * (low + high))[:, None] * units[rows], vertices, radius)
    rows = rows[seen]
    place, weights = nodes_on(low[seen], high[seen])
    points = origins[rows, None] + place[..., None] * units[rows, None]
    tangents = np.broadcast_to(units[rows, None], points.shape)
    return points.reshape(-1, 2), tangents.reshape(-1, 2), weights.ravel()


def arc_nodes(vertices, radius):
    """Points, tangents and weights of the exposed parts of the circles around vertices."""
    by_circles = arc_circle_cuts(vertices, radius)
    by_offsets = arc_offset_cuts(vertices, radius)
    rows, angles = joined(by_circles, by_offsets)
    rows, low, high = pieces(rows, np.mod(angles, 2 * np.pi), np.full(len(vertices), 2 * np.pi))
    middle = 0.5 * (low + high)
    around = np.column_stack([np.cos(middle), np.sin(middle)])
    seen = exposed(vertices[rows] + radius * around, vertices, radius)
    place, weights = nodes_on(low[seen], high[seen])
    outward = np.stack([np.cos(place), np.sin(place)], axis=-1)
    points = vertices[rows[seen], None] + radius * outward
    tangents = np.stack([-outward[..., 1], outward[..., 0]], axis=-1)
    return points.reshape(-1, 2), tangents.reshape(-1, 2), radius * weights.ravel()


def outline_nodes(vertices, radius):
    """Quadrature points, unit tangents and weights of the whole outline of a core with edges."""
    return joined(chord_nodes(vertices, radius), arc_nodes(vertices, radius))


def swept_moments(vertices, radius):
    """Area [m²], centroid (2,) [m] and second moment of area about it, ∫ρ² dA [m⁴].

    ``vertices`` (N, 2): a point, a segment, or a simple counter-clockwise polygon; ``radius`` > 0.
    """
    if len(vertices) == 1:
        return np.pi * radius**2, vertices[0].copy(), 0.5 * np.pi * radius**4
    origin = vertices.mean(axis=0)
    points, tangents, weights = outline_nodes(vertices - origin, radius)
    x, y = points.T
    dx, dy = (tangents * weights[:, None]).T
    area = 0.5 * np.sum(x * dy - y * dx)
    centroid = np.array([np.sum(x**2 * dy), -np.sum(y**2 * dx)]) / (2.0 * area)
    polar = np.sum(x**3 * dy - y**3 * dx) / 3.0
    return area, centroid + origin, polar - area * (centroid @ centroid)
