"""Rates of single doublets → counts and quantiles of every condition, and their table."""

from collections.abc import Container, Sequence
from typing import Any

import numpy as np

from flocsim.ensembles.storage.row_store import RowStore
from flocsim.io.results.schema import AXES
from flocsim.io.results.strength_file import (
    QUANTILES,
    ROW,
    STATUS,
    Strengths,
    labelled_conditions,
    labelled_doublets,
)


def quantiles_of(opens: np.ndarray, holding: int) -> np.ndarray:
    """Rates at which these shares of the doublets have opened, those that hold at any rate counted
    as inf; NaN without any doublet.

    The least rate at which at least the share has opened: no rate between two is made up.
    """
    ordered = np.concatenate([np.sort(opens), np.full(holding, np.inf)])
    if not len(ordered):
        return np.full(len(QUANTILES), np.nan)
    return np.quantile(ordered, QUANTILES, method="inverted_cdf")


OPENED, OPENS_AT_LEAST, HOLDS, FAILED = range(len(STATUS))
"""What was found of a doublet."""


def strengths_of(
    axes: tuple[Sequence[str], np.ndarray, np.ndarray], bound: np.ndarray,
    columns: dict[str, np.ndarray], about: dict[str, Any],
) -> Strengths:  # fmt: skip
    """The Strengths of tested doublets.

    ``axes``: types, N and δ of the study; ``bound``: how many it found bound of each condition;
    ``columns`` (k,): all of DOUBLETS.
    """
    status, opens = columns["status"], columns["opens"]
    places = np.column_stack([columns[name] for name in AXES])
    shape = bound.shape
    counts = {name: np.zeros(shape, dtype=np.int64)
              for name in ("n_tested", "n_opened", "n_holding", "n_failed")}  # fmt: skip
    rate = np.full((*shape, len(QUANTILES)), np.nan)
    for place in map(tuple, np.unique(places, axis=0).tolist()):
        rows = np.all(places == place, axis=1)
        opened = rows & np.isin(status, (OPENED, OPENS_AT_LEAST))
        holding = int(np.sum(rows & (status == HOLDS)))
        counts["n_tested"][place], counts["n_opened"][place] = rows.sum(), opened.sum()
        counts["n_holding"][place] = holding
        counts["n_failed"][place] = np.sum(rows & (status == FAILED))
        rate[place] = quantiles_of(opens[opened], holding)
    conditions = labelled_conditions(axes, {"n_bound": bound, **counts, "rate": rate})
    return Strengths(about, labelled_doublets(columns), conditions)


def strengths_in(
    store: RowStore, bound: np.ndarray, about: dict[str, Any],
    known: Container[tuple[int, int]] | None = None,
) -> Strengths:  # fmt: skip
    """The Strengths of all rows of a store, in its order; of those (place of the condition,
    replicate) that are ``known`` to be bound, all for None."""
    axes = [list(dict.fromkeys(each)) for each in zip(*store.conditions, strict=True)]
    tested = [
        (place, replicate)
        for place in range(len(store.conditions))
        for interval in store.intervals(place)
        for replicate in range(*interval)
        if known is None or (place, replicate) in known
    ]
    places, replicates = np.array(tested, dtype=np.int64).reshape(-1, 2).T
    columns = dict(zip(AXES, np.unravel_index(places, bound.shape), strict=True))
    columns["replicate"] = replicates
    for name in ROW.fields or ():
        values = [store.read(place, name, each, each + 1) for place, each in tested]
        columns[name] = np.concatenate([np.empty(0, ROW[name]), *values])
    given = axes[0], np.array(axes[1]), np.array(axes[2])
    return strengths_of(given, bound, columns, {"asked": len(tested)} | about)


def table_of(found: Strengths) -> str:
    """Counts and quantiles of every condition that has a bound doublet, as text."""
    heads = "".join(f"{f'G {100.0 * each:g} %':>12}" for each in QUANTILES)
    lines = [f"{'type':<10}{'N':>5}{'delta':>7}{'bound':>7}{'tested':>8}{'opened':>8}{heads}"]
    axes = [found.conditions.axes[name].values.tolist() for name in AXES]
    for place in np.ndindex(found.table("n_bound").shape):
        if not found.table("n_bound")[place]:
            continue
        name, n, delta = (values[each] for values, each in zip(axes, place, strict=True))
        counts = (int(found.table(f"n_{word}")[place]) for word in ("bound", "tested", "opened"))
        bound, tested, opened = counts
        rates = "".join(f"{each:>12.4g}" for each in found.table("rate")[place])
        lines.append(f"{name:<10}{n:>5}{delta:>7g}{bound:>7}{tested:>8}{opened:>8}{rates}")
    return "\n".join(lines)
