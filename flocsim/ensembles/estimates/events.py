"""Which replicates count in a probability, and which of these as successes."""

import numpy as np

from flocsim.io.results.schema import BONDS, CLASSES, NOT_APPLICABLE, OUTCOMES

MISSED = OUTCOMES.index("missed")
UNDECIDED = OUTCOMES.index("undecided")
HELD = OUTCOMES.index("held")
DECIDED = len(CLASSES)
"""Outcomes below this code are classes A to D."""
AGGREGATED = (0, 2)
INSIDE_CLASSES, OUTSIDE_CLASSES = (0, 1), (2, 3)
HOOK = 1 + BONDS.index("hook")


def events(
    outcome: np.ndarray, inside: np.ndarray, bond: np.ndarray
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """{probability: (trials, successes)}, flags as the codes; (class, …), (bond, …) of those."""
    decided, aggregated = outcome < DECIDED, np.isin(outcome, AGGREGATED)
    within, without = np.isin(outcome, INSIDE_CLASSES), np.isin(outcome, OUTSIDE_CLASSES)
    classes = np.stack([outcome == code for code in range(len(CLASSES))])
    bonds = np.stack([bond == 1 + place for place in range(len(BONDS))])
    return {
        "pr_inside": (inside != NOT_APPLICABLE, inside == 1),
        "pr_a_given_inside": (within, within & aggregated),
        "pr_a_given_outside": (without, without & aggregated),
        "pr_a": (decided, aggregated),
        "pr_sticks": (decided, aggregated & (bond != HOOK)),
        "pr_hangs": (decided, aggregated & (bond == HOOK)),
        "pr_class": (np.broadcast_to(decided, classes.shape), classes),
        "pr_bond": (np.broadcast_to(aggregated, bonds.shape), bonds),
    }
