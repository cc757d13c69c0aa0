"""Two spheres in the plane of their centres: what their motion and a flow's strain do to them.

Directions are n, from 1 to 2, and t, n turned counter-clockwise; spins are counter-clockwise. The
flow is linear, u = u₀ + ω × x + E x, and what the spheres feel follows from what they do against it
at their centres: (force, torque) = −R (velocity − u, spin − ω) + Γ E.

For runs the resistance is a sum of squares, in tables: common motion, relative motion.

Held together as one rigid body the two resist with A; against each other, while nothing is put on
them together, with S. With W the rigid motions of the two, J their relative motion (the rate of the
gap; sliding and the difference of spins, where the gap is) and R of `SpherePair`,

    A = Wᵀ R W,  S⁻¹ = J R⁻¹ Jᵀ,  R = R W A⁻¹ Wᵀ R + Jᵀ S J.

A and what belongs to it stay finite at touch, S is what lubrication is in. Both are positive, and
stay so where each is taken at a distance of its own. Tables hold factors K, A⁻¹ being made of them,
and L, S = L Lᵀ, so that interpolating leaves them positive, too:

    forces = −Kᵀ (K (v − u) − k E) − Jᵀ (L Lᵀ J v − t E),

u being the flow at the centres and E its strain. t is what a strain pulls at the two with while
they are held together, and finite: the flow against them and the resistance to it, each of which
diverges, are in it together.
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
"""The sign of n along which a sphere sees the other."""


def apart(gap: ArrayLike) -> np.ndarray:
    """Gaps (k,) [m]; UsageError unless all are above 0."""
    found = np.atleast_1d(np.asarray(gap, dtype=float))
    if not np.all(found > 0.0):
        raise UsageError("two spheres in water are known at gaps above 0 m")
    return found


@attrs.frozen(slots=False)
class SpherePair:
    """Two spheres of the radii ``radii`` (a₁, a₂) [m] in a fluid of ``viscosity`` µ [Pa s].

    All methods take gaps (k,) [m] above 0, r − a₁ − a₂. Source: Jeffrey and Onishi (1984), Jeffrey
    (1992); signs as in Kim and Karrila (1991), Microhydrodynamics, ch. 7 and 11.
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
        """Those of the ratio of the radii."""
        first, second = self.radii
        return TwoSpheres(second / first)

    def scaled(self, family: str, power: int, on: int, of: int, gap: np.ndarray) -> np.ndarray:
        """π µ (a_on + a_of)^power times a function; of A three times that."""
        sum_ = self.radii[on - 1] + self.radii[of - 1]
        scale = math.pi * self.viscosity * sum_**power * (3.0 if family.endswith("A") else 1.0)
        return scale * self.functions.function(family, on, of, 2.0 * gap / sum(self.radii))

    def along(self, gap: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """(R (k, 2, 2) [N s/m], Γ (k, 2) [N s]) of velocities along n, and of E_nn."""
        gap = apart(gap)
        resistance, strain = np.empty((len(gap), 2, 2)), np.zeros((len(gap), 2))
        for on in SPHERES:
            for of in SPHERES:
                resistance[:, on - 1, of - 1] = self.scaled("XA", 1, on, of, gap)
                # By reciprocity: what moving sphere `on` does to the stresslet of `of`.
                strain[:, on - 1] += TOWARDS[of] * self.scaled("XG", 2, of, on, gap)
        return resistance, strain

    def across(self, gap: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """(R (k, 4, 4), Γ (k, 4)) of the velocities along t of both and their spins, and of E_nt;
        forces [N] first, then torques [N m]."""
        gap = apart(gap)
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
        """How the two move against each other where no torque acts on them."""
        gap = apart(gap)
        distance = sum(self.radii) + gap
        along, stretch = self.along(gap)
        across, shear = self.across(gap)
        n = np.linalg.solve(along, np.dstack([np.broadcast_to(np.eye(2), along.shape), stretch]))
        loads = np.broadcast_to(np.eye(4)[:, :2], (len(gap), 4, 2))
        t = np.linalg.solve(across, np.dstack([loads, shear]))
        n, t = n[:, 1] - n[:, 0], t[:, 1] - t[:, 0]
        return Relative(n[:, :2], t[:, :2], -n[:, 2] / distance, -t[:, 2] / distance)

    def doublet(self, gap: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """(tension over E_nn (k,) [N s], B (k,)) of the two as one rigid body, free in a flow.

        The tension is what water pulls at either along n; the doublet turns by
        ω_z + B E_nt, in a shear G once in 4π/(G √(1 − B²)). Both have limits as the gap closes:
        of equal spheres 12.23 πµa² and .594.
        """
        gap = apart(gap)
        arm = 0.5 * (sum(self.radii) + gap)
        (along, stretch), (across, shear) = self.along(gap), self.across(gap)
        ones = np.ones_like(gap)
        # What the spheres do against the flow at their centres, for E_nn = 1 and E_nt = 1.
        held = stretch - np.einsum("kij,kj->ki", along, np.stack([arm, -arm], axis=1))
        drift = held.sum(axis=1) / along.sum(axis=(1, 2))
        tension = held[:, 1] - drift * along[:, 1].sum(axis=1)
        moves = np.stack([[ones, ones, 0 * ones, 0 * ones], [-arm, arm, ones, ones]]).T
        flow = np.stack([-arm, arm, 0 * ones, 0 * ones], axis=1)
        load = shear + np.einsum("kij,kj->ki", across, flow)
        whole = np.einsum("kia,kij,kjb->kab", moves, across, moves)
        turning = np.linalg.solve(whole, np.einsum("kia,ki->ka", moves, load)[..., None])
        return tension, turning[:, 1, 0]

    def alone(self, gap: ArrayLike) -> "Relative":
        """The same of two spheres that do not move the water around each other."""
        gap = apart(gap)
        mobility = 1.0 / (6.0 * math.pi * self.viscosity * np.array(self.radii))
        driven = np.tile(mobility * [-1.0, 1.0], (len(gap), 1))
        return Relative(driven, driven, np.zeros(len(gap)), np.zeros(len(gap)))


@attrs.frozen
class Relative:
    """Velocities of sphere 2 against 1, free of torques: along n (``along`` (k, 2) [m/(N s)]) and t
    (``across``) by forces on 1 and 2; in a flow (E·r)_n (1 − ``stretch``) along n and
    (E·r)_t (1 − ``shear``) + ω r along t, the A and B of Batchelor and Green (1972)."""

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
"""{column: powers of the viscosity and of the mean radius that it grows by}."""

NEAREST, FARTHEST, NODES_A_DECADE = 1e-7, 200.0, 12
"""Gaps over the mean radius of the two from which to which tables reach; the cubics between their
nodes are right to 1e-5."""

NODES_A_UNIT = NODES_A_DECADE / math.log(10.0)
"""Nodes in a unit of ln(gap over the mean radius), from NEAREST on."""

NODES = 1 + math.ceil(math.log(FARTHEST / NEAREST) * NODES_A_UNIT)

LARGEST_RATIO, HALF_NODES = 50.0, 48
"""Of the radii, and nodes of its logarithm from 1 to there; between them cubics of four."""

REVERSED = ("n_1", "n_2"), ("a_v1", "a_v2"), ("a_w1", "a_w2"), ("b_v1", "b_v2"), ("b_w1", "b_w2")
CHANGED = "a_w1", "a_w2", "b_v1", "b_v2", "k_n", "k_a", "mixed", "t_s"
"""Columns that change places, and such as change sign, where 1 and 2 do and n and t turn round."""


def columns_at(pair: SpherePair, gap: np.ndarray) -> np.ndarray:
    """(k, columns) of two spheres at gaps (k,) [m]; SI units."""
    (along, stretch), (across, shear) = pair.along(gap), pair.across(gap)
    ones, none = np.ones_like(gap), np.zeros_like(gap)
    arm_1, arm_2 = (radius + 0.5 * gap for radius in pair.radii)
    half = 0.5 * (arm_1 + arm_2)

    def rows(*each: list) -> np.ndarray:
        return np.moveaxis(np.array(each), -1, 0)

    n = split(along, stretch, rows([ones, ones]), rows([-ones, ones]), rows([-half, half])[:, 0])
    t = split(
        across, shear,
        rows([ones, ones, none, none], [-arm_1, arm_2, ones, ones]),
        rows([-ones, ones, -arm_1, -arm_2], [none, none, -ones, ones]),
        rows([-half, half, none, none])[:, 0],
    )  # fmt: skip
    (k_n, load_n, l_n, pull_n), (k_t, load_t, l_t, pull_t) = n, t
    sliding = np.stack([l_t[:, 0, 0], l_t[:, 1, 0], l_t[:, 1, 1]], axis=1)
    return np.concatenate([
        k_n[:, 0], k_t[:, 0], k_t[:, 1], load_n, load_t, l_n[:, 0], sliding, pull_n, pull_t,
    ], axis=1)  # fmt: skip


def split(
    resistance: np.ndarray, strain: np.ndarray, rigid: np.ndarray, relative: np.ndarray,
    flow: np.ndarray,
) -> tuple[np.ndarray, ...]:  # fmt: skip
    """(K, k, L, t) of R (k, m, m) and Γ (k, m), of the rows of W and J (k, …, m), and of what a
    strain of 1 does at the centres (k, m)."""
    held = strain + np.einsum("kij,kj->ki", resistance, flow)
    whole = rigid @ resistance
    factor = np.linalg.cholesky(whole @ np.swapaxes(rigid, 1, 2))
    loads = np.einsum("kij,kj->ki", rigid, strain)
    common = np.linalg.solve(factor, np.dstack([whole, loads]))
    freed = np.linalg.solve(resistance, np.dstack([np.swapaxes(relative, 1, 2), held]))
    against = np.linalg.inv(relative @ freed[..., :-1])
    pull = np.einsum("kij,kj->ki", against @ relative, freed[..., -1])
    return common[..., :-1], common[..., -1], np.linalg.cholesky(against), pull


def node(place: int) -> np.ndarray:
    """(NODES, columns) at a node of the ratio, r₂/r₁ = 50^(place/HALF_NODES), of a mean radius and
    a viscosity of 1."""
    return columns_at(
        SpherePair(node_radii(place)), NEAREST * np.exp(np.arange(NODES) / NODES_A_UNIT)
    )


def node_radii(place: int) -> tuple[float, float]:
    """The radii, of a mean of 1, at a node of the ratio."""
    ratio = LARGEST_RATIO ** (place / HALF_NODES)
    return 2.0 / (1.0 + ratio), 2.0 * ratio / (1.0 + ratio)


def exchanged(values: np.ndarray) -> np.ndarray:
    """Columns (…, columns) of the same two spheres, 1 being called 2."""
    order, sign = list(range(len(COLUMNS))), np.ones(len(COLUMNS))
    for pair in REVERSED:
        one, other = map(COLUMNS.index, pair)
        order[one], order[other] = other, one
    sign[[COLUMNS.index(name) for name in CHANGED]] = -1.0
    return values[..., order] * sign


@functools.lru_cache(maxsize=256)
def slots(ratio: float) -> tuple[tuple[int, float], ...]:
    """((node, weight), …) of a ratio of the radii, by Lagrange; its node alone at one."""
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
    """(intervals, columns, 4): coefficients of the cubics between even nodes, constant first, in
    shares of an interval."""
    from scipy.interpolate import CubicSpline

    found = CubicSpline(np.arange(len(values)), values)
    return np.ascontiguousarray(np.moveaxis(found.c[::-1], 0, -1))


def scales(viscosity: float, mean_radius: float) -> np.ndarray:
    """(columns,) by which the columns of a mean radius and a viscosity of 1 are multiplied."""
    powers = np.array([POWERS[name] for name in COLUMNS])
    return viscosity ** powers[:, 0] * mean_radius ** powers[:, 1]
