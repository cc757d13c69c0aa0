"""Resistance and mobility of two spheres moving in the plane of their centres, and tables for runs.

Directions: n from 1 to 2, and t, n turned counter-clockwise; spins are counter-clockwise. The flow
is linear, u = u₀ + ω × x + E x. The load depends on the motion relative to the flow at the centres:
(force, torque) = −R (velocity − u, spin − ω) + Γ E.

For runs the resistance is tabulated as a sum of squares, split into common and relative motion.
Held together as one rigid body the two resist with A. Relative to each other, without a total load,
they resist with S. With W the rigid motions of the two, J their relative motion (rate of the gap,
sliding and difference of spins at the gap) and R of `SpherePair`,

    A = Wᵀ R W,  S⁻¹ = J R⁻¹ Jᵀ,  R = R W A⁻¹ Wᵀ R + Jᵀ S J.

A and its factors stay finite at contact; S contains lubrication. Both are positive definite, and
remain so if each is evaluated at a distance of its own. The tables contain factors, K of the first
term and L with S = L Lᵀ, so interpolated values stay positive as well:

    forces = −Kᵀ (K (v − u) − k E) − Jᵀ (L Lᵀ J v − t E),

where u is the flow at the centres and E its strain. t is the tension that a strain exerts on two
spheres held together. It is finite: it combines the relative flow and the resistance to it, each of
which diverges.
"""

import functools
import math

import attrs
import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import UsageError
from flocsim.hydrodynamics.two_spheres import TwoSpheres

SPHERES = (1, 2)
TOWARDS = {1: 1.0, 2: -1.0}
"""Sign of n in the direction from a sphere to the other one."""


def positive_gaps(gap: ArrayLike) -> np.ndarray:
    """Return gaps as an array (k,) [m]; raise UsageError unless all are positive."""
    found = np.atleast_1d(np.asarray(gap, dtype=float))
    if not np.all(found > 0.0):
        raise UsageError("the gap of two spheres in water must be above 0 m")
    return found


@attrs.frozen(slots=False)
class SpherePair:
    """Two spheres in a viscous fluid.

    Parameters
    ----------
    radii : (float, float)
        a₁, a₂ [m].
    viscosity : float
        µ [Pa s].

    Raises
    ------
    UsageError
        Unless radii and viscosity are positive.

    Notes
    -----
    All methods take gaps (k,) [m] above 0, r − a₁ − a₂.

    Sources: Jeffrey and Onishi (1984), Jeffrey (1992); signs as in Kim and Karrila (1991),
    Microhydrodynamics, ch. 7 and 11.
    """

    radii: tuple[float, float]
    viscosity: float = 1.0

    def __attrs_post_init__(self) -> None:
        given = (*self.radii, self.viscosity)
        if len(given) != 3 or not all(0.0 < each < math.inf for each in given):
            raise UsageError(
                "two spheres in water need two radii and a viscosity above 0, found "
                f"{self.radii} m and {self.viscosity} Pa s"
            )

    @functools.cached_property
    def functions(self) -> TwoSpheres:
        """Resistance functions for this ratio of radii."""
        first, second = self.radii
        return TwoSpheres(second / first)

    def scaled(self, family: str, power: int, on: int, of: int, gap: np.ndarray) -> np.ndarray:
        """Return a resistance function times its scale, π µ (a_on + a_of)^power (three times that
        for A)."""
        sum_ = self.radii[on - 1] + self.radii[of - 1]
        scale = math.pi * self.viscosity * sum_**power * (3.0 if family.endswith("A") else 1.0)
        return scale * self.functions.function(family, on, of, 2.0 * gap / sum(self.radii))

    def along(self, gap: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return the resistance to motion along the line of centres, n.

        Parameters
        ----------
        gap : (k,) float array
            Gap of the spheres [m], above 0.

        Returns
        -------
        resistance : (k, 2, 2) float array
            Force on each sphere per velocity of each along n [N s/m].
        strain : (k, 2) float array
            Force on each sphere per strain rate E_nn [N s].
        """
        gap = positive_gaps(gap)
        resistance, strain = np.empty((len(gap), 2, 2)), np.zeros((len(gap), 2))
        for on in SPHERES:
            for of in SPHERES:
                resistance[:, on - 1, of - 1] = self.scaled("XA", 1, on, of, gap)
                # By reciprocity the force on sphere `on` in a strain follows from the stresslets
                # that its motion causes.
                strain[:, on - 1] += TOWARDS[of] * self.scaled("XG", 2, of, on, gap)
        return resistance, strain

    def across(self, gap: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return the resistance to motion across the line of centres, along t, and to rotation.

        Parameters
        ----------
        gap : (k,) float array
            Gap of the spheres [m], above 0.

        Returns
        -------
        resistance : (k, 4, 4) float array
            Forces [N] on both spheres, then torques [N m], per velocity of each along t and per
            spin of each.
        strain : (k, 4) float array
            The same per strain rate E_nt.
        """
        gap = positive_gaps(gap)
        resistance, strain = np.empty((len(gap), 4, 4)), np.zeros((len(gap), 4))
        for on in SPHERES:
            for of in SPHERES:
                force, torque = on - 1, on + 1
                resistance[:, force, of - 1] = self.scaled("YA", 1, on, of, gap)
                turning = -TOWARDS[on] * self.scaled("YB", 2, on, of, gap)
                resistance[:, torque, of - 1] = resistance[:, of - 1, torque] = turning
                resistance[:, torque, of + 1] = self.scaled("YC", 3, on, of, gap)
                strain[:, force] += 2.0 * TOWARDS[of] * self.scaled("YG", 2, of, on, gap)
                strain[:, torque] += 2.0 * self.scaled("YH", 3, of, on, gap)
        return resistance, strain

    def relative(self, gap: ArrayLike) -> "Relative":
        """Return the relative motion of two spheres free of torques.

        Parameters
        ----------
        gap : (k,) float array
            Gap of the spheres [m], above 0.

        Returns
        -------
        Relative
            Functions of the gap, each with k values.
        """
        gap = positive_gaps(gap)
        distance = sum(self.radii) + gap
        along, stretch = self.along(gap)
        across, shear = self.across(gap)
        n = np.linalg.solve(along, np.dstack([np.broadcast_to(np.eye(2), along.shape), stretch]))
        loads = np.broadcast_to(np.eye(4)[:, :2], (len(gap), 4, 2))
        t = np.linalg.solve(across, np.dstack([loads, shear]))
        n, t = n[:, 1] - n[:, 0], t[:, 1] - t[:, 0]
        return Relative(n[:, :2], t[:, :2], -n[:, 2] / distance, -t[:, 2] / distance)

    def doublet(self, gap: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return the tension and the rotation of both spheres as one rigid body, free in a flow.

        Parameters
        ----------
        gap : (k,) float array
            Gap of the spheres [m], above 0.

        Returns
        -------
        tension : (k,) float array
            Force of the water that pulls the two apart along n, per strain rate E_nn [N s].
        elongation : (k,) float array
            B: the doublet rotates with ω_z + B E_nt, in a shear G with period 4π/(G √(1 − B²)).

        Notes
        -----
        Both have finite limits at contact: 12.23 πµa² and 0.594 for equal spheres.
        """
        gap = positive_gaps(gap)
        arm = 0.5 * (sum(self.radii) + gap)
        (along, stretch), (across, shear) = self.along(gap), self.across(gap)
        ones = np.ones_like(gap)
        # Loads on the spheres at rest in the strain: they move by (arm, −arm) relative to the flow.
        held = stretch - np.einsum("kij,kj->ki", along, np.stack([arm, -arm], axis=1))
        # Free of force: the doublet drifts such that the total force vanishes.
        drift = held.sum(axis=1) / along.sum(axis=(1, 2))
        tension = held[:, 1] - drift * along[:, 1].sum(axis=1)
        # Rigid motions of the pair across n: translation, and rotation about the middle.
        moves = np.stack([[ones, ones, 0 * ones, 0 * ones], [-arm, arm, ones, ones]]).T
        flow = np.stack([-arm, arm, 0 * ones, 0 * ones], axis=1)
        load = shear + np.einsum("kij,kj->ki", across, flow)
        whole = np.einsum("kia,kij,kjb->kab", moves, across, moves)
        turning = np.linalg.solve(whole, np.einsum("kia,ki->ka", moves, load)[..., None])
        return tension, turning[:, 1, 0]

    def alone(self, gap: ArrayLike) -> "Relative":
        """Return the relative motion of two spheres without hydrodynamic interaction.

        Parameters
        ----------
        gap : (k,) float array
            Gap of the spheres [m], above 0.

        Returns
        -------
        Relative
            Functions of the gap, each with k values.
        """
        gap = positive_gaps(gap)
        mobility = 1.0 / (6.0 * math.pi * self.viscosity * np.array(self.radii))
        driven = np.tile(mobility * [-1.0, 1.0], (len(gap), 1))
        return Relative(driven, driven, np.zeros(len(gap)), np.zeros(len(gap)))


@attrs.frozen
class Relative:
    """Relative mobility of sphere 2 against sphere 1, free of torques.

    Attributes
    ----------
    along, across : (k, 2) arrays
        Relative velocities along n and along t by unit forces on 1 and 2 [m/(N s)].
    stretch, shear : (k,) arrays
        A and B of Batchelor and Green (1972): in a flow the relative velocity is (E·r)_n (1 − A)
        along n and (E·r)_t (1 − B) + ω r along t.
    """

    along: np.ndarray
    across: np.ndarray
    stretch: np.ndarray
    shear: np.ndarray


COMMON = (
    "n_1", "n_2",  # K of velocities along n
    "a_v1", "a_v2", "a_w1", "a_w2",  # and across, first row, of velocities and spins
    "b_v1", "b_v2", "b_w1", "b_w2",  # second row
    "k_n", "k_a", "k_b",  # k of E_nn; of E_nt
)  # fmt: skip
"""Columns of common motion."""

RELATIVE = (
    "gap",  # L of the rate of the gap
    "slide", "mixed", "turn",  # of sliding, and of the difference of spins
    "t_n", "t_t", "t_s",  # t of E_nn, and of E_nt: tension, shear, torque
)  # fmt: skip
"""Columns of relative motion."""

COLUMNS = (*COMMON, *RELATIVE)

HALF, WHOLE_M, FORCE, TORQUE = (0.5, 0.5), (0.5, 1.5), (1.0, 2.0), (1.0, 3.0)
POWERS = {
    **dict.fromkeys(COLUMNS, HALF),
    **dict.fromkeys(
        ("a_w1", "a_w2", "b_w1", "b_w2", "k_n", "k_a", "k_b", "mixed", "turn"), WHOLE_M
    ),
    **dict.fromkeys(("t_n", "t_t"), FORCE),
    "t_s": TORQUE,
}
"""{column: powers of the viscosity and of the mean radius with which it scales}."""

NEAREST, FARTHEST, NODES_A_DECADE = 1e-7, 200.0, 12
"""Smallest and largest tabulated gap over the mean radius, and nodes per decade: cubics between the
nodes are right to 1e-5."""

NODES_A_UNIT = NODES_A_DECADE / math.log(10.0)
"""Nodes per unit of ln(gap over the mean radius), from NEAREST on."""

NODES = 1 + math.ceil(math.log(FARTHEST / NEAREST) * NODES_A_UNIT)

LARGEST_RATIO, HALF_NODES = 50.0, 48
"""Largest ratio of radii, and number of nodes of its logarithm from 1 to there; interpolation is
cubic."""

EXCHANGED_COLUMNS = (
    ("n_1", "n_2"),
    ("a_v1", "a_v2"),
    ("a_w1", "a_w2"),
    ("b_v1", "b_v2"),
    ("b_w1", "b_w2"),
)
NEGATED_COLUMNS = "a_w1", "a_w2", "b_v1", "b_v2", "k_n", "k_a", "mixed", "t_s"
"""Columns to exchange, and columns that change sign, if spheres 1 and 2 are exchanged and n and t
reversed."""


def columns_at(pair: SpherePair, gap: np.ndarray) -> np.ndarray:
    """Return the columns (k, columns) for two spheres at gaps (k,) [m]; SI units."""
    (along, stretch), (across, shear) = pair.along(gap), pair.across(gap)
    ones, none = np.ones_like(gap), np.zeros_like(gap)
    arm_1, arm_2 = (radius + 0.5 * gap for radius in pair.radii)
    half = 0.5 * (arm_1 + arm_2)

    def rows(*each: list) -> np.ndarray:
        return np.moveaxis(np.array(each), -1, 0)

    # Motion along n: common translation; approach; the flow at the centres for E_nn = 1.
    n = split(along, stretch, rows([ones, ones]), rows([-ones, ones]), rows([-half, half])[:, 0])
    # Motion across n: translation and rotation; sliding at the middle of the gap and relative spin.
    t = split(
        across, shear,
        rows([ones, ones, none, none], [-arm_1, arm_2, ones, ones]),
        rows([-ones, ones, -arm_1, -arm_2], [none, none, -ones, ones]),
        rows([-half, half, none, none])[:, 0],
    )  # fmt: skip
    (k_n, load_n, l_n, pull_n), (k_t, load_t, l_t, pull_t) = n, t
    sliding = np.stack([l_t[:, 0, 0], l_t[:, 1, 0], l_t[:, 1, 1]], axis=1)
    common = k_n[:, 0], k_t[:, 0], k_t[:, 1], load_n, load_t
    return np.concatenate([*common, l_n[:, 0], sliding, pull_n, pull_t], axis=1)


def split(
    resistance: np.ndarray, strain: np.ndarray, rigid: np.ndarray, relative: np.ndarray,
    flow: np.ndarray,
) -> tuple[np.ndarray, ...]:  # fmt: skip
    """Return (K, k, L, t) from R (k, m, m), Γ (k, m), W and J.

    ``rigid`` and ``relative``: rows of W and J (k, …, m); ``flow``: velocity of the centres in a
    unit strain (k, m).
    """
    # Load on spheres at rest in the strain.
    held = strain + np.einsum("kij,kj->ki", resistance, flow)
    weighted = rigid @ resistance
    # A = F Fᵀ, K = F⁻¹ Wᵀ R, k = F⁻¹ Wᵀ Γ: then Kᵀ K = R W A⁻¹ Wᵀ R.
    factor = np.linalg.cholesky(weighted @ np.swapaxes(rigid, 1, 2))
    loads = np.einsum("kij,kj->ki", rigid, strain)
    common = np.linalg.solve(factor, np.dstack([weighted, loads]))
    responses = np.linalg.solve(resistance, np.dstack([np.swapaxes(relative, 1, 2), held]))
    # S = (J R⁻¹ Jᵀ)⁻¹, and the tension t = S J R⁻¹ (load).
    relative_resistance = np.linalg.inv(relative @ responses[..., :-1])
    tension = np.einsum("kij,kj->ki", relative_resistance @ relative, responses[..., -1])
    return common[..., :-1], common[..., -1], np.linalg.cholesky(relative_resistance), tension


def ratio_node(place: int) -> np.ndarray:
    """Return (NODES, columns) at a node of the ratio, r₂/r₁ = 50^(place/HALF_NODES).

    For a mean radius and a viscosity of 1.
    """
    return columns_at(
        SpherePair(node_radii(place)), NEAREST * np.exp(np.arange(NODES) / NODES_A_UNIT)
    )


def node_radii(place: int) -> tuple[float, float]:
    """Return the radii, with a mean of 1, at a node of the ratio."""
    ratio = LARGEST_RATIO ** (place / HALF_NODES)
    return 2.0 / (1.0 + ratio), 2.0 * ratio / (1.0 + ratio)


def exchanged(values: np.ndarray) -> np.ndarray:
    """Return the columns (…, columns) of the same two spheres with their numbers exchanged."""
    order, sign = list(range(len(COLUMNS))), np.ones(len(COLUMNS))
    for pair in EXCHANGED_COLUMNS:
        one, other = map(COLUMNS.index, pair)
        order[one], order[other] = other, one
    sign[[COLUMNS.index(name) for name in NEGATED_COLUMNS]] = -1.0
    return values[..., order] * sign


@functools.lru_cache(maxsize=256)
def interpolation_weights(ratio: float) -> tuple[tuple[int, float], ...]:
    """Return ((node, weight), …) of Lagrange interpolation for a ratio of radii.

    A ratio at a node has this node alone.
    """
    place = HALF_NODES * math.log(ratio) / math.log(LARGEST_RATIO)
    if abs(place - round(place)) < 1e-9:
        return ((round(place), 1.0),)
    first = min(max(math.floor(place) - 1, -HALF_NODES), HALF_NODES - 3)
    nodes = range(first, first + 4)
    return tuple(
        (one, math.prod((place - other) / (one - other) for other in nodes if other != one))
        for one in nodes
    )


def cubics(values: np.ndarray) -> np.ndarray:
    """Return cubic spline coefficients (intervals, columns, 4), constant first, in shares of an
    interval."""
    from scipy.interpolate import CubicSpline

    found = CubicSpline(np.arange(len(values)), values)
    return np.ascontiguousarray(np.moveaxis(found.c[::-1], 0, -1))


def scales(viscosity: float, mean_radius: float) -> np.ndarray:
    """Return the factors (columns,) from a mean radius and viscosity of 1 to the given ones."""
    powers = np.array([POWERS[name] for name in COLUMNS])
    return viscosity ** powers[:, 0] * mean_radius ** powers[:, 1]
