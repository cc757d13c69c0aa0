"""Drag of rigid bodies in slow flow: a floc's outline, permeable spheres, clusters of bodies.

**Prism.** The surface of a prism of the outline is divided into flat panels with a constant force
on each (flocsim.hydrodynamics.panels). Three sizes of panels are extrapolated to zero, which also
estimates the error. Loads are averaged over the motions that bring the outline onto itself.

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

import attrs
import numpy as np

from flocsim.compiler.composer import compiled
from flocsim.errors import UsageError
from flocsim.geometry.shapes.cores import signed_area
from flocsim.geometry.shapes.outline import oriented, require_simple
from flocsim.hydrodynamics.panels import panels_of, rigid_loads

PANELS, FINER = 24, (1, 2, 4)
"""Approximate number of panels on half of the surface, and into how many each is divided, in both
directions, in three coverings."""

ORDERS = 1.09, 2.0
"""Powers of the size of panels in the error of the loads. The force is singular at edges, as their
distance to the power −.4555 at those of 90° (Moffatt 1964, J. Fluid Mech. 18, 1), so that the error
of the leading order is 2 (1 − .4555)."""

SECOND_ORDER = 0.42
"""Share of the term of second order in the coarsest covering that the stated error is at least: the
two coarser coverings would be extrapolated to so much less, or more, by the leading order alone."""

LEAST_CORRECTION = 0.25
"""Share of the extrapolated part of the loads that the stated error is at least."""

SYMMETRIC_WITHIN = 1e-6
"""Distance, in r_eq, within which vertices of an outline have to lie on others once it is turned or
mirrored."""

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
        Error estimate of any element of R over √(R_ii R_jj), and of Γ, where spin stands for a
        strain.
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
        If the rings enclose no area or cross themselves, or the depth is not positive.

    Notes
    -----
    Boundary elements (flocsim.hydrodynamics.panels), in three sizes that are extrapolated to zero.
    """
    if not 0.0 < (area := sum(abs(signed_area(np.asarray(ring))) for ring in rings)) < math.inf:
        raise UsageError(f"an outline must hold an area above 0 m^2, found {area:.3g}")
    for ring in rings:
        require_simple(ring)
    rings = oriented(rings)
    radius = math.sqrt(sum(map(signed_area, rings)) / math.pi)
    height = 4.0 / 3.0 if depth is None else depth / radius
    if not 0.0 < height < math.inf:
        raise UsageError(f"the depth of a prism must be above 0 m, found {depth!r}")
    # In units of r_eq about the middle of the vertices.
    middle = rings[0].mean(axis=0) / radius
    unit = [ring / radius - middle for ring in rings]
    perimeter = sum(np.sum(np.hypot(*(np.roll(ring, -1, axis=0) - ring).T)) for ring in unit)
    size = math.sqrt((0.5 * height * perimeter + math.pi) / PANELS)
    found = np.array([rigid_loads(panels_of(unit, height, size, finer)) for finer in FINER])
    found[:, :, :3] = 0.5 * (found[:, :, :3] + found[:, :, :3].swapaxes(1, 2))
    motions = symmetries(unit)
    found = np.mean([each[:3, :3] @ found @ each.T for each in motions], axis=0)
    # Extrapolated to panels of no size.
    terms = np.array([[1.0, *(finer**-order for order in ORDERS)] for finer in FINER])
    last, _, second = np.tensordot(np.linalg.inv(terms), found, 1)
    # Errors of elements over those of the diagonal; strains go with the spin.
    scale = np.sqrt(np.diag(last[:, :3]))
    differences = SECOND_ORDER * second, LEAST_CORRECTION * (found[-1] - last)
    error = np.max(np.abs(differences) / (scale[:, None] * scale[[0, 1, 2, 2, 2]]))
    # About the origin, and of the outline's size: R_ij and Γ_ij carry different powers of length.
    x, y = middle
    shift = np.eye(5)
    shift[:2, 2:] = [[-y, x, y], [x, -y, x]]
    powers = np.array([1.0, 1.0, 2.0, 2.0, 2.0])
    whole = shift[:3, :3].T @ last @ shift * radius ** (powers[:3, None] + powers - 1.0)
    return PrismDrag(whole[:, :3], whole[:, 3:], float(error), radius)


def symmetries(rings: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the motions that bring an outline about the origin onto itself, the identity first.

    Each as a matrix (5, 5) of (v_x, v_y, spin, E_xx, E_xy).
    """
    from scipy.linalg import block_diag
    from scipy.spatial import KDTree

    points, tree = np.concatenate(rings), KDTree(np.concatenate(rings))
    first, found = rings[0] @ [1.0, 1j], []
    for sign in (1.0, -1.0):
        # Mirrored at the x-axis, the outline runs the other way.
        image = first if sign > 0.0 else np.conj(first)[::-1]
        for shift in range(len(first)):
            turn = np.vdot(image, np.roll(first, shift))
            turn /= abs(turn) or 1.0
            if np.max(np.abs(turn * image - np.roll(first, shift))) > SYMMETRIC_WITHIN:
                continue
            # A strain turns by twice the angle.
            plane, strain = (
                np.array([[z.real, -z.imag], [z.imag, z.real]]) * [1.0, sign]
                for z in (turn, turn * turn)
            )
            if np.max(tree.query(points @ plane.T)[0]) < SYMMETRIC_WITHIN:
                found.append(block_diag(plane, sign, strain))
    return found


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
