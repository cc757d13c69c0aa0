"""Where a study begins: with nothing, or with what a journal and an older results file hold.

First comes the lock (`claim`), then everything else is looked at. Rows only ever get more: what a
journal or a results file has beyond what is asked for stays where it is, or the run is refused.
"""

import os
import shlex
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles import kind
from flocsim.ensembles.kind import OldResults, StudyKind
from flocsim.ensembles.storage.identity import differences, short
from flocsim.ensembles.storage.row_store import RowStore, condition_of
from flocsim.errors import FileError, FlocsimError, UsageError
from flocsim.io.files import Rule, keep, ordinary_target, set_aside
from flocsim.io.groups import UNREADABLE
from flocsim.io.journal import CHUNK, OLD, PART, SESSION, Journal, Record, journal_path
from flocsim.io.json_text import matches
from flocsim.io.outputs import extension_rule, in_the_way
from flocsim.io.results.run_group import distinct, is_session, now, source_line, stored

NEW, RESUME, RESTART = "new", "resume", "restart"
"""What to do about an unfinished run: refuse to touch it, go on with it, put it aside."""

WAYS = (
    "extend it with --resume if it belongs to this study, or add --overwrite, which keeps the old "
    "one under another name"
)
"""What a user can do about a file in the place of the results."""

MOST_DIFFERENCES = 5
HISTORY = ("date", "command")
"""What is kept of a run that contributed to a results file."""


@attrs.define(eq=False)
class Beginning:
    """What a study starts from.

    ``remarks`` are for the user; ``notes`` are those on failed replicates among the found ones;
    ``history`` has date and command of the runs before. ``cpus_now`` are the kinds of CPU that
    this run computes on, ``cpus_found`` those that the found rows are of; ``replacing`` says what
    becomes of a file at the place of the results when they are written. ``rule`` is the rule that
    ends the study early, as the journal has it; ``unasked`` says that the journal has rows of other
    conditions, and ``farthest`` how far it has them of these (those beyond the end of a run with
    the same rule left out): they are not to go with it. ``at_least``: replicates that each
    condition has in the results file already. ``old``: the results file that is extended, its rows
    being in the journal by now; ``session``, the record of this run.
    """

    store: RowStore
    identity: dict
    remarks: list[str] = attrs.Factory(list)
    notes: list[dict] = attrs.Factory(list)
    history: list[dict] = attrs.Factory(list)
    rule: list | None = None
    unasked: bool = False
    farthest: int = 0
    at_least: int = 0
    cpus_now: list[dict] = attrs.Factory(list)
    cpus_found: list[dict] = attrs.Factory(list)
    replacing: Rule = keep
    old: OldResults | None = None
    session: int = 0

    def remark(self, words: str) -> None:
        """Say something of what is in the journal."""
        self.remarks.append(f"{self.journal.path}: {words}")

    @property
    def journal(self) -> Journal:
        """Where finished chunks go."""
        return self.store.writer

    @property
    def about(self) -> dict[str, Any]:
        """What the journal says of each chunk and part of this run."""
        return {"identity": short(self.identity), "session": self.session}

    def is_covered(self, count: int) -> bool:
        """Whether the older results file has so many replicates of all conditions already."""
        return (
            self.old is not None
            and not self.old.sparse
            and count <= self.old.count
            and set(self.store.conditions) <= set(self.old.conditions)
        )

    def found(self, count: int) -> list[list[kind.Interval]]:
        """Of every condition the replicates below ``count`` that exist, as intervals."""
        whole = (self.store.intervals(place) for place in range(len(self.store.conditions)))
        return [
            [(first, min(stop, count)) for first, stop in each if first < count] for each in whole
        ]


def claim(output: str | Path, mode: str, overwrite: bool = False) -> tuple[Journal, list[str]]:
    """(the locked journal of a results file, remarks): from now on no other job writes there.

    Waits for a job that is about to end, and looks at everything only then. Raises UsageError
    where an unfinished run is in the way, or results are that are neither to be extended nor to be
    set aside (``overwrite``); FileError where the journal cannot be opened, is none, or another
    job goes on writing it.
    """
    path = journal_path(output)
    journal, remarks = Journal(path), []
    try:
        if not journal.has_lock:
            remarks.append(
                f"the file system of {path} has no locks: make sure that no two jobs write there"
            )
        if mode != RESUME and not overwrite:
            check_free(output)  # before an unfinished run is put aside
        if journal.is_blank:
            journal.begin_anew()
        elif mode == RESTART:
            remarks.append(f"the unfinished run is kept as {journal.put_aside()}")
        elif journal.problem:
            raise FileError(f"{path} {journal.problem}")
        elif mode == NEW:
            raise UsageError(
                f"{path} holds an unfinished run: continue it with --resume, or start over with "
                "--restart, which keeps it under another name"
            )
    except Exception:
        journal.release()
        raise
    return journal, remarks


def begin(
    study: StudyKind, identity: dict, output: str | Path, mode: str, journal: Journal,
    old_rows: Callable[[Any], AbstractContextManager[OldResults]], cpus: Sequence[dict] = (),
    overwrite: bool = False,
) -> Beginning:  # fmt: skip
    """The Beginning of a study, run on these kinds of CPU, with results in the file ``output``.

    ``journal``: as `claim` gave it; ``old_rows`` of the Kind. Raises UsageError where what lies
    there is of another config, of other shapes or other physics, has rows that this study would
    drop, or is anything but results of this study to be extended; with ``overwrite`` that is set
    aside.
    """
    start = Beginning(RowStore(journal, study.conditions, study.row), identity)
    start.cpus_now = list(cpus)
    if (stop := study.config.stop).half_width is not None:
        start.rule = [stop.half_width, list(stop.of), stop.least]  # as JSON gives it back
    refuse_other_sessions(start, study)
    take_place(start, output, mode, overwrite, lambda: take_results(start, study, output, old_rows))
    take_journal(start, study)
    refuse_fewer(start, output, study.config.replicates)
    start.session = journal.add(SESSION, "", 0, {
        "kind": study.format, "identity": identity, "short": short(identity),
        "layout": kind.layout(study.row),
        "date": now(), "command": shlex.join(sys.argv), "cpus": start.cpus_now,
        "rule": start.rule, "asked": study.asked(), "source": source_line(study.source),
    })  # fmt: skip
    journal.sync()
    return start


def check_free(output: str | Path) -> None:
    """UsageError where there is a file at the place of the results."""
    if os.path.lexists(ordinary_target(output)):
        raise in_the_way(output, WAYS)


def take_place(
    start: Beginning, output: str | Path, mode: str, overwrite: bool, take: Callable[[], None]
) -> None:
    """``take`` the results of this study that are to be extended; nothing else may lie there."""
    if os.path.lexists(ordinary_target(output)) and mode == RESUME:
        try:
            replacing = extension_rule(output)
            take()
            start.replacing = replacing
            return
        except (FileError, UsageError) as error:
            if not overwrite:
                raise UsageError(f"{error}; --overwrite keeps it under another name") from error
            start.remarks.append(str(error))
    if not overwrite:
        check_free(output)
    elif aside := set_aside(output):
        start.remarks.append(f"{output} is kept as {aside.name}")


def refuse_fewer(start, output, replicates):
    """UsageError where the results file has rows that a new one in its place would not have."""
    old = start.old
    if old is None or start.is_covered(replicates):
        return
    asked = set(start.store.conditions)
    left_out = [condition for condition in old.conditions if condition not in asked]
    if left_out or old.count > replicates:
        what = [f"{old.count} replicates of each"] if old.count > replicates else []
        if left_out:
            name, n, share = left_out[0]
            such = f"type {name}, N = {n}, delta {share:g}"
            what.insert(0, f"{len(left_out)} conditions such as {such}")
        raise UsageError(
            f"{output} has rows that this run does not ask for ({'; '.join(what)}), and lacks "
            "others: ask for all of them together, or name another output"
        )
    start.at_least = old.count


ELSEWHERE = "name another output"
REMEDY = f"{ELSEWHERE}, or start over with --restart, which keeps it under another name"


def refuse_other(start, path, stored, remedy=REMEDY):
    """UsageError where an identity in a file is not that of this study."""
    lines = differences(stored, start.identity)
    if lines:
        shown = "; ".join(lines[:MOST_DIFFERENCES])
        rest = len(lines) - MOST_DIFFERENCES
        more = f"; and {rest} more" if rest > 0 else ""
        raise UsageError(f"{path} belongs to another study: {shown}{more}; {remedy}")


def sessions_of(journal: Journal) -> dict[int, dict]:
    """{id: description} of the runs that wrote a journal."""
    return {each.id: each.about for each in journal.records(SESSION)}


def refuse_other_sessions(start: Beginning, study: StudyKind) -> None:
    """UsageError where a journal was written by runs of another study."""
    for session in sessions_of(start.journal).values():
        if not is_session(session):
            raise FileError(f"{start.journal.path} was not begun by flocsim: move it away")
        refuse_other(start, start.journal.path, session["identity"])
        if session["layout"] != kind.layout(study.row):
            raise UsageError(
                f"{start.journal.path} was written by another version of flocsim: {REMEDY}"
            )


def take_journal(start: Beginning, study: StudyKind) -> None:
    """Take the rows and parts that a journal has; what is damaged or of unknown origin is deleted,
    so that it is computed again."""
    journal, sessions = start.journal, sessions_of(start.journal)
    start.history += [{key: each[key] for key in HISTORY} for each in sessions.values()]
    known = {*(short(each["identity"]) for each in sessions.values()), short(start.identity)}
    refused: Counter[str] = Counter()
    discarded = []
    for record in journal.records():
        if record.kind == SESSION:
            continue
        try:
            about = record.about
            if record.kind == OLD:
                take_record(start, study, record, {})
            elif matches(about, ABOUT) and about["identity"] in known:
                take_record(start, study, record, sessions.get(about["session"], {}))
            else:
                raise ValueError(f"{title_of(record, study)} cannot be verified")
        except ValueError as error:
            refused[str(error)] += 1
            discarded.append(record.id)
    for words, times in refused.items():
        more = f" ({times} times)" if times > 1 else ""
        start.remark(f"{words}{more}: computed again")
    if discarded or journal.damaged:
        journal.discard([*discarded, *journal.damaged])
    there = f"the {start.store.there()} finished replicates that are intact are used"
    if journal.salvaged is not None:
        start.remark(
            f"damaged: {there}, what is missing is computed again; the damaged file is kept as "
            f"{journal.salvaged}"
        )
    elif count := len(journal.damaged) + journal.lost:
        start.remark(
            f"{count} damaged or missing record{'s' * (count != 1)} (the end of its -wal file may "
            f"be missing): {there}, what is missing is computed again"
        )


ABOUT = {"identity": str, "session": int}
"""What the journal says of a chunk or part, as a pattern."""


def title_of(record: Record, study: StudyKind) -> str:
    """A record for messages."""
    if record.kind == PART:
        return "what was saved of a replicate"
    return kind.named(
        condition_of(record.condition), record.first, len(record.data) // study.row.itemsize
    )


def take_record(start: Beginning, study: StudyKind, record: Record, session: dict) -> None:
    """Take the rows or the part of a record, written by a run of this description; ValueError
    where no run can have given them."""
    store, title = start.store, title_of(record, study)

    def check(rows: np.ndarray) -> None:
        if record.kind == CHUNK or start.old is None:
            study.check_whole(rows, store.parts.get((place, record.first), ()))

    place = store.indices.get(record.condition, -1)
    try:
        taken = store.take(record, check)
    except ValueError as error:
        raise ValueError(f"{title}: {error}") from error
    if record.kind != CHUNK:
        return
    if taken is None:
        start.unasked = True
        return
    start.notes += record.about.get("notes", [])
    start.cpus_found = distinct([*start.cpus_found, *session.get("cpus", [])])
    # What is computed beyond the end that a rule has set is nobody's: so it is on any machine.
    if start.rule is None or session.get("rule") != start.rule:
        stop = record.first + len(record.data) // study.row.itemsize
        start.farthest = max(start.farthest, stop)


def take_results(
    start: Beginning, study: StudyKind, output: str | Path,
    old_rows: Callable[[Any], AbstractContextManager[OldResults]],
) -> None:  # fmt: skip
    """Copy the rows of an older results file into the journal; FlocsimError if they are not of
    this study."""
    resources = ExitStack()
    try:
        old = resources.enter_context(old_rows(output))
        if "identity" not in old.run:
            raise UsageError(f"{output} does not record what it was made from: {ELSEWHERE}")
        refuse_other(start, output, stored(old.run, "identity"), ELSEWHERE)
        found = {name: stored(old.run, name) for name in ("failed", "cpus", "history")}
        with start.journal.together():
            before = [each.id for each in start.journal.records(OLD)]
            start.journal.discard([*before, *start.journal.damaged])
            for condition, first, rows in old.chunks:
                start.store.copy(condition, first, rows)
    except UNREADABLE as error:
        if isinstance(error, FlocsimError):
            raise
        raise FileError(f"{output} has no readable results: {error}; {ELSEWHERE}") from error
    finally:
        resources.close()
    start.old = old
    start.notes += found["failed"]
    start.cpus_found = distinct([*found["cpus"], *start.cpus_found])
    earlier = {key: old.run[key] for key in HISTORY if key in old.run}
    start.history = [*found["history"], earlier, *start.history]
