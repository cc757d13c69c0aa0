"""From the rows of all replicates to tables and columns, a block of replicates at a time.

The error by the shape is what probabilities would be with the outlines of all flocs cut closer, or
wider. The same replicates are run with outlines at either end of their bands, so that the change is
one of paired proportions, over the replicates that count both times. The interval of the shape
reaches from the lower 95 % bound of the one change to the upper bound of the other, and holds 0.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.collision.draw import FAILURES
from flocsim.ensembles.estimates import numerical, statistics
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.study import Study
from flocsim.io.results import schema
from flocsim.io.results.events import Events, events
from flocsim.io.results.kernel_group import Kernel


def outline_sums(
    first: Sequence[np.ndarray], ends: Sequence[Sequence[np.ndarray]]
) -> dict[str, np.ndarray]:
    """Return {probability: whole numbers (end, 3, type, …, 4)}, bounded_cells of replicates with
    outlines cut otherwise, and as they were cut; nothing where none was run so.

    ``first``, ``ends``: outcome, inside and bond, codes (type, vertices, delta, replicate).
    """
    if all(np.all(outcome == schema.NOT_APPLICABLE) for outcome, _, _ in ends):
        return {}
    as_cut = events(*first)
    found: dict[str, list[np.ndarray]] = {name: [] for name in as_cut}
    for codes in ends:
        run = codes[0] != schema.NOT_APPLICABLE
        for name, here in events(*codes).items():
            both = [
                Events(*(numerical.along(run, flags) & flags for flags in each))
                for each in (here, as_cut[name])
            ]
            cells = statistics.bounded_cells(both[0], both[1])
            found[name].append(cells)
    return {name: np.stack(cells) for name, cells in found.items()}


def outline_changes(
    sums: Mapping[str, np.ndarray], table: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Return the arrays of OUTLINES from outline_sums; NaN where no replicate counts.

    ``table``: the probabilities as cut, which no change takes beyond 0 and 1.
    """
    found: dict[str, np.ndarray] = {}
    for name, cells in sums.items():
        differences, lows, highs = zip(
            *(statistics.bounded_difference(each, scrambled=False) for each in cells), strict=True
        )
        found |= {f"{name}_{end}": change
                  for end, change in zip(schema.BAND_ENDS, differences, strict=True)}  # fmt: skip
        low, high = np.minimum(*lows), np.maximum(*highs)
        found[f"{name}_shape_low"] = np.clip(low, -table[name], 0.0)
        found[f"{name}_shape_high"] = np.clip(high, 0.0, 1.0 - table[name])
    return found


BLOCK_ROWS = 65_536
"""Rows, of all conditions together, that are looked at together: 11 MB."""


@attrs.define
class Reader:
    """All rows of a finished study, in the order of the results file.

    ``shape``: how many types, vertices, delta, replicates.
    """

    store: RowStore
    shape: tuple[int, ...]

    def codes(self, first: int, stop: int) -> tuple[np.ndarray, ...]:
        """Return COUNTED of replicates [first, stop) of all conditions: Codes."""
        rows = self.part(first, stop)
        return tuple(rows[name] for name in statistics.COUNTED)

    def part(self, first: int, stop: int) -> np.ndarray:
        """Return the rows of replicates [first, stop) (type, vertices, delta, replicate)."""
        parts = [self.store.rows(place, first, stop) for place in range(len(self.store.conditions))]
        return np.stack(parts).reshape(*self.shape[:3], -1)


Codes = Callable[[int, int], tuple[np.ndarray, ...]]
"""Gives COUNTED of replicates [first, stop), each (type, vertices, delta, replicate)."""

Sums = dict[tuple[str, str], np.ndarray]
"""Whole numbers by part (counted, pooled, joint, scrambles, outlines) and name, those of some
replicates and of others being added up."""


def sums_of(codes: Codes, conditions: int, first: int, stop: int, scrambles: int = 0) -> Sums:
    """Return the Sums of replicates [first, stop) of so many conditions, points of
    ``scrambles``."""
    step = max(BLOCK_ROWS // conditions, 1)
    sums: Sums = {}
    for start in range(first, max(stop, first + 1), step):
        own, again, third, *ends = statistics.by_runs(codes(start, min(start + step, stop)))
        parts = {
            "counted": statistics.count(*own) | numerical.count_changes(own, again, third),
            "pooled": statistics.pooled_sums(*own),
            "joint": {"": statistics.joint_counts(own[0], own[1], start, scrambles)},
            "scrambles": statistics.scrambled_sums(own, start, scrambles),
            "outlines": outline_sums(own, ends),
        }
        found = {(part, k): each for part, some in parts.items() for k, each in some.items()}
        sums = added(sums, found)
    return sums


def added(sums: Sums, more: Sums) -> Sums:
    """Return the sum of two Sums; what only one of them has stands for itself."""
    both = {name: sums[name] + more[name] for name in sums.keys() & more.keys()}
    return {name: both.get(name, values) for name, values in {**more, **sums}.items()}


def part_of(sums: Sums, part: str) -> dict[str, np.ndarray]:
    """Return {name: whole numbers} of one part of Sums."""
    return {name: each for (of, name), each in sums.items() if of == part}


def tables_of(sums: Sums) -> dict[str, Any]:
    """Return the arrays of the groups of a results file that follow from the Sums of a whole
    study."""
    counted, of_scrambles = part_of(sums, "counted"), part_of(sums, "scrambles")
    over_delta = {name: values.sum(axis=2) for name, values in counted.items()}
    together = numerical.numerical_of(numerical.change_intervals(over_delta))
    changes = numerical.change_intervals(counted)
    table, clusters, scrambles = table_from(counted, changes), part_of(sums, "pooled"), 0
    if of_scrambles:
        # Points of a scramble depend on each other: these are the clusters, of a condition, too.
        scrambles = of_scrambles["pr_a"].shape[-1]
        alone = statistics.clustered_probabilities(of_scrambles, scrambles)
        table |= {name: each for name, each in alone.items() if name in table}
        clusters = {name: of_scrambles[name].sum(axis=3) for name in clusters}
    pooled = statistics.clustered_probabilities(clusters, scrambles)
    return {
        "probabilities": table,
        "pooled": pooled | {k: each for k, each in together.items() if k in schema.POOLED},
        "differences": statistics.paired_differences(sums["joint", ""], bool(of_scrambles)),
        "numerics": numerical.change_columns(changes),
        "outlines": outline_changes(part_of(sums, "outlines"), table),
    }


def table_from(
    counted: Mapping[str, np.ndarray], changes: numerical.Intervals | None = None
) -> dict[str, np.ndarray]:
    """Return the table of probabilities from what is counted of conditions; ``changes``: its
    change_intervals, where they are there."""
    counts = {name: values for name, values in counted.items() if name.startswith("n_")}
    changes = numerical.change_intervals(counted) if changes is None else changes
    return counts | statistics.probabilities(counts) | numerical.numerical_of(changes)


def results_of(
    study: Study, count: int, sums: Sums, run: dict, kernel: Kernel | None = None
) -> schema.Results:
    """Return the Results of so many replicates of each condition from their Sums."""
    config = study.config
    return schema.Results(
        types=config.scene.names,
        vertices=np.array(config.shapes.vertices),
        delta=np.array(config.scene.delta),
        replicates=None,
        run=run,
        failures=FAILURES,
        flocs=tuple(floc.name for floc in study.flocs),
        count=count,
        radii=study.radii,
        kernel=kernel,
        **tables_of(sums),
    )
