"""All bound doublets of a results file, each put into flows of rising rates."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flocsim.ensembles.strength.distribution import strengths_of
from flocsim.ensembles.strength.opening import FLOWS, Doublet, Opening
from flocsim.ensembles.studies.opened import StudyResults
from flocsim.errors import UsageError
from flocsim.fields import is_number, is_whole
from flocsim.io.provenance import now, package_version
from flocsim.io.results.schema import AGGREGATED, OUTCOMES
from flocsim.io.results.strength_file import STATUS, Strengths


class Bound(NamedTuple):
    """Where a bound doublet stands in a file: places of type, N and δ, the replicate, its bond."""

    type: int
    vertices: int
    delta: int
    replicate: int
    bond: int


def bound_doublets(results: StudyResults) -> Iterator[Bound]:
    """The doublets that a study has found bound, in the order of the file."""
    outcomes, bonds = results.replicates["outcome"], results.replicates["bond"]
    codes = [OUTCOMES.index(name) for name in AGGREGATED]
    for place in np.argwhere(np.isin(outcomes, codes)).tolist():
        first, second, third, replicate = place
        yield Bound(first, second, third, replicate, int(bonds[tuple(place)]))


def chosen_of(found: list[Bound], count: int | None) -> list[Bound]:
    """The first ``count`` of every condition; all for None."""
    taken: dict[tuple[int, ...], int] = {}
    chosen = []
    for each in found:
        taken[each[:3]] = taken.get(each[:3], 0) + 1
        if count is None or taken[each[:3]] <= count:
            chosen.append(each)
    return chosen


def survey(
    results: StudyResults, flow: str = "shear", *, count: int | None = None,
    precision: float = 5e-3, tell: Callable[[str], None] = lambda _: None,
) -> Strengths:  # fmt: skip
    """The rates at which the bound doublets of a study open in a flow.

    ``flow``: a key of FLOWS; ``count`` of every condition, all by default; ``precision`` of a rate.
    ``tell`` takes a line about each. UsageError where the file holds no bound doublet, or where
    its replicates cannot be run again.
    """
    if flow not in FLOWS:
        raise UsageError(f"flow must be one of {', '.join(FLOWS)}, found {flow!r}")
    if count is not None and (not is_whole(count) or count < 1):
        raise UsageError(f"count must be a whole number from 1, found {count!r}")
    if not is_number(precision) or not 1e-9 <= precision <= 1.0:
        raise UsageError(f"precision must lie between 1e-9 and 1, found {precision!r}")
    found = list(bound_doublets(results))
    chosen = chosen_of(found, count)
    if not chosen:
        raise UsageError(
            f"{results.path} holds no bound doublet (class {' or '.join(AGGREGATED)}): there is no "
            "bond to test"
        )
    openings: list[Opening] = []
    for number, each in enumerate(chosen, 1):
        name, n, delta = results.types[each.type], *conditions(results, each)
        start = results.replicate(each.replicate, name, n, delta)
        openings.append(Doublet(start, flow).opening(precision))
        tell(f"{number} of {len(chosen)}: type {name}, N = {n}, delta {delta:g}, replicate "
             f"{each.replicate}: {in_words(openings[-1])}")  # fmt: skip
    about = {
        "flow": flow, "precision": precision, "study": Path(results.path).name,
        "flocsim_version": package_version("flocsim"), "date": now(),
    }  # fmt: skip
    shape = len(results.types), len(results.vertices), len(results.delta)
    bound = np.zeros(shape, dtype=np.int64)
    np.add.at(bound, tuple(np.array([each[:3] for each in found]).T), 1)
    axes = results.types, results.vertices, results.delta
    return strengths_of(axes, bound, np.array(chosen), openings, about)


def conditions(results: StudyResults, each: Bound) -> tuple[int, float]:
    """(N, δ) of a doublet."""
    return int(results.vertices[each.vertices]), float(results.delta[each.delta])


def in_words(opening: Opening) -> str:
    """What was found of one doublet, in words."""
    runs = f"({opening.runs} runs)"
    word = STATUS[opening.status]
    if word == "opened":
        return f"opens at {opening.opens:.4g} 1/s {runs}"
    if word == "opens_at_least_rate":
        return f"opens at {opening.opens:.4g} 1/s already, the lowest rate {runs}"
    if word == "holds_at_most_rate":
        return f"holds up to {opening.holds:.4g} 1/s, the highest rate {runs}"
    return f"a run failed behind {opening.holds:.4g} 1/s {runs}"
