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


def beside(points, starts, units, lengths):
    """Which points (k, 2) project onto the edge of the same row, with a rounding's margin."""
    along = np.einsum("ij,ij->i", points - starts, units)
    margin = 1e-9 * lengths
    return (along > -margin) & (along < lengths + margin)


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


def chord_crossings(origin, direction, length, vertices, radius):
    """Where the line origin + s·direction, 0 < s < length, meets circles and offset edges."""
    to_centre = vertices - origin
    along = to_centre @ direction
    half = radius**2 - (np.einsum("ij,ij->i", to_centre, to_centre) - along**2)
    root = np.sqrt(half[half > 0.0])
    cuts = [along[half > 0.0] - root, along[half > 0.0] + root]
    starts, units, lengths = unit_edges(vertices)
    slope = cross(direction[None], units)
    oblique = np.abs(slope) > 1e-12
    starts, units, lengths, slope = (
        starts[oblique],
        units[oblique],
        lengths[oblique],
        slope[oblique],
    )
    offset = cross(starts - origin, units)
    for side in (-radius, radius):
        cut = (offset + side) / slope
        met = origin + cut[:, None] * direction
        cuts.append(cut[beside(met, starts, units, lengths)])
    cuts = np.concatenate(cuts)
    return cuts[(cuts > 0.0) & (cuts < length)]


def circle_crossings(centre, vertices, radius):
    """Angles at which the circle around centre meets the other circles and the offset edges."""
    to_centre = vertices - centre
    distance = np.hypot(to_centre[:, 0], to_centre[:, 1])
    meets = (distance > 0.0) & (distance < 2.0 * radius)
    bearing = np.arctan2(to_centre[meets, 1], to_centre[meets, 0])
    half = np.arccos(distance[meets] / (2.0 * radius))
    angles = [bearing - half, bearing + half]
    starts, units, lengths = unit_edges(vertices)
    normals = np.column_stack([units[:, 1], -units[:, 0]])
    facing = np.arctan2(normals[:, 1], normals[:, 0])
    level = np.einsum("ij,ij->i", starts - centre, normals)
    # Where the arc meets its own edges tangentially, the normals themselves are the cuts.
    own = np.abs(level) < 1e-9 * radius
    angles += [facing[own], facing[own] + np.pi]
    for side in (-radius, radius):
        cosine = (level + side) / radius
        crosses = np.abs(cosine) < 1.0
        opening = np.arccos(cosine[crosses])
        for angle in (facing[crosses] - opening, facing[crosses] + opening):
            met = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])
            angles.append(angle[beside(met, starts[crosses], units[crosses], lengths[crosses])])
    return np.mod(np.concatenate(angles), 2.0 * np.pi)


def pieces_between(cuts, first, last):
    """Neighbouring cuts as (start, end) intervals that cover [first, last]."""
    stops = np.unique(np.concatenate([[first], cuts, [last]]))
    return stops[:-1], stops[1:]


def chord_nodes(start, end, vertices, radius):
    """Points, tangents and weights of the exposed part of an edge's offset to its right."""
    along = end - start
    length = np.hypot(*along)
    direction = along / length
    origin = start + radius * np.array([direction[1], -direction[0]])
    low, high = pieces_between(
        chord_crossings(origin, direction, length, vertices, radius), 0.0, length
    )
    middles = origin + (0.5 * (low + high))[:, None] * direction
    seen = exposed(middles, vertices, radius)
    centre, half = 0.5 * (low + high)[seen], 0.5 * (high - low)[seen]
    position = (centre[:, None] + half[:, None] * QUADRATURE_NODES).ravel()
    weights = (half[:, None] * QUADRATURE_WEIGHTS).ravel()
    return origin + position[:, None] * direction, np.tile(direction, (len(position), 1)), weights


def arc_nodes(centre, vertices, radius):
    """Points, tangents and weights of the exposed part of the circle around one vertex."""
    low, high = pieces_between(circle_crossings(centre, vertices, radius), 0.0, 2.0 * np.pi)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    around = np.column_stack([np.cos(middle), np.sin(middle)])
    seen = exposed(centre + radius * around, vertices, radius)
    angle = (middle[seen, None] + half[seen, None] * QUADRATURE_NODES).ravel()
    weights = (radius * half[seen, None] * QUADRATURE_WEIGHTS).ravel()
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    return centre + radius * outward, np.column_stack([-outward[:, 1], outward[:, 0]]), weights


def outline_nodes(vertices, radius):
    """Quadrature points, unit tangents and weights of the whole outline of a core with edges."""
    starts, ends = edges_of(vertices)
    if len(vertices) == 2:
        starts, ends = vertices, vertices[::-1]
    nodes = [chord_nodes(a, b, vertices, radius) for a, b in zip(starts, ends, strict=True)]
    nodes += [arc_nodes(vertex, vertices, radius) for vertex in vertices]
    return tuple(np.concatenate(part) for part in zip(*nodes, strict=True))


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
