"""Which replicates count in a probability, which of these as successes, and which may yet.

A replicate that is undecided or has failed could count in every probability that what is known of
it leaves open: where it has touched inside the zone it says nothing of collisions outside.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from flocsim.io.results.schema import BONDS, CLASSES, NOT_APPLICABLE, OUTCOMES, UNKNOWN


class Events(NamedTuple):
    """Flags or counts: ``trials`` that are decided, ``successes`` among them, and what is
    ``unknown``, which may be either or no trial."""

    trials: np.ndarray
    successes: np.ndarray
    unknown: np.ndarray


MISSED = OUTCOMES.index("missed")
UNDECIDED = OUTCOMES.index("undecided")
HELD = OUTCOMES.index("held")
DECIDED = len(CLASSES)
"""Outcomes below this code are classes A to D."""
MOST_UNKNOWN = 0.05
"""Share of a condition without an outcome up to which a study counts as done, unless it says."""

FEW = 10
"""Trials below which a probability of a condition says little."""

AGGREGATED = (0, 2)
INSIDE_CLASSES, OUTSIDE_CLASSES = (0, 1), (2, 3)
CERTIFICATE, HOOK, REST = (1 + BONDS.index(name) for name in ("certificate", "hook", "rest"))


WITHOUT_OUTCOME = tuple(OUTCOMES.index(name) for name in UNKNOWN)


def events(outcome: np.ndarray, inside: np.ndarray, bond: np.ndarray) -> dict[str, Events]:
    """{probability: Events}, flags (…, replicate) as the codes; those of classes and of bonds are
    (…, class, replicate)."""
    decided, aggregated = outcome < DECIDED, np.isin(outcome, AGGREGATED)
    within, without = np.isin(outcome, INSIDE_CLASSES), np.isin(outcome, OUTSIDE_CLASSES)
    unknown, apart = np.isin(outcome, WITHOUT_OUTCOME), inside == NOT_APPLICABLE
    classes = np.stack([outcome == code for code in range(len(CLASSES))], axis=-2)
    bonds = np.stack([bond == 1 + place for place in range(len(BONDS))], axis=-2)

    def of_each(flags: np.ndarray, like: np.ndarray) -> np.ndarray:
        return np.broadcast_to(flags[..., np.newaxis, :], like.shape)

    return {
        "pr_inside": Events(~apart, inside == 1, unknown & apart),
        "pr_a_given_inside": Events(within, within & aggregated, unknown & (inside != 0)),
        "pr_a_given_outside": Events(without, without & aggregated, unknown & (inside != 1)),
        "pr_a": Events(decided, aggregated, unknown),
        "pr_sticks": Events(decided, aggregated & (bond != HOOK), unknown),
        "pr_hangs": Events(decided, aggregated & (bond == HOOK), unknown),
        "pr_class": Events(of_each(decided, classes), classes, of_each(unknown, classes)),
        "pr_bond": Events(of_each(aggregated, bonds), bonds, of_each(unknown, bonds)),
    }


def approaches(outcome: np.ndarray) -> Events:
    """Events of Pr[aggregation | decided approach]: misses count."""
    return Events(
        np.isin(outcome, [*range(DECIDED), MISSED, HELD]), np.isin(outcome, AGGREGATED),
        np.isin(outcome, WITHOUT_OUTCOME),
    )  # fmt: skip


def events_of(counts: Mapping[str, np.ndarray]) -> dict[str, Events]:
    """{probability: Events} as whole numbers, from the counts ``n_…`` of conditions."""
    classes, bonds = np.asarray(counts["n_class"]), np.asarray(counts["n_bond"])
    a, b, c, d = np.moveaxis(classes, -1, 0)
    decided, aggregated, hooks = a + b + c + d, a + c, bonds[..., HOOK - 1]
    unknown = np.asarray(counts["n_undecided"]) + counts["n_failed"]
    touched, inside = np.asarray(counts["n_collided"]), np.asarray(counts["n_inside"])
    unknown_inside, unknown_outside = inside - a - b, touched - inside - c - d

    def of_each(numbers: np.ndarray, like: np.ndarray) -> np.ndarray:
        return np.broadcast_to(numbers[..., np.newaxis], like.shape)

    return {
        "pr_inside": Events(touched, inside, unknown - unknown_inside - unknown_outside),
        "pr_a_given_inside": Events(a + b, a, unknown - unknown_outside),
        "pr_a_given_outside": Events(c + d, c, unknown - unknown_inside),
        "pr_a": Events(decided, aggregated, unknown),
        "pr_sticks": Events(decided, aggregated - hooks, unknown),
        "pr_hangs": Events(decided, hooks, unknown),
        "pr_class": Events(of_each(decided, classes), classes, of_each(unknown, classes)),
        "pr_bond": Events(of_each(aggregated, bonds), bonds, of_each(unknown, bonds)),
    }


NOT_COLLIDED = ("missed", "held", "undecided", "failed")
ENDS_COUNTED = ("n_total", "n_class", *(f"n_{name}" for name in NOT_COLLIDED))
"""Counts that ends_of follows from."""


def ends_of(counts: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """{end: how many replicates}, which add up to n_total."""
    classes = np.asarray(counts["n_class"])
    aggregated = classes[..., list(AGGREGATED)].sum(axis=-1)
    found = {"aggregated": aggregated, "departed": classes.sum(axis=-1) - aggregated}
    return found | {name: np.asarray(counts[f"n_{name}"]) for name in NOT_COLLIDED}


KINDS = ("easily", "surely", "others")
"""Kinds of first runs, by how often they flip where run more exactly: those of `flips_easily`;
those held by a certificate, which all but never do; all others that have an outcome."""


def flips_easily(outcome: Any, bond: Any) -> Any:
    """Whether replicates, by their codes, are of those that flip most: a hook or a rest decides by
    overlaps, and a miss may be a graze; or cost next to nothing."""
    return (bond == HOOK) | (bond == REST) | (outcome == MISSED) | (outcome == HELD)


def kinds_of(outcome: np.ndarray, bond: np.ndarray) -> np.ndarray:
    """Flags (kind, …) of KINDS; none of them where there is no outcome."""
    known = ~np.isin(outcome, WITHOUT_OUTCOME)
    easily, surely = flips_easily(outcome, bond), bond == CERTIFICATE
    return np.stack([easily & known, surely & known, known & ~easily & ~surely])
