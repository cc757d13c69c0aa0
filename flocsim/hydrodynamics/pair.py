"""Two spheres in the plane of their centres: what their motion and a flow's strain do to them.

Directions are n, from 1 to 2, and t, n turned counter-clockwise; spins are counter-clockwise. The
flow is linear, u = u₀ + ω × x + E x, and what the spheres feel follows from what they do against it
at their centres: (force, torque) = −R (velocity − u, spin − ω) + Γ E.
"""

import math
from functools import cached_property

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

    @cached_property
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
