"""Slow flow around rigid prisms: their surface as flat panels, and the forces on them.

The velocity of the water is that of a single layer of forces on the surface,

    u(x) = 1/(8πµ) ∫ (1/r + r r/r³) f dS,

and equals that of the body there. The force is constant on a panel and the equation holds at its
middle. Integrals over panels are sums over their edges in closed form. Motion is in the plane, so
half of the surface suffices: the other half is its mirror image.

Sources: C. Pozrikidis (1992), Boundary Integral and Singularity Methods for Linearized Viscous
Flow, chapter 4; integrals of 1/r: D. R. Wilton et al. (1984), IEEE Trans. Antennas Propag. 32, 276;
those of r r/r³ are the second derivatives of ∫ r dS, by Gauss's theorem sums over edges, too.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import attrs
import numpy as np

from flocsim.compiler.composer import compiled
from flocsim.geometry.shapes.outline import cells_of

CORNER_ANGLE = 0.7
"""[rad] Turn of an outline since the last corner from which on panels end at a vertex: less than
half a right angle, so that a rounded corner is cut in its middle."""

ON_THE_LINE = 1e-24
"""Square of the distance from the line of an edge below which its logarithm is left out: both
factors of it vanish there."""


SAME_POINT = 1e-12
"""Share of the length of an outline within which ends of panels and vertices are the same."""

SHORTEST = 1e-100
"""Edges of no length have the tangent 0, so that they add nothing."""


@attrs.frozen(eq=False)
class Panels:
    """The upper half of the closed surface of a prism, in panels that may bend around an outline.

    Attributes
    ----------
    middles : (n, 3) array
        Points on the panels at which the velocity is that of the body.
    areas : (n,) array
    starts, frames, lengths : (e, 3), (e, 3, 3) and (e,) arrays
        Directed edges of the flat pieces of panels: where they start, their tangent t, m out of the
        piece in its plane, its normal n out of the body, and their length.
    owners : (e,) int array
        Panel of each edge.
    """

    middles: np.ndarray
    areas: np.ndarray
    starts: np.ndarray
    frames: np.ndarray
    lengths: np.ndarray
    owners: np.ndarray


def panels_of(rings: Sequence[np.ndarray], height: float, size: float, finer: int = 1) -> Panels:
    """Return panels on the upper half of a prism.

    ``rings``: oriented outlines and holes (k, 2). Panels of about ``size``
    are divided by ``finer`` in both directions, so that errors fall steadily with it.
    """
    middles: list[list[float]] = []
    areas: list[float] = []
    # Flat pieces: their corners, the normal out of the body, and the panel that they belong to.
    pieces: list[tuple[np.ndarray, list[float], int]] = []
    # The wall: the same panels of the outline in each layer.
    levels = np.linspace(0.0, 0.5 * height, max(1, round(0.5 * height / size)) * finer + 1)
    for ring in rings:
        way, cuts = cuts_of(ring, size, finer)
        marks = np.unique(np.concatenate([way, cuts]))
        marks = marks[np.append(np.diff(marks) > SAME_POINT * way[-1], True)]
        points, halfway = (
            np.column_stack([np.interp(s, way, axis) for axis in np.vstack([ring, ring[:1]]).T])
            for s in (marks, 0.5 * (cuts[1:] + cuts[:-1]))
        )
        owners = np.searchsorted(cuts, 0.5 * (marks[1:] + marks[:-1])) - 1
        for low, high in pairwise(levels):
            for (p, q), owner in zip(pairwise(points), owners, strict=True):
                corners = np.array([[*p, low], [*q, low], [*q, high], [*p, high]])
                x, y = (q - p) / np.hypot(*(q - p))
                pieces.append((corners, [y, -x, 0.0], len(middles) + owner))
            middles += [[*middle, 0.5 * (low + high)] for middle in halfway]
            areas += list(np.diff(cuts) * (high - low))
    # The face: cells of a grid, cut by the outline.
    for middle, area, edges in cells_of(rings, size, finer):
        for ring in edges:
            corners = np.column_stack([ring, np.full(len(ring), 0.5 * height)])
            pieces.append((corners, [0.0, 0.0, 1.0], len(middles)))
        middles.append([*middle, 0.5 * height])
        areas.append(area)
    corners, normals, owners = zip(*pieces, strict=True)
    counts, starts = list(map(len, corners)), np.concatenate(corners)
    steps = np.concatenate([np.roll(each, -1, axis=0) for each in corners]) - starts
    lengths, normal = np.linalg.norm(steps, axis=1), np.repeat(normals, counts, axis=0)
    tangent = steps / np.maximum(lengths, SHORTEST)[:, None]
    frames = np.stack([tangent, np.cross(tangent, normal), normal], axis=1)
    owner = np.repeat(owners, counts)
    return Panels(np.array(middles), np.array(areas), starts, frames, lengths, owner)


def cuts_of(ring: np.ndarray, size: float, finer: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances along a closed ring of its vertices, and of the ends of panels."""
    steps = np.roll(ring, -1, axis=0) - ring
    way = np.append(0.0, np.cumsum(np.hypot(*steps.T)))
    direction = steps @ [1.0, 1j]
    turns = np.angle(direction / np.roll(direction, 1))
    # Panels end at corners, sharp or round, that are not too close to each other: the force is
    # singular there.
    corners, turned = [0.0], 0.0
    for at, turn in zip(way[1:-1], turns[1:], strict=True):
        turned += turn
        if abs(turned) > CORNER_ANGLE and min(at - corners[-1], way[-1] - at) >= 0.5 * size:
            corners.append(at)
            turned = 0.0
    cuts = [
        np.linspace(begin, end, max(1, round((end - begin) / size)) * finer, endpoint=False)
        for begin, end in pairwise([*corners, way[-1]])
    ]
    return way, np.append(np.concatenate(cuts), way[-1])


def rigid_loads(surface: Panels) -> np.ndarray:
    """Return (3, 5): force and torque about the origin for unit motions and strains, viscosity 1.

    The columns are v_x, v_y, spin, E_xx and E_xy.
    """
    x, y, _ = surface.middles.T
    one, none = np.ones(len(x)), np.zeros(len(x))
    # Velocities of the panels for each; forces follow from the matrix.
    motions = [(one, none), (none, one), (-y, x), (x, -y), (y, x)]
    wanted = np.array([np.column_stack([*each, none]).ravel() for each in motions]).T
    matrix = layer_of(surface, surface.middles) + inner_pressure(surface)
    areas = np.repeat(surface.areas, 3)[:, None]
    return 2.0 * (areas * wanted[:, :3]).T @ np.linalg.solve(matrix, wanted)


def layer_of(surface: Panels, points: np.ndarray) -> np.ndarray:
    """Return the velocities (3 k, 3 n) at points (k, 3) by unit forces per area on n panels."""
    matrix = np.zeros((3 * len(points), 3 * len(surface.middles)))
    compiled(add_layers, what="the drag of shapes")(
        points, surface.starts, surface.frames, surface.lengths, surface.owners, matrix
    )
    return matrix


def inner_pressure(surface: Panels) -> np.ndarray:
    """Return what sets the pressure inside of a closed surface to 0, in its matrix (3 n, 3 n).

    It moves no water, so that the matrix leaves it open, and rounding would make it large.
    """
    vectors, steps = np.zeros_like(surface.middles), surface.lengths[:, None] * surface.frames[:, 0]
    np.add.at(vectors, surface.owners, 0.5 * np.cross(surface.starts, steps))
    return np.outer(vectors / surface.areas[:, None], vectors)


def add_layers(middles, starts, frames, lengths, owners, matrix):
    """Add to ``matrix`` (3 k, 3 n) the velocities at points (k, 3) by unit forces per area on n
    panels and, mirrored, on their mirror images; viscosity 1. Edges as in Panels."""
    for i in range(middles.shape[0]):
        # The velocity by the image of a force is the mirrored one at the mirrored point.
        for side in (1.0, -1.0):
            for e in range(starts.shape[0]):
                t, m, n = axis_of(frames, e, 0), axis_of(frames, e, 1), axis_of(frames, e, 2)
                x, y = middles[i, 0] - starts[e, 0], middles[i, 1] - starts[e, 1]
                z = side * middles[i, 2] - starts[e, 2]
                begin = -(x * t[0] + y * t[1] + z * t[2])
                apart = -(x * m[0] + y * m[1] + z * m[2])
                end, height = begin + lengths[e], x * n[0] + y * n[1] + z * n[2]
                square = apart * apart + height * height
                near, far = math.sqrt(square + begin * begin), math.sqrt(square + end * end)
                # ∫ dl/r along the edge, and the solid angle of its triangle with the point below.
                logarithm = angle = 0.0
                if square > ON_THE_LINE:
                    # near + begin and far − end without cancelling.
                    ahead = near + begin if begin > 0.0 else square / (near - begin)
                    logarithm = math.log((far + end if end > 0.0 else square / (far - end)) / ahead)
                above = abs(height)
                if above > 0.0:
                    a, b = square + above * far, square + above * near
                    angle = above * math.atan2(
                        apart * (end * b - begin * a), a * b + apart * apart * end * begin
                    )
                # Parts of the edge in ∫ dS/r and in ∫ ∂∂r dS = ∫ (1/r − r r/r³) dS.
                along, slope, rise = apart * logarithm, far - near, height * logarithm
                whole, deep = along - angle, along - 2.0 * angle
                for k in range(3):
                    sign = (side if k == 2 else 1.0) * 0.125 / math.pi
                    matrix[3 * i + k, 3 * owners[e] + k] += sign * 2.0 * whole
                    for j in range(3):
                        second = m[k] * (along * m[j] + slope * t[j] - rise * n[j])
                        second += n[k] * (deep * n[j] - rise * m[j])
                        matrix[3 * i + k, 3 * owners[e] + j] -= sign * second


def axis_of(frames, e, k):
    """Return the axis k of an edge."""
    return frames[e, k, 0], frames[e, k, 1], frames[e, k, 2]
