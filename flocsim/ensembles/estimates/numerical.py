"""The numerical error of probabilities, estimated from replicates that are run again.

A fraction of the replicates is run a second time at a tighter tolerance. For one probability, a
replicate *flips* if the second run counts differently: as a success, as a failure, or not at all.
It then raises the probability (*gained*) or lowers it (*lost*). Some second runs are followed by a
third one, tighter still, because an outcome may be the same at two tolerances and differ at the
third.

The change that exact runs would make to S successes of M trials has two parts:

1. The known part: S' of M', with the most exact run of each replicate that was run again.
2. A bound for flips that nobody has seen. `further_flips` predicts, from first and second runs of
   the same kind of outcome (`io.results.events.KINDS`), how many of the replicates without a second
   run would flip; `further_of_all` predicts, from second and third runs, how many of those without
   a third run would. `flips_together` adds these bounds. A flip changes the probability by at most
   1/M.

The interval of the change is the known part, minus what may be lost, to the known part, plus what
may be gained.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from flocsim.io.results.events import WITHOUT_OUTCOME, Events, events, events_of, kinds_of
from flocsim.io.results.schema import NOT_APPLICABLE, PROBABILITIES

EACH_SIDE = 0.975
"""Probability of each end of an interval."""

EACH_CONDITION = 0.99
"""The same for flips that second runs leave open. Rates of one study are estimated together, and a
condition that flips three times as often as the others is to be covered, too: at 0.975 some such
probabilities were covered in 85 % of small studies, at 0.99 in 95 % or more, with bounds that are a
fifth wider (benchmarks.accuracy.numerical_error)."""

OF_KINDS, SHIFTED = "of kinds", "shifted"
"""Names of what is summed beside the counts of a results file, behind that of a probability; the
counts of kinds stand under KIND_COUNTS."""
KIND_COUNTS = "kinds"

Intervals = dict[str, tuple[np.ndarray, np.ndarray]]
"""{probability: (low, high)}."""

Codes = Sequence[np.ndarray]
"""Outcome, inside and bond of runs as in the results file, (…, replicate); the outcome of what was
not run is NOT_APPLICABLE."""


def run_so(codes: Codes) -> np.ndarray:
    """Return True for each replicate that was run."""
    return codes[0] != NOT_APPLICABLE


def most_exact(again: Codes, third: Codes) -> list[np.ndarray]:
    """Return the codes of third runs that say something of the outcome, of second runs
    elsewhere."""
    says = run_so(third) & ~np.isin(third[0], WITHOUT_OUTCOME)
    return [np.where(says, *pair) for pair in zip(third, again, strict=True)]


def gains_and_losses(before: Events, after: Events) -> tuple[np.ndarray, np.ndarray]:
    """Return flags of replicates that raise a probability, and that lower it, counted as
    ``after``."""
    fails, fails_after = before.trials & ~before.successes, after.trials & ~after.successes
    return (
        (after.successes & ~before.successes) | (fails & ~after.trials),
        (before.successes & ~after.successes) | (~before.trials & fails_after),
    )


def of_each_kind(kinds: np.ndarray, flags: Iterable[np.ndarray]) -> np.ndarray:
    """Return whole numbers (…, kind, flag): for how many of each of kinds_of a flag is set."""
    of_flags = [np.stack([(along(kind, each) & each).sum(axis=-1) for kind in kinds], axis=-1)
                for each in flags]  # fmt: skip
    return np.stack(of_flags, axis=-1)


def kind_counts(kinds: np.ndarray, again: Codes, third: Codes) -> np.ndarray:
    """Return whole numbers (…, kind, 4): how many of each kind there are, were run a second, and a
    third time, and were run again without an outcome."""
    lost_sight = run_so(again) & np.isin(most_exact(again, third)[0], WITHOUT_OUTCOME)
    every = np.ones_like(lost_sight)
    return of_each_kind(kinds, (every, run_so(again), run_so(third), lost_sight))


def kind_changes(
    kinds: np.ndarray, runs: Sequence[Codes], counted: Sequence[tuple[np.ndarray, np.ndarray]]
) -> np.ndarray:
    """Return whole numbers (…, kind, 4): how many of each kind gain and lose by the second run, and
    by the third one after it.

    ``runs``: second and third ones; ``counted``: gains_and_losses of each. A run without an outcome
    may have come to either.
    """
    return of_each_kind(kinds, (
        (each | along(np.isin(codes[0], WITHOUT_OUTCOME), each)) & along(run_so(codes), each)
        for codes, sides in zip(runs, counted, strict=True) for each in sides
    ))  # fmt: skip


def along(flags: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Return flags (…, replicate), (…, 1, replicate) where those they go with are of each class."""
    return flags[..., np.newaxis, :] if like.ndim > flags.ndim else flags


def count_changes(
    first: Codes, again: Codes, third: Codes | None = None,
    of: Callable[..., dict[str, Events]] = events,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Return whole-number counts n_checked, n_flipped, n_third, n_third_flipped and those of
    CHANGES, over the last axis.

    ``first``, ``again``, ``third``: codes of first, second and third runs, none of the last by
    default; ``of`` gives the Events of codes. And what `change_intervals` follows from:
    KIND_COUNTS, see kind_counts; "pr_a of kinds" (…, kind, 4), see kind_changes; "pr_a shifted"
    (…, 2), by how much the most exact runs change trials and successes.
    """
    runs = again, (np.full_like(again[0], NOT_APPLICABLE),) * 3 if third is None else third
    # Exact are third runs that came to an outcome, else second ones; kinds are those of first runs.
    exact, kinds = most_exact(*runs), kinds_of(first[0], first[2])
    checked, thrice = map(run_so, runs)
    differ = [(one[0] != other[0]) | (one[1] != other[1])
              for one, other in ((first, exact), runs)]  # fmt: skip
    flags = {"n_checked": checked, "n_flipped": checked & differ[0], "n_third": thrice,
             "n_third_flipped": thrice & differ[1]}  # fmt: skip
    # A replicate shifts the estimate only if its most exact run came to an outcome.
    known = checked & ~np.isin(exact[0], WITHOUT_OUTCOME) & kinds.any(axis=0)
    counts = {KIND_COUNTS: kind_counts(kinds, *runs)}
    tables = [of(*codes) for codes in (first, *runs, exact)]
    for name in tables[0]:
        before, second, last, after = (table[name] for table in tables)
        gained, lost = gains_and_losses(before, after)
        again_of, known_of = along(checked, gained), along(known, gained)
        flags |= {
            f"n_checked_{name}": again_of & (before.trials | after.trials),
            f"n_gained_{name}": again_of & gained, f"n_lost_{name}": again_of & lost,
        }  # fmt: skip
        shifts = [(known_of & now).sum(axis=-1) - (known_of & then).sum(axis=-1)
                  for now, then in zip(after[:2], before[:2], strict=True)]  # fmt: skip
        counts[f"{name} {SHIFTED}"] = np.stack(shifts, axis=-1)
        sides = gains_and_losses(before, second), gains_and_losses(second, last)
        counts[f"{name} {OF_KINDS}"] = kind_changes(kinds, runs, sides)
    return {name: np.sum(each, axis=-1) for name, each in flags.items()} | counts


def further(of_kinds: np.ndarray, counts: np.ndarray) -> list[np.ndarray]:
    """Return bounds [of further gains, of further losses] from kind_changes and kind_counts (…).

    Without any third run second ones are taken for exact. NaN where no replicate was run again.
    """
    if of_kinds.ndim > counts.ndim:  # each class or bond by itself
        of_each = [further(of_kinds[..., k, :, :], counts) for k in range(of_kinds.shape[-3])]
        return [np.stack(side, axis=-1) for side in zip(*of_each, strict=True)]
    # First axis: gained and lost from the first run to the second, then from that to the third.
    changed = np.moveaxis(of_kinds, (-1, -2), (0, 1))
    members, checked, thrice, lost_sight = np.moveaxis(counts, (-1, -2), (0, 1))
    found = []
    for side in range(2):
        # What has no second run may flip, and so may what came to no outcome when run again.
        parts = [*further_of_kinds(changed[side], checked, members - checked + lost_sight)]
        if thrice.any():
            # Second runs are not exact either: all that have no third run may flip once more.
            third = changed[2 + side], thrice, members - thrice
            parts.append(further_of_all(*(each.sum(axis=0) for each in third)))
        found.append(flips_together(parts))
    return found


def change_intervals(
    counts: Mapping[str, np.ndarray], totals: Mapping[str, Events] | None = None
) -> Intervals:
    """Return {probability: (low, high)}: 95 % interval of its change if all replicates were run
    exactly.

    ``counts`` of conditions (type, vertices, …), or sums over displacements: see count_changes;
    ``totals``: how many trials and successes there are, by default from the counts of a results
    file. NaN where there are no trials, or nothing was run again.
    """
    found = {}
    for name, (trials, successes, _) in (totals or events_of(counts)).items():
        gained, lost = further(counts[f"{name} {OF_KINDS}"], counts[KIND_COUNTS])
        more_trials, more_successes = np.moveaxis(counts[f"{name} {SHIFTED}"], -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = successes / trials
            again = (successes + more_successes) / (trials + more_trials)
            # The change that is known; further flips may add to it on either side.
            change = np.where(trials + more_trials > 0, again - share, 0.0)
            # No change leads beyond probabilities of 0 and 1.
            low = np.maximum(change - lost / trials, -share)
            high = np.minimum(change + gained / trials, 1.0 - share)
        found[name] = np.where(trials > 0, low, np.nan), np.where(trials > 0, high, np.nan)
    return found


def further_of_kinds(flipped: np.ndarray, checked: np.ndarray, exposed: np.ndarray) -> np.ndarray:
    """Return further_flips (kind, 3, …) of each kind: of arrays (kind, condition, …).

    Of a kind of which none was run again anywhere all may flip; NaN where no replicate of any kind
    was.
    """
    found = np.stack(
        [
            further_flips(*of_kind, EACH_CONDITION)
            for of_kind in zip(flipped, checked, exposed, strict=True)
        ]
    )
    if np.any(checked):
        worst = np.stack([exposed, exposed, np.zeros_like(exposed)], axis=1)
        found = np.where(np.isnan(found), worst, found)
    return found


def further_of_all(flipped: np.ndarray, checked: np.ndarray, exposed: np.ndarray) -> np.ndarray:
    """Return (most, mean, none) (3, …) of flips between second and third runs, as further_flips.

    Third runs are too few to tell conditions apart: those of the whole study share one rate, of
    which LATE_RATES is known beforehand. Where any may flip, ``most`` is one at least.
    """
    flips, runs = np.sum(flipped), np.sum(checked)
    rates = weighed(LATE_RATES, flips, runs)
    found = predicted(rates, np.broadcast_arrays(flips, runs, exposed))
    found[0] = np.maximum(found[0], exposed > 0.0)
    return found


LATE_RATES = np.array([1.5, 0.5]), np.array([0.003, 0.5]), np.log([0.9, 0.1])
"""Shapes and means of two gamma distributions of the rate at which third runs flip, and the
logarithms of their weights: Jeffreys's shape of ½ after one flip in 500 runs, more than third runs
were seen to flip at any tolerance (benchmarks.accuracy.numerical_error); and after none in a single
run, in case that this study is not like those. Source of such mixtures: Schmidli et al., Biometrics
70 (2014) 1023, section 3. The few third runs of a small study would say next to nothing by
themselves."""


SHAPES = np.array([0.03, 0.1, 0.3, 1.0, 3.0])
MEANS = np.geomspace(1e-5, 0.3, 16)
"""Gamma distributions of rates over conditions: from a few that flip to all alike."""


def further_flips(
    flipped: ArrayLike, checked: ArrayLike, exposed: ArrayLike, confidence: float = EACH_SIDE
) -> np.ndarray:
    """Return (most, mean, none) (3, …): how many more flip at most, with the probability that is
    asked for, and on average, and the probability that none does.

    Arrays of one shape, an element for each condition: f ``flipped`` of c ``checked``, and how many
    others, u, may flip (``exposed``, need not be whole). NaN where nothing was checked anywhere.

    Rates of flips scatter over conditions by a gamma distribution of shape k and mean m, of which
    k in SHAPES and m in MEANS (prior density √m per log m) are weighed by the flips of all
    conditions. So if flips are concentrated in few conditions, the rate of a condition with few
    re-runs is uncertain; if all conditions are alike, it is inferred from the others.
    """
    f, c, u = np.broadcast_arrays(
        *(np.asarray(each, float) for each in (flipped, checked, exposed))
    )
    if not np.any(c > 0.0):
        unknown = np.where(u > 0.0, np.nan, 0.0)
        return np.stack([unknown, unknown, 1.0 + unknown])
    # Conditions of the same f of c weigh the distributions alike: computed once, counted often.
    seen, times = np.unique(np.stack([f.ravel(), c.ravel()]), axis=1, return_counts=True)
    k, m = (each.ravel() for each in np.meshgrid(SHAPES, MEANS))
    k, m, weights = weighed((k, m, 0.5 * np.log(m)), seen[0], seen[1], times)
    some = weights > NEGLIGIBLE
    rates = k[some], m[some], weights[some] / weights[some].sum()
    return predicted(rates, (f, c, u), confidence)


Gammas = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Shapes k and means m of gamma distributions of a rate, and their weights or the logarithms of
these."""


def weighed(
    prior: Gammas, flipped: np.ndarray, checked: np.ndarray, times: ArrayLike = 1
) -> Gammas:
    """Return gamma distributions with their posterior weights, from the logarithms of prior ones.

    ``flipped`` of ``checked`` runs were seen in conditions, each so many ``times``.
    """
    from scipy.special import gammaln

    k, m, log_prior = prior
    f, c = np.atleast_1d(flipped), np.atleast_1d(checked)
    rate = (k / m)[:, np.newaxis]
    # log of the negative binomial's Γ(k + f)/Γ(k) (r/(r + c))^k (r + c)^−f, r = k/m: factors of f
    # and c alone are the same for all (k, m).
    logs = (
        gammaln(k[:, np.newaxis] + f) - gammaln(k)[:, np.newaxis]
        + k[:, np.newaxis] * np.log(rate / (rate + c)) - f * np.log(rate + c)
    )  # fmt: skip
    logs = np.sum(logs * times, axis=1) + log_prior
    # The largest weight is set to 1 before exponentials are taken: none of them overflows.
    weights = np.exp(logs - logs.max())
    return k, m, weights / weights.sum()


def predicted(
    rates: Gammas, seen: Sequence[np.ndarray], confidence: float = EACH_SIDE
) -> np.ndarray:
    """Return (most, mean, none) (3, …), see further_flips, by weighted gamma distributions.

    ``seen``: f flipped of c checked, and u exposed. Given f of c, a rate has shape k + f and rate
    k/m + c, and the number of further flips is at most q with probability I_p(k + f, q + 1), I the
    incomplete beta function, p = b/(b + u), b = k/m + c. The mean over the distributions has its
    quantile here.
    """
    from scipy.special import betainc

    k, m, weights = rates
    # Conditions of the same numbers have the same bound: found once.
    shape_of_result = seen[0].shape
    cases, index = np.unique(np.stack([each.ravel() for each in seen]), axis=1, return_inverse=True)
    f, c, u = cases.astype(float)
    shape, b = k[:, np.newaxis] + f, (k / m)[:, np.newaxis] + c
    low, high = np.full(f.shape, -1.0), np.ceil(u)
    # The smallest q lies above low, and is no more than high: halve until they are neighbours.
    while np.any(high - low > 1.0):
        middle = np.floor(0.5 * (low + high))
        enough = weights @ betainc(shape, middle + 1.0, b / (b + u)) >= confidence
        split = high - low > 1.0
        low = np.where(split & ~enough, middle, low)
        high = np.where(split & enough, middle, high)
    mean = np.minimum(weights @ (shape * u / b), u)
    none = weights @ (b / (b + u)) ** shape
    return np.stack([high, mean, none])[:, index.reshape(shape_of_result)]


def flips_together(parts: ArrayLike, confidence: float = EACH_SIDE) -> np.ndarray:
    """Return the bound of the sum of independent numbers of flips (part, 3, …).

    With means µ and bounds q of the parts: Σ µ + √(Σ (q − µ)²), rounded up to a whole number; 0
    where all parts together have none with this probability. A single part keeps its bound. The sum
    of the bounds would be too wide, since the parts hardly ever reach theirs together.
    Source: G. Y. Zou and A. Donner, Stat. Med. 27 (2008) 1693-1702.
    """
    most, mean, none = np.moveaxis(np.asarray(parts), 1, 0)
    bound = mean.sum(axis=0) + np.sqrt(np.sum(np.maximum(most - mean, 0.0) ** 2, axis=0))
    bound = np.ceil(bound * (1.0 - ROUNDED))
    return np.where(none.prod(axis=0) >= confidence, 0.0, bound)


ROUNDED = 1e-12
"""What a sum of whole numbers may be off by, so that it does not count as one more."""


NEGLIGIBLE = 1e-6
"""Weight below which a distribution is left out."""


def numerical_of(intervals: Intervals) -> dict[str, np.ndarray]:
    """Return {"pr_…_numerical": array} of every probability: the larger side of its
    change_intervals."""
    return {
        f"{name}_numerical": np.maximum(np.abs(low), np.abs(high))
        for name, (low, high) in intervals.items()
    }


def change_columns(intervals: Intervals) -> dict[str, np.ndarray]:
    """Return the arrays of NUMERICS."""
    return {
        f"{name}_change{end}": intervals[name][side]
        for name in PROBABILITIES for side, end in enumerate(("_low", "_high"))
    }  # fmt: skip
