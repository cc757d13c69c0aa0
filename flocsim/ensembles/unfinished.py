"""What an unfinished study has so far: read from its journal, which is neither locked nor changed.

The job that writes the journal only ever appends to it, so that what is whole in it stays as it is
while it is read here.
"""

import os
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.chunks import Condition, condition_of, fits, layout, rows_of, total
from flocsim.ensembles.collision.failures import FAILURES
from flocsim.ensembles.estimates.numerical import numerical_errors
from flocsim.ensembles.estimates.statistics import COUNTED, probabilities
from flocsim.ensembles.estimates.summary import sums_of
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.storage.shared_rows import ReadOnlyJournal
from flocsim.ensembles.storage.stored_json import is_session
from flocsim.errors import FileError, UsageError
from flocsim.io.journal.journal import SUFFIX, journal_path
from flocsim.io.journal.records import CHUNK, SESSION, SNAPSHOT, Record, scan
from flocsim.io.json_text import matches
from flocsim.io.results.checks import check_rows
from flocsim.io.results.schema import Results

ASKED = {"types": [str], "vertices": [int], "delta": [float], "replicates": int}
"""What a session says that it was asked for, as a pattern of `flocsim.io.json_text`."""


@attrs.frozen(eq=False)
class Unfinished:
    """What a journal holds. ``results``, without replicates and pooled tables, has its counts and
    probabilities so far; ``done`` of ``asked`` replicates (0: unknown) are finished; ``notes`` tell
    of the failed ones; ``sessions`` describe the runs that wrote it; ``unread`` bytes of chunks are
    damaged or of other columns."""

    path: Path
    results: Results
    done: int
    asked: int
    notes: list[dict]
    sessions: list[dict]
    unread: int

    @property
    def progress(self) -> str:
        """ "unfinished: 120 of 400 replicates so far"."""
        of = f" of {self.asked}" if self.asked >= self.done else ""
        return f"unfinished: {self.done}{of} replicates so far"


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
    refuse_swarm(path, sessions[-1], found)
    current = any(each["layout"] == layout() for each in sessions)
    chunks = [each for each in found if each.kind == CHUNK and current]
    whole = [each for each in chunks if fits(each.description, each.length)]
    axes = axes_of(sessions[-1], [condition_of(each.description) for each in whole])
    conditions = tuple(
        Condition(name, count, share)
        for name in axes["types"] for count in axes["vertices"] for share in axes["delta"]
    )  # fmt: skip
    places = {condition: place for place, condition in enumerate(conditions)}
    with ReadOnlyJournal(str(path)) as journal:
        store, notes, unread = RowStore(journal, conditions), [], 0
        for each in whole:
            about, place = each.description, places.get(condition_of(each.description))
            if place is None:
                continue
            try:
                rows = rows_of(journal.read(each.offset, each.length))
                check_rows(rows.__getitem__, len(FAILURES), 2**31)
            except ValueError:
                unread += each.length
                continue
            first = about["first"]
            store.add(place, first, first + about["count"], each.offset, each.digest)
            notes += about.get("notes", [])
        table = tables(store, tuple(len(axes[name]) for name in ("types", "vertices", "delta")))
        done = sum(total(store.intervals(place)) for place in range(len(conditions)))
    if not done:
        raise FileError(f"{path} has no finished replicate yet: try again later")
    results = Results(
        types=axes["types"], vertices=axes["vertices"], delta=axes["delta"], replicates=None,
        probabilities=table, failures=FAILURES, count=int(table["n_total"].max()),
    )  # fmt: skip
    return Unfinished(
        path, results, done, axes["replicates"] * len(conditions), notes, sessions, unread
    )


def refuse_swarm(path: Path, session: dict, found: list[Record]) -> None:
    """FileError for a swarm study, with how far it is: what it has is read once it has ended."""
    replicates, moments = session.get("replicates"), session.get("moments")
    if not isinstance(replicates, int) or not isinstance(moments, int):
        return
    kept = {
        (each.description.get("replicate"), str(each.description.get("facts", {})))
        for each in found
        if each.kind == SNAPSHOT and each.description.get("of") == "moment"
    }
    raise FileError(
        f"{path} is of swarms that still run, or were stopped: {len(kept)} of "
        f"{replicates * moments} snapshots so far; --resume goes on, and its results can be read "
        "once it has ended"
    )


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
