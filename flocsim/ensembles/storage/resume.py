"""Where a study begins: with nothing, or with what a journal and an older results file hold.

First comes the lock (`claim`), then everything else is looked at. Rows only ever get more: what a
journal or a results file has beyond what is asked for stays where it is, or the run is refused.
"""

import os
import shlex
import sys
from contextlib import ExitStack
from pathlib import Path

import attrs

from flocsim.ensembles.config import contents_of
from flocsim.ensembles.kind import OldResults, StudyKind, layout
from flocsim.ensembles.storage.identity import differences, short
from flocsim.ensembles.storage.row_store import RowStore, sessions_of
from flocsim.errors import FileError, FlocsimError, UsageError, plural
from flocsim.io.files import Rule, ordinary_target, set_aside
from flocsim.io.groups import UNREADABLE
from flocsim.io.journal import DAMAGED, ROWS, SESSION, Journal, as_text, journal_path
from flocsim.io.outputs import in_the_way
from flocsim.io.results.run_group import now, processor, source_line, stored
from flocsim.io.seals import held

NEW, RESUME, RESTART = "new", "resume", "restart"
"""What to do about an unfinished run: refuse to touch it, go on with it, put it aside."""

WAYS = (
    "extend it with --resume (in Python mode='resume') if it belongs to this study, or add "
    "--overwrite (overwrite=True), which keeps the old one under another name"
)
"""What a user can do about a file in the place of the results."""

MOST_DIFFERENCES = 5
"""Lines on what differs between two studies in one message."""

HISTORY = ("date", "command", "processor")
"""What is kept of a run that contributed to a results file."""


@attrs.define(eq=False)
class Beginning:
    """What a study starts from.

    ``remarks`` are for the user; ``history`` has HISTORY of the runs before. ``replacing`` says
    what becomes of a file at the place of the results when they are written. ``rules`` are the
    rules that end a study early, by session. ``old`` is the results file that is extended, its rows
    being in the journal by now, and ``at_least`` how many replicates each condition has there.
    """

    store: RowStore
    identity: dict
    remarks: list[str] = attrs.Factory(list)
    history: list[dict] = attrs.Factory(list)
    rules: dict[int, list | None] = attrs.Factory(dict)
    at_least: int = 0
    replacing: Rule = False
    old: OldResults | None = None

    def is_covered(self, count: int) -> bool:
        """Return True if the older results file has so many replicates of all conditions."""
        return (
            self.old is not None
            and count <= self.old.count
            and set(self.store.conditions) <= set(self.old.conditions)
        )

    def has_more(self, count: int) -> bool:
        """Return True if the journal has computed rows that results of so many replicates lack.

        What is computed beyond the end that a rule has set is needed by nobody: so it is on any
        machine.
        """
        rule = self.rules.get(self.store.session)
        query = (
            "SELECT condition, session, max(first + count) FROM rows WHERE session NOT NULL "
            "GROUP BY condition, session"
        )
        return any(
            condition not in self.store.indices
            or (stop > count and (rule is None or self.rules.get(session) != rule))
            for condition, session, stop in self.store.journal.db.execute(query)
        )


def claim(output: str | Path, mode: str, overwrite: bool = False) -> tuple[Journal, list[str]]:
    """Return (the locked journal of a results file, remarks): no other job writes there now.

    Waits for a job that is about to end, and looks at everything only then. Raises UsageError
    where an unfinished run is in the way, or results are that are neither to be extended nor to be
    set aside (``overwrite``); FileError where the journal cannot be opened, is none, or another
    job goes on writing it.
    """
    path = journal_path(output)
    journal, remarks = Journal(path), []
    try:
        if not journal.lock.is_locked:
            remarks.append(
                f"the file system of {path} has no locks: make sure that no two jobs write there"
            )
        # Before an unfinished run is put aside, and after the job that this one waited for.
        if mode != RESUME and not overwrite and os.path.lexists(ordinary_target(output)):
            raise in_the_way(output, WAYS)
        if journal.is_blank:
            journal.discard("session", "1")
        elif mode == RESTART:
            remarks.append(f"the unfinished run is kept as {journal.put_aside()}")
        elif journal.is_damaged:
            raise FileError(f"{path} {DAMAGED}")
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
    overwrite: bool = False,
) -> Beginning:  # fmt: skip
    """Return the Beginning of a study with results in ``output``.

    ``journal``: as `claim` gave it. Raises UsageError where what lies there is of another config,
    of other shapes or other physics, has rows that this study would drop, or is anything but
    results of this study to be extended; with ``overwrite`` that is set aside.
    """
    store = RowStore(journal, study.conditions, study.row, short(identity))
    start = Beginning(store, identity)
    for number, session in sessions_of(journal).items():
        refuse_other(start, journal.path, session["identity"])
        if session["layout"] != layout(study.row):
            raise UsageError(f"{journal.path} was written by another version of flocsim: {REMEDY}")
        store.known.add(short(session["identity"]))
        start.history.append({key: session[key] for key in HISTORY})
        start.rules[number] = session.get("rule")
    if mode == RESUME and os.path.lexists(ordinary_target(output)):
        try:
            rule = held(output)
            take_results(start, study, output)
            start.replacing = rule
        except (FileError, UsageError) as error:
            if not overwrite:
                raise UsageError(f"{error}; --overwrite keeps it under another name") from error
            start.remarks.append(str(error))
    # Without `overwrite` a file that has come since `claim` is spared when results are written.
    if start.old is None and overwrite and (aside := set_aside(output)):
        start.remarks.append(f"{output} is kept as {aside.name}")
    take_journal(start, study)
    refuse_fewer(start, output, study.config.replicates)
    stop = study.config.stop
    ends_early = None if stop.half_width is None else [stop.half_width, list(stop.of), stop.least]
    about = {
        "kind": study.format, "identity": identity, "layout": layout(study.row), "date": now(),
        "command": shlex.join(sys.argv), "processor": processor(), "rule": ends_early,
        "asked": study.asked(), "source": source_line(study.source),
    }  # fmt: skip
    store.session = journal.add(SESSION, as_text(about))
    start.rules[store.session] = ends_early
    journal.sync()
    return start


def take_results(start: Beginning, study: StudyKind, output: str | Path) -> None:
    """Copy the rows of an older results file into the journal; FlocsimError if they are not of
    this study."""
    resources = ExitStack()  # closed by itself: the file would call any error one of its own
    try:
        old = resources.enter_context(contents_of(study.format).old_rows(output))
        refuse_other(start, output, stored(old.run, "identity"), ELSEWHERE)
        failed, history = stored(old.run, "failed"), stored(old.run, "history")
        with start.store.journal.together():
            start.store.journal.discard(ROWS, "session IS NULL")
            for condition, first, rows in old.chunks:
                start.store.copy(condition, first, rows)
    except FlocsimError:
        raise
    except UNREADABLE as error:
        raise FileError(f"{output} has no readable results: {error}; {ELSEWHERE}") from error
    finally:
        resources.close()
    start.old = old
    start.store.notes += failed
    earlier = {key: old.run[key] for key in HISTORY if key in old.run}
    start.history = [*history, earlier, *start.history]


def take_journal(start: Beginning, study: StudyKind) -> None:
    """Take the rows and parts that a journal has; what is damaged is deleted, so that it is
    computed again."""
    store, journal = start.store, start.store.journal
    store.load(study.check_whole, start.old is not None)
    for table, number in store.refused:
        journal.discard(table, "id=?", number)
    if count := len(store.refused) + journal.lost:
        start.remarks.append(
            f"{journal.path}: {plural(count, 'damaged or missing record')} (the end of its -wal "
            f"file may be missing): {plural(store.there(), 'intact replicate')} will be used, and "
            "the missing ones computed again"
        )


def refuse_fewer(start: Beginning, output: str | Path, replicates: int) -> None:
    """UsageError where the results file has rows that a new one in its place would not have."""
    old = start.old
    if old is None or start.is_covered(replicates):
        return
    left_out = set(old.conditions) - set(start.store.conditions)
    if left_out or old.count > replicates:
        raise UsageError(
            f"{output} has rows that this run does not ask for ({old.count} replicates of each "
            f"condition, and {plural(len(left_out), 'more condition')}), but lacks others: ask for "
            "all of them together, or name another output"
        )
    start.at_least = old.count


ELSEWHERE = "name another output"
REMEDY = f"{ELSEWHERE}, or start over with --restart, which keeps it under another name"


def refuse_other(start: Beginning, path: str | Path, stored: dict, remedy: str = REMEDY) -> None:
    """UsageError where an identity in a file is not that of this study."""
    if lines := differences(stored, start.identity):
        more = [f"and {len(lines) - MOST_DIFFERENCES} more"] * (len(lines) > MOST_DIFFERENCES)
        shown = "; ".join([*lines[:MOST_DIFFERENCES], *more])
        raise UsageError(f"{path} belongs to another study: {shown}; {remedy}")
