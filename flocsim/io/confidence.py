"""Confidence intervals of a probability estimated from counts.

They live in this room because the figures need them for pooled counts and may not look up to
`flocsim.ensembles`, whose `statistics` module offers them to users.
"""

from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import UsageError


def wilson(
    successes: ArrayLike, trials: ArrayLike, confidence: float = 0.95
) -> tuple[np.ndarray, np.ndarray]:
    """Wilson's score interval (low, high) of a probability, from whole-number counts.

    With p = successes/trials and z the normal quantile at (1 + confidence)/2:
    (p + z²/2n ± z √(p(1 − p)/n + z²/4n²)) / (1 + z²/n).

    ``successes`` and ``trials`` broadcast against each other; both results have their shape and
    are NaN where trials = 0.  Raises UsageError unless 0 ≤ successes ≤ trials, both whole, and
    0 < confidence < 1.  Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209–212.
    """
    successes, trials = checked_counts(successes, trials)
    if not 0.0 < confidence < 1.0:
        raise UsageError(f"confidence must lie between 0 and 1, found {confidence!r}")
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = score_interval(successes / trials, trials, confidence)
    # At the ends the formula gives 0 and 1, but only up to rounding.
    low = np.where((successes == 0) & (trials > 0), 0.0, low)
    high = np.where((successes == trials) & (trials > 0), 1.0, high)
    return low, high


def score_interval(
    share: np.ndarray, trials: np.ndarray, confidence: float = 0.95
) -> tuple[np.ndarray, np.ndarray]:
    """Wilson's score interval (low, high) of a share among ``trials``, which need not be whole."""
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    spread = z * np.sqrt(share * (1.0 - share) / trials + (z / (2.0 * trials)) ** 2)
    scale = 1.0 + z * z / trials
    centre = share + z * z / (2.0 * trials)
    return (centre - spread) / scale, (centre + spread) / scale


def proportion(
    successes: ArrayLike, trials: ArrayLike, confidence: float = 0.95
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(successes/trials, low, high) with Wilson's interval; all NaN where trials = 0."""
    low, high = wilson(successes, trials, confidence)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.true_divide(successes, trials)
    return share, low, high


def checked_counts(successes: ArrayLike, trials: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Both counts as float arrays, after a check that they can be counts."""
    try:
        successes, trials = np.broadcast_arrays(
            np.asarray(successes, dtype=float), np.asarray(trials, dtype=float)
        )
    except (TypeError, ValueError) as error:
        raise UsageError(f"successes and trials must be matching counts: {error}") from error
    possible = (successes >= 0) & (successes <= trials) & np.isfinite(trials)
    whole = (successes == np.floor(successes)) & (trials == np.floor(trials))
    if not np.all(possible & whole):
        raise UsageError("successes and trials must be whole with 0 <= successes <= trials")
    return successes, trials


def clustered_proportion(
    s: np.ndarray,
    m: np.ndarray,
    ss: np.ndarray,
    sm: np.ndarray,
    mm: np.ndarray,
    clusters: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(p, low, high, n): p = Σ S/Σ M, and Wilson's interval at the n events that it is worth.

    S successes of M trials in each cluster; arguments: Σ S, Σ M, Σ S², Σ S M, Σ M² and the number
    of clusters with trials, as floats (W. G. Cochran, Sampling Techniques, 1977, ch. 6). At n
    independent events p (1 − p)/n is the variance between clusters; n is no more than the trials
    there were, and the number of clusters where all agree.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        p = s / m
        spread = np.maximum(ss - 2.0 * p * sm + p * p * mm, 0.0)
        variance = clusters / (clusters - 1.0) * spread / (m * m)
        number = np.minimum(p * (1.0 - p) / variance, m)
        number = np.where(np.isfinite(number) & (number > 0.0), number, clusters)
        number = np.where(m > 0, number, np.nan)
        low, high = score_interval(p, number)
    # At the ends the formula gives 0 and 1, but only up to rounding.
    return p, np.where(p == 0.0, 0.0, low), np.where(p == 1.0, 1.0, high), number


def numerical_error(
    flipped: ArrayLike, checked: ArrayLike, trials: ArrayLike, confidence: float = 0.95
) -> np.ndarray:
    """95 % bound of the share of a condition's trials that flip where run more exactly.

    Arrays (type, …) of whole numbers, a place for each condition: ``flipped`` among ``checked``,
    the trials that were run again, of ``trials`` in all. NaN without trials, and where nothing was
    checked in any condition of the type.

    f of c have flipped here, and F of C in the type's other conditions. Rates of flips scatter
    over conditions like an exponential distribution with the mean (F + 1)/(C + 2) that the others
    show (Laplace's rule), so that here, given f of c, the rate has a gamma distribution of shape
    1 + f and rate b = (C + 2)/(F + 1) + c. How many more flip of the u = trials − c that were not
    run again is then negative binomial: at most k with probability I_p(1 + f, k + 1), I the
    incomplete beta function, p = b/(b + u). With q, the smallest k of probability
    ``confidence``: (f + q)/(c + u), at most 1.
    """
    from scipy.special import betainc

    f, c, n = (np.asarray(each, dtype=float) for each in (flipped, checked, trials))
    rest = tuple(range(1, f.ndim))
    others_flipped = f.sum(axis=rest, keepdims=True) - f
    others = c.sum(axis=rest, keepdims=True) - c
    # A trial may count in the second run alone: then there are more checked ones than trials.
    unknown = np.maximum(n - c, 0.0)
    rate = (others + 2.0) / (others_flipped + 1.0) + c
    p = rate / (rate + unknown)
    low, high = np.full(f.shape, -1.0), unknown.copy()
    # The smallest k lies above low, and is no more than high: halve until they are neighbours.
    while np.any(high - low > 1.0):
        middle = np.floor(0.5 * (low + high))
        enough = betainc(1.0 + f, middle + 1.0, p) >= confidence
        split = high - low > 1.0
        low = np.where(split & ~enough, middle, low)
        high = np.where(split & enough, middle, high)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.minimum((f + high) / n, 1.0)
    return np.where((n > 0) & (c + others > 0), share, np.nan)
