"""Exact area, centroid and second moment of a swept outline: a filled core widened by a disk."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(16)
LONGEST_ARC = np.pi / 2
COVERED = 1e-12
"""A piece of offset curve this share of the radius nearer to the core is inside the body."""


def core_geometry(vertices):
    """The core as a shapely point, line or filled polygon."""
    makers = {1: shapely.Point, 2: shapely.LineString}
    return makers.get(len(vertices), shapely.Polygon)(vertices)


def area_centroid_inertia(vertices, radius):
    """Area [m²], centroid (2,) [m] and polar second moment about it [m⁴] of the swept outline.

    Green's theorem over the outline's visible pieces, each run with the body on its left:
    A = ½∮(x dy − y dx), A x̄ = ½∮x² dy, A ȳ = −½∮y² dx, J₀ = ⅓∮(x³ dy − y³ dx). No chaining of
    the pieces is needed, and a hole subtracts itself. Exact to rounding; bends between two
    edges that are not zero but below 1e-6 rad are not resolved.
    """
    vertices = np.array(vertices, dtype=float).reshape(-1, 2)
    origin = vertices.mean(axis=0)
    sums = sum(green_integrals(piece) for piece in visible_pieces(vertices - origin, radius))
    area, first, second_moment = sums[0], sums[1:3], sums[3]
    centroid = first / area
    return area, origin + centroid, second_moment - area * (centroid @ centroid)


def second_moments(vertices, radius):
    """∫ρρᵀ dA (2, 2) [m⁴] about the origin, to which the centroid has been moved before.

    Green's theorem again: ∫x² = ⅓∮x³ dy, ∫y² = −⅓∮y³ dx, ∫xy = ½∮x² y dy.
    """
    total = np.zeros((2, 2))
    for piece in visible_pieces(np.array(vertices, dtype=float).reshape(-1, 2), radius):
        start, end = piece.span
        parameter = start + (end - start) * (GAUSS_NODES + 1) / 2
        (x, y), (dx, dy) = piece.point(parameter), piece.derivative(parameter)
        mixed = x**2 * y * dy / 2
        integrands = np.array([[x**3 * dy / 3, mixed], [mixed, -(y**3) * dx / 3]])
        total += integrands @ GAUSS_WEIGHTS * (end - start) / 2
    return total


def green_integrals(piece):
    """∮ over one piece: (A, A x̄, A ȳ, J₀), by 16-point Gauss quadrature on arcs up to 90°."""
    start, end = piece.span
    parameter = start + (end - start) * (GAUSS_NODES + 1) / 2
    (x, y), (dx, dy) = piece.point(parameter), piece.derivative(parameter)
    area, second_moment = (x * dy - y * dx) / 2, (x**3 * dy - y**3 * dx) / 3
    integrands = [area, x**2 * dy / 2, -(y**2) * dx / 2, second_moment]
    return np.array(integrands) @ GAUSS_WEIGHTS * (end - start) / 2


@dataclass(frozen=True)
class OffsetLine:
    """A straight piece from `start` along `vector`; the parameter runs over `span` in [0, 1]."""

    start: np.ndarray
    vector: np.ndarray
    span: tuple = (0.0, 1.0)

    def point(self, s):
        return self.start[:, None] + self.vector[:, None] * s

    def derivative(self, s):
        return self.vector[:, None] * np.ones_like(s)


@dataclass(frozen=True)
class Arc:
    """A counter-clockwise arc about `centre`; the parameter is the angle [rad] within `span`."""

    centre: np.ndarray
    radius: float
    span: tuple

    def point(self, angle):
        return self.centre[:, None] + self.radius * np.array([np.cos(angle), np.sin(angle)])

    def derivative(self, angle):
        return self.radius * np.array([-np.sin(angle), np.cos(angle)])


def visible_pieces(vertices, radius):
    """The pieces of the offset curves, cut where they cross, that bound the swept body."""
    pieces = offset_pieces(vertices, radius)
    core = core_geometry(vertices)
    cut = [part for piece in pieces for part in split(piece, pieces)]
    return [part for part in cut if not is_covered(part, core, radius)]


def offset_pieces(vertices, radius):
    """Each edge shifted outwards by the radius, and an arc around each convex corner."""
    if len(vertices) == 1:
        return quarter_arcs(vertices[0], radius, 0.0, 2 * np.pi)
    vertices = counter_clockwise(vertices)
    vectors = np.roll(vertices, -1, axis=0) - vertices
    headings = np.arctan2(vectors[:, 1], vectors[:, 0])
    normals = np.stack([np.sin(headings), -np.cos(headings)], axis=1)
    pieces = [
        OffsetLine(v + radius * n, u) for v, n, u in zip(vertices, normals, vectors, strict=True)
    ]
    for k, vertex in enumerate(vertices):
        turn = (headings[k] - headings[k - 1] + np.pi) % (2 * np.pi) - np.pi
        # A two-point core turns back by half a circle, which the modulo may sign either way.
        turn = np.pi if len(vertices) == 2 else turn
        if turn > 0:
            pieces += quarter_arcs(vertex, radius, headings[k - 1] - np.pi / 2, turn)
    return pieces


def quarter_arcs(centre, radius, start, sweep):
    """An arc of `sweep` [rad] in equal parts of at most 90°."""
    angles = np.linspace(start, start + sweep, int(np.ceil(sweep / LONGEST_ARC)) + 1)
    return [Arc(centre, radius, span) for span in pairwise(angles)]


def counter_clockwise(vertices):
    """The same polygon with its vertices in counter-clockwise order."""
    x, y = vertices.T
    doubled_area = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    return vertices[::-1] if doubled_area < 0 else vertices


def split(piece, others):
    """The piece cut at its crossings with the other pieces."""
    start, end = piece.span
    cuts = np.concatenate([crossings(piece, other) for other in others if other is not piece])
    knots = np.concatenate([[start], np.sort(cuts[(cuts > start) & (cuts < end)]), [end]])
    return [replace(piece, span=span) for span in pairwise(knots) if span[1] > span[0]]


def crossings(piece, other):
    """Parameters on `piece` where it meets the full line or circle that carries `other`.

    Crossings with the unused part of a carrier only cut a piece once more than needed.
    """
    if isinstance(piece, OffsetLine):
        return (line_line if isinstance(other, OffsetLine) else line_circle)(piece, other)
    return (circle_line if isinstance(other, OffsetLine) else circle_circle)(piece, other)


def line_line(line, other):
    determinant = np.linalg.det([line.vector, -other.vector])
    if determinant == 0.0:
        return np.array([])
    return np.array([np.linalg.det([other.start - line.start, -other.vector]) / determinant])


def line_circle(line, arc):
    offset, vector = line.start - arc.centre, line.vector
    half_b, c = (offset @ vector) / (vector @ vector), offset @ offset - arc.radius**2
    root = half_b**2 - c / (vector @ vector)
    return np.array([]) if root <= 0 else -half_b + np.sqrt(root) * np.array([-1.0, 1.0])


def circle_line(arc, line):
    meeting = line.point(line_circle(line, arc)) - arc.centre[:, None]
    return into_span(arc, np.arctan2(meeting[1], meeting[0]))


def circle_circle(arc, other):
    between = other.centre - arc.centre
    distance = np.hypot(*between)
    if not 0 < distance < 2 * arc.radius:
        return np.array([])
    half_angle = np.arccos(distance / (2 * arc.radius))
    return into_span(arc, np.arctan2(between[1], between[0]) + half_angle * np.array([-1.0, 1.0]))


def into_span(arc, angles):
    """The angles shifted by whole turns to follow the arc's start."""
    return arc.span[0] + (angles - arc.span[0]) % (2 * np.pi)


def is_covered(piece, core, radius):
    """Whether the middle of the piece lies inside the swept body."""
    middle = piece.point(np.array([sum(piece.span) / 2])).ravel()
    return core.distance(shapely.Point(middle)) < radius * (1 - COVERED)
