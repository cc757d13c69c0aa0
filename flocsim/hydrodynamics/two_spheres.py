"""Resistance functions of two unequal rigid spheres in slow flow: series with lubrication terms.

Sphere 2 has λ times the radius of sphere 1. The flow around each is a sum of multipoles (Lamb's
solution), and those of one sphere form the incident flow of the other. The coefficients of x^k, x =
(a₁ + a₂)/r, follow from those of lower k. The part that decays no faster than k⁻³ belongs to
lubrication. It is known in closed form and summed to infinity; the rest converges down to contact.

Sources: D. J. Jeffrey and Y. Onishi (1984), J. Fluid Mech. 139, 261 (A, B, C); D. J. Jeffrey
(1992), Phys. Fluids A 4, 16 (G, H); with the corrections of A. K. Townsend (2018),
arXiv:1802.08226.
"""

from functools import lru_cache
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import UsageError

TERMS = 300
"""Terms of each series. The relative velocity of two spheres, over the gap where it vanishes with
the gap, is right to 1e-4 for ratios above 0.1 and to 2e-3 at LEAST_RATIO (compared with twice as
many terms)."""

LEAST_RATIO = 0.02
"""Smallest ratio of the radii: below it lubrication has a shorter range than the terms resolve."""

FAMILIES = ("XA", "YA", "YB", "YC", "XG", "YG", "YH")

ODD_ITSELF = frozenset({"YB", "XG", "YG"})
"""Families whose functions of a sphere's own motion are odd in 1/r; the others are even."""


def lubrication(ratio: float) -> dict[str, tuple[float, float, float]]:
    """Return {family and parity: (g₁, g₂, g₃)}, the coefficients of 1/ξ, ln 1/ξ and ξ ln 1/ξ near
    contact.

    ``ratio``: radius of the other sphere over that of the sphere that the function acts on.
    """
    x, sum_ = ratio, 1.0 + ratio
    two, three = sum_**2, sum_**3
    a1, g1 = 2.0 * x**2 / three, 3.0 * x**2 / three
    xa2 = x * (1.0 + 7.0 * x + x**2) / (5.0 * three)
    xa3 = (1.0 + 18.0 * x - 29.0 * x**2 + 18.0 * x**3 + x**4) / (42.0 * three)
    ya2 = 4.0 * x * (2.0 + x + 2.0 * x**2) / (15.0 * three)
    ya3 = 2.0 * (16.0 - 45.0 * x + 58.0 * x**2 - 45.0 * x**3 + 16.0 * x**4) / (375.0 * three)
    yb2 = -x * (4.0 + x) / (5.0 * two)
    yb3 = -(32.0 - 33.0 * x + 83.0 * x**2 + 43.0 * x**3) / (250.0 * two)
    xg2 = 3.0 * x * (1.0 + 12.0 * x - 4.0 * x**2) / (10.0 * three)
    xg3 = (5.0 + 181.0 * x - 453.0 * x**2 + 566.0 * x**3 - 65.0 * x**4) / (140.0 * three)
    yg2 = x * (4.0 - x + 7.0 * x**2) / (10.0 * three)
    yg3 = (32.0 - 179.0 * x + 532.0 * x**2 - 356.0 * x**3 + 221.0 * x**4) / (500.0 * three)
    both = {
        "XA": (a1, xa2, xa3), "YA": (0.0, ya2, ya3), "YB": (0.0, yb2, yb3),
        "XG": (g1, xg2, xg3), "YG": (0.0, yg2, yg3),
    }  # fmt: skip
    return {name + parity: each for name, each in both.items() for parity in ("even", "odd")} | {
        "YCeven": (0.0, 0.4 * x / sum_, (8.0 + 6.0 * x + 33.0 * x**2) / (125.0 * sum_)),
        "YCodd": (
            0.0,
            x**2 / (10.0 * sum_),
            x * (43.0 - 24.0 * x + 43.0 * x**2) / (500.0 * sum_),
        ),
        "YHeven": (
            0.0,
            x * (2.0 - x) / (10.0 * two),
            (16.0 - 61.0 * x + 180.0 * x**2 + 2.0 * x**3) / (500.0 * two),
        ),
        "YHodd": (
            0.0,
            x**2 * (1.0 + 7.0 * x) / (20.0 * two),
            x * (43.0 + 147.0 * x - 185.0 * x**2 + 221.0 * x**3) / (1000.0 * two),
        ),
    }


def couplings(shares: tuple[float, float], order: int, terms: int) -> list[dict]:
    """Return for each sphere the matrices (n, s) by which multipole s of the other causes its
    multipole n.

    Jeffrey and Onishi's (3.6) to (3.9) for ``order`` 0, (4.6) to (4.11) for 1.
    """
    from scipy.special import gammaln

    numbers = np.arange(1.0, terms + 2.0)
    n, s = numbers[:, np.newaxis], numbers[np.newaxis, :]
    binomial = gammaln(n + s + 1.0) - gammaln(n + order + 1.0) - gammaln(s - order + 1.0)
    sign = 2.0 * order - 1.0
    if order == 0:
        straight = n * (2 * n + 1) * (2 * n * s - n - s + 2) / (2 * (n + 1) * (2 * s - 1) * (n + s))
    else:
        straight = 3.0 * (n + s) - (n * s + 1) * (2 * n * s - s - n + 2)
        straight *= (2 * n + 1) / (2 * (n + 1) * s * (n + s) * (2 * s - 1))
    # {name: (factor, powers of the other and of the own share of a₁ + a₂)}.
    factors = {
        "p_of_p": (straight, s, n - 1),
        "p_of_p_beyond": (sign * n * (2 * n - 1) / (2 * (n + 1)), s, n + 1),
        "p_of_v": (sign * n * (4 * n**2 - 1) / (2 * (n + 1) * (2 * s + 1)), s + 2, n - 1),
        "v_of_p": (sign * 2 * n / ((n + 1) * (2 * n + 3)), s, n + 1),
        "p_of_q": (-2 * (4 * n**2 - 1) / (3 * (n + 1)), s + 1, n - 1),
        "q_of_q": (s / (n + 1), s + 1, n),
        "q_of_p": (-3 / (2 * n * s * (n + 1)), s, n),
    }
    used = n + s <= terms + 2

    def matrix(factor: Any, of_other: Any, of_own: Any, own: float, other: float) -> np.ndarray:
        logs = np.where(used, binomial + of_other * np.log(other) + of_own * np.log(own), 0.0)
        return np.where(used, factor * np.exp(logs), 0.0)

    return [
        {name: matrix(*each, own, other) for name, each in factors.items()}
        for own, other in (shares, shares[::-1])
    ]


def multipoles(ratio: float, order: int, spinning: bool, terms: int) -> list[np.ndarray]:
    """Return for each sphere the coefficients (P and Q, n of 1 and 2, k) of x^k.

    For spheres that move along (``order`` 0) or across (1) their line of centres, or spin about an
    axis across it (``spinning``).
    """
    shares = 1.0 / (1.0 + ratio), ratio / (1.0 + ratio)
    matrices = couplings(shares, order, terms)
    # Coefficient k of multipole s is stored in column s + k: the values needed for one k then lie
    # in rows.
    start = terms + 3
    p, v, q = (np.zeros((2, terms + 1, 2 * start + terms)) for _ in range(3))
    for each in [q] if spinning else [p, v]:
        each[:, 0, start + 1] = 1.0
    index = np.arange(1, terms + 2)
    for k in range(1, terms + 1):
        # Multipoles that contribute at order k.
        size = min(k + 1, terms + 1)
        rows = index[:size]

        def of(array, other, delay, k=k, size=size, rows=rows):
            return array[other, :size, start + k - rows - delay].reshape(size, size)

        news = []
        for sphere, other in ((0, 1), (1, 0)):
            made = {name: each[:size, :size] for name, each in matrices[sphere].items()}
            near, beyond = of(p, other, -1), of(p, other, 1)
            new_p = np.sum(
                made["p_of_p"] * near + made["p_of_p_beyond"] * beyond
                + made["p_of_v"] * of(v, other, 1), axis=1,
            )  # fmt: skip
            new_q = np.zeros(size)
            if order == 1:
                turning = of(q, other, 0)
                new_p += np.sum(made["p_of_q"] * turning, axis=1)
                new_q = np.sum(
                    made["q_of_q"] * of(q, other, 1) + made["q_of_p"] * of(p, other, 0), axis=1
                )
            new_v = new_p + np.sum(made["v_of_p"] * beyond, axis=1)
            news.append((new_p, new_v, new_q))
        for sphere, new in enumerate(news):
            for array, values in zip((p, v, q), new, strict=True):
                array[sphere, rows - 1, start + k + rows] = values
    of_k = start + np.arange(terms + 1)
    return [
        np.array([[array[sphere, n, of_k + n + 1] for n in (0, 1)] for array in (p, q)])
        for sphere in (0, 1)
    ]


@attrs.frozen
class Series:
    """One function of ξ = s − 2, s = 2r/(a₁ + a₂).

    ``odd``: parity in 1/s; ``singular``: (g₁, g₂, g₃); ``rest``: coefficients of (2/s)^k, k even or
    odd, without the singular terms.
    """

    odd: bool
    singular: tuple[float, float, float]
    rest: np.ndarray
    scale: float

    def __call__(self, xi: ArrayLike) -> np.ndarray:
        """Return its value at ξ > 0."""
        xi = np.asarray(xi, dtype=float)
        s = 2.0 + xi
        # y = 1 − x²: the singular terms are 1/y, ln y and y ln y (odd functions: with (1 + x)/(1 −
        # x)).
        x, y = 2.0 / s, xi * (s + 2.0) / s**2
        first, logarithm, third = self.singular
        rest = np.polynomial.polynomial.polyval(x * x, self.rest)
        if self.odd:
            log = np.log((s + 2.0) / xi)
            return self.scale * (first * x / y + (logarithm + third * y) * log + x * rest)
        log = -np.log(y)
        return self.scale * (first / y + (logarithm + third * y) * log + rest)


def series_of(
    coefficients: np.ndarray, singular: tuple[float, float, float], odd: bool, scale: float
) -> Series:
    """Return the Series of one parity: coefficients of x^k minus those of the singular terms."""
    first, second, third = singular
    k = np.arange(len(coefficients), dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        known = first + 2.0 * second / k - 4.0 * third / (k * (k - 2.0))
    known[0] = first
    known[1] = first + 2.0 * (second + third)
    known[2] = first + second + third
    return Series(odd, singular, (coefficients - known)[int(odd) :: 2], scale)


@attrs.frozen
class TwoSpheres:
    """Resistance functions of two spheres with radii a₂/a₁ = ``ratio``.

    Parameters
    ----------
    ratio : float
        From 0.02 to 50.

    Raises
    ------
    UsageError
        For other ratios.

    Notes
    -----
    Construction takes half a second; the last 256 are cached.
    """

    ratio: float = attrs.field(converter=float)

    def __attrs_post_init__(self) -> None:
        # Tolerate a rounded quotient of two radii.
        less = min(self.ratio, 1.0 / (self.ratio or 1.0))
        if not less * (1.0 + 1e-12) >= LEAST_RATIO:
            raise UsageError(
                f"the radii of two spheres in water must be {LEAST_RATIO:g} to "
                f"{1.0 / LEAST_RATIO:g} times each other, found {self.ratio:.4g}"
            )

    def function(self, family: str, on: int, of: int, xi: ArrayLike) -> np.ndarray:
        """Return the function X^A, Y^A, Y^B, Y^C, X^G, Y^G or Y^H at ξ = 2r/(a₁ + a₂) − 2.

        Parameters
        ----------
        family : str
            "XA", "YA", "YB", "YC", "XG", "YG" or "YH".
        on, of : 1 or 2
            The sphere on which force, torque or stresslet acts, and the sphere that moves.
        xi : array
            ξ > 0.

        Returns
        -------
        array
            Jeffrey and Onishi's dimensionless function: force (A), torque (B, C) or stresslet (G,
            H) by the velocity (A, B, G) or spin (C, H), over 3πµ(a_on + a_of) (A), πµ(a_on + a_of)²
            (B, G), πµ(a_on + a_of)³ (C, H). B, G and H are those of a sphere that sees the other
            one along d; for sphere 2, d points from 2 to 1.
        """
        return functions_of(self.ratio)[family, on, of](xi)


@lru_cache(maxsize=256)
def functions_of(ratio: float, terms: int = TERMS) -> dict[tuple[str, int, int], Series]:
    """Return {(family, on, of): Series} for a ratio of radii."""
    along, across, spinning = (
        multipoles(ratio, order, spins, terms)
        for order, spins in ((0, False), (1, False), (1, True))
    )
    found = {}
    for sphere, other_over_own in enumerate((ratio, 1.0 / ratio)):
        sum_ = 1.0 + other_over_own
        turned = np.where(np.arange(terms + 1) % 2 == 0, 1.0, other_over_own)
        families = {
            "XA": (along[sphere][0, 0], -2.0 / sum_),
            "YA": (across[sphere][0, 0], -2.0 / sum_),
            "YB": (2.0 * across[sphere][1, 0], -4.0 / sum_**2),
            "YC": (spinning[sphere][1, 0] * turned, 8.0 / sum_**3),
            "XG": (0.75 * along[sphere][0, 1], -4.0 / sum_**2),
            "YG": (0.75 * across[sphere][0, 1], -4.0 / sum_**2),
            "YH": (-0.375 * spinning[sphere][0, 1] * turned, 8.0 / sum_**3),
        }
        known = lubrication(other_over_own)
        for name, (coefficients, of_other) in families.items():
            for of, scale in ((sphere, 1.0), (1 - sphere, of_other)):
                odd = (of != sphere) != (name in ODD_ITSELF)
                singular = known[name + ("odd" if odd else "even")]
                found[name, sphere + 1, of + 1] = series_of(coefficients, singular, odd, scale)
    return found


FADES_FROM = 0.5
"""Share of the cut-off gap from which a force fades out."""


def fading(gap, cut):
    """Return (w, dw/dgap): 1 up to FADES_FROM of the cut, 0 beyond it, a cubic with continuous
    slope between."""
    left = (cut - gap) / ((1.0 - FADES_FROM) * cut)
    if left >= 1.0:
        return 1.0, 0.0
    if left <= 0.0:
        return 0.0, 0.0
    slope = -6.0 * left * (1.0 - left) / ((1.0 - FADES_FROM) * cut)
    return left * left * (3.0 - 2.0 * left), slope
