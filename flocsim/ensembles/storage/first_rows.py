"""The rows that a run computes first, held against those of other ranks and of earlier runs.

Whatever makes two machines, or two days, compute otherwise, the identity of a study may not see it.
Every rank runs one replicate of each kind of code before the study begins; where its bytes are not
those of all other ranks, and of the file that is gone on with, nothing is added to it.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from flocsim.ensembles.chunks import COLUMNS, ROW, Condition
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.study import Kind, Study

Rows = dict[Kind, bytes]
"""{kind: the row of its first replicate at the first displacement}."""


def packed(rows: Mapping[Kind, dict | None]) -> Rows:
    """The rows of Study.compile as bytes."""
    return {
        kind: np.array(tuple(row[name] for name in COLUMNS), ROW).tobytes()
        for kind, row in rows.items() if row is not None
    }  # fmt: skip


def stored_rows(study: Study, store: RowStore) -> Rows:
    """The same rows as a journal or an older results file has them, where it does."""
    scene, found = study.config.scene, {}
    for kind in study.kinds:
        condition = Condition(scene.names[kind[0]], kind[1], scene.delta[0])
        place = store.conditions.index(condition)
        if any(first == 0 < stop for first, stop in store.intervals(place)):
            values = (store.read(place, name, 0, 1)[0] for name in COLUMNS)
            found[kind] = np.array(tuple(values), ROW).tobytes()
    return found


def difference(study: Study, ranks: Sequence[Rows], arithmetic: Sequence[str], stored: Rows) -> str:
    """What was computed otherwise, in one line; "" for nothing.

    ``ranks`` and ``arithmetic``: the Rows of all ranks, and how they round (arithmetic_digest).
    """
    scene = study.config.scene
    for rank, each in enumerate(arithmetic):
        if each != arithmetic[0]:
            return (
                f"rank {rank} rounds sin, exp and the like otherwise than rank 0 (another kind of "
                "processor, another C library or numpy): give the job machines of one kind"
            )
    for kind in study.kinds:
        name, n = scene.names[kind[0]], kind[1]
        which = f"replicate 0 of type {name}, N = {n}, delta {scene.delta[0]:g}"
        for rank, rows in enumerate(ranks):
            if rows.get(kind) != ranks[0].get(kind):
                return (
                    f"{which} comes out otherwise on rank {rank} than on rank 0: give the job "
                    "machines of one kind, or leave out what is random in a force of your own"
                )
        if kind in stored and stored[kind] != ranks[0].get(kind):
            return (
                f"{which} comes out otherwise here than it is in the file: go on where the run was "
                "begun, or begin anew by --restart"
            )
    return ""
