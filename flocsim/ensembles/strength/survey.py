"""All bound doublets of a results file, each put into flows of rising rates."""

import contextlib
import hashlib
import json
import os
import time
from collections.abc import Callable, Generator, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import attrs
import numpy as np

from flocsim.ensembles.storage.identity import physics_digest
from flocsim.ensembles.strength.distribution import strengths_of
from flocsim.ensembles.strength.opening import FLOWS, Doublet, Opening
from flocsim.ensembles.strength.processes import dealt
from flocsim.ensembles.studies.opened import StudyResults, open_results
from flocsim.errors import UsageError
from flocsim.fields import is_number, is_whole
from flocsim.io.provenance import now, package_version
from flocsim.io.results.schema import AGGREGATED, OUTCOMES
from flocsim.io.results.strength_file import STATUS, Strengths

KEEP_SECONDS = 20.0
"""Seconds after which what has been tested is kept again, as soon as a doublet is done."""

TESTING = ("ensembles/strength/opening.py",)
"""The code by which a doublet is tested; that by which it is run is part of the study's identity,
without which no replicate is run again."""


class OtherSurvey(UsageError):
    """What is to be gone on with is of another study, flow, precision or flocsim."""


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


def checked(results: StudyResults, flow: Any, count: Any, precision: Any, jobs: Any) -> list[Bound]:
    """The bound doublets of a file; UsageError for none, and for what cannot be asked."""
    if flow not in FLOWS:
        raise UsageError(f"flow must be one of {', '.join(FLOWS)}, found {flow!r}")
    if count is not None and (not is_whole(count) or count < 1):
        raise UsageError(f"count must be a whole number from 1, found {count!r}")
    if not is_number(precision) or not 1e-9 <= precision <= 1.0:
        raise UsageError(f"precision must lie between 1e-9 and 1, found {precision!r}")
    if not is_whole(jobs) or jobs < 1:
        raise UsageError(f"jobs must be a whole number from 1, found {jobs!r}")
    found = list(bound_doublets(results))
    if not found:
        raise UsageError(
            f"{results.path} holds no bound doublet (class {' or '.join(AGGREGATED)}): there is no "
            "bond to test"
        )
    return found


def survey(
    results: StudyResults, flow: str = "shear", *, count: int | None = None,
    precision: float = 5e-3, jobs: int = 1, known: Strengths | None = None,
    tell: Callable[[str], None] = lambda _: None, keep: Callable[[Strengths], None] | None = None,
    every: float = KEEP_SECONDS,
) -> Strengths:  # fmt: skip
    """The rates at which the bound doublets of a study open in a flow.

    ``flow``: a key of FLOWS; ``count`` of every condition, all by default; ``precision`` of a rate;
    ``jobs``: processes of this machine, on which no number depends; ``known``: what an earlier
    survey of the same has found, which is not tested again. ``tell`` takes a line about each;
    ``keep`` what has been tested so far, whenever a doublet is done ``every`` [s] or more after the
    last time, at the end, and where anything, such as a KeyboardInterrupt, ends it early.
    UsageError where the file holds no bound doublet, and where its replicates cannot be run again;
    OtherSurvey where ``known`` is of something else.
    """
    found = checked(results, flow, count, precision, jobs)
    chosen = set(chosen_of(found, count))
    about = about_of(results, flow, precision)
    openings = {} if known is None else taken_over(known, about, found)
    wanted = [each for each in found if each in openings or each in chosen]
    about |= {"asked": len(wanted), "date": now() if known is None else known.about.get("date")}

    def so_far() -> Strengths:
        tested = [each for each in found if each in openings]
        complete = len(tested) == len(wanted)
        shape = len(results.types), len(results.vertices), len(results.delta)
        bound = np.zeros(shape, dtype=np.int64)
        np.add.at(bound, tuple(np.array([each[:3] for each in found]).T), 1)
        axes = results.types, results.vertices, results.delta
        rows = [openings[each] for each in tested]
        return strengths_of(axes, bound, np.array(tested), rows, about | {"complete": complete})

    todo = [each for each in wanted if each not in openings]
    kept_at, unkept = time.monotonic(), 0
    try:
        # Closed at once, not when it is collected: its processes are to end before anything else.
        with contextlib.closing(answers(results, flow, precision, todo, jobs)) as tested:
            for each, opening in tested:
                openings[each] = opening
                unkept += 1
                name, n, delta = results.types[each.type], *conditions(results, each)
                tell(f"{len(openings)} of {len(wanted)}: type {name}, N = {n}, delta {delta:g}, "
                     f"replicate {each.replicate}: {in_words(opening)}")  # fmt: skip
                if keep is not None and time.monotonic() - kept_at >= every:
                    keep(so_far())
                    kept_at, unkept = time.monotonic(), 0
    except BaseException:
        if keep is not None and unkept:
            keep(so_far())
        raise
    if keep is not None:
        keep(so_far())
    return so_far()


def answers(
    results: StudyResults, flow: str, precision: float, todo: list[Bound], jobs: int
) -> Generator[tuple[Bound, Opening]]:
    """(doublet, Opening) of each, in whatever order several processes have them."""
    if jobs == 1 or len(todo) < 2:
        for each in todo:
            yield each, opening_of(results, each, flow, precision)
        return
    given = results.source, os.fspath(results.folder), flow, precision
    yield from dealt(tester, given, todo, jobs)


def tester(
    path: os.PathLike, folder: str, flow: str, precision: float
) -> Callable[[Bound], Opening]:
    """What a process does: the Opening of each doublet of a file that it is asked for."""
    return partial(opened_again, open_results(path, folder), flow, precision)


def opened_again(results: StudyResults, flow: str, precision: float, each: Bound) -> Opening:
    """`opening_of` with the doublet last."""
    return opening_of(results, each, flow, precision)


def opening_of(results: StudyResults, each: Bound, flow: str, precision: float) -> Opening:
    """Run a doublet of a file again until it is bound, and then in flows."""
    n, delta = conditions(results, each)
    start = results.replicate(each.replicate, results.types[each.type], n, delta)
    return Doublet(start, flow).opening(precision)


def about_of(results: StudyResults, flow: str, precision: float) -> dict[str, Any]:
    """What two surveys have to agree on, so that one can go on with the doublets of the other."""
    return {
        "flow": flow, "precision": precision, "study": Path(results.path).name,
        "study_digest": digest_of(results), "flocsim_version": package_version("flocsim"),
        "code": physics_digest(names=TESTING),
    }  # fmt: skip


def digest_of(results: StudyResults) -> str:
    """A hash of what the doublets of a file follow from, and of which are bound by what."""
    found = hashlib.blake2b(digest_size=16)
    facts = results.stored("identity"), list(results.types)
    found.update(json.dumps(facts, sort_keys=True).encode())
    rows = results.replicates["outcome"], results.replicates["bond"]
    for values in (results.vertices, results.delta, *rows):
        array = np.ascontiguousarray(values)
        found.update(f"{array.shape} {array.dtype.str}".encode())
        found.update(array.tobytes())
    return found.hexdigest()


UNLIKE = {
    "study": "it is of the study {there}, not of {here}",
    "study_digest": "the study {study} holds other data than the one that it is of",
    "flow": "its flow is {there}, not {here}",
    "precision": "its precision is {there}, not {here}",
    "flocsim_version": "it was made by flocsim {there}, and this is {here}",
    "code": "flocsim has changed how it tests doublets",
}
"""What is to agree → words where it does not."""


def taken_over(known: Strengths, about: dict[str, Any], found: list[Bound]) -> dict[Bound, Opening]:
    """The Openings of an earlier survey; OtherSurvey where it is not of the same."""
    for name, words in UNLIKE.items():
        if known.about.get(name) != about[name]:
            there = known.about.get(name, "unknown")
            raise OtherSurvey(words.format(there=there, here=about[name], study=about["study"]))
    columns = [known.column(name).tolist() for name in Bound._fields]
    places = [Bound(*row) for row in zip(*columns, strict=True)]
    fields = [each.name for each in attrs.fields(Opening)]
    rows = zip(*(known.column(name).tolist() for name in fields), strict=True)
    openings = {each: Opening(*row) for each, row in zip(places, rows, strict=True)}
    if len(openings) < len(places) or not set(openings) <= set(found):
        raise OtherSurvey("it has doublets that the study does not have, or one of them twice")
    return openings


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
