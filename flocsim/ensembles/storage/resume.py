"""Where a study begins: with nothing, or with what a journal and an older results file hold.

First comes the lock (`claim`), then everything else is looked at. Rows only ever get more: what a
journal or a results file has beyond what is asked for stays where it is, or the run is refused.
"""

import contextlib
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import attrs

from flocsim.ensembles import kind
from flocsim.ensembles.kind import StudyKind
from flocsim.ensembles.storage.identity import differences, short
from flocsim.ensembles.storage.row_store import OldTable, RowStore, stamp
from flocsim.errors import FileError, FlocsimError, UsageError
from flocsim.io.files import Rule, keep, ordinary_target, set_aside
from flocsim.io.groups import UNREADABLE
from flocsim.io.journal import Journal, MemoryJournal, journal_path
from flocsim.io.outputs import extension_rule, in_the_way
from flocsim.io.records import CHUNK, SESSION, SNAPSHOT, encode, matches
from flocsim.io.results.run_group import distinct, is_session, now, source_line, stored

NEW, RESUME, RESTART = "new", "resume", "restart"
"""What to do about an unfinished run: refuse to touch it, go on with it, put it aside."""

WAYS = (
    "extend it with --resume if it belongs to this study, or add --overwrite, which keeps the old "
    "one under another name"
)
"""What a user can do about a file in the place of the results."""

MOST_DIFFERENCES = 5
BLOCK = 262_144
"""Rows of a results file that are looked at together."""
HISTORY = ("date", "command")
"""What is kept of a run that contributed to a results file."""


@attrs.define(eq=False)
class Beginning:
    """What a study starts from.

    ``remarks`` are for the user; ``notes`` are those on failed replicates among the found ones;
    ``history`` has date and command of the runs before. ``cpus_now`` are the kinds of CPU that
    this run computes on, ``cpus_found`` those that the found rows are of; ``replacing`` says what
    becomes of a file at the place of the results when they are written. ``rule`` is the rule that
    ends the study early, as the journal has it; ``unasked`` says what rows the journal has of other
    conditions, and ``farthest`` how far it has them of these (those beyond the end of a run with
    the same rule left out): they are not to go with it. ``at_least``: replicates that each
    condition has in the results file already.
    """

    store: RowStore
    identity: dict
    remarks: list[str] = attrs.Factory(list)
    notes: list[dict] = attrs.Factory(list)
    history: list[dict] = attrs.Factory(list)
    rule: list | None = None
    unasked: list[kind.Condition] = attrs.Factory(list)
    farthest: int = 0
    at_least: int = 0
    cpus_now: list[dict] = attrs.Factory(list)
    cpus_found: list[dict] = attrs.Factory(list)
    replacing: Rule = keep
    resources: contextlib.ExitStack = attrs.Factory(lambda: contextlib.ExitStack())

    def remark(self, words: str) -> None:
        """Say something of what is in the journal."""
        self.remarks.append(f"{self.journal.path}: {words}")

    @property
    def journal(self) -> Journal | MemoryJournal:
        """Where finished chunks go."""
        return self.store.journal

    def is_covered(self, count: int) -> bool:
        """Whether the older results file has so many replicates of all conditions already."""
        old = self.store.old
        return (
            old is not None
            and old.there is None
            and count <= old.count
            and all(condition in old.places for condition in self.store.conditions)
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
        elif not journal.is_journal:
            raise FileError(
                f"{path} is not a journal of flocsim, or is damaged at its start: move it away"
            )
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
    old_rows: Callable[..., OldTable], cpus: Sequence[dict] = (), overwrite: bool = False,
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
    start.resources.callback(journal.release)
    take_rows = partial(take_results, start, study, output, old_rows)
    try:
        take_journal(start, study)
        take_place(start, output, mode, overwrite, take_rows)
        refuse_fewer(start, output, study.config.replicates)
        session = {
            "identity": identity, "short": short(identity), "layout": kind.layout(study.row),
            "date": now(), "command": shlex.join(sys.argv), "cpus": start.cpus_now,
            "rule": start.rule, "asked": study.asked(), "source": source_line(study.source),
        }  # fmt: skip
        journal.append(encode(SESSION, session))
    except Exception:
        start.resources.close()
        raise
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
    old = start.store.old
    if old is None or start.is_covered(replicates):
        return
    asked = set(start.store.conditions)
    left_out = [condition for condition in old.places if condition not in asked]
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


def take_journal(start: Beginning, study: StudyKind) -> None:
    """Find the chunks in the journal; UsageError where they are those of another study."""
    journal: Any = start.journal
    sessions = [record.description for record in journal.records if record.kind == SESSION]
    if not all(is_session(each) for each in sessions):
        raise FileError(f"{journal.path} was not begun by flocsim: move it away")
    start.history += [{key: each[key] for key in HISTORY} for each in sessions]
    for description in sessions:
        refuse_other(start, journal.path, description["identity"])
        if description["layout"] != kind.layout(study.row):
            raise UsageError(f"{journal.path} was written by another version of flocsim: {REMEDY}")
    known = {*(short(each["identity"]) for each in sessions), short(start.identity)}
    session: dict = {}
    for record in journal.records:
        if record.kind == SESSION:
            session = record.description
        elif record.kind == SNAPSHOT:
            take_part(start, study, record, known)
        elif record.kind == CHUNK and kind.fits(record.description, record.length, study.row):
            take_chunk(start, study, record, known, session)
        elif record.kind == CHUNK:
            told = kind.named(record.description)
            start.remark(f"{told}: its form is unknown: computed again")
    for each in journal.damage:
        start.remark(
            f"damaged from byte {each.start} to {each.stop} ({kind.named(each.description)}); "
            "what is missing is computed again"
        )


def take_part(start, study, record, known):
    """Note what was kept of an unfinished replicate, if it can be of this study."""
    about = record.description
    try:
        if not matches(about, kind.KEPT) or about["identity"] not in known:
            raise ValueError("what was kept of a replicate cannot be verified")
        place = start.store.places.get(kind.condition_of(about))
        study.check_part(about, start.journal.read(record.offset, record.length))
    except ValueError as error:
        start.remark(f"{error}: it is left out")
        return
    if place is not None:
        start.store.parts[place, about["replicate"]].append(record)


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


def take_chunk(start, study, record, known, session):
    """Note where a chunk's rows lie, if they are of a condition of this study.

    ``session``: the description of the run that wrote it.
    """
    about = record.description
    if about["identity"] not in known:
        start.remark(f"{kind.named(about)} cannot be verified: computed again")
        return
    place = start.store.places.get(kind.condition_of(about))
    if place is None:
        start.unasked.append(kind.condition_of(about))
        return

    def check(rows):
        study.check_rows(rows.__getitem__)
        study.check_whole(rows, start.store.parts.get((place, about["first"]), []))

    try:
        start.store.add_chunk(record, place, check)
    except ValueError as error:
        start.remark(f"{kind.named(about)}: {error}: computed again")
        return
    start.notes += about.get("notes", [])
    start.cpus_found = distinct([*start.cpus_found, *session.get("cpus", [])])
    # What is computed beyond the end that a rule has set is nobody's: so it is on any machine.
    if start.rule is None or session.get("rule") != start.rule:
        start.farthest = max(start.farthest, about["first"] + about["count"])


def take_results(start, study, output, old_rows):
    """Use the rows of an older results file; FlocsimError if they are not of this study."""
    before = stamp(os.fspath(output))
    try:
        old = old_rows(output, start.resources)
        run, count = old.run, old.count
        if "identity" not in run:
            raise UsageError(f"{output} does not record what it was made from: {ELSEWHERE}")
        refuse_other(start, output, stored(run, "identity"), ELSEWHERE)
        found = {name: stored(run, name) for name in ("failed", "cpus", "history")}
        check_old(study, old)
    except UNREADABLE as error:
        if isinstance(error, FlocsimError):
            raise
        raise FileError(f"{output} has no readable results: {error}; {ELSEWHERE}") from error
    for place, condition in enumerate(start.store.conditions):
        if condition in old.places and count:
            for interval in [(0, count)] if old.there is None else old.there[condition]:
                start.store.add(place, *interval, -1)
    start.store.old = attrs.evolve(old, path=os.fspath(output), before=before)
    start.notes += found["failed"]
    start.cpus_found = distinct([*found["cpus"], *start.cpus_found])
    earlier = {key: run[key] for key in HISTORY if key in run}
    start.history = [*found["history"], earlier, *start.history]


def check_old(study: StudyKind, old: OldTable) -> None:
    """ValueError for rows of a results file that no run can have given."""
    for condition in study.conditions:
        for first in range(0, old.count if condition in old.places else 0, BLOCK):
            part = (*old.places[condition], slice(first, first + BLOCK))

            def column(name: str, part: tuple = part) -> Any:
                return old.columns[name][part]

            study.check_rows(column)
