"""The drag of prisms against boundary elements that become small towards edges.

The reference shares nothing with flocsim but the equation: its panels are quadrilaterals graded
towards all edges, where the force is singular, its integrals are written with numpy, and its last
two meshes are extrapolated.

    python -m benchmarks.accuracy.prism_drag [--quick] [--markdown]

`off` is the largest error of an element of R and Γ over √(R_ii R_jj), in %; `turned` is that of the
shape turned by 0.3 rad.
"""

import math

import numpy as np

from benchmarks.reporting import Table, begin
from flocsim.hydrodynamics import prism_drag

GRADING = 2.5
"""Power by which panels become small towards edges."""

ORDER = 1.09 * GRADING
"""Power of the size of panels in their error."""

MIRROR = np.array([1.0, 1.0, -1.0])


def rectangle(length, width):
    """Corners (4, 2) about the middle."""
    return 0.5 * np.array([[-length, -width], [length, -width], [length, width], [-length, width]])


def regular(count):
    """Corners (k, 2) of a regular polygon of circumradius 1, turned by 0.1 rad."""
    turn = 2.0 * np.pi * np.arange(count) / count + 0.1
    return np.column_stack([np.cos(turn), np.sin(turn)])


ELL = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float) - 5.0 / 6.0
SHAPES = {
    "square": (rectangle(1, 1), 1.0),
    "square, depth 0.2": (rectangle(1, 1), 0.2),
    "2 : 1": (rectangle(2, 1), 1.0),
    "2 : 1, depth 3": (rectangle(2, 1), 3.0),
    "4 : 1": (rectangle(4, 1), 1.0),
    "4 : 1, depth 2": (rectangle(4, 1), 2.0),
    "triangle": (regular(3), 1.0),
    "triangle of three sides": (np.array([[-1, -0.4], [2, -0.4], [-1, 0.8]]), 1.0),
    "hexagon": (regular(6), 1.0),
    "L": (ELL, 1.0),
}
"""Cross-sections and depths."""


def convex_parts(ring):
    """Convex polygons that make up a cross-section: of the L three squares."""
    if ring is not ELL:
        return [ring]
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 5.0 / 6.0
    return [square + shift for shift in ([0, 0], [1, 0], [0, 1])]


def graded(count, both=False):
    """Numbers from 0 to 1, dense towards 1, or towards both."""
    t = np.linspace(0.0, 1.0, count + 1)
    if not both:
        return 1.0 - (1.0 - t) ** GRADING
    return np.where(t < 0.5, 0.5 * (2.0 * t) ** GRADING, 1.0 - 0.5 * (2.0 * (1.0 - t)) ** GRADING)


def patch(corners, u, v):
    """Panels (k, 4, 3) of a flat patch a b c d, cut at u from a to b and v from a to d."""
    a, b, c, d = np.array(corners)
    u, v = u[:, None, None], v[None, :, None]
    grid = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
    cells = [grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]]
    return np.stack(cells, axis=2).reshape(-1, 4, 3)


def mesh(ring, height, count):
    """Panels of the upper half of a prism; faces as kites between their middle and corners."""
    following = np.roll(ring, -1, axis=0)
    lengths = np.hypot(*(following - ring).T)
    panels = []
    for p, q, length in zip(ring, following, lengths, strict=True):
        cuts = 2 * round(count * max(1.0, math.sqrt(length / lengths.mean())))
        corners = [[*p, 0.0], [*q, 0.0], [*q, 0.5 * height], [*p, 0.5 * height]]
        panels.append(patch(corners, graded(cuts, both=True), graded(count)))
    for part in convex_parts(ring):
        halfway = 0.5 * (part + np.roll(part, -1, axis=0))
        for k, corner in enumerate(part):
            kite = [part.mean(axis=0), halfway[k], corner, halfway[k - 1]]
            corners = [[*place, 0.5 * height] for place in kite]
            panels.append(patch(corners, graded(count), graded(count)))
    return np.concatenate(panels)


def velocities(places, panels):
    """Integrals (k, n, 3, 3) of 1/r + r r/r³ over flat panels, by their edges."""
    normals = np.cross(panels[:, 2] - panels[:, 0], panels[:, 3] - panels[:, 1])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    height = np.einsum("kni,ni->kn", places[:, None] - panels[:, 0], normals)
    above = np.abs(height)
    inverse, angle = np.zeros_like(height), np.zeros_like(height)
    second = np.zeros((*height.shape, 3, 3))
    for k in range(4):
        start, end = panels[:, k], panels[:, (k + 1) % 4]
        length = np.linalg.norm(end - start, axis=1)
        tangent = (end - start) / length[:, None]
        out = np.cross(tangent, normals)
        s, d = (np.einsum("kni,ni->kn", start - places[:, None], each) for each in (tangent, out))
        e, square = s + length, d * d + height * height
        near, far = np.sqrt(square + s * s), np.sqrt(square + e * e)
        behind = s + e < 0.0
        logarithm = np.log(np.where(behind, near - s, far + e))
        logarithm -= np.log(np.where(behind, far - e, near + s))
        angle += np.arctan2(d * e, square + above * far)
        angle -= np.arctan2(d * s, square + above * near)
        inverse += d * logarithm
        rise = -(height * logarithm)[..., None]
        along = (d * logarithm)[..., None] * out + (far - near)[..., None] * tangent
        along += rise * normals
        second += out[:, :, None] * along[:, :, None, :]
        second += normals[:, :, None] * (rise * out)[:, :, None, :]
    inverse -= above * angle
    second += (inverse - above * angle)[..., None, None] * (normals[:, :, None] * normals[:, None])
    return 2.0 * inverse[..., None, None] * np.eye(3) - second


def loads_of(panels):
    """(3, 5): forces and torque for unit motions and strains, viscosity 1."""
    halves = panels[:, [0, 1, 2]], panels[:, [0, 2, 3]]
    areas = [
        0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1) for t in halves
    ]
    area = sum(areas)
    middle = sum(a[:, None] * t.mean(axis=1) for a, t in zip(areas, halves, strict=True))
    middle /= area[:, None]
    matrix = velocities(middle, panels)
    matrix += MIRROR[:, None] * velocities(middle * MIRROR, panels)
    count = len(panels)
    matrix = matrix.transpose(0, 2, 1, 3).reshape(3 * count, 3 * count) / (8.0 * math.pi)
    (x, y, _), one, none = middle.T, np.ones(count), np.zeros(count)
    motions = (one, none), (none, one), (-y, x), (x, -y), (y, x)
    wanted = np.stack([np.column_stack([*each, none]).ravel() for each in motions], axis=1)
    found = np.linalg.solve(matrix, wanted)
    return 2.0 * (wanted[:, :3] * np.repeat(area, 3)[:, None]).T @ found


def reference(ring, height, counts):
    """The same of a prism, extrapolated from two meshes."""
    coarse, fine = (loads_of(mesh(ring, height, count)) for count in counts)
    return fine + (fine - coarse) / ((counts[1] / counts[0]) ** ORDER - 1.0)


def turned(ring, loads, angle):
    """A cross-section turned about the origin, and its loads."""
    c, s = math.cos(angle), math.sin(angle)
    whole = np.eye(5)
    whole[:2, :2] = [[c, -s], [s, c]]
    c, s = math.cos(2.0 * angle), math.sin(2.0 * angle)
    whole[3:, 3:] = [[c, -s], [s, c]]
    return ring @ whole[:2, :2].T, whole[:3, :3] @ loads @ whole.T


def main():
    """Print the table."""
    arguments = begin(__doc__)
    counts = (4, 6) if arguments.quick else (6, 8)
    table = Table("Drag of prisms: largest error and stated error [%]", (
        "cross-section", "off", "stated", "turned, off", "stated", "R_xx", "R_yy", "R_ss",
    ))  # fmt: skip
    for name, (ring, height) in SHAPES.items():
        wanted, cells = reference(ring, height, counts), []
        for angle in (0.0, 0.3):
            place, loads = turned(ring, wanted, angle)
            drag = prism_drag([place], height)
            scale = np.sqrt(np.diag(loads[:, :3]))
            off = np.hstack([drag.resistance, drag.strain]) - loads
            off /= scale[:, None] * scale[[0, 1, 2, 2, 2]]
            cells += [100.0 * float(np.abs(off).max()), 100.0 * drag.error]
        table.add(name, *cells, *(f"{each:.4f}" for each in np.diag(wanted[:, :3])))
    table.print()


if __name__ == "__main__":
    main()
