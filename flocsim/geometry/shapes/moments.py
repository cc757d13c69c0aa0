"""Area, centroid and second moment of a swept outline, exact to round-off, convex or not.

The outline of core ⊕ disk is made of offset edges and of arcs around vertices, of all rings of all
parts. Each such piece is cut wherever another piece crosses it; what lies nearer than the radius to
some other part of a core, or inside of one, is dropped; Green's theorem over what remains gives the
moments of the union, holes included.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flocsim.geometry.shapes.cores import (
    Part,
    cross,
    edges_of,
    from_edges,
    inside_rings,
    unit_edges,
)


class Pieces(NamedTuple):
    """What the outlines of parts are made of.

    ``points`` (p, 2), the corners, with ``first`` (p,) the angle at which the arc around each
    begins and ``turn`` (p,) how far it goes; ``starts``, ``units``, ``lengths`` of edges;
    ``side_starts``, ``side_units``, ``side_lengths`` of the sides in the order of a walk, and
    ``at_start``, ``at_end`` by which their offsets are cut; of points, edges and sides the
    ``…radius``, and the part that they belong to.
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
    """The Pieces of some parts, ring after ring."""
    return Pieces(*joined(*(
        ring_pieces(ring, float(part.radius), number)
        for number, part in enumerate(parts) for ring in part.rings
    )))  # fmt: skip


def ring_pieces(ring, radius, number):
    """The Pieces of one ring of the part of a number, as a tuple."""
    starts, units, lengths = unit_edges(ring)
    if len(ring) == 1:
        first, turn = np.zeros(1), np.full(1, 2.0 * np.pi)
        side_starts, side_units, side_lengths = starts, units, lengths
        at_start = at_end = lengths
    else:
        side_starts, side_units, side_lengths = starts, units, lengths
        if len(ring) == 2:  # a segment has two sides, one in each sense
            side_starts = ring
            side_units, side_lengths = np.vstack([units, -units]), np.tile(lengths, 2)
        before = np.roll(side_units, 1, axis=0)
        first = np.arctan2(-before[:, 0], before[:, 1])
        # By how much the walk turns at the start of each side: above 0 at convex corners.
        along = np.einsum("ij,ij->i", before, side_units)
        bends = np.arctan2(cross(before, side_units), along)
        bends = np.abs(bends) if len(ring) == 2 else bends
        turn = np.maximum(bends, 0.0)
        at_start, at_end = trims_of(bends, side_lengths, radius)
    each, sides = len(ring), len(side_lengths)
    return (
        ring, first, turn, np.full(each, radius), np.full(each, radius**2), np.full(each, number),
        starts, units, lengths, np.full(len(lengths), radius),
        side_starts, side_units, side_lengths, at_start, at_end, np.full(sides, radius),
        np.full(sides, number),
    )  # fmt: skip


def beside(along, lengths):
    """Which distances along an edge lie on the edge, with a rounding's margin."""
    return (along > -1e-9 * lengths) & (along < lengths * (1.0 + 1e-9))


def circle_cuts(origins, directions, found):
    """Where lines (rows) cross the circles around the points: row numbers and places."""
    to_centre = found.points[None] - origins[:, None]
    along = np.einsum("pkj,pj->pk", to_centre, directions)
    half = found.point_square - (np.einsum("pkj,pkj->pk", to_centre, to_centre) - along**2)
    rows, columns = np.nonzero(half > 0.0)
    root = np.sqrt(half[rows, columns])
    middle = along[rows, columns]
    return np.tile(rows, 2), np.concatenate([middle - root, middle + root])


def offset_cuts(origins, directions, found):
    """Where lines (rows) cross the offsets of the edges, on both sides: row numbers and places."""
    starts, units, lengths = found.starts, found.units, found.lengths
    (dx, dy), (ux, uy) = directions.T[..., None], units.T
    (x, y) = starts.T[:, None] - origins.T[..., None]
    slope, alike = dx * uy - dy * ux, dx * ux + dy * uy
    offset, ahead = x * uy - y * ux, x * ux + y * uy
    slope = np.where(np.abs(slope) > 1e-12, slope, np.nan)
    cuts = []
    for side in (-found.edge_radius, found.edge_radius):
        place = (offset + side) / slope
        rows, edges = np.nonzero(beside(place * alike - ahead, lengths))
        cuts.append((rows, place[rows, edges]))
    return joined(*cuts)


def arc_circle_cuts(found):
    """Where the circles around points (rows) cross each other: row numbers and angles."""
    points, radius = found.points, found.point_radius
    to_centre = points[None] - points[:, None]
    distance = np.hypot(to_centre[..., 0], to_centre[..., 1])
    widest, least = radius[:, None] + radius, np.abs(radius[:, None] - radius)
    rows, columns = np.nonzero((distance > least) & (distance < widest))
    across, apart = to_centre[rows, columns], distance[rows, columns]
    bearing = np.arctan2(across[:, 1], across[:, 0])
    own, other = radius[rows], radius[columns]
    cosine = (apart**2 + (own - other) * (own + other)) / (2.0 * apart * own)
    alike = own == other
    half = np.arccos(np.where(alike, apart / (2.0 * own), np.clip(cosine, -1.0, 1.0)))
    return np.tile(rows, 2), np.concatenate([bearing - half, bearing + half])


def arc_offset_cuts(found):
    """Where the circles around points (rows) cross the offsets of edges: rows and angles."""
    points, radius = found.points, found.point_radius
    starts, units, lengths = found.starts, found.units, found.lengths
    normals = np.column_stack([units[:, 1], -units[:, 0]])
    facing = np.arctan2(normals[:, 1], normals[:, 0])
    level = np.einsum("pej,ej->pe", starts[None] - points[:, None], normals)
    own = radius[:, None]
    # A point on the line of an edge of its own radius: they touch, and do not cross.
    touches = (np.abs(level) < 1e-9 * own) & (found.edge_radius == own)
    cuts = []
    for side in (-found.edge_radius, found.edge_radius):
        cosine = (level + side) / own
        rows, edges = np.nonzero((np.abs(cosine) < 1.0) & ~touches)
        opening = np.arccos(cosine[rows, edges])
        for angle in (facing[edges] - opening, facing[edges] + opening):
            met = points[rows] - starts[edges]
            met = met + radius[rows, None] * np.column_stack([np.cos(angle), np.sin(angle)])
            on_edge = beside(np.einsum("ij,ij->i", met, units[edges]), lengths[edges])
            cuts.append((rows[on_edge], angle[on_edge]))
    return joined(*cuts)


def touching_cuts(origins, directions, found):
    """Where lines (rows), offsets of sides, touch the circles around points of other parts: there
    begins or ends what two parts share."""
    to_centre = found.points[None] - origins[:, None]
    apart = np.abs(cross(directions[:, None], to_centre)) - found.point_radius
    other = found.point_part != found.side_part[:, None]
    rows, columns = np.nonzero(other & (np.abs(apart) < SHARED * found.point_radius))
    return rows, np.einsum("ij,ij->i", to_centre[rows, columns], directions[rows])


def shared_arc_cuts(found):
    """Where arcs around the same point (rows), of other parts, begin and end: rows and angles."""
    apart = np.hypot(*np.moveaxis(found.points[None] - found.points[:, None], -1, 0))
    other = found.point_part != found.point_part[:, None]
    rows, columns = np.nonzero(other & (apart < SHARED * found.point_radius))
    first, turn = found.first[columns], found.turn[columns]
    return np.tile(rows, 2), np.concatenate([first, first + turn])


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

SHARED = 1e-9
"""Outlines of two parts that are nearer than this share of the radius run along each other."""

ROUNDED = 1e-14
"""By this share of the body's extent rounding may move a place on the offset of a core."""


def exposed(points, normals, owners, parts):
    """Which of the points, each on the offset of a part with its outward normal, lie on the swept
    outline, not inside the swept shape."""
    seen = np.ones(len(points), dtype=bool)
    for number, part in enumerate(parts):
        count = sum(len(ring) for ring in part.rings)
        for rows in np.array_split(np.arange(len(points)), 1 + len(points) * count // 200_000):
            seen[rows] &= ~covered(points[rows], normals[rows], owners[rows] - number, part)
    return seen


def covered(points, normals, after, part):
    """Which of the points a part covers. Of pieces that two parts share, that of the earlier one
    counts: ``after`` says by how many parts that of each point comes after this one. Where they
    share it back to back, both count, in opposite senses."""
    later = after > 0
    away = np.concatenate([
        points[:, None] - ring if len(ring) == 1 else from_edges(points, *edges_of(ring))
        for ring in part.rings
    ], axis=1)  # fmt: skip
    squared = away[..., 0] ** 2 + away[..., 1] ** 2
    nearest = squared.argmin(axis=1)
    least = np.sqrt(squared[np.arange(len(points)), nearest])
    depth = np.where(after == 0, ROUNDED * np.abs(points).max(initial=0.0), SHARED * part.radius)
    found = (least < part.radius - depth) | inside_rings(points, part.rings)
    if later.any():
        foot = away[np.arange(len(points)), nearest]
        shared = (least < (1.0 + SHARED) * part.radius) & later
        found |= shared & (np.einsum("ij,ij->i", foot, normals) > 0.0)
    return found


def nodes_on(starts, ends):
    """Quadrature places (k, 16) and weights (k, 16) of intervals."""
    middle, half = 0.5 * (starts + ends), 0.5 * (ends - starts)
    return middle[:, None] + half[:, None] * QUADRATURE_NODES, half[:, None] * QUADRATURE_WEIGHTS


def trims_of(bends, lengths, radius):
    """(at the start, at the end) lengths by which offsets of sides are cut at faint reflex corners.

    There they cross so flatly that no distance tells which part is covered; geometry does.
    """
    faint = (bends < 0.0) & (bends > -FAINT)
    cut = np.where(faint, radius * np.tan(-0.5 * bends), 0.0)
    cut = np.where(cut < np.minimum(lengths, np.roll(lengths, 1)), cut, 0.0)
    return cut, np.roll(cut, -1)


def exposed_chords(parts, found):
    """The exposed parts of the sides' offsets: where the offset of each begins (k, 2), its unit
    tangent (k, 2), from where to where along it, and the radii (k,)."""
    units, lengths = found.side_units, found.side_lengths
    outward = np.column_stack([units[:, 1], -units[:, 0]])
    origins = found.side_starts + found.side_radius[:, None] * outward
    origins = origins + found.at_start[:, None] * units
    cuts = joined(circle_cuts(origins, units, found), offset_cuts(origins, units, found))
    if len(parts) > 1:
        cuts = joined(cuts, touching_cuts(origins, units, found))
    whole = np.maximum(lengths - found.at_start - found.at_end, 0.0)
    rows, low, high = pieces(*cuts, whole)
    middle = origins[rows] + (0.5 * (low + high))[:, None] * units[rows]
    seen = exposed(middle, outward[rows], found.side_part[rows], parts)
    rows = rows[seen]
    return origins[rows], units[rows], low[seen], high[seen], found.side_radius[rows]


def exposed_arcs(parts, found):
    """The exposed parts of the arcs around convex corners: centres (k, 2), radii (k,), and from
    which angle to which.

    An arc reaches from the normal of one side to that of the next; the rest of its circle is
    covered by those two sides.
    """
    points, first, radius = found.points, found.first, found.point_radius
    rows, angles = joined(arc_circle_cuts(found), arc_offset_cuts(found))
    if len(parts) > 1:
        rows, angles = joined((rows, angles), shared_arc_cuts(found))
    turns = np.mod(angles - first[rows], 2.0 * np.pi)
    rows, low, high = pieces(rows, turns, found.turn)
    middle = first[rows] + 0.5 * (low + high)
    around = np.column_stack([np.cos(middle), np.sin(middle)])
    met = points[rows] + radius[rows, None] * around
    seen = exposed(met, around, found.point_part[rows], parts)
    rows = rows[seen]
    return points[rows], radius[rows], first[rows] + low[seen], first[rows] + high[seen]


def area_and_growth(parts: Sequence[Part]) -> tuple[float, float]:
    """Area [m²] of what parts of one radius cover together, and by how much it grows with that
    radius [m]: the length of the outline, holes included."""
    if is_disc(parts):
        return np.pi * parts[0].radius ** 2, 2.0 * np.pi * parts[0].radius
    (x, y), (dx, dy), weights, _ = outline_nodes(parts)
    return 0.5 * np.sum(x * dy - y * dx), weights.sum()


def is_disc(parts):
    return len(parts) == len(parts[0].rings) == len(parts[0].rings[0]) == 1


def outline_nodes(parts):
    """(x, y), (dx, dy), weights of the swept outline, and the origin (2,) that they are seen from,
    amid the cores."""
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
    points, tangents, weights = joined(chords, arcs)
    return points.T, (tangents * weights[:, None]).T, weights, origin


def all_moments(parts: Sequence[Part]) -> tuple[float, np.ndarray, float, np.ndarray]:
    """Area [m²], centroid (2,) [m] and second moment of area about it, ∫ρ² dA [m⁴], of all that
    some parts cover together, outer rings counter-clockwise, those of holes clockwise; and how the
    area is stretched: (∫(x² − y²) dA, 2 ∫xy dA) about the centroid [m⁴].

    With the principal moments M₁ ≥ M₂ and the long axis at the angle ψ that is
    (M₁ − M₂)(cos 2ψ, sin 2ψ).
    """
    if is_disc(parts):
        radius, [ring] = parts[0].radius, parts[0].rings
        return np.pi * radius**2, ring[0].copy(), 0.5 * np.pi * radius**4, np.zeros(2)
    (x, y), (dx, dy), _, origin = outline_nodes(parts)
    area = 0.5 * np.sum(x * dy - y * dx)
    centroid = np.array([np.sum(x**2 * dy), -np.sum(y**2 * dx)]) / (2.0 * area)
    polar = np.sum(x**3 * dy - y**3 * dx) / 3.0
    stretch = np.array([np.sum(x**3 * dy + y**3 * dx) / 3.0, np.sum(x**2 * y * dy)])
    stretch -= area * np.array([centroid[0] ** 2 - centroid[1] ** 2, 2.0 * np.prod(centroid)])
    return area, centroid + origin, polar - area * (centroid @ centroid), stretch
