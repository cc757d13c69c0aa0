"""The numerical error of probabilities: outcomes that change at a tighter tolerance.

Replicates are exchangeable, as an index does nothing but name random numbers; so the first few
of a study, run again at a tighter tolerance, are a random sample of it.
"""

import attrs
import numpy as np

from flocsim.errors import UsageError
from flocsim.io.results.schema import CLASSES, Results


@attrs.frozen(eq=False)
class OutcomeChanges:
    """Which replicates change: flags (type, vertices, delta, replicate).

    ``both``: decided collisions in both runs; ``aggregation`` and ``zone``: those of them that
    change between aggregated and departed, inside and outside; ``outcome``: any change of outcome,
    also to missed or undecided, among ``all`` replicates.
    """

    both: np.ndarray
    aggregation: np.ndarray
    zone: np.ndarray
    outcome: np.ndarray


def outcome_changes(found: Results, exact: Results) -> OutcomeChanges:
    """The OutcomeChanges of ``found`` against ``exact``, Results of the same conditions.

    Replicates are paired; the shorter of the two decides how many are compared. UsageError where
    the conditions differ.
    """
    same = (
        found.types == exact.types
        and np.array_equal(found.vertices, exact.vertices)
        and np.array_equal(found.delta, exact.delta)
    )
    if not same:
        raise UsageError("the two results are not of the same conditions: name runs of one config")
    outcomes = [each.replicates["outcome"] for each in (found, exact) if each.replicates]
    count = min(each.shape[-1] for each in outcomes)
    a, b = (each[..., :count] for each in outcomes)
    both = (a < len(CLASSES)) & (b < len(CLASSES))
    return OutcomeChanges(both, both & (a % 2 != b % 2), both & (a // 2 != b // 2), a != b)


def percent_changed(changed: np.ndarray, among: np.ndarray) -> float:
    """Percent of what is in ``among`` that has changed; NaN of nothing."""
    count = np.count_nonzero(among)
    return 100.0 * np.count_nonzero(changed & among) / count if count else np.nan
