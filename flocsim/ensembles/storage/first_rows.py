"""The rows that a run computes first, held against those of other ranks and of earlier runs.

Whatever makes two machines, or two days, compute otherwise, the identity of a study may not see it.
Every rank runs one replicate of each kind of code before the study begins; where its bytes are not
those of all other ranks, and of the file that is gone on with, nothing is added to it.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from flocsim.ensembles.kind import Code, StudyKind
from flocsim.ensembles.storage.row_store import RowStore

Rows = dict[Code, bytes]
"""{kind of code: what is compared of the row of its first replicate at the first displacement}."""


def packed(study: StudyKind, rows: Mapping[Code, dict | None]) -> Rows:
    """The rows of StudyKind.compile as bytes."""
    return {
        code: b"".join(np.array(row[name], study.row[name]).tobytes() for name in study.compared)
        for code, row in rows.items() if row is not None
    }  # fmt: skip


def stored_rows(study: StudyKind, store: RowStore) -> Rows:
    """The same rows as a journal or an older results file has them, where it does."""
    found: dict[Code, dict | None] = {}
    for code in study.kinds:
        condition, replicate = study.first_of(code)
        place = store.conditions.index(condition)
        if any(first <= replicate < stop for first, stop in store.intervals(place)):
            found[code] = {name: store.read(place, name, replicate, replicate + 1)[0]
                           for name in study.compared}  # fmt: skip
    return packed(study, found)


def difference(
    study: StudyKind, ranks: Sequence[Rows], arithmetic: Sequence[str], stored: Rows
) -> str:
    """What was computed otherwise, in one line; "" for nothing.

    ``ranks`` and ``arithmetic``: the Rows of all ranks, and how they round (arithmetic_digest).
    """
    for rank, each in enumerate(arithmetic):
        if each != arithmetic[0]:
            return (
                f"rank {rank} rounds sin, exp and similar functions differently from rank 0 "
                "(another kind of processor, C library or numpy): run the job on machines of one "
                "kind"
            )
    for code in study.kinds:
        (name, n, share), replicate = study.first_of(code)
        which = f"replicate {replicate} of type {name}, N = {n}, delta {share:g}"
        for rank, rows in enumerate(ranks):
            if rows.get(code) != ranks[0].get(code):
                return (
                    f"{which} differs between rank {rank} and rank 0: run the job on machines of "
                    "one kind, or remove randomness from a force of your own"
                )
        if code in stored and stored[code] != ranks[0].get(code):
            return (
                f"{which} comes out differently here from the file: resume where the run was "
                "begun, or start over with --restart"
            )
    return ""
