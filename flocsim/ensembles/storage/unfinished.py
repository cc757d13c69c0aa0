"""What an unfinished study has so far, read from its journal in one state while the job that writes
it goes on. A kind of study makes of its rows what it makes of those of a finished one.
"""

from itertools import product
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.config import STUDIES, contents_of
from flocsim.ensembles.kind import ORDER, Condition, layout
from flocsim.ensembles.storage.identity import short
from flocsim.ensembles.storage.row_store import RowStore, sessions_of
from flocsim.errors import FileError
from flocsim.io.groups import UNREADABLE
from flocsim.io.journal import JournalReader, read_journal
from flocsim.io.json_text import matches

ASKED = {"types": [str], "vertices": [int], "delta": [float], "replicates": int}


@attrs.frozen(eq=False)
class Unfinished:
    """What a journal holds. ``results``, as in a file of this ``kind``, have what is finished so
    far, of pairs without replicates and pooled tables; ``done`` of ``asked`` replicates (0:
    unknown), or what the ``noun`` says, are finished; ``notes`` tell of the failed ones;
    ``sessions`` describe the runs that wrote it; ``unread`` records are damaged or of no run."""

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


def store_of(journal: JournalReader, sessions: list[dict], row: np.dtype) -> RowStore:
    """Return the rows and parts of a journal; FileError where there is nothing."""
    last = sessions[-1]
    if last["layout"] != layout(row):
        raise FileError(f"{journal.path} was written by another version of flocsim: use that one")
    axes = [last["asked"][name] for name in ORDER]
    conditions = tuple(Condition(*each) for each in product(*axes))
    known = {short(each["identity"]) for each in sessions}
    store = RowStore(journal, conditions, row, known=known)
    store.load()
    if not store.there() and not store.parts:
        raise FileError(f"{journal.path} has no finished replicate yet: try again later")
    return store


def read_unfinished(path: str | Path) -> Unfinished:
    """Return what the journal at ``path`` holds; FileError where it holds no finished replicate."""
    with read_journal(Path(path)) as journal:
        sessions = list(sessions_of(journal).values())
        last = sessions[-1] if sessions else {}
        name, asked = last.get("kind"), last.get("asked")
        if not matches(asked, ASKED) or name not in STUDIES:
            raise FileError(f"{path} has only just begun: try again")
        kind = STUDIES[name].part("study").KINDS[0]
        store = store_of(journal, sessions, kind.row)
        try:
            results, done, of = contents_of(name).so_far(store, asked)
        except UNREADABLE as error:
            raise FileError(f"{path} cannot be read: {error}") from error
        unread, notes = len(store.refused), store.notes
        return Unfinished(journal.path, name, results, done, of, notes, sessions, unread, kind.noun)
