"""Where a study begins: with nothing, or with what a journal and an older results file hold."""

import contextlib
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import attrs

from flocsim.ensembles.chunks import (
    Condition,
    Interval,
    condition_of,
    fits,
    layout,
    named,
    rows_of,
)
from flocsim.ensembles.collision.failures import FAILURES
from flocsim.ensembles.storage.cpu_kind import distinct
from flocsim.ensembles.storage.identity import differences, short
from flocsim.ensembles.storage.row_store import OldTable, RowStore
from flocsim.ensembles.storage.stored_json import is_session, stored
from flocsim.ensembles.study import Study
from flocsim.errors import FileError, FlocsimError, UsageError
from flocsim.io.files import Rule, keep, ordinary_target, set_aside
from flocsim.io.journal.journal import Journal, MemoryJournal, journal_path
from flocsim.io.journal.records import CHUNK, SESSION, encode
from flocsim.io.outputs import extension_rule, in_the_way
from flocsim.io.provenance import now
from flocsim.io.results.checks import check_rows
from flocsim.io.results.file import BLOCK, UNREADABLE, opened, read_scalar
from flocsim.io.results.schema import as_words

NEW, RESUME, RESTART = "new", "resume", "restart"
"""What to do about an unfinished run: refuse to touch it, go on with it, throw it away."""

WAYS = (
    "extend it by --resume if it is of this study, or add --overwrite, which keeps the old one "
    "under another name"
)
"""What a user can do about a file in the place of the results."""

MOST_DIFFERENCES = 5
HISTORY = ("date", "command")
"""What is kept of a run that contributed to a results file."""


@attrs.define(eq=False)
class Beginning:
    """What a study starts from.

    ``remarks`` are for the user; ``notes`` are those on failed replicates among the found ones;
    ``history`` has date and command of the runs before; ``complete`` is what an older results
    file holds, (conditions, replicates of each), where nothing else was found. ``cpus_now`` are
    the kinds of CPU that this run computes on, ``cpus_found`` those that the found rows are of;
    ``flocs``: how many flocs its rows may be of; ``replacing`` says what becomes of a file at the
    place of the results when they are written.
    """

    store: RowStore
    identity: dict
    remarks: list[str] = attrs.Factory(list)
    notes: list[dict] = attrs.Factory(list)
    history: list[dict] = attrs.Factory(list)
    complete: tuple[tuple[Condition, ...], int] | None = None
    cpus_now: list[dict] = attrs.Factory(list)
    cpus_found: list[dict] = attrs.Factory(list)
    flocs: int = 0
    replacing: Rule = keep
    resources: contextlib.ExitStack = attrs.Factory(lambda: contextlib.ExitStack())

    @property
    def journal(self) -> Journal | MemoryJournal:
        """Where finished chunks go."""
        return self.store.journal

    def found(self, count: int) -> list[list[Interval]]:
        """Of every condition the replicates below ``count`` that exist, as intervals."""
        whole = (self.store.intervals(place) for place in range(len(self.store.conditions)))
        return [
            [(first, min(stop, count)) for first, stop in each if first < count] for each in whole
        ]


def begin(
    study: Study,
    identity: dict,
    output: str | Path,
    mode: str,
    cpus: Sequence[dict] = (),
    overwrite: bool = False,
) -> Beginning:
    """The Beginning of a study, run on these kinds of CPU, with results in the file ``output``.

    Raises UsageError where an unfinished run is in the way, or is one of another config, of other
    shapes or other physics, or where anything but results of this study to be extended lies at
    ``output``; with ``overwrite`` that is set aside. FileError where the journal cannot be opened.
    """
    path = journal_path(output)
    if mode != RESUME and not overwrite:
        check_free(output)  # before an unfinished run is thrown away
    if mode == NEW and path.exists() and path.stat().st_size:
        raise UsageError(
            f"{path} holds an unfinished run: go on with it by --resume, or throw it away by "
            "--restart"
        )
    if mode == RESTART:
        with contextlib.suppress(OSError):
            os.unlink(path)
    journal = Journal(path)
    start = Beginning(RowStore(journal, study.conditions), identity, cpus_now=list(cpus))
    start.flocs = len(study.flocs)
    start.resources.callback(journal.close)
    try:
        take_journal(start)
        take_place(start, output, mode, overwrite)
        session = {
            "identity": identity, "short": short(identity), "layout": layout(), "date": now(),
            "command": shlex.join(sys.argv), "cpus": start.cpus_now,
        }  # fmt: skip
        journal.append(encode(SESSION, session))
    except Exception:
        journal.drop_if_empty()
        raise
    return start


def check_free(output: str | Path) -> None:
    """UsageError where there is a file at the place of the results."""
    if os.path.lexists(ordinary_target(output)):
        raise in_the_way(output, WAYS)


def take_place(start: Beginning, output: str | Path, mode: str, overwrite: bool) -> None:
    """Use the results of this study that are to be extended; nothing else may lie there."""
    if os.path.lexists(ordinary_target(output)) and mode == RESUME:
        try:
            replacing = extension_rule(output)
            take_results(start, output)
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


def take_journal(start: Beginning) -> None:
    """Find the chunks in the journal; UsageError where they are those of another study."""
    journal: Any = start.journal
    if journal.damage and not journal.records and not journal.is_cut_short:
        raise FileError(
            f"{journal.path} is no journal of flocsim, or damaged from its start: move it away"
        )
    sessions = [record.description for record in journal.records if record.kind == SESSION]
    if not all(is_session(each) for each in sessions):
        raise FileError(f"{journal.path} was begun by no flocsim: move it away")
    start.history += [{key: each[key] for key in HISTORY} for each in sessions]
    for description in sessions:
        refuse_other(start, journal.path, description["identity"])
        if description["layout"] != layout():
            raise UsageError(f"{journal.path} was written by another version of flocsim: {REMEDY}")
    known = {*(each["short"] for each in sessions), short(start.identity)}
    places = {condition: place for place, condition in enumerate(start.store.conditions)}
    cpus = []
    for record in journal.records:
        if record.kind == SESSION:
            cpus = record.description.get("cpus", [])
        elif record.kind == CHUNK and fits(record.description, record.length):
            take_chunk(start, record, known, places, cpus)
        elif record.kind == CHUNK:
            start.remarks.append(
                f"{journal.path}: {named(record.description)}: it is not as flocsim writes it: "
                "computed again"
            )
    for each in journal.damage:
        start.remarks.append(
            f"{journal.path}: damaged from byte {each.start} to {each.stop} "
            f"({named(each.description)}); what is missing is computed again"
        )


ELSEWHERE = "name another output"
REMEDY = f"{ELSEWHERE}, or throw it away by --restart"


def refuse_other(start, path, stored, remedy=REMEDY):
    """UsageError where an identity in a file is not that of this study."""
    lines = differences(stored, start.identity)
    if lines:
        shown = "; ".join(lines[:MOST_DIFFERENCES])
        rest = len(lines) - MOST_DIFFERENCES
        more = f"; and {rest} more" if rest > 0 else ""
        raise UsageError(f"{path} is of another study: {shown}{more}; {remedy}")


def take_chunk(start, record, known, places, cpus):
    """Note where a chunk's rows lie, if they are of a condition of this study.

    ``cpus``: the kinds of CPU of the run that wrote it.
    """
    about = record.description
    if about["identity"] not in known:
        start.remarks.append(
            f"{start.journal.path}: nothing vouches for {named(about)}: computed again"
        )
        return
    place = places.get(condition_of(about))
    if place is not None:
        rows = rows_of(start.journal.read(record.offset, record.length))
        try:
            check_rows(rows.__getitem__, len(FAILURES), start.flocs)
        except ValueError as error:
            start.remarks.append(f"{start.journal.path}: {named(about)}: {error}: computed again")
            return
        first = about["first"]
        start.store.add(place, first, first + about["count"], record.offset)
        start.notes += about.get("notes", [])
        start.cpus_found = distinct([*start.cpus_found, *cpus])


def take_results(start, output):
    """Use the rows of an older results file; FlocsimError if they are not of this study."""
    begun = any(start.store.counts)
    file = start.resources.enter_context(opened(output))
    run = {name: read_scalar(dataset) for name, dataset in file["run"].items()}
    if "identity" not in run:
        raise UsageError(f"{output} does not say what it was made from: {ELSEWHERE}")
    try:
        refuse_other(start, output, stored(run, "identity"), ELSEWHERE)
        found = {name: stored(run, name) for name in ("failed", "cpus", "history")}
        rows, places, count = old_rows(start, file)
    except UNREADABLE as error:
        if isinstance(error, FlocsimError):
            raise
        raise FileError(f"{output} holds no readable results: {error}; {ELSEWHERE}") from error
    for place, condition in enumerate(start.store.conditions):
        if condition in places and count:
            start.store.add(place, 0, count, -1)
    start.store.old = OldTable(rows, places)
    start.notes += found["failed"]
    start.cpus_found = distinct([*found["cpus"], *start.cpus_found])
    earlier = {key: run[key] for key in HISTORY if key in run}
    start.history = [*found["history"], earlier, *start.history]
    if not begun:
        start.complete = (tuple(places), count)


def old_rows(start, file):
    """(table of replicates, {Condition: place in it}, replicates of each) of a results file.

    Raises ValueError for rows that no run can have given.
    """
    rows = file["replicates"]
    if tuple(rows["failure"].attrs["flag_meanings"].split()) != as_words(FAILURES):
        raise ValueError("its codes of failures have other words")
    axes = rows["type"].asstr()[()], rows["vertices"][()], rows["delta"][()]
    places = {
        Condition(str(name), int(n), float(share)): (t, v, d)
        for t, name in enumerate(axes[0])
        for v, n in enumerate(axes[1])
        for d, share in enumerate(axes[2])
    }
    count = len(rows["replicate"])
    for condition in start.store.conditions:
        for first in range(0, count if condition in places else 0, BLOCK):
            part = (*places[condition], slice(first, first + BLOCK))
            check_rows(lambda name, part=part: rows[name][part], len(FAILURES), start.flocs)
    return rows, places, count
