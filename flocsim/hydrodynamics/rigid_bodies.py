"""Drag of rigid bodies in slow flow: of a floc's outline, of a sphere that water passes through,
and of clusters of bodies.

A prism of the outline is covered by small spheres that move as one. These push each other by the
tensor of Rotne, Prager and Yamakawa, and what each has to bear follows from one linear system (a
rigid multiblob). As the spheres stand out from the surface, the body is too large by a share of
their spacing: from three spacings follow the limit of none, and by how much that may be wrong.
Nothing moves out of the plane, so that half of the surface is enough.

Sources: H. Yamakawa (1970), J. Chem. Phys. 53, 436 (with overlaps: E. Wajnryb et al. 2013, J. Fluid
Mech. 731, R3); S. Delong et al. (2015), Commun. Appl. Math. Comput. Sci. 11, 217.

Inside of a permeable sphere of radius a and permeability k Brinkman's equation holds, Stokes's
outside; β = a/√k.

Sources: H. C. Brinkman (1949), Appl. Sci. Res. A 1, 27; G. Neale, N. Epstein and W. Nader (1973),
Chem. Eng. Sci. 28, 1865; of turning B. U. Felderhof and J. M. Deutch (1975), J. Chem. Phys. 62,
2391; J. Happel (1958), AIChE J. 4, 197, for flocs X. Li and B. E. Logan (2001), Water Res. 35,
3373.

Of a force on a cluster every body bears a share, and moves the others by the same tensor, the
sphere of its drag in its place (Kirkwood and Riseman); the shares are those with which all move
alike in the mean of two directions, which makes the least of the sum. Touching spheres push each
other by less than that tensor says when they move as one, as neither yields to what the other does
around it: by as much as is exact for two alike, which fades by the cube of the distance.
`mobilities` is what others call; the kernels are plain functions on scalars and arrays.

Sources: J. G. Kirkwood and J. Riseman (1948), J. Chem. Phys. 16, 565; of unequal and overlapping
spheres P. J. Zuk et al. (2014), J. Fluid Mech. 741, R5; of two that touch D. J. Jeffrey and
Y. Onishi (1984), J. Fluid Mech. 139, 261.
"""

import math
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.compiler.composer import compiled
from flocsim.errors import UsageError
from flocsim.geometry.shapes.cores import inside_polygon, inside_rings, signed_area

SPHERES = (150, 300, 600)
"""Of half of a surface, about: three coverings."""

RADIUS = 0.5
"""Of a sphere, over their spacing."""

LEAST_LAYER = 0.6
"""Spheres of the two faces are as many spacings from the outline at least, where others are."""


ACROSS = np.array([[math.cos(0.3), math.sin(0.3)], [-math.sin(0.3), math.cos(0.3)]])
"""How rows of a face lie: along no straight side, whose distance to the nearest would count."""

FEW = 100
"""Bodies of a cluster of which all pairs count by themselves."""

LESS_ALONG, LESS_ACROSS = 0.120, 0.1315
"""By which shares of the tensor two alike push each other less where they touch, along the line of
centres and across."""

CENTRED = 1e-6
"""Centres nearer to each other than this share of both radii count as so far apart."""

SHARE_ERROR, MOST_CHANGES = 0.03, 30
"""Shares are good where bodies move alike to so much; after so many changes at most. The sum is
then right to 1 %."""


@attrs.frozen(eq=False)
class PrismDrag:
    """How a rigid prism moves in its plane through slow flow of viscosity 1, around the origin.

    ``resistance`` (3, 3) [m, m², m³], symmetric and positive, of (v_x, v_y, spin); ``strain``
    (3, 2) [m², m³] of E_xx = −E_yy and E_xy. Times the viscosity µ the load is
    (f_x, f_y, torque) = −R (v − u, ω − Ω) + Γ (E_xx, E_xy), u and Ω the flow's at the origin.
    ``error``: by which share numbers may be wrong; ``radius``: r_eq of the outline [m].
    """

    resistance: np.ndarray
    strain: np.ndarray
    error: float
    radius: float

    @property
    def mobility(self) -> np.ndarray:
        """Those in the plane (2,), the larger first, of a body that is free to turn, over that of
        the equivalent sphere."""
        free = np.linalg.inv(self.resistance)[:2, :2]
        return 6.0 * math.pi * self.radius * np.linalg.eigvalsh(free)[::-1]

    @property
    def turning(self) -> float:
        """The mobility of turning freely, over that of the equivalent sphere."""
        return float(8.0 * math.pi * self.radius**3 * np.linalg.inv(self.resistance)[2, 2])

    @property
    def elongation(self) -> float:
        """B by which a strain turns it freely, Jeffery's (a² − b²)/(a² + b²) of an ellipse."""
        return float(np.hypot(*np.linalg.solve(self.resistance, self.strain)[2]))


def prism_drag(rings: Sequence[np.ndarray], depth: float | None = None) -> PrismDrag:
    """The PrismDrag of an outline, closed ``rings`` [(k, 2), …] in metres, outer ones and holes.

    ``depth`` [m]: by default 4/3 r_eq, with which the prism has the volume of the equivalent
    sphere. UsageError where the rings hold no area, or the depth none.
    """
    rings = [np.asarray(ring, dtype=float) for ring in rings]
    rings = [ring[:-1] if np.array_equal(ring[0], ring[-1]) else ring for ring in rings]
    # Where rings nest, a hole takes away what it holds.
    nested = [sum(inside_polygon(ring[:1], each)[0] for each in rings if each is not ring)
              for ring in rings]  # fmt: skip
    area = sum(abs(signed_area(ring)) * (-1.0) ** level
               for ring, level in zip(rings, nested, strict=True))  # fmt: skip
    if not 0.0 < area < math.inf:
        raise UsageError(f"an outline must hold an area above 0 m^2, found {area:.3g}")
    radius = math.sqrt(area / math.pi)
    height = 4.0 / 3.0 if depth is None else depth / radius
    if not 0.0 < height < math.inf:
        raise UsageError(f"the depth of a prism must be above 0 m, found {depth!r}")
    unit = [ring / radius for ring in rings]
    spacings, found = [], []
    perimeter = sum(np.sum(np.hypot(*(np.roll(ring, -1, axis=0) - ring).T)) for ring in unit)
    for count in SPHERES:
        spacings.append(math.sqrt((0.5 * height * perimeter + math.pi) / count))
        found.append(loads(surface(unit, height, spacings[-1]), RADIUS * spacings[-1]))
    # The line through the three, and those through two of them.
    spacing, values = np.array(spacings), np.reshape(found, (len(found), -1))
    lines = [np.polyfit(spacing[use], values[use], 1)[1] for use in ([0, 1, 2], [0, 1], [1, 2])]
    last, *others = (each.reshape(found[0].shape) for each in lines)
    error = max(np.max(np.abs(np.diag(each) / np.diag(last) - 1.0)) for each in others)
    powers = np.array([1.0, 1.0, 2.0])
    grown = radius ** (powers[:, None] + np.array([1.0, 1.0, 2.0, 2.0, 2.0]) - 1.0)
    whole = last * grown
    resistance = 0.5 * (whole[:, :3] + whole[:, :3].T)
    return PrismDrag(resistance, whole[:, 3:], float(error), radius)


def surface(rings: Sequence[np.ndarray], height: float, spacing: float) -> np.ndarray:
    """Places (k, 3) of spheres that cover the upper half of a prism: its wall, and a face."""
    walls = [along(ring, spacing) for ring in rings]
    # An even number: none lies in the middle.
    layers = 2 * max(1, round((height / spacing + 1.0) / 2.0))
    levels = np.linspace(-0.5 * height, 0.5 * height, layers)[layers // 2 :]
    wall = np.concatenate(walls)
    middle = wall.mean(axis=0)
    reach = float(np.max(np.hypot(*(wall - middle).T))) + spacing
    rows = np.arange(-reach, reach, spacing * math.sqrt(0.75))
    columns = np.arange(-reach, reach, spacing)
    shift = 0.5 * spacing * (np.arange(len(rows)) % 2)
    grid = np.column_stack([(columns + shift[:, None]).ravel(), np.repeat(rows, len(columns))])
    grid = middle + grid @ ACROSS
    grid = grid[inside_rings(grid, rings)]
    # Wall spheres are as dense as the spacing: the nearest is as far as the outline, nearly.
    gap = np.min(np.hypot(*(grid[:, None] - wall).T), axis=0) if len(grid) else np.empty(0)
    grid = grid[gap > LEAST_LAYER * spacing]
    return np.concatenate([
        np.column_stack([places, np.full(len(places), level)])
        for places, level in [*((wall, level) for level in levels), (grid, 0.5 * height)]
    ])  # fmt: skip


def along(ring: np.ndarray, spacing: float) -> np.ndarray:
    """Even points of a ring."""
    closed = np.vstack([ring, ring[:1]])
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(closed, axis=0).T)))
    count = max(3, round(way[-1] / spacing))
    places = (np.arange(count) + 0.5) * way[-1] / count
    return np.column_stack([np.interp(places, way, axis) for axis in closed.T])


def pushes(places: np.ndarray, others: np.ndarray, radius: float) -> np.ndarray:
    """(k, m, 3, 3): velocities of spheres by forces on others, all of one radius, viscosity 1."""
    apart = places[:, None] - others
    distance = np.linalg.norm(apart, axis=2)
    r = np.maximum(distance, 1e-9 * radius)
    outside = distance >= 2.0 * radius
    even = np.where(
        outside, (1.0 + 2.0 * radius**2 / (3.0 * r**2)) / (8.0 * math.pi * r),
        (1.0 - 9.0 * r / (32.0 * radius)) / (6.0 * math.pi * radius),
    )  # fmt: skip
    towards = np.where(
        outside, (1.0 - 2.0 * radius**2 / r**2) / (8.0 * math.pi * r**3),
        3.0 / (32.0 * radius * r) / (6.0 * math.pi * radius),
    )  # fmt: skip
    found = (towards[..., None] * apart)[..., None] * apart[..., None, :]
    found[..., range(3), range(3)] += even[..., None]
    return found


def loads(
    places: np.ndarray, radius: float, bodies: Any = None, centres: Any = ((0.0, 0.0),)
) -> np.ndarray:
    """(3 n, 3 n + 2): forces and torques on n bodies that v_x, v_y and the spin of each, and E_xx
    and E_xy, take, by unit viscosity.

    ``bodies`` (k,): to which of them the spheres belong, all to one by default, which turn about
    and are loaded at their ``centres`` (n, 2); the strain is about the origin.
    """
    from scipy.linalg import cho_factor, cho_solve

    count, mirror = len(places), np.array([1.0, 1.0, -1.0])
    matrix: Any = pushes(places, places, radius)
    matrix += pushes(places, places * mirror, radius) * mirror
    matrix = np.moveaxis(matrix, 2, 1).reshape(3 * count, 3 * count)
    x, y, _ = places.T
    none = np.zeros(count)
    motions = []
    for body, centre in enumerate(centres):
        own = np.ones(count) if bodies is None else np.where(bodies == body, 1.0, 0.0)
        motions += [
            (own, none, none), (none, own, none),
            (-own * (y - centre[1]), own * (x - centre[0]), none),
        ]  # fmt: skip
    whole = [*motions, (x, -y, none), (y, x, none)]
    wanted = np.stack([np.column_stack(each).ravel() for each in whole], axis=1)
    found = cho_solve(cho_factor(matrix, overwrite_a=True), wanted)
    return 2.0 * wanted[:, : len(motions)].T @ found


SLOW = 1e-2
"""β below which series take the place of differences that cancel."""


def drag_factor(radius, permeability):
    """2β²(1 − tanh β/β)/(2β² + 3(1 − tanh β/β)): the drag of a permeable sphere over that of a
    solid one; radius [m], permeability [m²] above 0."""
    beta = radius / math.sqrt(permeability)
    # 1 − tanh β/β of small β.
    less = beta * beta * (1.0 / 3.0 - 2.0 * beta * beta / 15.0)
    if beta > SLOW:
        less = 1.0 - math.tanh(beta) / beta
    return 2.0 * beta * beta * less / (2.0 * beta * beta + 3.0 * less)


def turning_factor(radius, permeability):
    """1 + 3/β² − 3 coth β/β: the same of the torque on one that turns."""
    beta = radius / math.sqrt(permeability)
    if beta < SLOW:
        return beta * beta / 15.0
    return 1.0 + 3.0 / (beta * beta) - 3.0 / (beta * math.tanh(beta))


def happel_permeability(grain: float, solid: float) -> float:
    """k [m²] of flocs of grains of a radius ``grain`` [m] that fill a share ``solid`` of them.

    k = 2 a²/(9 φ) · (3 − 4.5 φ^⅓ + 4.5 φ^(5/3) − 3 φ²)/(3 + 2 φ^(5/3)), by Happel's cell. For a
    floc that is a cluster of clusters, those are its grains, as water passes between them (Li and
    Logan). UsageError for a radius that is none, or a share that is not between 0 and 1.
    """
    if not 0.0 < grain < math.inf or not 0.0 < solid < 1.0:
        raise UsageError(
            "permeability is of grains of a radius above 0 m that fill a share between 0 and 1, "
            f"found {grain} m and {solid}"
        )
    third = solid ** (1.0 / 3.0)
    cell = 3.0 - 4.5 * third + 4.5 * third**5 - 3.0 * solid**2
    return 2.0 * grain**2 / (9.0 * solid) * cell / (3.0 + 2.0 * third**5)


def push(x, y, a, b):
    """(xx, xy, yy) [1/m]: what a force on a sphere of radius b does to one of radius a, which is
    (x, y) from it, in the plane, where both are of one rigid cluster."""
    sum_, less = a + b, abs(a - b)
    r = max(math.hypot(x, y), less, CENTRED * sum_)
    if r >= sum_:
        scale = 1.0 / (8.0 * math.pi * r)
        across = scale * (1.0 + (a * a + b * b) / (3.0 * r * r))
        more = scale * (1.0 - (a * a + b * b) / (r * r))
    else:
        scale = 1.0 / (6.0 * math.pi * a * b * 32.0 * r * r * r)
        across = scale * (16.0 * r * r * r * sum_ - (less * less + 3.0 * r * r) ** 2)
        more = scale * 3.0 * (less * less - r * r) ** 2
    near = min(1.0, sum_ / r) ** 3
    along = (across + more) * (1.0 - LESS_ALONG * near)
    across *= 1.0 - LESS_ACROSS * near
    more = (along - across) / (r * r)
    return across + more * x * x, more * x * y, across + more * y * y


def add_push(moved, one, other, found, of_one, of_other):
    """Add what two shares of a force do to each other's bodies, or cells, pushed by ``found``."""
    for k in range(3):
        moved[k, one] += found[k] * of_other
        moved[k, other] += found[k] * of_one


def pushed_by(c, cells, starts, grid, places, radii, own, shares, moved, sums):
    """``moved`` (3, n): xx, xy, yy of how fast shares of a force move the bodies of cluster c."""
    for one in range(cells[c], cells[c + 1]):
        for k in range(4):
            sums[k, one] = 0.0
        for i in range(starts[one], starts[one + 1]):
            sums[3, one] += shares[i]
            for k in range(3):
                moved[k, i] = own[k, i] * shares[i]
    for one in range(cells[c], cells[c + 1]):
        for other in range(cells[c], one + 1):
            if not are_near(grid, one, other):
                far = push(grid[one, 2] - grid[other, 2], grid[one, 3] - grid[other, 3], 0.0, 0.0)
                add_push(sums, one, other, far, sums[3, one], sums[3, other])
                continue
            for i in range(starts[one], starts[one + 1]):
                for j in range(starts[other], min(i, starts[other + 1])):
                    x, y = places[i, 0] - places[j, 0], places[i, 1] - places[j, 1]
                    near = push(x, y, radii[i], radii[j])
                    add_push(moved, i, j, near, shares[i], shares[j])
    for one in range(cells[c], cells[c + 1]):
        for i in range(starts[one], starts[one + 1]):
            for k in range(3):
                moved[k, i] += sums[k, one]


def are_near(grid, one, other):
    """Whether two cells of a grid are next to each other, or one: then all pairs of bodies count
    by themselves, others by those of cells."""
    return max(abs(grid[one, 0] - grid[other, 0]), abs(grid[one, 1] - grid[other, 1])) < 1.5


def mean_of(moved, i):
    """Of a body in the two directions."""
    return 0.5 * (moved[0, i] + moved[2, i])


def find_shares(c, cells, starts, grid, places, radii, own, scratch, moved, sums):
    """The shares of a force by which all bodies of cluster c move alike: conjugate gradients, by
    the drag of each, from shares that go by their radii."""
    shares, left, way = scratch[0], scratch[1], scratch[2]
    first, last = starts[cells[c]], starts[cells[c + 1]]
    for i in range(first, last):
        shares[i] = radii[i]
    pushed_by(c, cells, starts, grid, places, radii, own, shares, moved, sums)
    speed = total = size = alike = 0.0
    for i in range(first, last):
        speed += shares[i] * mean_of(moved, i)
        total += shares[i]
        alike += 1.0 / mean_of(own, i)
    for i in range(first, last):
        shares[i] *= total / speed
        left[i] = 1.0 - mean_of(moved, i) * total / speed
        way[i] = left[i] / mean_of(own, i)
        size += left[i] * way[i]
    for _ in range(MOST_CHANGES):
        if size <= SHARE_ERROR * SHARE_ERROR * alike:
            break
        pushed_by(c, cells, starts, grid, places, radii, own, way, moved, sums)
        against = 0.0
        for i in range(first, last):
            against += way[i] * mean_of(moved, i)
        before, size = size, 0.0
        for i in range(first, last):
            shares[i] += before / against * way[i]
            left[i] -= before / against * mean_of(moved, i)
            size += left[i] * left[i] / mean_of(own, i)
        for i in range(first, last):
            way[i] = left[i] / mean_of(own, i) + size / before * way[i]
    total = 0.0
    for i in range(first, last):
        total += shares[i]
    for i in range(first, last):
        shares[i] /= total


def cluster_mobilities(cells, starts, grid, places, radii, own, scratch, moved, sums, found):
    """``found`` (c, 3): (xx, xy, yy) [1/m], the velocity of a cluster by a force on it, over the
    viscosity.

    The cells of cluster c are those from ``cells[c]`` to before ``cells[c + 1]``, the bodies of
    cell k those from ``starts[k]`` to before ``starts[k + 1]``; ``grid`` (k, 4): column and row of
    a cell, and the middle of its bodies [m]. Of the bodies: ``places`` (n, 2) [m], whole across the
    seams of a box, ``radii`` [m] of the spheres that stand for them, ``own`` (3, n) [1/m], their
    mobilities alone. ``scratch`` and ``moved`` (3, n), ``sums`` (4, k).
    """
    shares = scratch[0]
    for c in range(cells.shape[0] - 1):
        find_shares(c, cells, starts, grid, places, radii, own, scratch, moved, sums)
        pushed_by(c, cells, starts, grid, places, radii, own, shares, moved, sums)
        for i in range(starts[cells[c]], starts[cells[c + 1]]):
            for k in range(3):
                found[c, k] += shares[i] * moved[k, i]


def mobilities(
    label: np.ndarray, places: np.ndarray, radii: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """(xx, xy, yy) (c, 3) [1/m], the velocity of each cluster by a force on it, viscosity 1.

    Of n bodies: ``label`` (n,) of their cluster, 0, 1, …, of which none is left out; ``places``
    (n, 2) [m], whole across the seams of a box; ``radii`` [m] of the spheres that stand for them;
    ``own`` (n, 3) [1/m], the mobility of each alone.

    Clusters of many bodies are cut into cells, as many as n^⅔ for a full one, and bodies of cells
    that are not next to each other push each other together: some n^(4/3) pushes in all.
    """
    count = np.bincount(label)
    order = np.argsort(label, kind="stable")
    first = np.append(0, np.cumsum(count)[:-1])
    low, high = (each.reduceat(places[order], first, axis=0) for each in (np.minimum, np.maximum))
    extent = (high - low).max(axis=1)
    side = np.where(count > FEW, extent / np.cbrt(count), 2.0 * extent + 1.0)
    cell = np.floor((places - low[label]) / side[label, None])
    order = np.lexsort((cell[:, 1], cell[:, 0], label))
    known = np.column_stack([label, cell])[order]
    starts = np.flatnonzero(np.r_[True, np.any(known[1:] != known[:-1], axis=1)])
    radii, places = radii[order], places[order]
    weight = np.add.reduceat(radii, starts)
    middle = np.add.reduceat(radii[:, None] * places, starts, axis=0) / weight[:, None]
    found = np.zeros((len(count), 3))
    compiled(cluster_mobilities, what="the drag of clusters")(
        np.searchsorted(known[starts, 0], np.arange(len(count) + 1)).astype(np.int64),
        np.append(starts, len(label)), np.hstack([known[starts, 1:], middle]), places, radii,
        own[order].T.copy(), *np.zeros((2, 3, len(label))), np.zeros((4, len(starts))), found,
    )  # fmt: skip
    return found
