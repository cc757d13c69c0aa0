"""Area, centroid and second moment of a swept outline, exact to rounding, convex or not.

The outline of core ⊕ disk consists of offset edges and of arcs around vertices, for all rings of
all parts. Each such piece is cut wherever another piece crosses it. Pieces closer than the radius
to some other part of a core, or inside one, are dropped. Green's theorem over the remaining pieces
gives the moments of the union, holes included:

    A = ½ ∮ (x dy − y dx),  A x_c = ½ ∮ x² dy,  J = ⅓ ∮ (x³ dy − y³ dx).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flocsim.geometry.shapes.cores import (
    Part,
    cross,
    edges_of,
    from_edges,
    inside_polygon,
    unit_edges,
)


class Pieces(NamedTuple):
    """Offset edges and arcs of the outlines of parts, before they are cut.

    ``points`` (p, 2), the corners, with ``first`` (p,), the angle at which the arc around each
    begins, and ``turn`` (p,), its extent; ``starts``, ``units``, ``lengths`` of edges;
    ``side_starts``, ``side_units``, ``side_lengths`` of sides in walking order, and ``at_start``,
    ``at_end``, the lengths by which their offsets are trimmed; ``…radius`` and ``…part``:
    spheroradius and number of the part of each point, edge and side.
    """

    points: np.ndarray
    first: np.ndarray
    turn: np.ndarray
    point_radius: np.ndarray
    point_square: np.ndarray
    point_part: np.ndarray
    starts: np.ndarray
    units: np.ndarray
    lengths: np.ndarray
    edge_radius: np.ndarray
    side_starts: np.ndarray
    side_units: np.ndarray
    side_lengths: np.ndarray
    at_start: np.ndarray
    at_end: np.ndarray
    side_radius: np.ndarray
    side_part: np.ndarray


def pieces_of(parts: Sequence[Part]) -> Pieces:
    """Return the Pieces of some parts, ring after ring."""
    return Pieces(*concatenated(*(
        ring_pieces(ring, float(part.radius), number)
        for number, part in enumerate(parts) for ring in part.rings
    )))  # fmt: skip


def ring_pieces(ring, radius, number):
    """Return the Pieces of one ring of part ``number``, as a tuple."""
    side_starts, side_units, side_lengths = starts, units, lengths = unit_edges(ring)
    if len(ring) == 1:
        first, turn = np.zeros(1), np.full(1, 2.0 * np.pi)
        at_start = at_end = lengths
    else:
        if len(ring) == 2:  # a segment has two sides, one in each direction
            side_starts = ring
            side_units, side_lengths = np.vstack([units, -units]), np.tile(lengths, 2)
        before = np.roll(side_units, 1, axis=0)
        first = np.arctan2(-before[:, 0], before[:, 1])
        # Exterior angle at the start of each side, positive at convex corners, where an arc is
        # needed.
        along = np.einsum("ij,ij->i", before, side_units)
        bends = np.arctan2(cross(before, side_units), along)
        bends = np.abs(bends) if len(ring) == 2 else bends
        turn = np.maximum(bends, 0.0)
        at_start, at_end = trim_lengths(bends, side_lengths, radius)
    each, sides = len(ring), len(side_lengths)
    points = ring, first, turn, np.full(each, radius), np.full(each, radius**2)
    edges = starts, units, lengths, np.full(len(lengths), radius)
    offsets = side_starts, side_units, side_lengths, at_start, at_end, np.full(sides, radius)
    return *points, np.full(each, number), *edges, *offsets, np.full(sides, number)


def lies_on_edge(along, lengths):
    """Return which positions along an edge lie on it, with a margin for rounding."""
    return (along > -1e-9 * lengths) & (along < lengths * (1.0 + 1e-9))


def circle_cuts(origins, directions, found):
    """Return (row numbers, positions) where lines (rows) cross the circles around the points."""
    to_centre = found.points[None] - origins[:, None]
    along = np.einsum("pkj,pj->pk", to_centre, directions)
    # half: squared half of the chord; negative where a line misses the circle.
    half = found.point_square - (np.einsum("pkj,pkj->pk", to_centre, to_centre) - along**2)
    rows, columns = np.nonzero(half > 0.0)
    root = np.sqrt(half[rows, columns])
    middle = along[rows, columns]
    return np.tile(rows, 2), np.concatenate([middle - root, middle + root])


def offset_cuts(origins, directions, found):
    """Return (row numbers, positions) where lines (rows) cross the offsets of edges, on both
    sides."""
    starts, units, lengths = found.starts, found.units, found.lengths
    (dx, dy), (ux, uy) = directions.T[..., None], units.T
    (x, y) = starts.T[:, None] - origins.T[..., None]
    slope, alike = dx * uy - dy * ux, dx * ux + dy * uy
    offset, ahead = x * uy - y * ux, x * ux + y * uy
    # Parallel lines do not cross: nan fails the test below.
    slope = np.where(np.abs(slope) > 1e-12, slope, np.nan)
    # Position along the line, for both offsets; the crossing must lie beside the edge.
    cuts = []
    for side in (-found.edge_radius, found.edge_radius):
        place = (offset + side) / slope
        rows, edges = np.nonzero(lies_on_edge(place * alike - ahead, lengths))
        cuts.append((rows, place[rows, edges]))
    return concatenated(*cuts)


def arc_circle_cuts(found):
    """Return (row numbers, angles) where the circles around points (rows) cross each other."""
    points, radius = found.points, found.point_radius
    to_centre = points[None] - points[:, None]
    distance = np.hypot(to_centre[..., 0], to_centre[..., 1])
    widest, least = radius[:, None] + radius, np.abs(radius[:, None] - radius)
    # Two circles cross if their distance lies between the difference and the sum of the radii.
    rows, columns = np.nonzero((distance > least) & (distance < widest))
    across, apart = to_centre[rows, columns], distance[rows, columns]
    bearing = np.arctan2(across[:, 1], across[:, 0])
    own, other = radius[rows], radius[columns]
    # Law of cosines; for equal radii in the form that stays exact.
    cosine = (apart**2 + (own - other) * (own + other)) / (2.0 * apart * own)
    alike = own == other
    half = np.arccos(np.where(alike, apart / (2.0 * own), np.clip(cosine, -1.0, 1.0)))
    return np.tile(rows, 2), np.concatenate([bearing - half, bearing + half])


def arc_offset_cuts(found):
    """Return (row numbers, angles) where the circles around points (rows) cross the offsets of
    edges."""
    points, radius = found.points, found.point_radius
    starts, units, lengths = found.starts, found.units, found.lengths
    normals = np.column_stack([units[:, 1], -units[:, 0]])
    facing = np.arctan2(normals[:, 1], normals[:, 0])
    # Distance of the edge's line from the point; its offsets lie ± the edge's radius from there.
    level = np.einsum("pej,ej->pe", starts[None] - points[:, None], normals)
    own = radius[:, None]
    # A point on the line of an edge with the same radius: circle and offset touch without crossing.
    touches = (np.abs(level) < 1e-9 * own) & (found.edge_radius == own)
    cuts = []
    for side in (-found.edge_radius, found.edge_radius):
        cosine = (level + side) / own
        rows, edges = np.nonzero((np.abs(cosine) < 1.0) & ~touches)
        # Two crossings, at ± the opening from the direction of the normal; they must lie beside the
        # edge.
        opening = np.arccos(cosine[rows, edges])
        for angle in (facing[edges] - opening, facing[edges] + opening):
            met = points[rows] - starts[edges]
            met = met + radius[rows, None] * np.column_stack([np.cos(angle), np.sin(angle)])
            on_edge = lies_on_edge(np.einsum("ij,ij->i", met, units[edges]), lengths[edges])
            cuts.append((rows[on_edge], angle[on_edge]))
    return concatenated(*cuts)


def touching_cuts(origins, directions, found):
    """Return (row numbers, positions) where offsets of sides (rows) touch circles of other parts.

    Shared stretches of two parts begin or end there.
    """
    to_centre = found.points[None] - origins[:, None]
    # Tangency: the distance of a centre from the line equals the radius.
    apart = np.abs(cross(directions[:, None], to_centre)) - found.point_radius
    other = found.point_part != found.side_part[:, None]
    rows, columns = np.nonzero(other & (np.abs(apart) < SHARED * found.point_radius))
    return rows, np.einsum("ij,ij->i", to_centre[rows, columns], directions[rows])


def shared_arc_cuts(found):
    """Return (row numbers, angles) of the ends of arcs of other parts around the same point
    (rows)."""
    apart = np.hypot(*np.moveaxis(found.points[None] - found.points[:, None], -1, 0))
    other = found.point_part != found.point_part[:, None]
    rows, columns = np.nonzero(other & (apart < SHARED * found.point_radius))
    first, turn = found.first[columns], found.turn[columns]
    return np.tile(rows, 2), np.concatenate([first, first + turn])


def concatenated(*parts):
    """Return tuples of arrays concatenated element by element."""
    return tuple(np.concatenate(same) for same in zip(*parts, strict=True))


def pieces(rows, cuts, lasts):
    """Return the intervals that cover [0, last] of every row, cut at the given positions.

    They are given as row numbers, starts and ends, in order.
    """
    count = len(lasts)
    # Begin and end of each row are cuts, too.
    rows = np.concatenate([rows, np.arange(count), np.arange(count)])
    cuts = np.concatenate([cuts, np.zeros(count), lasts])
    within = (cuts >= 0.0) & (cuts <= lasts[rows])
    rows, cuts = rows[within], cuts[within]
    # Sorted cuts of one row bound its intervals; empty intervals are dropped.
    order = np.lexsort((cuts, rows))
    rows, cuts = rows[order], cuts[order]
    whole = (rows[1:] == rows[:-1]) & (cuts[1:] > cuts[:-1])
    return rows[:-1][whole], cuts[:-1][whole], cuts[1:][whole]


QUADRATURE_NODES, QUADRATURE_WEIGHTS = np.polynomial.legendre.leggauss(16)
"""Gauss–Legendre rule of 16 nodes: integrates a quartic, on a chord and on an arc of up to π, to
rounding."""

FAINT_CORNER = 1e-3
"""Reflex corners with a smaller angle [rad] are resolved by trimming: distances there differ by
less than 1e-7."""

SHARED = 1e-9
"""Outlines of two parts closer than this share of the radius coincide."""

ROUNDING = 1e-14
"""Bound of rounding errors of an offset position over the extent of the body."""


def exposed(points, normals, owners, parts):
    """Return which of the points lie on the swept outline, not inside the swept shape.

    Each point lies on the offset of part ``owners``, with outward normal ``normals``.
    """
    visible = np.ones(len(points), dtype=bool)
    for number, part in enumerate(parts):
        count = sum(len(ring) for ring in part.rings)
        # In blocks, to limit the memory of all point–edge distances.
        for rows in np.array_split(np.arange(len(points)), 1 + len(points) * count // 200_000):
            visible[rows] &= ~covered(points[rows], normals[rows], owners[rows] - number, part)
    return visible


def covered(points, normals, after, part):
    """Return which of the points a part covers.

    If two parts share a piece of outline, that of the earlier one counts: ``after`` is the number
    of the point's part minus that of this one. Pieces shared back to back both count, in opposite
    directions.
    """
    later = after > 0
    # Vectors to every point from the nearest place of every edge (or from a lone core point).
    offsets = np.concatenate([
        points[:, None] - ring if len(ring) == 1 else from_edges(points, *edges_of(ring))
        for ring in part.rings
    ], axis=1)  # fmt: skip
    squared = offsets[..., 0] ** 2 + offsets[..., 1] ** 2
    nearest = squared.argmin(axis=1)
    least = np.sqrt(squared[np.arange(len(points)), nearest])
    # A point lies on the offset of its own part up to rounding, on that of others up to SHARED.
    depth = np.where(after == 0, ROUNDING * np.abs(points).max(initial=0.0), SHARED * part.radius)
    # Covered: within the radius of the core, or inside its polygon, but not in a hole.
    inside = np.logical_xor.reduce([inside_polygon(points, ring) for ring in part.rings])
    found = (least < part.radius - depth) | inside
    if later.any():
        foot = offsets[np.arange(len(points)), nearest]
        shared = (least < (1.0 + SHARED) * part.radius) & later
        found |= shared & (np.einsum("ij,ij->i", foot, normals) > 0.0)
    return found


def nodes_on(starts, ends):
    """Return quadrature nodes (k, 16) and weights (k, 16) of intervals."""
    middle, half = 0.5 * (starts + ends), 0.5 * (ends - starts)
    return middle[:, None] + half[:, None] * QUADRATURE_NODES, half[:, None] * QUADRATURE_WEIGHTS


def trim_lengths(bends, lengths, radius):
    """Return lengths (at the start, at the end) to trim from the offsets of sides at faint reflex
    corners.

    The offsets intersect so flatly there that distances cannot tell which part is covered; the
    intersection is computed from the angle.
    """
    faint = (bends < 0.0) & (bends > -FAINT_CORNER)
    cut = np.where(faint, radius * np.tan(-0.5 * bends), 0.0)
    cut = np.where(cut < np.minimum(lengths, np.roll(lengths, 1)), cut, 0.0)
    return cut, np.roll(cut, -1)


def exposed_chords(parts, found):
    """Return the exposed parts of the offsets of sides.

    Start of each offset (k, 2), unit tangent (k, 2), begin and end along it (k,), and spheroradius
    (k,).
    """
    units, lengths = found.side_units, found.side_lengths
    outward = np.column_stack([units[:, 1], -units[:, 0]])
    origins = found.side_starts + found.side_radius[:, None] * outward
    origins = origins + found.at_start[:, None] * units
    # Cut every offset at all crossings; each interval is then exposed or covered as a whole, which
    # its midpoint decides.
    cuts = concatenated(circle_cuts(origins, units, found), offset_cuts(origins, units, found))
    if len(parts) > 1:
        cuts = concatenated(cuts, touching_cuts(origins, units, found))
    whole = np.maximum(lengths - found.at_start - found.at_end, 0.0)
    rows, low, high = pieces(*cuts, whole)
    middle = origins[rows] + (0.5 * (low + high))[:, None] * units[rows]
    visible = exposed(middle, outward[rows], found.side_part[rows], parts)
    rows = rows[visible]
    return origins[rows], units[rows], low[visible], high[visible], found.side_radius[rows]


def exposed_arcs(parts, found):
    """Return the exposed parts of the arcs around convex corners.

    Centres (k, 2), radii (k,), and first and last angles (k,). An arc extends from the normal of
    one side to that of the next; these two sides cover the rest of its circle.
    """
    points, first, radius = found.points, found.first, found.point_radius
    rows, angles = concatenated(arc_circle_cuts(found), arc_offset_cuts(found))
    if len(parts) > 1:
        rows, angles = concatenated((rows, angles), shared_arc_cuts(found))
    # Angles relative to the beginning of each arc.
    turns = np.mod(angles - first[rows], 2.0 * np.pi)
    rows, low, high = pieces(rows, turns, found.turn)
    middle = first[rows] + 0.5 * (low + high)
    around = np.column_stack([np.cos(middle), np.sin(middle)])
    met = points[rows] + radius[rows, None] * around
    visible = exposed(met, around, found.point_part[rows], parts)
    rows = rows[visible]
    return points[rows], radius[rows], first[rows] + low[visible], first[rows] + high[visible]


def area_and_growth(parts: Sequence[Part]) -> tuple[float, float]:
    """Return (area [m²] covered by parts of one radius, its derivative with respect to that radius
    [m]).

    The derivative is the length of the outline, holes included.
    """
    if is_disc(parts):
        return np.pi * parts[0].radius ** 2, 2.0 * np.pi * parts[0].radius
    (x, y), (dx, dy), weights, _ = outline_nodes(parts)
    return 0.5 * np.sum(x * dy - y * dx), weights.sum()


def is_disc(parts):
    return len(parts) == len(parts[0].rings) == len(parts[0].rings[0]) == 1


def outline_nodes(parts):
    """Return (x, y), (dx, dy), weights of quadrature nodes on the swept outline, and their origin
    (2,).

    The origin is the mean of the core points.
    """
    origin = np.concatenate([ring for part in parts for ring in part.rings]).mean(axis=0)
    placed = [Part(tuple(ring - origin for ring in part.rings), part.radius) for part in parts]
    found = pieces_of(placed)
    origins, units, low, high, _ = exposed_chords(placed, found)
    place, weights = nodes_on(low, high)
    points = origins[:, None] + place[..., None] * units[:, None]
    tangents = np.broadcast_to(units[:, None], points.shape)
    chords = points.reshape(-1, 2), tangents.reshape(-1, 2), weights.ravel()
    centres, radius, low, high = exposed_arcs(placed, found)
    place, weights = nodes_on(low, high)
    outward = np.stack([np.cos(place), np.sin(place)], axis=-1)
    reach = radius[:, None]
    points = centres[:, None] + reach[..., None] * outward
    tangents = np.stack([-outward[..., 1], outward[..., 0]], axis=-1)
    arcs = points.reshape(-1, 2), tangents.reshape(-1, 2), (reach * weights).ravel()
    points, tangents, weights = concatenated(chords, arcs)
    return points.T, (tangents * weights[:, None]).T, weights, origin


def all_moments(parts: Sequence[Part]) -> tuple[float, np.ndarray, float, np.ndarray]:
    """Return the moments of the area that some parts cover together.

    Area [m²], centroid (2,) [m], second moment about it, ∫ρ² dA [m⁴], and (∫(x² − y²) dA, 2 ∫xy dA)
    about it [m⁴]. With the principal moments M₁ ≥ M₂ and the angle ψ of the long axis the last is
    (M₁ − M₂)(cos 2ψ, sin 2ψ). Outer rings must be counter-clockwise, holes clockwise.
    """
    if is_disc(parts):
        radius, [ring] = parts[0].radius, parts[0].rings
        return np.pi * radius**2, ring[0].copy(), 0.5 * np.pi * radius**4, np.zeros(2)
    (x, y), (dx, dy), _, origin = outline_nodes(parts)
    # Green's theorem for all moments about the origin, then Steiner's theorem for the centroid.
    area = 0.5 * np.sum(x * dy - y * dx)
    centroid = np.array([np.sum(x**2 * dy), -np.sum(y**2 * dx)]) / (2.0 * area)
    polar = np.sum(x**3 * dy - y**3 * dx) / 3.0
    stretch = np.array([np.sum(x**3 * dy + y**3 * dx) / 3.0, np.sum(x**2 * y * dy)])
    stretch -= area * np.array([centroid[0] ** 2 - centroid[1] ** 2, 2.0 * np.prod(centroid)])
    return area, centroid + origin, polar - area * (centroid @ centroid), stretch
