"""From the outcomes of single collisions to counts, probabilities and their intervals.

Of single conditions, and pooled over all displacements. There a replicate has the same orientations
at every displacement, so that its collisions are not independent: the interval is Wilson's at the
number of independent events which the spread between replicates shows (a ratio of cluster totals;
W. G. Cochran, Sampling Techniques, 1977, ch. 6). And the rule that ends a study early, once these
are narrow enough, where the config asks for one.
"""

import math
from collections.abc import Mapping, Sequence

import attrs
import numpy as np

from flocsim.ensembles.config.schema import StopConfig
from flocsim.ensembles.estimates.paired import sums_of_scrambles
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.io import confidence
from flocsim.io.results import schema
from flocsim.io.results.checks import FURTHER_RUNS
from flocsim.io.results.events import HELD, MISSED, UNDECIDED, Events, events, events_of

CODES = ("outcome", "inside", "bond")
"""The columns of first runs that are counted."""

COUNTED = tuple(f"{run}{name}" for run in ("", *(f"{each}_" for each in FURTHER_RUNS))
                for name in CODES)  # fmt: skip
"""All columns that are counted: of first runs, of those run again, a third time, and with outlines
cut otherwise."""

EXACT_RUNS = COUNTED[: 3 * len(CODES)]
"""The columns of the first, second and third runs, with outlines as they were cut."""


def by_runs(columns: Sequence[np.ndarray]) -> list[Sequence[np.ndarray]]:
    """CODES of each run, from columns in the order of COUNTED, all of them or the first ones."""
    return [columns[k : k + len(CODES)] for k in range(0, len(columns), len(CODES))]


def count(outcome: np.ndarray, inside: np.ndarray, bond: np.ndarray) -> dict[str, np.ndarray]:
    """Whole-number counts over the last axis.

    n_total = n_missed + n_held + n_undecided + n_failed + Σ n_class. n_collided counts every
    replicate whose outlines touched, whatever came later: a collision that ended undecided or
    failed still happened inside or outside the zone, and is in n_collided and n_inside. Σ n_bond is
    the number of aggregated ones, A + C.
    """
    classes = [np.sum(outcome == code, axis=-1) for code in range(len(schema.CLASSES))]
    bonds = [np.sum(bond == 1 + place, axis=-1) for place in range(len(schema.BONDS))]
    return {
        "n_total": np.sum(np.ones(outcome.shape, dtype=np.int64), axis=-1),
        "n_missed": np.sum(outcome == MISSED, axis=-1),
        "n_held": np.sum(outcome == HELD, axis=-1),
        "n_undecided": np.sum(outcome == UNDECIDED, axis=-1),
        "n_failed": np.sum(outcome == schema.FAILED, axis=-1),
        "n_collided": np.sum(inside != schema.NOT_APPLICABLE, axis=-1),
        "n_inside": np.sum(inside == 1, axis=-1),
        "n_class": np.stack(classes, axis=-1),
        "n_bond": np.stack(bonds, axis=-1),
    }


def probabilities(counts: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Probabilities with 95 % intervals (``_low``, ``_high``) from counts, also pooled ones.

    Wilson's, from the low end for none to the high end for all of those that are undecided or have
    failed (`flocsim.io.confidence.proportion`).

    pr_inside = n_inside / n_collided: where the outlines first touched is known for every one.
    pr_a_given_inside = A/(A+B), pr_a_given_outside = C/(C+D), pr_a = (A+C)/(A+B+C+D) and
    pr_class = (A, B, C, D)/(A+B+C+D): over decided collisions, as an undecided or failed one has
    no class. pr_a = pr_sticks + pr_hangs, by their bonds: a hook hangs, the others stick; pr_bond =
    n_bond/(A+C). NaN where the denominator is 0. pr_inside equals A + B of pr_class, the paper's
    identity, exactly when every collision was decided.
    """
    table: dict[str, np.ndarray] = {}
    for name, (trials, successes, unknown) in events_of(counts).items():
        values = confidence.proportion(successes, trials, unknown=unknown)
        table |= zip((name, f"{name}_low", f"{name}_high"), values, strict=True)
    return table


def pooled_sums(outcome: np.ndarray, inside: np.ndarray, bond: np.ndarray) -> dict[str, np.ndarray]:
    """{estimate: bounded_sums (3, 6, type, vertices)}: a replicate over all displacements is a
    cluster. Codes are (type, vertices, delta, replicate)."""
    sums, counted = {}, events(outcome, inside, bond)
    for name in schema.POOLED_PROBABILITIES:
        each = Events(*(flags.sum(axis=2, dtype=np.int64) for flags in counted[name]))
        sums[name] = confidence.bounded_sums(each.successes, each.trials, each.unknown)
    return sums


def pooled_probabilities(sums: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays of POOLED; NaN where there was no event."""
    table: dict[str, np.ndarray] = {}
    for name, each in sums.items():
        share, low, high, effective = confidence.clustered_proportion(each)
        table |= {name: share, f"{name}_low": low, f"{name}_high": high}
        table[f"n_effective_{name}"] = effective
    return table


OF_SCRAMBLES = " of scrambles"
"""Behind the name of a probability: what is summed of it for every scramble."""


def scrambled_sums(
    codes: Sequence[np.ndarray], first: int, scrambles: int
) -> dict[str, np.ndarray]:
    """{"pr_a of scrambles": whole numbers (3, type, …, scramble)} of trials, successes and unknown.

    ``codes``: outcome, inside, bond of replicates from the ``first`` on, replicate k of scramble k
    mod ``scrambles``; nothing for none.
    """
    if not scrambles:
        return {}
    found = {}
    for name, each in events(*codes).items():
        sums = sums_of_scrambles(np.stack(each), first, scrambles)
        found[name + OF_SCRAMBLES] = np.moveaxis(sums, 1, -2) if schema.last_axis(name) else sums
    return found


def scrambled_probabilities(
    sums: Mapping[str, np.ndarray], pooled: bool = False
) -> dict[str, np.ndarray]:
    """Ends of the intervals of replicates that are points of scrambles, from scrambled_sums, in
    the place of those for independent ones; also n_effective where all displacements are
    ``pooled``."""
    table: dict[str, np.ndarray] = {}
    for key, each in sums.items():
        name = key.removesuffix(OF_SCRAMBLES)
        if pooled and name not in schema.POOLED_PROBABILITIES:
            continue
        trials, successes, unknown = each.sum(axis=3) if pooled else each
        low, high, effective = confidence.scrambled_proportion(successes, trials, unknown)
        table |= {f"{name}_low": low, f"{name}_high": high}
        if pooled:
            table[f"n_effective_{name}"] = effective
    return table


GROWTH = 1.25
"""Each look is at so many times the replicates of the one before."""


def borders(stop: StopConfig, replicates: int) -> list[int]:
    """The numbers of replicates at which the rule looks; the last is ``replicates``."""
    looks = []
    look = stop.least
    while stop.half_width is not None and look < replicates:
        looks.append(look)
        look = math.ceil(GROWTH * look)
    return [*looks, replicates]


@attrs.define
class StopRule:
    """Whether the first so many replicates of every condition are enough. Counts as it goes."""

    stop: StopConfig
    store: RowStore
    seen: int = 0
    counts: list[dict[str, np.ndarray]] = attrs.Factory(list)

    def __call__(self, replicates: int) -> bool:
        """Whether the study may end with this many, all of which exist."""
        for place in range(len(self.store.conditions)):
            codes = (self.store.read(place, name, self.seen, replicates) for name in CODES)
            more = count(*codes)
            if place == len(self.counts):
                self.counts.append(more)
            else:
                before = self.counts[place]
                self.counts[place] = {name: more[name] + before[name] for name in more}
        self.seen = replicates
        if self.stop.half_width is None:
            return False
        return all(self.is_narrow(counts) for counts in self.counts)

    def is_narrow(self, counts):
        """Whether the intervals of a condition are narrow enough."""
        table = probabilities(counts)
        widths = [table[f"{name}_high"] - table[f"{name}_low"] for name in self.stop.of]
        return not np.any(0.5 * np.array(widths) > self.stop.half_width)
