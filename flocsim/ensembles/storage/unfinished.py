"""What an unfinished study has so far: read from its journal, which is neither locked nor changed.

The job that writes the journal only ever appends to it, so that what is whole in it stays as it is
while it is read here. A kind of study reads its rows from it.
"""

import math
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.chunks import ORDER, Condition, condition_of, fits, layout
from flocsim.ensembles.kind import kinds
from flocsim.ensembles.storage.plan import ASKED
from flocsim.ensembles.storage.row_store import ReadOnlyJournal, RowStore
from flocsim.ensembles.storage.stored_json import is_session
from flocsim.errors import FileError
from flocsim.io.records import CHUNK, SESSION, Record, matches, scan

MOST_CONDITIONS = 20_000
"""Of a study that is read while it runs."""


@attrs.frozen(eq=False)
class Unfinished:
    """What a journal holds. ``results``, as in a file of this ``kind``, have what is finished so
    far, of pairs without replicates and pooled tables; ``done`` of ``asked`` replicates (0:
    unknown), or what the ``noun`` says, are finished; ``notes`` tell of the failed ones;
    ``sessions`` describe the runs that wrote it; ``unread`` bytes of chunks are damaged or of other
    columns."""

    path: Path
    kind: str
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


def store_of(
    journal: ReadOnlyJournal, sessions: list[dict], found: list[Record], axes: dict[str, Any],
    row: np.dtype, check: Callable[[Callable[[str], np.ndarray]], None],
) -> tuple[RowStore, list[dict], int]:  # fmt: skip
    """(rows of a journal that can be believed, notes on failed ones, bytes that are damaged);
    FileError where there is none."""
    many = math.prod(len(axes[name]) for name in ORDER)
    if many > MOST_CONDITIONS:
        raise FileError(
            f"{journal.path} has {many} conditions, and at most {MOST_CONDITIONS} are shown before "
            "a study is complete: wait for the results"
        )
    if any(len(set(axes[name])) < len(axes[name]) for name in ORDER):
        raise FileError(f"{journal.path} has the same condition twice")
    conditions = tuple(Condition(*each) for each in product(*(axes[name] for name in ORDER)))
    store, notes, unread = RowStore(journal, conditions, row), [], 0
    current = any(each["layout"] == layout(row) for each in sessions)
    for each in found if current else ():
        about = each.description
        if each.kind != CHUNK or not fits(about, each.length, row):
            continue
        if (place := store.places.get(condition_of(about))) is None:
            continue
        try:
            store.add_chunk(each, place, lambda rows: check(rows.__getitem__))
        except ValueError:
            unread += each.length
            continue
        notes += about.get("notes", [])
    if not store.there():
        raise FileError(f"{journal.path} has no finished replicate yet: try again later")
    return store, notes, unread


def read_unfinished(path: str | Path) -> Unfinished:
    """What the journal at ``path`` holds; FileError where it holds no finished replicate."""
    path = Path(path)
    try:
        with open(path, "rb") as file:
            records = [each for each in scan(file) if isinstance(each, Record)]
    except OSError as error:
        raise FileError(f"{path} could not be read: {error.strerror}") from error
    sessions = [each.description for each in records if each.kind == SESSION]
    sessions = [each for each in sessions if is_session(each)]
    if not sessions:
        raise FileError(
            f"{path} is not a journal of an unfinished run, or has only just begun: try again"
        )
    asked = sessions[-1].get("asked")
    # Pairs come first, and are all that says nothing of itself.
    first, *others = kinds().values()
    said = [each for each in others if each.asked and matches(asked, ASKED | each.asked)]
    return (said or [first])[0].so_far(path, sessions, records)
