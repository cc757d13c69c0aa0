"""Double layer of an outline at constant potential, as line charges behind it, and tables of their
field.

In linear (Debye–Hückel) theory the potential outside a body is that of a single layer σ on its
outline, φ(x) = (1/2πε) ∮ σ K₀(κρ) ds, constant along the outline. Charges a little behind the
outline create the same outside potential, which is unique, and feel the same force in the field of
another body (method of fundamental solutions). The energy by linear superposition is

    E = (1/2πε) ∮∮ σ₁ σ₂ K₀(κρ) ds ds = 2πε φ₁ φ₂ Σ Σ q₁ q₂ K₀(κρ)

per unit length, where q are the charges for a potential of 1 on the outline. Unlike σ they keep a
distance from the other body even at contact, where sums over the outlines themselves would need
nodes as dense as the gap. Depth and spacing of the charges are CHARGE_DEPTH times the smaller of
the spheroradius and 1/κ. Energies are then right within 2e-3
(tests/geometry/contact/test_charges.py).

**Tables.** Nodes of a field lie on a grid of spacing GRID_STEP (in units of `unit_of`), in square
tiles, wherever a charge of another body may be. Each node stores the potential and its derivatives,
exact; between nodes the field is interpolated by bicubic Hermite polynomials. The potential of
charges at contact is within 1e-4 of the sum over them, its slope within 1e-3. The force is the
slope of the interpolated potential.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flocsim.compiler.composer import compiled
from flocsim.errors import ShapeError
from flocsim.geometry.shapes.pieces import at_parameter, piece_at, pieces_of_shape
from flocsim.geometry.shapes.shape import Shape
from flocsim.state.outlines import GROUP, TILE, Charge, ChargeGroup, FieldNode, Grid

CHARGE_DEPTH = 0.6
"""Depth of charges behind the outline, and their spacing, over the smaller of spheroradius
and 1/κ."""

THIN_LAYER = 60.0
"""κ times the smallest radius of curvature from which double layers act as between plates, within 1
% (1/(2κr) for a cylinder above a plate)."""

MOST_CHARGES = 20_000
"""Largest number of charges of an outline: solving for them takes seconds."""

MERGE_DISTANCE = 0.15
"""Charges closer than this (in units of `unit_of`), as behind reflex corners, are merged: two would
grow without bound with opposite signs."""

DENSE = 2000
"""Up to this number of charges the system is dense, beyond that sparse."""

GRID_STEP = 0.3
"""Distance of the nodes of a field (in units of `unit_of`)."""

LAYER_REACH = 12.0
"""Distance in Debye lengths beyond which charges are neglected: e^−12 = 6e-6 of the force at
contact."""

LEAST_SQUARED = 1e-4
"""Lower bound of (κρ)² in the field of a charge, which diverges at ρ = 0."""

BESSEL_STEPS = 256.0
"""Rows of the table of Bessel functions per unit of ln z²: cubic polynomials in between are within
1e-9 of them."""

MOST_NODES = 2_000_000
"""Largest number of nodes of a body's field: 64 MB."""


def is_thin(shapes: Sequence[Shape], kappa: float) -> bool:
    """Return True if double layers are thin compared with all radii of curvature of some bodies."""
    return min(float(part.radius) for shape in shapes for part in shape.parts) * kappa >= THIN_LAYER


def unit_of(shape: Shape, kappa: float) -> float:
    """Return the length unit of charges [m]: the smaller of 1/κ and the smallest spheroradius."""
    return min(1.0 / kappa, *(float(part.radius) for part in shape.parts))


def spacings(pieces, kappa):
    """Return the spacing [m] and number of charges behind each piece of an outline."""
    spacing = CHARGE_DEPTH * np.minimum(pieces["core_depth"], 1.0 / kappa)
    bend, size = pieces["arc_radius"], pieces["half"]
    # ``half`` of an arc is tan of a quarter of its angle.
    lengths = np.where(bend > 0.0, 4.0 * np.arctan(size) * bend, 2.0 * size)
    # A sharp corner would need infinitely many.
    with np.errstate(divide="ignore"):
        return spacing, np.maximum(np.ceil(lengths / spacing), 1.0)


def too_long(shape: Shape, kappa: float, takes: str) -> ShapeError:
    """Return a ShapeError for an outline that needs too many charges or nodes."""
    radius = min(float(part.radius) for part in shape.parts)
    return ShapeError(
        f"the outline of a body of r_eq = {shape.equivalent_radius:.3g} m, rounded by "
        f"{radius:.3g} m, is too long for a double layer of 1/κ = {1.0 / kappa:.3g} m along "
        f'outlines (it needs {takes} at most): give gap = "surface" instead of law = "outline"'
    )


def check_length(shape: Shape, kappa: float) -> None:
    """Raise ShapeError if a shape's outline needs more charges than can be solved for."""
    _, counts = spacings(pieces_of_shape(shape), kappa)
    if counts.sum() > MOST_CHARGES:
        raise too_long(shape, kappa, f"{counts.sum():.3g} charges, of {MOST_CHARGES}")


def points_of(pieces, kappa, times):
    """Return points on an outline (n, 2) and the positions of charges behind them (n, 2) [m].

    ``times``: number of points per charge.
    """
    spacing, counts = spacings(pieces, kappa)
    points, places = [], []
    for row, (depth, count) in enumerate(zip(spacing, times * counts.astype(int), strict=True)):
        piece = piece_at(pieces, row)
        share = (2.0 * np.arange(count) + 1.0) / count - 1.0
        parameter = share * piece.half
        if piece.arc_radius > 0.0:
            # Evenly spaced angles: the parameter of an arc is tan(φ/2).
            parameter = np.tan(share * math.atan(piece.half))
        x, y, nx, ny, _ = at_parameter(piece, parameter)
        points.append(np.column_stack([x, y]))
        places.append(np.column_stack([x - depth * nx, y - depth * ny]))
    return np.concatenate(points), np.concatenate(places)


@lru_cache(maxsize=256)
def charges_of_shape(shape: Shape, kappa: float) -> np.ndarray:
    """Return the charges (n, 3) of a shape around its centroid: x, y [m] and q [-], at κ [1/m].

    They minimise the squared error of the potential at twice as many points of the outline. Raises
    ShapeError for an outline that needs too many.
    """
    from scipy.sparse.linalg import spsolve
    from scipy.spatial import cKDTree
    from scipy.special import k0

    check_length(shape, kappa)
    pieces = pieces_of_shape(shape)
    places = without_close(points_of(pieces, kappa, 1)[1], MERGE_DISTANCE * unit_of(shape, kappa))
    points, _ = points_of(pieces, kappa, 2)
    # The potential of each unit charge at each point; far ones can be dropped.
    if len(places) <= DENSE:
        matrix, solve = k0(kappa * distances(points, places)), np.linalg.solve
    else:
        trees, far = (cKDTree(points), cKDTree(places)), LAYER_REACH / kappa
        near = trees[0].sparse_distance_matrix(trees[1], far, output_type="coo_matrix")
        near.data = k0(kappa * near.data)
        matrix, solve = near.tocsc(), spsolve
    # Normal equations of the least-squares problem: potential 1 at all points.
    charges = solve(matrix.T @ matrix, matrix.T @ np.ones(len(points)))
    return np.column_stack([places, charges])


def without_close(places, near):
    """Return the positions without those closer than ``near`` [m] to an earlier one."""
    from scipy.spatial import cKDTree

    remaining = np.ones(len(places), bool)
    pairs = cKDTree(places).query_pairs(near, output_type="ndarray")
    # In ascending order, as a position that has been dropped must drop no other one.
    for first, second in sorted(map(sorted, pairs.tolist())):
        remaining[second] &= not remaining[first]
    return places[remaining]


def distances(points, others):
    """Return the distances (n, m) between two sets of points."""
    return np.hypot(*(points[:, None, :2] - others[None, :, :2]).transpose(2, 0, 1))


def clusters(charges):
    """Split charges into lists of up to GROUP neighbours, halving along the longer side."""
    if len(charges) <= GROUP:
        return [charges]
    axis = int(np.argmax(np.ptp(charges[:, :2], axis=0)))
    order = charges[np.argsort(charges[:, axis], kind="stable")]
    return [*clusters(order[: len(order) // 2]), *clusters(order[len(order) // 2 :])]


class Charges(NamedTuple):
    """Charges of some bodies in groups of neighbours; a Scene has the same fields."""

    groups: np.ndarray
    first_group: np.ndarray
    charges: np.ndarray


@lru_cache(maxsize=256)
def grouped_charges(shape: Shape, kappa: float) -> Charges:
    """Return the Charges of a shape around its centroid, at κ [1/m]."""
    found = clusters(charges_of_shape(shape, kappa))
    groups, first = ChargeGroup.rows(len(found)), 0
    for group, members in zip(groups, found, strict=True):
        # A circle around the group, by which sums skip it where it is out of reach.
        middle = 0.5 * (members[:, :2].min(axis=0) + members[:, :2].max(axis=0))
        group.x, group.y = middle
        group.extent = np.hypot(*(members[:, :2] - middle).T).max()
        group.first, group.count = first, len(members)
        first += len(members)
    return Charges(groups, np.array([0, len(groups)]), Charge.of(np.concatenate(found)))


def charges_of_bodies(shapes: Sequence[Shape], kappa: float) -> Charges:
    """Return the Charges of bodies of these shapes at κ [1/m]; for κ = 0, of bodies without
    charges."""
    if not kappa > 0.0:
        return Charges(ChargeGroup.rows(0), np.zeros(len(shapes) + 1, np.int64), Charge.rows(0))
    found = [grouped_charges(shape, kappa) for shape in shapes]
    groups = ChargeGroup.joined(each.groups for each in found)
    sizes = [len(each.groups) for each in found]
    before = np.cumsum([0, *[len(each.charges) for each in found[:-1]]])
    # Rows of charges count over all bodies: shift those of each body after the first.
    groups["first"] += np.repeat(before, sizes)
    first = np.cumsum([0, *sizes]).astype(np.int64)
    return Charges(groups, first, Charge.joined(each.charges for each in found))


def layer_energy(
    shape_a: Shape, shape_b: Shape, pose: tuple[float, float, float], kappa: float
) -> float:
    """Return E/(2πε φ₁ φ₂ W) [-] of two bodies of depth W by linear superposition, at κ [1/m].

    ``pose``: position [m] and angle [rad] of a in the frame of b. All pairs of charges are summed.
    """
    from scipy.special import k0

    a, b = charges_of_shape(shape_a, kappa), charges_of_shape(shape_b, kappa)
    x, y, angle = pose
    c, s = math.cos(angle), math.sin(angle)
    placed = a[:, :2] @ np.array([[c, s], [-s, c]]) + (x, y)
    return float(a[:, 2] @ k0(kappa * distances(placed, b)) @ b[:, 2])


def bessel_table() -> np.ndarray:
    """Return K₀(z), K₁(z)/z and the slopes of both per row, in rows at even steps of ln z²."""
    from scipy.special import k0, k1, kn

    ends = math.log(LEAST_SQUARED), 2.0 * math.log(LAYER_REACH + 2.0)
    z = np.exp(0.5 * np.arange(*ends, 1.0 / BESSEL_STEPS))
    # The derivatives by ln z² are −z K₁/2 and −K₂/2.
    slopes = z * k1(z), kn(2, z)
    return np.column_stack([k0(z), k1(z) / z, *(-0.5 / BESSEL_STEPS * np.array(slopes))])


def bessel_pair(bessel, squared):
    """Return (K₀(z), K₁(z)/z) for z², interpolated in the table by cubic Hermite polynomials."""
    place = math.log(squared / LEAST_SQUARED) * BESSEL_STEPS
    row = int(place)
    t = place - row
    s = 1.0 - t
    # Of the values at both ends, and of the slopes there.
    a, b, c, d = s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t), t * s * s, -t * t * s
    zero = a * bessel[row, 0] + b * bessel[row + 1, 0] + c * bessel[row, 2] + d * bessel[row + 1, 2]
    first = a * bessel[row, 1] + b * bessel[row + 1, 1]
    return zero, first + c * bessel[row, 3] + d * bessel[row + 1, 3]


class Field(NamedTuple):
    """Grids, tiles and nodes of one or several bodies; a Scene has the same fields."""

    grids: np.ndarray
    tiles: np.ndarray
    field: np.ndarray


def list_groups(groups, x, y, reach, near):
    """List the groups of charges that may lie within a reach [m] of a point; return their
    number."""
    count = 0
    for row in range(groups.shape[0]):
        group = groups[row]
        dx, dy = x - group.x, y - group.y
        most = reach + group.extent
        if dx * dx + dy * dy < most * most:
            near[count] = row
            count += 1
    return count


def field_at(bessel, groups, charges, near, count, kappa, x, y):
    """Return φ, ∂φ/∂x, ∂φ/∂y [1/m] and ∂²φ/∂x∂y [1/m²] of the listed groups at a point."""
    value, by_x, by_y, by_both = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        group = groups[near[k]]
        for row in range(group.first, group.first + group.count):
            charge = charges[row]
            dx, dy = x - charge.x, y - charge.y
            squared = kappa * kappa * (dx * dx + dy * dy)
            if squared > (LAYER_REACH + 1.0) * (LAYER_REACH + 1.0):
                continue
            squared = max(squared, LEAST_SQUARED)
            zero, first = bessel_pair(bessel, squared)
            size = charge.strength
            # K₀' = −K₁, so ∂φ/∂x = −q κ² (K₁(z)/z) dx, and K₂ = K₀ + 2 K₁/z in the mixed
            # derivative.
            slope = -size * kappa * kappa * first
            value += size * zero
            by_x += slope * dx
            by_y += slope * dy
            by_both += size * kappa**4 * dx * dy * (zero + 2.0 * first) / squared
    return value, by_x, by_y, by_both


def fill_tiles(bessel, groups, charges, kappa, step, corners, near, field):
    """Write the nodes of tiles with the given lower left corners (m, 2); ``near`` is scratch."""
    side, half = TILE + 1, 0.5 * TILE * step
    for tile in range(corners.shape[0]):
        # List once what may act in a tile; 1.5 of half its side is more than half its diagonal.
        x, y = corners[tile, 0] + half, corners[tile, 1] + half
        reach = (LAYER_REACH + 1.0) / kappa + 1.5 * half
        count = list_groups(groups, x, y, reach, near)
        for node in range(side * side):
            x = corners[tile, 0] + step * (node % side)
            y = corners[tile, 1] + step * (node // side)
            value, by_x, by_y, by_both = field_at(bessel, groups, charges, near, count, kappa, x, y)
            known = field[tile * side * side + node]
            # Derivatives per grid step, as Hermite interpolation needs them.
            known.potential = value
            known.by_x = step * by_x
            known.by_y = step * by_y
            known.by_xy = step * step * by_both


def tiles_around(shape, kappa, step):
    """Return (lower left corner, (across, up), whether each tile has nodes) around a shape."""
    from scipy.spatial import cKDTree

    points, places = points_of(pieces_of_shape(shape), kappa, 1)
    width, reach = TILE * step, LAYER_REACH / kappa
    low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
    counts = np.ceil((high - low) / width).astype(int)
    x, y = (low[k] + width * (np.arange(counts[k]) + 0.5) for k in range(2))
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # Three quarters of a side cover the distance from a tile's middle to its corners.
    most, inside = reach + 0.75 * width, CHARGE_DEPTH * unit_of(shape, kappa) + 0.75 * width
    distance, nearest = cKDTree(points).query(middles, distance_upper_bound=most)
    used = np.isfinite(distance)
    nearest = nearest[used]
    outward = points[nearest] - places[nearest]
    # Tiles further behind the outline than its charges are not tabulated.
    behind = np.sum((middles[used] - points[nearest]) * outward, axis=1) < 0.0
    used[used] = ~behind | (distance[used] < inside)
    return low, counts, used


@lru_cache(maxsize=32)
def field_of_shape(shape: Shape, kappa: float) -> Field:
    """Return the Field of a shape around its centroid, at κ [1/m].

    Raises ShapeError for an outline that needs too many charges, or nodes around it.
    """
    check_length(shape, kappa)
    step, side = GRID_STEP * unit_of(shape, kappa), TILE + 1
    low, counts, used = tiles_around(shape, kappa, step)
    nodes = int(used.sum()) * side * side
    if nodes > MOST_NODES:
        raise too_long(shape, kappa, f"{nodes:.3g} nodes of its field, of {MOST_NODES}")
    # For each tile the row of its first node, or −1 where the field is not tabulated.
    tiles = np.where(used, (np.cumsum(used) - 1) * side * side, -1)
    places = np.flatnonzero(used)
    corners = low + TILE * step * np.column_stack([places % counts[0], places // counts[0]])
    field = FieldNode.rows(nodes)
    groups, _, charges = grouped_charges(shape, kappa)
    near = np.zeros(len(groups), np.int64)
    bessel = bessel_table()
    compiled(fill_tiles)(bessel, groups, charges, kappa, step, corners, near, field)
    grid = Grid.rows(1)
    grid["x"], grid["y"] = low
    grid["across"], grid["up"] = counts
    grid["fineness"] = 1.0 / step
    return Field(grid, tiles, field)


def field_of_bodies(shapes: Sequence[Shape], kappa: float) -> Field:
    """Return the Field of bodies of these shapes at κ [1/m]; for κ = 0, of bodies without fields.

    Sums run over the charges of the smaller body in the field of the larger one, so of two bodies
    only the larger is tabulated.
    """
    if not kappa > 0.0:
        return Field(Grid.rows(len(shapes)), np.zeros(0, np.int64), FieldNode.rows(0))
    bounds = [shape.bounding_radius for shape in shapes]
    # The earlier one of two that are as large: outline_sum.outline_forces_at.
    asked = {bounds.index(max(bounds))} if len(shapes) == 2 else set(range(len(shapes)))
    none = Field(Grid.rows(1), np.zeros(0, np.int64), FieldNode.rows(0))
    found = [
        field_of_shape(shape, kappa) if body in asked else none for body, shape in enumerate(shapes)
    ]
    grids = Grid.joined(each.grids for each in found)
    known = [each for each in found if len(each.field)]
    if len(known) == 1:  # tables are large, and not copied where they need not be
        return Field(grids, known[0].tiles, known[0].field)
    grids["tile"] = np.cumsum([0, *[len(each.tiles) for each in found[:-1]]])
    before = np.cumsum([0, *[len(each.field) for each in found[:-1]]])
    tiles = [np.where(each.tiles < 0, -1, each.tiles + first)
             for each, first in zip(found, before, strict=True)]  # fmt: skip
    return Field(grids, np.concatenate(tiles), FieldNode.joined(each.field for each in found))
