"""The double layer of an outline at a constant potential, as that of line charges behind it.

Outside of the body its potential, by linear theory, is that of a single layer σ on the outline,
φ(x) = (1/2πε) ∮ σ K₀(κρ) ds, which is constant along it. Charges a little behind the outline make
the same potential outside, where it is unique, and so feel the same force in the field of another
body: the energy by linear superposition is

    E = (1/2πε) ∮∮ σ₁ σ₂ K₀(κρ) ds ds = 2πε φ₁ φ₂ Σ Σ q₁ q₂ K₀(κρ)

a length, the charges q being those of potential 1 on the outline. Unlike σ they see the other body
from afar even at touch, where sums over the outlines themselves would need nodes as near as the
gap. Each lies DEEP behind the point at which the potential is asked for, in units of the radius by
which the core is rounded or of 1/κ, whichever is less; next ones are as far apart. That makes
energies right within 2e-3 (tests/geometry/surfaces/test_charges.py).
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

import flocsim.arrays as at
from flocsim.errors import ShapeError
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.surfaces.distances import piece_at
from flocsim.geometry.surfaces.nodes import at_parameter
from flocsim.geometry.surfaces.pieces import pieces_of_shape

DEEP = 0.6
"""Depth of charges, and their distance from each other."""

THIN = 60.0
"""κ times the least radius of curvature from which on double layers are as those of plates, within
1 % (1/(2κr) of a cylinder over a plate)."""

MOST = 20_000
"""Charges of an outline at most: their potentials are solved for in seconds."""

FAR = 16.0
"""κρ beyond which charges are not seen in that."""

NEAR = 0.15
"""Charges nearer to each other than that, as behind reflex corners, are one: two would grow without
bound against each other."""

DENSE = 2000
"""Up to so many charges all of them are solved for at once; more, by what is near each alone."""


def is_thin(shapes: Sequence[Shape], kappa: float) -> bool:
    """Whether the double layers of some bodies are thin beside all that is round in them."""
    return min(float(part.radius) for shape in shapes for part in shape.parts) * kappa >= THIN


def unit_of(shape: Shape, kappa: float) -> float:
    """1/κ, or the least radius by which a shape is rounded where that is less [m]."""
    return min(1.0 / kappa, *(float(part.radius) for part in shape.parts))


def spacings(pieces, kappa):
    """How far charges behind each piece lie from each other [m], and their numbers."""
    spacing = DEEP * np.minimum(pieces[:, at.INWARD], 1.0 / kappa)
    bend, size = pieces[:, at.BEND], pieces[:, at.SIZE]
    lengths = np.where(bend > 0.0, 4.0 * np.arctan(size) * bend, 2.0 * size)
    # A corner that is not rounded would need infinitely many.
    with np.errstate(divide="ignore"):
        return spacing, np.maximum(np.ceil(lengths / spacing), 1.0)


def too_long(shape: Shape, kappa: float, takes: str) -> ShapeError:
    """What to say of an outline that takes more of something than there may be."""
    radius = min(float(part.radius) for part in shape.parts)
    return ShapeError(
        f"the outline of a body of r_eq = {shape.equivalent_radius:.3g} m, rounded by "
        f"{radius:.3g} m, is too long for a double layer of 1/κ = {1.0 / kappa:.3g} m along "
        f'outlines (it takes {takes} at most): give gap = "surface" in the place of '
        'law = "outline"'
    )


def check_length(shape: Shape, kappa: float) -> None:
    """ShapeError where a shape's outline takes more charges than can be solved for."""
    _, counts = spacings(pieces_of_shape(shape), kappa)
    if counts.sum() > MOST:
        raise too_long(shape, kappa, f"{counts.sum():.3g} charges, of {MOST}")


def points_of(pieces, kappa, times=1):
    """(points on an outline (n, 2), what lies behind them as deep as charges (n, 2)) [m], so many
    times as many as charges."""
    spacing, counts = spacings(pieces, kappa)
    points, places = [], []
    for row, (depth, count) in enumerate(zip(spacing, times * counts.astype(int), strict=True)):
        piece = piece_at(pieces, row)
        share = (2.0 * np.arange(count) + 1.0) / count - 1.0
        parameter = share * piece.size
        if piece.bend > 0.0:
            parameter = np.tan(share * math.atan(piece.size))
        x, y, nx, ny, _ = at_parameter(piece, parameter)
        points.append(np.column_stack([x, y]))
        places.append(np.column_stack([x - depth * nx, y - depth * ny]))
    return np.concatenate(points), np.concatenate(places)


@lru_cache(maxsize=256)
def charges_of_shape(shape: Shape, kappa: float) -> np.ndarray:
    """The charges (n, 3) of a shape around its centroid: x, y [m] and q [-], at κ [1/m], by least
    squares of the potential at twice as many points.

    ShapeError for an outline that takes too many.
    """
    from scipy.sparse.linalg import spsolve
    from scipy.spatial import cKDTree
    from scipy.special import k0

    check_length(shape, kappa)
    pieces = pieces_of_shape(shape)
    places = parted(points_of(pieces, kappa)[1], NEAR * unit_of(shape, kappa))
    points, _ = points_of(pieces, kappa, 2)
    if len(places) <= DENSE:
        matrix, solve = k0(kappa * distances(points, places)), np.linalg.solve
    else:
        trees, far = (cKDTree(points), cKDTree(places)), FAR / kappa
        near = trees[0].sparse_distance_matrix(trees[1], far, output_type="coo_matrix")
        near.data = k0(kappa * near.data)
        matrix, solve = near.tocsc(), spsolve
    charges = solve(matrix.T @ matrix, matrix.T @ np.ones(len(points)))
    return np.column_stack([places, charges])


def parted(places, near):
    """Places without those that are nearer than that [m] to an earlier one."""
    from scipy.spatial import cKDTree

    kept = np.ones(len(places), bool)
    pairs = cKDTree(places).query_pairs(near, output_type="ndarray")
    for first, second in sorted(map(sorted, pairs.tolist())):
        kept[second] &= not kept[first]
    return places[kept]


def distances(points, others):
    """(n, m) from each of some points to each of others."""
    return np.hypot(*(points[:, None, :2] - others[None, :, :2]).transpose(2, 0, 1))


def clusters(charges):
    """Some charges as lists of up to at.GROUP neighbours."""
    if len(charges) <= at.GROUP:
        return [charges]
    axis = int(np.argmax(np.ptp(charges[:, :2], axis=0)))
    order = charges[np.argsort(charges[:, axis], kind="stable")]
    return [*clusters(order[: len(order) // 2]), *clusters(order[len(order) // 2 :])]


@lru_cache(maxsize=256)
def rows_of_shape(shape: Shape, kappa: float) -> np.ndarray:
    """The same as rows (groups, at.CHARGE_COLUMNS), of neighbours and a circle that holds them."""
    found = clusters(charges_of_shape(shape, kappa))
    rows = np.zeros((len(found), at.CHARGE_COLUMNS))
    for row, group in zip(rows, found, strict=True):
        middle = 0.5 * (group[:, :2].min(axis=0) + group[:, :2].max(axis=0))
        extent = np.hypot(*(group[:, :2] - middle).T).max()
        row[: at.FIRST_CHARGE] = *middle, extent, len(group)
        row[at.FIRST_CHARGE : at.FIRST_CHARGE + group.size] = group.ravel()
    return rows


class Charges(NamedTuple):
    """The charges of some bodies; a Scene has the same fields."""

    charges: np.ndarray
    first_charge: np.ndarray


def charges_of_bodies(shapes: Sequence[Shape], kappa: float) -> Charges:
    """The Charges of bodies of these shapes at κ [1/m]; 0: of so many bodies with none."""
    none = np.zeros((0, at.CHARGE_COLUMNS))
    rows = [rows_of_shape(shape, kappa) if kappa > 0.0 else none for shape in shapes]
    first = np.concatenate([[0], np.cumsum([len(each) for each in rows])])
    return Charges(np.ascontiguousarray(np.concatenate(rows)), first.astype(np.int64))


def layer_energy(
    shape_a: Shape, shape_b: Shape, pose: tuple[float, float, float], kappa: float
) -> float:
    """E/(2πε φ₁ φ₂ W) [-] of two bodies of a depth W by linear superposition, at κ [1/m].

    ``pose``: x, y [m] and angle [rad] of a in the frame of b. All charges count, however far.
    """
    from scipy.special import k0

    a, b = charges_of_shape(shape_a, kappa), charges_of_shape(shape_b, kappa)
    x, y, angle = pose
    c, s = math.cos(angle), math.sin(angle)
    placed = a[:, :2] @ np.array([[c, s], [-s, c]]) + (x, y)
    return float(a[:, 2] @ k0(kappa * distances(placed, b)) @ b[:, 2])
