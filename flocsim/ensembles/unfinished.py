"""What an unfinished study has so far: read from its journal, which is neither locked nor changed.

The job that writes the journal only ever appends to it, so that what is whole in it stays as it is
while it is read here.
"""

import os
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.chunks import (
    ROW,
    Condition,
    condition_of,
    fits,
    is_chunk,
    layout,
    rows_of,
    total,
)
from flocsim.ensembles.collision.failures import FAILURES
from flocsim.ensembles.estimates.numerical import numerical_errors
from flocsim.ensembles.estimates.statistics import COUNTED, probabilities
from flocsim.ensembles.estimates.strengths import strengths_in
from flocsim.ensembles.estimates.summary import sums_of
from flocsim.ensembles.storage.plan import ASKED
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.storage.shared_rows import ReadOnlyJournal
from flocsim.ensembles.storage.stored_json import is_session
from flocsim.ensembles.swarms.assembly import groups_of, results_from
from flocsim.ensembles.swarms.checks import FORM, Form, check_part
from flocsim.ensembles.swarms.records import Found, part_of
from flocsim.errors import FileError, UsageError
from flocsim.fields import is_whole
from flocsim.io.journal.journal import SUFFIX, journal_path
from flocsim.io.journal.records import CHUNK, SESSION, SNAPSHOT, Record, scan
from flocsim.io.json_text import matches
from flocsim.io.results.checks import check_rows
from flocsim.io.results.schema import Results
from flocsim.io.results.strength_file import ROW as STRENGTH_ROW
from flocsim.io.results.strength_file import check_opened
from flocsim.io.results.swarm_file import ENDS, check_swarm

ORDER = ("types", "vertices", "delta")
"""Axes of conditions, as a session has them."""


@attrs.frozen(eq=False)
class Unfinished:
    """What a journal holds. ``results``, without replicates and pooled tables, has its counts and
    probabilities so far, or snapshots; ``done`` of ``asked`` replicates (0: unknown), or what the
    ``noun`` says, are finished; ``notes`` tell
    of the failed ones; ``sessions`` describe the runs that wrote it; ``unread`` bytes of chunks are
    damaged or of other columns."""

    path: Path
    results: Any
    done: int
    asked: int
    notes: list[dict]
    sessions: list[dict]
    unread: int
    noun: str = "replicates"

    @property
    def progress(self) -> str:
        """ "unfinished: 120 of 400 replicates so far"."""
        of = f" of {self.asked}" if self.asked >= self.done else ""
        return f"unfinished: {self.done}{of} {self.noun} so far"


def journal_of(path: str | Path) -> Path | None:
    """The journal to read where a command is given this path: the path itself, or the journal
    beside results that are not there yet; None where there is neither."""
    place = Path(path)
    if place.name.endswith(SUFFIX) and place.is_file():
        return place
    try:
        beside = journal_path(path)
    except FileError:
        return None
    return beside if not os.path.lexists(path) and beside.is_file() else None


def read_unfinished(path: str | Path) -> Unfinished:
    """What the journal at ``path`` holds; FileError where it holds no finished replicate."""
    path = Path(path)
    try:
        with open(path, "rb") as file:
            records = list(scan(file))
    except OSError as error:
        raise FileError(f"{path} could not be read: {error.strerror}") from error
    found = [each for each in records if isinstance(each, Record)]
    sessions = [each.description for each in found if each.kind == SESSION]
    sessions = [each for each in sessions if is_session(each)]
    if not sessions:
        raise FileError(f"{path} is no journal of an unfinished run, or has just begun: try again")
    if (form := form_of(sessions[-1])) is not None:
        return swarms_so_far(path, sessions, found, form)
    if matches(sessions[-1].get("asked"), ASKED | {"strength": SURVEY}):
        return strengths_so_far(path, sessions, found)
    axes = axes_of(sessions[-1], [
        condition_of(each.description) for each in found
        if each.kind == CHUNK and fits(each.description, each.length)
    ])  # fmt: skip
    checked = partial(check_rows, failures=len(FAILURES), flocs=2**31)
    with ReadOnlyJournal(str(path)) as journal:
        store, notes, unread = store_of(journal, sessions, found, axes, ROW, checked)
        table = tables(store, tuple(len(axes[name]) for name in ORDER))
    done = done_in(store)
    results = Results(
        types=axes["types"], vertices=axes["vertices"], delta=axes["delta"], replicates=None,
        probabilities=table, failures=FAILURES, count=int(table["n_total"].max()),
    )  # fmt: skip
    asked = axes["replicates"] * len(store.conditions)
    return Unfinished(path, results, done, asked, notes, sessions, unread)


def store_of(
    journal: ReadOnlyJournal, sessions: list[dict], found: list[Record], axes: dict[str, Any],
    row: np.dtype, check: Callable[[Callable[[str], np.ndarray]], None],
) -> tuple[RowStore, list[dict], int]:  # fmt: skip
    """(rows of a journal that can be believed, notes on failed ones, bytes that are damaged);
    FileError where there is none."""
    conditions = tuple(Condition(*each) for each in product(*(axes[name] for name in ORDER)))
    places = {condition: place for place, condition in enumerate(conditions)}
    store, notes, unread = RowStore(journal, conditions, row), [], 0
    current = any(each["layout"] == layout(row) for each in sessions)
    for each in found if current else ():
        about = each.description
        if each.kind != CHUNK or not fits(about, each.length, row):
            continue
        if (place := places.get(condition_of(about))) is None:
            continue
        try:
            check(rows_of(journal.read(each.offset, each.length), row).__getitem__)
        except ValueError:
            unread += each.length
            continue
        first = about["first"]
        store.add(place, first, first + about["count"], each.offset, each.digest)
        notes += about.get("notes", [])
    if not done_in(store):
        raise FileError(f"{journal.path} has no finished replicate yet: try again later")
    return store, notes, unread


def done_in(store: RowStore) -> int:
    """How many replicates there are."""
    return sum(total(store.intervals(place)) for place in range(len(store.conditions)))


def swarms_so_far(path: Path, sessions: list[dict], found: list[Record], form: Form) -> Unfinished:
    """What a journal has of swarms, of which those appear that have begun."""
    asked, unread = sessions[-1]["asked"]["replicates"], 0
    parts: dict[int, list[Record]] = {}
    notes: list[dict] = []
    with ReadOnlyJournal(str(path)) as journal:
        for each in found:
            about = each.description
            if each.kind == CHUNK:
                notes += about.get("notes", []) if is_chunk(about) else []
            if each.kind != SNAPSHOT:
                continue
            try:
                check_part(part_of(about, journal.read(each.offset, each.length)), form)
            except ValueError:
                unread += each.length
                continue
            replicate = about.get("replicate")
            if replicate is not None and is_whole(replicate) and 0 <= replicate < asked:
                parts.setdefault(replicate, []).append(each)
        swarms = {replicate: Found.of(records) for replicate, records in sorted(parts.items())}
        swarms = {replicate: each for replicate, each in swarms.items() if each.bodies}
        done = sum(len(each.moments) for each in swarms.values())
        if not done:
            raise FileError(f"{path} has no snapshot yet: try again later")
        known = max(max(each.moments, default=0) for each in swarms.values()) + 1
        if known > done:
            raise FileError(f"{path} holds no readable swarms: snapshots of it are missing")
        seen = attrs.evolve(form, times=form.times[:known])
        groups = groups_of(seen, list(swarms.values()), journal.read)
    groups["ends"] = {name: np.zeros(len(swarms), kind) for name, (kind, _, _) in ENDS.items()}
    results = results_from(seen, groups, {"periodic": form.periodic}, np.array(list(swarms)))
    try:
        check_swarm(results.scales, groups)
    except ValueError as error:
        raise FileError(f"{path} holds no readable swarms: {error}") from error
    return Unfinished(
        path, results, done, asked * len(form.times), notes, sessions, unread, "snapshots"
    )


SURVEY = {"bound": [int], "wanted": int, "about": {}}
"""What a session says of strengths, as a pattern."""


def strengths_so_far(path: Path, sessions: list[dict], found: list[Record]) -> Unfinished:
    """What a journal has of the strengths of bonds."""
    asked = sessions[-1]["asked"]
    survey, shape = asked["strength"], tuple(len(asked[name]) for name in ORDER)
    if len(survey["bound"]) != np.prod(shape):
        raise FileError(f"{path} does not say what is bound")
    bound = np.array(survey["bound"], dtype=np.int64).reshape(shape)
    about = survey["about"] | {"asked": survey["wanted"], "complete": False}
    with ReadOnlyJournal(str(path)) as journal:
        store, notes, unread = store_of(journal, sessions, found, asked, STRENGTH_ROW, check_opened)
        results = strengths_in(store, bound, about)
    done, wanted = done_in(store), survey["wanted"]
    return Unfinished(path, results, done, wanted, notes, sessions, unread, "doublets")


def form_of(session: dict) -> Form | None:
    """What the records of swarms look like by a session; None in studies of anything else."""
    asked: Any = session.get("asked")
    about: Any = asked.get("swarm") if matches(asked, ASKED) else None
    if not matches(about, FORM):
        return None
    times, bounds = (tuple(map(float, about[name])) for name in ("times", "bounds"))
    known = bool(times) and about["bodies"] >= 1
    return Form(about["bodies"], bounds, times, about["periodic"]) if known else None


def axes_of(session: dict, found: list[Condition]) -> dict[str, Any]:
    """ASKED of a session; of one that does not say it, what was found, and 0 replicates."""
    asked = session.get("asked")
    if matches(asked, ASKED):
        assert asked is not None
        return asked
    return {
        "types": list(dict.fromkeys(each.type for each in found)),
        "vertices": sorted({each.vertices for each in found}),
        "delta": sorted({each.delta for each in found}),
        "replicates": 0,
    }


def tables(store: RowStore, shape: tuple[int, ...]) -> dict[str, np.ndarray]:
    """The table of probabilities from all rows of a store, whose conditions have this shape."""
    each = [counts_of(store, place) for place in range(len(store.conditions))]
    counts = {
        name: np.stack([one[name] for one in each]).reshape(*shape, *each[0][name].shape)
        for name in each[0]
    }
    return counts | probabilities(counts) | numerical_errors(counts)


def counts_of(store: RowStore, place: int) -> dict[str, np.ndarray]:
    """{n_…: count} of a condition, its replicates in whatever pieces they are there."""

    def codes(first: int, stop: int) -> tuple[np.ndarray, ...]:
        near = [(max(a, first), min(b, stop)) for a, b in runs if a < stop and b > first]
        found = []
        for name in COUNTED:
            parts = [store.read(place, name, *each) for each in near]
            values = np.concatenate([np.empty(0, "i8"), *parts]).astype("i8")
            found.append(values.reshape(1, 1, 1, -1))
        return tuple(found)

    runs = store.intervals(place)
    end = runs[-1][1] if runs else 0
    try:
        sums = sums_of(codes, 1, 0, end)
    except UsageError as error:
        raise FileError(f"{store.journal.path} holds no readable rows: {error}") from error
    return {
        name: values[0, 0, 0] for name, values in sums.items() if name.startswith("n_")
    }  # fmt: skip
