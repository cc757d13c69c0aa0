"""Outcomes that change at a tighter tolerance, of a study's own second runs."""

import attrs
import numpy as np

from flocsim.io.results.schema import CLASSES, NOT_APPLICABLE, Results


@attrs.frozen(eq=False)
class OutcomeChanges:
    """Which replicates change: flags (type, vertices, delta, replicate).

    ``checked``: those that were run twice; ``both``: decided collisions in both runs;
    ``aggregation`` and ``zone``: those of them that change between aggregated and departed, inside
    and outside; ``outcome``: any change of outcome, also to missed or undecided, among ``checked``.
    """

    checked: np.ndarray
    both: np.ndarray
    aggregation: np.ndarray
    zone: np.ndarray
    outcome: np.ndarray


def changes_between(a: np.ndarray, b: np.ndarray) -> OutcomeChanges:
    """The OutcomeChanges of outcome codes; NOT_APPLICABLE in ``b``: was not run again."""
    both = (a < len(CLASSES)) & (b < len(CLASSES))
    checked = b != NOT_APPLICABLE
    return OutcomeChanges(
        checked, both, both & (a % 2 != b % 2), both & (a // 2 != b // 2), checked & (a != b)
    )


def second_run_changes(results: Results) -> OutcomeChanges:
    """The OutcomeChanges of a study's second runs; its table of replicates must be there."""
    assert results.replicates is not None, "the table of replicates was not read into memory"
    return changes_between(results.replicates["outcome"], results.replicates["checked_outcome"])
