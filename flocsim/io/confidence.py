"""Confidence intervals of a probability estimated from counts, and of what is a sum of such.

They live in this room because the figures need them for pooled counts and may not look up to
`flocsim.ensembles`, whose `statistics` module offers them to users.

The collision efficiency is the probability of aggregation of an approach, summed over its offset.
With P(δ), the share of decided approaches (misses among them) that end aggregated, δ the sideways
offset of the approach over δ_max, and P linear between the simulated offsets:

- in the plane       E = ∫₀¹ P dδ, of all approaches within the width 2 δ_max;
- axially symmetric  E = ∫₀¹ P 2δ dδ, of all approaches within the area π δ_max².

Where P is 1 up to an offset y_c and 0 beyond, the latter is (y_c/δ_max)², the collision efficiency
of two settling bodies (Pruppacher and Klett 1997, Microphysics of Clouds and Precipitation, ch.
14.4; Han and Lawler 1991, J. Hydraul. Eng. 117, 1269); P makes it the mean over orientations.
"""

from collections.abc import Mapping
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import UsageError


def wilson(
    successes: ArrayLike, trials: ArrayLike, confidence: float = 0.95
) -> tuple[np.ndarray, np.ndarray]:
    """Return Wilson's score interval (low, high) of a probability, from whole-number counts.

    With p = successes/trials and z the normal quantile at (1 + confidence)/2:
    (p + z²/2n ± z √(p(1 − p)/n + z²/4n²)) / (1 + z²/n).

    ``successes`` and ``trials`` broadcast against each other; both results have their shape and
    are NaN where trials = 0.  Raises UsageError unless 0 ≤ successes ≤ trials, both whole, and
    0 < confidence < 1.  Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209–212.
    """
    return proportion(successes, trials, confidence)[1:]


def normal_quantile(confidence: float) -> float:
    """Return z of a two-sided interval."""
    return NormalDist().inv_cdf(0.5 + 0.5 * confidence)


Z = normal_quantile(0.95)


def score_interval(
    share: np.ndarray, trials: np.ndarray, z: ArrayLike = Z
) -> tuple[np.ndarray, np.ndarray]:
    """Return Wilson's score interval (low, high) of a share among ``trials``, which need not be
    whole.

    ``z``: normal quantile. At the ends 0 and 1, which the formula gives but for rounding.
    """
    z = np.asarray(z, dtype=float)
    spread = z * np.sqrt(share * (1.0 - share) / trials + (z / (2.0 * trials)) ** 2)
    scale = 1.0 + z * z / trials
    centre = share + z * z / (2.0 * trials)
    low, high = (centre - spread) / scale, (centre + spread) / scale
    return np.where(share == 0.0, 0.0, low), np.where(share == 1.0, 1.0, high)


def proportion(
    successes: ArrayLike, trials: ArrayLike, confidence: float = 0.95, unknown: ArrayLike = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (successes/trials, low, high) with Wilson's interval; NaN where there are no trials.

    ``unknown``: how many more there are that may be trials, and successes. The interval then holds
    whatever they would have come to, none of them a success or all (C. F. Manski, Am. Econ. Rev. 80
    (1990) 319-323): it goes from Wilson's low end for S of M + U to the high one for S + U of
    M + U, at the quantile of `bounds_quantile`. Of nothing but unknown ones it is [0, 1] about NaN.
    """
    successes, trials = checked_counts(successes, trials)
    successes, trials, unknown = np.broadcast_arrays(
        successes, trials, np.asarray(unknown, dtype=float)
    )
    if not 0.0 < confidence < 1.0:
        raise UsageError(f"confidence must lie between 0 and 1, found {confidence!r}")
    most = trials + unknown
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (successes / most, most), ((successes + unknown) / most, most)
        return successes / trials, *between_bounds(*ends, confidence)


Known = tuple[np.ndarray, np.ndarray]
"""A share, and the trials that it is known from."""


def between_bounds(
    least: Known, most: Known, confidence: float = 0.95
) -> tuple[np.ndarray, np.ndarray]:
    """Return (low, high) of a share between two."""
    two_sided = normal_quantile(confidence)
    # Standard errors, as half the width of a score interval over its quantile.
    error = [
        np.diff(score_interval(share, trials, two_sided), axis=0)[0] / (2.0 * two_sided)
        for share, trials in (least, most)
    ]
    z = bounds_quantile(most[0] - least[0], np.maximum(*error), confidence)
    return score_interval(*least, z)[0], score_interval(*most, z)[1]


def bounds_quantile(width: np.ndarray, error: np.ndarray, confidence: float = 0.95) -> np.ndarray:
    """Return by how many standard errors an interval reaches beyond two bounds ``width`` apart.

    The c of Φ(c + width/error) − Φ(−c) = confidence: that of a two-sided interval where the bounds
    are one, of a one-sided one where they are far apart, as the truth cannot be beyond both.
    Source: G. W. Imbens and C. F. Manski, Econometrica 72 (2004) 1845-1857.
    """
    from scipy.special import ndtr

    width, error = np.broadcast_arrays(width, error)
    c = np.full(width.shape, normal_quantile(confidence))
    apart = (width > 0.0) & (error > 0.0)
    ratio = width[apart] / error[apart]
    low = np.full(ratio.shape, NormalDist().inv_cdf(confidence))
    high = c[apart]
    # Bisection between the one-sided and the two-sided quantile; coverage rises with c.
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        enough = ndtr(middle + ratio) - ndtr(-middle) >= confidence
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    c[apart] = high
    return c


HALVINGS = 40
"""Of an interval of .3 until it is one of rounding."""


def checked_counts(successes: ArrayLike, trials: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return both counts as float arrays of one shape; UsageError for what cannot be counts."""
    try:
        s, m = np.broadcast_arrays(np.asarray(successes, float), np.asarray(trials, float))
    except (TypeError, ValueError) as error:
        raise UsageError(f"successes and trials must be matching counts: {error}") from error
    if not np.all((s >= 0) & (s <= m) & np.isfinite(m) & (s == np.floor(s)) & (m == np.floor(m))):
        raise UsageError("successes and trials must be whole with 0 <= successes <= trials")
    return s, m


def cluster_sums(successes: np.ndarray, trials: np.ndarray) -> np.ndarray:
    """Return Σ S, Σ M, Σ S², Σ S M, Σ M² and the number of clusters with trials (6, …), whole
    numbers.

    ``successes``, ``trials``: S and M of each cluster, clusters along the last axis.
    """
    s, m = np.broadcast_arrays(np.asarray(successes, "i8"), np.asarray(trials, "i8"))
    return np.stack([np.sum(each, axis=-1) for each in (s, m, s * s, s * m, m * m, m > 0)])


def bounded_sums(successes: np.ndarray, trials: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """Return cluster_sums (3, 6, …): as known, and with all ``unknown`` as trials that fail or
    succeed."""
    most = trials + unknown
    parts = (successes, trials), (successes, most), (successes + unknown, most)
    return np.stack([cluster_sums(*each) for each in parts])


LEAST_SCATTER = 0.25
"""Square of half a point: even points in a simple set are as many in every scramble, up to one."""


def student_quantile(scrambles: int) -> float:
    """Return Student's t of a two-sided 95 % interval from so many scrambles."""
    from scipy.special import stdtrit

    return float(stdtrit(scrambles - 1, 0.975))


def ratio_and_variance(sums: np.ndarray, scrambles: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return p = Σ S/Σ M of cluster_sums and its variance between clusters, NaN without trials.

    k/(k − 1) Σ (S − p M)²/(Σ M)² of k clusters (W. G. Cochran, Sampling Techniques, 1977, ch. 6);
    of ``scrambles``, each is taken to scatter by half a point at least.
    """
    s, m, ss, sm, mm, clusters = np.asarray(sums, dtype=float)
    k = scrambles or clusters
    with np.errstate(divide="ignore", invalid="ignore"):
        p = s / m
        least = LEAST_SCATTER * (scrambles - 1.0) if scrambles else 0.0
        spread = np.maximum(ss - 2.0 * p * sm + p * p * mm, least)
        return p, k / (k - 1.0) * spread / (m * m)


def clustered_proportion(
    sums: np.ndarray, scrambles: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (p, low, high, n): p = Σ S/Σ M, and an interval at the n events that it is worth.

    ``sums``: those of bounded_sums, S successes of M trials in each cluster. At n independent
    events p (1 − p)/n is the variance between clusters; n is no more than the trials there were,
    and the number of clusters where all agree. The interval is that of `proportion`, unknown ones
    included.

    Clusters that are ``scrambles``, whose points are more even than independent ones, may be worth
    more than their trials, and where all agree just these; the interval is Wilson's at Student's
    quantile of the scrambles in the place of the normal one.
    """
    shares, numbers = [], []
    for each in sums:
        p, variance = ratio_and_variance(each, scrambles)
        trials, clusters = np.asarray(each[1], float), each[5]
        with np.errstate(divide="ignore", invalid="ignore"):
            number = p * (1.0 - p) / variance
        if scrambles:
            number = np.where((p == 0.0) | (p == 1.0), trials, number)
        else:
            number = np.minimum(number, trials)
            number = np.where(np.isfinite(number) & (number > 0.0), number, clusters)
            number = np.where(trials > 0, number, np.nan)
        shares.append(p)
        numbers.append(number)
    if scrambles:
        t = student_quantile(scrambles)
        low = score_interval(shares[1], numbers[1], t)[0]
        high = score_interval(shares[2], numbers[2], t)[1]
    else:
        low, high = between_bounds((shares[1], numbers[1]), (shares[2], numbers[2]))
    return shares[0], low, high, numbers[0]


def aggregated(table: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (P, low, high) of every condition (type, vertices, delta): 95 % bounds.

    Undecided and failed approaches may have come to anything.
    """
    classes, unknown = table["n_class"], table["n_undecided"] + table["n_failed"]
    return proportion(
        classes[..., 0] + classes[..., 2], table["n_total"] - unknown, unknown=unknown
    )


def weights(delta: np.ndarray, axial: bool) -> np.ndarray | None:
    """Return what each P counts for in the integral; None unless the offsets reach from 0 to 1."""
    order = np.argsort(delta)
    places = np.asarray(delta, dtype=float)[order]
    if len(places) < 2 or places[0] != 0.0 or places[-1] != 1.0:
        return None
    # P is linear on [a, b]: ∫ P dδ = (b − a)(P_a + P_b)/2, and
    # ∫ P 2δ dδ = (b − a)((2a + b) P_a + (a + 2b) P_b)/3.
    found = np.zeros(len(places))
    a, b = places[:-1], places[1:]
    found[:-1] += (b - a) * ((2.0 * a + b) / 3.0 if axial else 0.5)
    found[1:] += (b - a) * ((a + 2.0 * b) / 3.0 if axial else 0.5)
    return found[np.argsort(order)]


def efficiency(
    table: Mapping[str, np.ndarray], delta: np.ndarray, axial: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return (E, low, high) (type, vertices); None unless the offsets reach from 0 to 1.

    The bounds are the same sums of the 95 % bounds at each offset: as wide as they come where
    all offsets err together, since they have the flocs and orientations in common.
    """
    share = weights(delta, axial)
    if share is None:
        return None
    value, low, high = (np.asarray(each) @ share for each in aggregated(table))
    return value, low, high


def explained_share(groups: np.ndarray, values: np.ndarray) -> tuple[float, float, float]:
    """Return (share, low, high) of the variance of ``values`` (n,) that lies between groups, of
    which ``groups`` (n,) has the numbers.

    ε² = (SS_between − (k − 1) s²)/SS_total, s² the variance within groups: 0 on average where they
    do not matter. 95 % interval by the noncentral F distribution.

    NaN for a single group, or where all values are one. Sources: T. L. Kelley, Proc. Natl. Acad.
    Sci. 21 (1935) 554-559; J. H. Steiger, Psychol. Methods 9 (2004) 164-182.
    """
    from scipy.optimize import brentq
    from scipy.stats import f, ncf

    sizes = np.bincount(groups)
    sums = np.bincount(groups, values)[sizes > 0]
    sizes = sizes[sizes > 0]
    n, k = len(values), len(sizes)
    total = float(np.sum((values - values.mean()) ** 2)) if n else 0.0
    if k < 2 or n - k < 1 or total == 0.0:
        return (float("nan"),) * 3
    between = float(np.sum(sums**2 / sizes)) - n * float(values.mean()) ** 2
    within = max(total - between, 0.0) / (n - k)
    if within <= 1e-12 * total:
        return 1.0, 1.0, 1.0
    ratio = between / (k - 1) / within

    def noncentrality(quantile):
        """Return that at which so many ratios lie below this one; 0 where none is as small."""
        if f.cdf(ratio, k - 1, n - k) <= quantile:
            return 0.0
        # From below, as the distribution is no number (NaN) where it underflows.
        most = 1.0
        while ncf.cdf(ratio, k - 1, n - k, most) > quantile:
            most *= 2.0
        return float(brentq(lambda c: ncf.cdf(ratio, k - 1, n - k, c) - quantile, 0.0, most))

    low, high = (noncentrality(quantile) for quantile in (0.975, 0.025))
    return max((between - (k - 1) * within) / total, 0.0), low / (low + n), high / (high + n)
