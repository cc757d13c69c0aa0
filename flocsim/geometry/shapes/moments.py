"""Area, centroid and second moment of a swept outline, exact to round-off, convex or not.

The outline of core ⊕ disk is made of offset edges and of arcs around vertices. Each such piece is
cut wherever another piece crosses it; what lies nearer than the radius to some other part of the
core is dropped; Green's theorem over what remains gives the moments, holes included.
"""

import numpy as np

from flocsim.geometry.shapes.cores import (
    cross,
    distance_to_edges,
    edges_of,
    inside_polygon,
    unit_edges,
)


def beside(along, lengths):
    """Which distances along an edge lie on the edge, with a rounding's margin."""
    return (along > -1e-9 * lengths) & (along < lengths * (1.0 + 1e-9))


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
    found = []
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


QUADRATURE_NODES, QUADRATURE_WEIGHTS = np.polynomial.legendre.leggauss(16)
"""Sixteen nodes integrate a quartic on a chord, and its like on an arc up to π, to round-off."""

FAINT = 1e-3
"""Bends below this angle are resolved by geometry: distances there differ by less than 1e-7."""

COVERED = 1.0 - 1e-9
"""A point nearer to the core than this share of the radius is inside the swept shape."""


def exposed(points, vertices, radius):
    """Which of the points lie on the swept outline, not inside the swept shape."""
    starts, ends = edges_of(vertices)
    seen = np.empty(len(points), dtype=bool)
    for rows in np.array_split(np.arange(len(points)), 1 + len(points) * len(starts) // 200_000):
        near = distance_to_edges(points[rows], starts, ends).min(axis=1) < COVERED * radius
        seen[rows] = ~near & ~inside_polygon(points[rows], vertices)
    return seen


def nodes_on(starts, ends):
    """Quadrature places (k, 16) and weights (k, 16) of intervals."""
    middle, half = 0.5 * (starts + ends), 0.5 * (ends - starts)
    return middle[:, None] + half[:, None] * QUADRATURE_NODES, half[:, None] * QUADRATURE_WEIGHTS


def sides_of(vertices):
    """(starts, units, lengths) of the sides in the order of a walk around the core.

    A segment has two, one in each sense.
    """
    starts, units, lengths = unit_edges(vertices)
    if len(vertices) == 2:
        return vertices, np.vstack([units, -units]), np.tile(lengths, 2)
    return starts, units, lengths


def bends_of(units):
    """Angle by which the walk turns at the start of each side: above 0 at convex corners."""
    before = np.roll(units, 1, axis=0)
    bends = np.arctan2(cross(before, units), np.einsum("ij,ij->i", before, units))
    return np.abs(bends) if len(units) == 2 else bends


def trims_of(bends, lengths, radius):
    """(at the start, at the end) lengths by which offsets of sides are cut at faint reflex corners.

    There they cross so flatly that no distance tells which part is covered; geometry does.
    """
    faint = (bends < 0.0) & (bends > -FAINT)
    cut = np.where(faint, radius * np.tan(-0.5 * bends), 0.0)
    cut = np.where(cut < np.minimum(lengths, np.roll(lengths, 1)), cut, 0.0)
    return cut, np.roll(cut, -1)


def chord_nodes(vertices, radius):
    """Points, tangents and weights of the exposed parts of the sides' offsets."""
    starts, units, lengths = sides_of(vertices)
    at_start, at_end = trims_of(bends_of(units), lengths, radius)
    origins = starts + radius * np.column_stack([units[:, 1], -units[:, 0]])
    origins = origins + at_start[:, None] * units
    cuts = joined(
        circle_cuts(origins, units, vertices, radius), offset_cuts(origins, units, vertices, radius)
    )
    whole = np.maximum(lengths - at_start - at_end, 0.0)
    rows, low, high = pieces(*cuts, whole)
    seen = exposed(origins[rows] + (0.5 * (low + high))[:, None] * units[rows], vertices, radius)
    rows = rows[seen]
    place, weights = nodes_on(low[seen], high[seen])
    points = origins[rows, None] + place[..., None] * units[rows, None]
    tangents = np.broadcast_to(units[rows, None], points.shape)
    return points.reshape(-1, 2), tangents.reshape(-1, 2), weights.ravel()


def arc_nodes(vertices, radius):
    """Points, tangents and weights of the exposed parts of the arcs around convex corners.

    An arc reaches from the normal of one side to that of the next; the rest of its circle is
    covered by those two sides.
    """
    _, units, _ = sides_of(vertices)
    before = np.roll(units, 1, axis=0)
    first = np.arctan2(-before[:, 0], before[:, 1])
    rows, angles = joined(arc_circle_cuts(vertices, radius), arc_offset_cuts(vertices, radius))
    turns = np.mod(angles - first[rows], 2.0 * np.pi)
    rows, low, high = pieces(rows, turns, np.maximum(bends_of(units), 0.0))
    middle = first[rows] + 0.5 * (low + high)
    around = np.column_stack([np.cos(middle), np.sin(middle)])
    seen = exposed(vertices[rows] + radius * around, vertices, radius)
    place, weights = nodes_on(low[seen], high[seen])
    place = place + first[rows[seen], None]
    outward = np.stack([np.cos(place), np.sin(place)], axis=-1)
    points = vertices[rows[seen], None] + radius * outward
    tangents = np.stack([-outward[..., 1], outward[..., 0]], axis=-1)
    return points.reshape(-1, 2), tangents.reshape(-1, 2), radius * weights.ravel()


def swept_moments(vertices: np.ndarray, radius: float) -> tuple[float, np.ndarray, float]:
    """Area [m²], centroid (2,) [m] and second moment of area about it, ∫ρ² dA [m⁴].

    ``vertices`` (N, 2): a point, a segment, or a simple counter-clockwise polygon; ``radius`` > 0.
    """
    return all_moments(vertices, radius)[:3]


def all_moments(vertices: np.ndarray, radius: float) -> tuple[float, np.ndarray, float, np.ndarray]:
    """The same, and how the area is stretched: (∫(x² − y²) dA, 2 ∫xy dA) about the centroid [m⁴].

    With the principal moments M₁ ≥ M₂ and the long axis at the angle ψ that is
    (M₁ − M₂)(cos 2ψ, sin 2ψ).
    """
    if len(vertices) == 1:
        return np.pi * radius**2, vertices[0].copy(), 0.5 * np.pi * radius**4, np.zeros(2)
    origin = vertices.mean(axis=0)
    core = vertices - origin
    points, tangents, weights = joined(chord_nodes(core, radius), arc_nodes(core, radius))
    x, y = points.T
    dx, dy = (tangents * weights[:, None]).T
    area = 0.5 * np.sum(x * dy - y * dx)
    centroid = np.array([np.sum(x**2 * dy), -np.sum(y**2 * dx)]) / (2.0 * area)
    polar = np.sum(x**3 * dy - y**3 * dx) / 3.0
    stretch = np.array([np.sum(x**3 * dy + y**3 * dx) / 3.0, np.sum(x**2 * y * dy)])
    stretch -= area * np.array([centroid[0] ** 2 - centroid[1] ** 2, 2.0 * np.prod(centroid)])
    return area, centroid + origin, polar - area * (centroid @ centroid), stretch
