"""Drag of rigid bodies in slow flow: a floc's outline, permeable spheres, clusters of bodies.

**Prism.** A prism of the outline is covered by small spheres that move as one rigid body. Their
mobility is the Rotne–Prager–Yamakawa tensor; the forces on them follow from one linear system
(rigid multiblob). Because the spheres protrude from the surface, the body is too large by a share
of their spacing. Three spacings are extrapolated to zero, which also estimates the error. Motion is
in the plane, so half of the surface suffices.

Sources: H. Yamakawa (1970), J. Chem. Phys. 53, 436 (with overlaps: E. Wajnryb et al. 2013, J. Fluid
Mech. 731, R3); S. Delong et al. (2015), Commun. Appl. Math. Comput. Sci. 11, 217.

**Permeable sphere.** Brinkman's equation inside a sphere of radius a and permeability k, Stokes's
outside; β = a/√k.

Sources: H. C. Brinkman (1949), Appl. Sci. Res. A 1, 27; G. Neale, N. Epstein and W. Nader (1973),
Chem. Eng. Sci. 28, 1865; rotation: B. U. Felderhof and J. M. Deutch (1975), J. Chem. Phys. 62,
2391; permeability: J. Happel (1958), AIChE J. 4, 197, for flocs X. Li and B. E. Logan (2001), Water
Res. 35, 3373.

**Cluster.** Each body carries a share of the force on a cluster and moves the others by the same
tensor, represented by the sphere with its drag (Kirkwood and Riseman). The shares are those with
which all bodies move alike, averaged over two directions; they minimise the dissipation. For
touching spheres that move as one the tensor overestimates the interaction, because neither yields
to the flow of the other. It is reduced by the exact amount for two equal spheres, decaying with the
cube of the distance. `mobilities` is the entry point; the kernels are plain functions on scalars
and arrays.

Sources: J. G. Kirkwood and J. Riseman (1948), J. Chem. Phys. 16, 565; unequal and overlapping
spheres: P. J. Zuk et al. (2014), J. Fluid Mech. 741, R5; two touching spheres: D. J. Jeffrey and Y.
Onishi (1984), J. Fluid Mech. 139, 261.
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
"""Approximate numbers of spheres on half of the surface: three coverings for the extrapolation."""

SPHERE_RADIUS = 0.5
"""Radius of a sphere over their spacing."""

LEAST_FACE_DISTANCE = 0.6
"""Smallest distance of spheres on the faces from those of the wall, in spacings."""


GRID_ROTATION = np.array([[math.cos(0.3), math.sin(0.3)], [-math.sin(0.3), math.cos(0.3)]])
"""Rotation of the grid on a face, so that its rows are parallel to no straight side, where the
distance of the first row would matter."""

ALL_PAIRS_UP_TO = 100
"""Number of bodies up to which all pairs of a cluster interact individually."""

RIGID_REDUCTION_ALONG, RIGID_REDUCTION_ACROSS = 0.120, 0.1315
"""Relative reduction of the tensor for two equal touching spheres, along the line of centres and
across."""

LEAST_DISTANCE = 1e-6
"""Centres closer than this share of the sum of radii count as that far apart."""

SHARE_ERROR, MOST_ITERATIONS = 0.03, 30
"""Shares are accepted when bodies move alike to this relative error, or after so many iterations;
the mobility is then right to 1 %."""


@attrs.frozen(eq=False)
class PrismDrag:
    """Resistance of a rigid prism to motion in its plane, in slow flow of viscosity 1, about the
    origin.

    Attributes
    ----------
    resistance : (3, 3) array
        R [m, m², m³], symmetric and positive definite, for (v_x, v_y, spin).
    strain : (3, 2) array
        Γ [m², m³] for E_xx = −E_yy and E_xy.
    error : float
        Relative error estimate.
    radius : float
        r_eq of the outline [m].

    Notes
    -----
    With viscosity µ the load is (f_x, f_y, torque) = −µ R (v − u, ω − Ω) + µ Γ (E_xx, E_xy), with u
    and Ω of the flow at the origin.
    """

    resistance: np.ndarray
    strain: np.ndarray
    error: float
    radius: float

    @property
    def mobility(self) -> np.ndarray:
        """Translational mobilities in the plane (2,), the larger first, over that of the equivalent
        sphere.

        The body is free to rotate.
        """
        free = np.linalg.inv(self.resistance)[:2, :2]
        return 6.0 * math.pi * self.radius * np.linalg.eigvalsh(free)[::-1]

    @property
    def turning(self) -> float:
        """Rotational mobility of the free body over that of the equivalent sphere."""
        return float(8.0 * math.pi * self.radius**3 * np.linalg.inv(self.resistance)[2, 2])

    @property
    def elongation(self) -> float:
        """B in the free rotation by a strain, Jeffery's (a² − b²)/(a² + b²) for an ellipse."""
        return float(np.hypot(*np.linalg.solve(self.resistance, self.strain)[2]))


def prism_drag(rings: Sequence[np.ndarray], depth: float | None = None) -> PrismDrag:
    """Return the in-plane Stokes resistance of a prism with this cross-section.

    Parameters
    ----------
    rings : list of (k, 2) arrays
        Outline and holes [m]; a repeated end point is ignored.
    depth : float, optional
        Extent in the third direction [m]; by default 4/3 r_eq, which gives the volume of the
        equivalent sphere.

    Returns
    -------
    PrismDrag

    Raises
    ------
    UsageError
        If the rings enclose no area, or the depth is not positive.

    Notes
    -----
    Rigid multiblob; sources at the top of the module. Three coverings are extrapolated to zero
    spacing.
    """
    rings = [np.asarray(ring, dtype=float) for ring in rings]
    rings = [ring[:-1] if np.array_equal(ring[0], ring[-1]) else ring for ring in rings]
    # Nested rings: an odd level of nesting is a hole.
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
    # Three coverings in units of r_eq, with spacings h ∝ count^(−1/2).
    for count in SPHERES:
        spacings.append(math.sqrt((0.5 * height * perimeter + math.pi) / count))
        found.append(rigid_loads(surface(unit, height, spacings[-1]), SPHERE_RADIUS * spacings[-1]))
    # The error is linear in h: fit lines and take their values at h = 0. Lines through two of the
    # points give the error estimate.
    spacing, values = np.array(spacings), np.reshape(found, (len(found), -1))
    lines = [np.polyfit(spacing[use], values[use], 1)[1] for use in ([0, 1, 2], [0, 1], [1, 2])]
    last, *others = (each.reshape(found[0].shape) for each in lines)
    error = max(np.max(np.abs(np.diag(each) / np.diag(last) - 1.0)) for each in others)
    powers = np.array([1.0, 1.0, 2.0])
    # Scale back to the size of the outline: R_ij and Γ_ij carry different powers of length.
    grown = radius ** (powers[:, None] + np.array([1.0, 1.0, 2.0, 2.0, 2.0]) - 1.0)
    whole = last * grown
    resistance = 0.5 * (whole[:, :3] + whole[:, :3].T)
    return PrismDrag(resistance, whole[:, 3:], float(error), radius)


def surface(rings: Sequence[np.ndarray], height: float, spacing: float) -> np.ndarray:
    """Return positions (k, 3) of spheres that cover the upper half of a prism: its wall, and a
    face."""
    walls = [along(ring, spacing) for ring in rings]
    # An even number of layers: none lies in the mid-plane.
    layers = 2 * max(1, round((height / spacing + 1.0) / 2.0))
    levels = np.linspace(-0.5 * height, 0.5 * height, layers)[layers // 2 :]
    wall = np.concatenate(walls)
    middle = wall.mean(axis=0)
    reach = float(np.max(np.hypot(*(wall - middle).T))) + spacing
    # Hexagonal grid on the face.
    rows = np.arange(-reach, reach, spacing * math.sqrt(0.75))
    columns = np.arange(-reach, reach, spacing)
    shift = 0.5 * spacing * (np.arange(len(rows)) % 2)
    grid = np.column_stack([(columns + shift[:, None]).ravel(), np.repeat(rows, len(columns))])
    grid = middle + grid @ GRID_ROTATION
    grid = grid[inside_rings(grid, rings)]
    # The wall spheres are dense, so their distance approximates that from the outline.
    gap = np.min(np.hypot(*(grid[:, None] - wall).T), axis=0) if len(grid) else np.empty(0)
    grid = grid[gap > LEAST_FACE_DISTANCE * spacing]
    return np.concatenate([
        np.column_stack([places, np.full(len(places), level)])
        for places, level in [*((wall, level) for level in levels), (grid, 0.5 * height)]
    ])  # fmt: skip


def along(ring: np.ndarray, spacing: float) -> np.ndarray:
    """Return evenly spaced points of a ring."""
    closed = np.vstack([ring, ring[:1]])
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(closed, axis=0).T)))
    count = max(3, round(way[-1] / spacing))
    places = (np.arange(count) + 0.5) * way[-1] / count
    return np.column_stack([np.interp(places, way, axis) for axis in closed.T])


def mobility_tensors(places: np.ndarray, others: np.ndarray, radius: float) -> np.ndarray:
    """Return the mobility tensors (k, m, 3, 3) of equal spheres at unit viscosity (RPY)."""
    apart = places[:, None] - others
    distance = np.linalg.norm(apart, axis=2)
    r = np.maximum(distance, 1e-9 * radius)
    outside = distance >= 2.0 * radius
    # Coefficients of the identity and of r r, for separate and for overlapping spheres.
    identity_part = np.where(
        outside, (1.0 + 2.0 * radius**2 / (3.0 * r**2)) / (8.0 * math.pi * r),
        (1.0 - 9.0 * r / (32.0 * radius)) / (6.0 * math.pi * radius),
    )  # fmt: skip
    outer_part = np.where(
        outside, (1.0 - 2.0 * radius**2 / r**2) / (8.0 * math.pi * r**3),
        3.0 / (32.0 * radius * r) / (6.0 * math.pi * radius),
    )  # fmt: skip
    tensors = (outer_part[..., None] * apart)[..., None] * apart[..., None, :]
    tensors[..., range(3), range(3)] += identity_part[..., None]
    return tensors


def rigid_loads(
    places: np.ndarray, radius: float, bodies: Any = None, centres: Any = ((0.0, 0.0),)
) -> np.ndarray:
    """Return (3 n, 3 n + 2): forces and torques on n bodies for unit motions and strains, viscosity
    1.

    The columns are v_x, v_y and spin of each body, then E_xx and E_xy. ``bodies`` (k,): body of
    each sphere, by default all of one; torques and rotations are about their ``centres`` (n, 2),
    the strain about the origin.
    """
    from scipy.linalg import cho_factor, cho_solve

    count, mirror = len(places), np.array([1.0, 1.0, -1.0])
    matrix: Any = mobility_tensors(places, places, radius)
    # Mirror images below the mid-plane move alike in the plane.
    matrix += mobility_tensors(places, places * mirror, radius) * mirror
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
    # Velocities of the spheres for each unit motion; forces follow from the mobility matrix.
    wanted = np.stack([np.column_stack(each).ravel() for each in whole], axis=1)
    found = cho_solve(cho_factor(matrix, overwrite_a=True), wanted)
    return 2.0 * wanted[:, : len(motions)].T @ found


SMALL_BETA = 1e-2
"""β below which series replace differences that cancel."""


def drag_factor(radius, permeability):
    """Return the drag of a permeable sphere over that of a solid one.

    2β²(1 − tanh β/β)/(2β² + 3(1 − tanh β/β)), β = radius/√permeability; radius [m], permeability
    [m²] above 0.
    """
    beta = radius / math.sqrt(permeability)
    # 1 − tanh β/β for small β, by its series.
    less = beta * beta * (1.0 / 3.0 - 2.0 * beta * beta / 15.0)
    if beta > SMALL_BETA:
        less = 1.0 - math.tanh(beta) / beta
    return 2.0 * beta * beta * less / (2.0 * beta * beta + 3.0 * less)


def turning_factor(radius, permeability):
    """Return the torque on a rotating permeable sphere over that on a solid one: 1 + 3/β² − 3 coth
    β/β."""
    beta = radius / math.sqrt(permeability)
    if beta < SMALL_BETA:
        return beta * beta / 15.0
    return 1.0 + 3.0 / (beta * beta) - 3.0 / (beta * math.tanh(beta))


def happel_permeability(grain: float, solid: float) -> float:
    """Return the permeability k [m²] of a floc of grains, by Happel's cell model.

    Parameters
    ----------
    grain : float
        Radius a of the grains [m]. In a cluster of clusters these are the clusters, as water passes
        between them (Li and Logan).
    solid : float
        Volume fraction φ of the grains.

    Returns
    -------
    float
        k [m²].

    Raises
    ------
    UsageError
        For a radius that is not positive, or a fraction not between 0 and 1.

    Notes
    -----
    k = 2 a²/(9 φ) · (3 − 4.5 φ^⅓ + 4.5 φ^(5/3) − 3 φ²)/(3 + 2 φ^(5/3)); Happel (1958).
    """
    if not 0.0 < grain < math.inf or not 0.0 < solid < 1.0:
        raise UsageError(
            "permeability needs a grain radius above 0 m and a solid fraction between 0 and 1, "
            f"found {grain} m and {solid}"
        )
    third = solid ** (1.0 / 3.0)
    cell = 3.0 - 4.5 * third + 4.5 * third**5 - 3.0 * solid**2
    return 2.0 * grain**2 / (9.0 * solid) * cell / (3.0 + 2.0 * third**5)


def pair_mobility(x, y, a, b):
    """Return the mobility (xx, xy, yy) [1/m] of a sphere of radius a by a force on one of radius b.

    Both belong to one rigid cluster; (x, y) is the vector between them [m]; viscosity 1.
    """
    sum_, less = a + b, abs(a - b)
    r = max(math.hypot(x, y), less, LEAST_DISTANCE * sum_)
    # RPY tensor of unequal spheres (Zuk et al. 2014), separate or overlapping.
    if r >= sum_:
        scale = 1.0 / (8.0 * math.pi * r)
        across = scale * (1.0 + (a * a + b * b) / (3.0 * r * r))
        more = scale * (1.0 - (a * a + b * b) / (r * r))
    else:
        scale = 1.0 / (6.0 * math.pi * a * b * 32.0 * r * r * r)
        across = scale * (16.0 * r * r * r * sum_ - (less * less + 3.0 * r * r) ** 2)
        more = scale * 3.0 * (less * less - r * r) ** 2
    # Reduction for spheres that move as one.
    near = min(1.0, sum_ / r) ** 3
    along = (across + more) * (1.0 - RIGID_REDUCTION_ALONG * near)
    across *= 1.0 - RIGID_REDUCTION_ACROSS * near
    more = (along - across) / (r * r)
    return across + more * x * x, more * x * y, across + more * y * y


def add_pair_velocities(velocities, one, other, mobility, of_one, of_other):
    """Add the velocities that two forces cause on each other's bodies, or cells, by a mobility
    ``mobility``."""
    for k in range(3):
        velocities[k, one] += mobility[k] * of_other
        velocities[k, other] += mobility[k] * of_one


def cluster_velocities(c, cells, starts, grid, places, radii, own, shares, velocities, sums):
    """Write to ``velocities`` (3, n) the velocities (xx, xy, yy) of the bodies of cluster c by the
    shares."""
    for one in range(cells[c], cells[c + 1]):
        # Own mobility, and the total share of each cell.
        for k in range(4):
            sums[k, one] = 0.0
        for i in range(starts[one], starts[one + 1]):
            sums[3, one] += shares[i]
            for k in range(3):
                velocities[k, i] = own[k, i] * shares[i]
    for one in range(cells[c], cells[c + 1]):
        for other in range(cells[c], one + 1):
            # Distant cells interact as points, near ones body by body.
            if not are_near(grid, one, other):
                far = pair_mobility(
                    grid[one, 2] - grid[other, 2], grid[one, 3] - grid[other, 3], 0.0, 0.0
                )
                add_pair_velocities(sums, one, other, far, sums[3, one], sums[3, other])
                continue
            for i in range(starts[one], starts[one + 1]):
                for j in range(starts[other], min(i, starts[other + 1])):
                    x, y = places[i, 0] - places[j, 0], places[i, 1] - places[j, 1]
                    near = pair_mobility(x, y, radii[i], radii[j])
                    add_pair_velocities(velocities, i, j, near, shares[i], shares[j])
    for one in range(cells[c], cells[c + 1]):
        for i in range(starts[one], starts[one + 1]):
            for k in range(3):
                velocities[k, i] += sums[k, one]


def are_near(grid, one, other):
    """Return True if two cells are neighbours or the same: their bodies then interact
    individually."""
    return max(abs(grid[one, 0] - grid[other, 0]), abs(grid[one, 1] - grid[other, 1])) < 1.5


def mean_velocity(velocities, i):
    """Return the mean of a body's velocity over the two directions."""
    return 0.5 * (velocities[0, i] + velocities[2, i])


def find_shares(
    c, cells, starts, grid, places, radii, own, shares, residual, search, velocities, sums
):
    """Write the shares of a force with which all bodies of cluster c move alike.

    Conjugate gradients, preconditioned by the mobility of each body alone, from shares in
    proportion to the radii.
    """
    first, last = starts[cells[c]], starts[cells[c + 1]]
    for i in range(first, last):
        shares[i] = radii[i]
    cluster_velocities(c, cells, starts, grid, places, radii, own, shares, velocities, sums)
    # Initial shares, scaled to a mean velocity of 1; ``search``: the direction searched along.
    speed = total = residual_norm = scale = 0.0
    for i in range(first, last):
        speed += shares[i] * mean_velocity(velocities, i)
        total += shares[i]
        scale += 1.0 / mean_velocity(own, i)
    for i in range(first, last):
        shares[i] *= total / speed
        residual[i] = 1.0 - mean_velocity(velocities, i) * total / speed
        search[i] = residual[i] / mean_velocity(own, i)
        residual_norm += residual[i] * search[i]
    for _ in range(MOST_ITERATIONS):
        if residual_norm <= SHARE_ERROR * SHARE_ERROR * scale:
            break
        cluster_velocities(c, cells, starts, grid, places, radii, own, search, velocities, sums)
        # One iteration of conjugate gradients: step along ``search``, new residual, conjugate
        # direction.
        curvature = 0.0
        for i in range(first, last):
            curvature += search[i] * mean_velocity(velocities, i)
        before, residual_norm = residual_norm, 0.0
        for i in range(first, last):
            shares[i] += before / curvature * search[i]
            residual[i] -= before / curvature * mean_velocity(velocities, i)
            residual_norm += residual[i] * residual[i] / mean_velocity(own, i)
        for i in range(first, last):
            search[i] = residual[i] / mean_velocity(own, i) + residual_norm / before * search[i]
    total = 0.0
    for i in range(first, last):
        total += shares[i]
    for i in range(first, last):
        shares[i] /= total


def cluster_mobilities(
    cells, starts, grid, places, radii, own, shares, residual, search, velocities, sums, found
):
    """Write to ``found`` (c, 3) the mobilities (xx, xy, yy) [1/m] of clusters, over the viscosity.

    Cells of cluster c are ``cells[c]`` to ``cells[c + 1]``, bodies of cell k ``starts[k]`` to
    ``starts[k + 1]``; ``grid`` (k, 4): column and row of a cell, and the mean position of its
    bodies [m]. Of the bodies: ``places`` (n, 2) [m], unwrapped across periodic boundaries,
    ``radii`` [m] of the spheres that represent them, ``own`` (3, n) [1/m], their mobilities
    alone. Scratch: ``shares``, ``residual`` and ``search`` (n,), ``velocities`` (3, n), ``sums``
    (4, k).
    """
    for c in range(cells.shape[0] - 1):
        find_shares(
            c, cells, starts, grid, places, radii, own, shares, residual, search, velocities, sums
        )
        cluster_velocities(c, cells, starts, grid, places, radii, own, shares, velocities, sums)
        for i in range(starts[cells[c]], starts[cells[c + 1]]):
            for k in range(3):
                found[c, k] += shares[i] * velocities[k, i]


def mobilities(
    label: np.ndarray, places: np.ndarray, radii: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """Return the mobility (xx, xy, yy) (c, 3) [1/m] of each cluster, at viscosity 1.

    ``label`` (n,): cluster of each body, 0, 1, … without gaps; ``places`` (n, 2) [m], unwrapped
    across periodic boundaries; ``radii`` [m] of the spheres that represent the bodies; ``own`` (n,
    3) [1/m], the mobility of each alone.

    Clusters of many bodies are divided into cells, n^⅔ for a full one. Bodies of cells that are not
    neighbours interact through their cells: some n^(4/3) interactions in all.
    """
    count = np.bincount(label)
    order = np.argsort(label, kind="stable")
    first = np.append(0, np.cumsum(count)[:-1])
    low, high = (each.reduceat(places[order], first, axis=0) for each in (np.minimum, np.maximum))
    extent = (high - low).max(axis=1)
    # Cell size per cluster; few bodies form a single cell.
    side = np.where(count > ALL_PAIRS_UP_TO, extent / np.cbrt(count), 2.0 * extent + 1.0)
    cell = np.floor((places - low[label]) / side[label, None])
    order = np.lexsort((cell[:, 1], cell[:, 0], label))
    known = np.column_stack([label, cell])[order]
    starts = np.flatnonzero(np.r_[True, np.any(known[1:] != known[:-1], axis=1)])
    radii, places = radii[order], places[order]
    weight = np.add.reduceat(radii, starts)
    # Cells are centred at the mean of their bodies, weighted by radii.
    middle = np.add.reduceat(radii[:, None] * places, starts, axis=0) / weight[:, None]
    found = np.zeros((len(count), 3))
    compiled(cluster_mobilities, what="the drag of clusters")(
        np.searchsorted(known[starts, 0], np.arange(len(count) + 1)).astype(np.int64),
        np.append(starts, len(label)), np.hstack([known[starts, 1:], middle]), places, radii,
        own[order].T.copy(), *np.zeros((3, len(label))), np.zeros((3, len(label))),
        np.zeros((4, len(starts))), found,
    )  # fmt: skip
    return found
