"""What an unfinished study has so far, and what the parts of an unfinished sweep have to become.

A study is read from its journal in one state, while the job that writes it goes on. A kind of study
makes of its rows what it makes of those of a finished one.

A sweep has a plan, all that the rows of each of its parts follow from, and their axes, fixed when
it begins; what is found or made in the place of a part is compared with it. A file sweep.json
beside the parts, and in the joined file: {"common": facts of all, "parts": {name of the results
file: its own facts}}; facts are those of the identity, and "asked", the axes.
"""

import json
import math
import os
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.config import STUDIES, contents_of
from flocsim.ensembles.kind import ORDER, Condition, layout
from flocsim.ensembles.storage.identity import differences
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.errors import FileError, UsageError
from flocsim.io.files import Old, write_file
from flocsim.io.groups import UNREADABLE
from flocsim.io.journal import SESSION, JournalReader, read_journal
from flocsim.io.json_text import matches, read_json
from flocsim.io.results.run_group import is_session

Facts = dict[str, Any]

NAME = "sweep.json"
ASKED = {"types": [str], "vertices": [int], "delta": [float], "replicates": int}
PLAN: Facts = {"common": {}, "parts": {}}

Plan = dict[str, Facts]
"""{name of a part's results file: its Facts}."""

MOST_CONDITIONS = 20_000
"""Of a study that is read while it runs."""


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


def store_of(
    journal: JournalReader, sessions: list[dict], row: np.dtype
) -> tuple[RowStore, list[dict], int]:
    """(what of a journal can be believed, notes on failed replicates, records that are damaged or
    of no run); FileError where there is nothing."""
    axes = sessions[-1]["asked"]
    if sessions[-1]["layout"] != layout(row):
        raise FileError(f"{journal.path} was written by another version of flocsim: use that one")
    many = math.prod(len(axes[name]) for name in ORDER)
    if many > MOST_CONDITIONS:
        raise FileError(
            f"{journal.path} has {many} conditions, and at most {MOST_CONDITIONS} are shown before "
            "a study is complete: wait for the results"
        )
    if any(len(set(axes[name])) < len(axes[name]) for name in ORDER):
        raise FileError(f"{journal.path} has the same condition twice")
    conditions = tuple(Condition(*each) for each in product(*(axes[name] for name in ORDER)))
    store, notes = RowStore(journal, conditions, row), []
    for each in journal.records():
        if each.kind == SESSION:
            continue
        try:
            if store.take(each, lambda rows: None) is not None:
                notes += each.about.get("notes", [])
        except ValueError:
            journal.damaged.append(each.id)
    if not store.there() and not store.parts:
        raise FileError(f"{journal.path} has no finished replicate yet: try again later")
    return store, notes, len(journal.damaged)


def read_unfinished(path: str | Path) -> Unfinished:
    """What the journal at ``path`` holds; FileError where it holds no finished replicate."""
    with read_journal(Path(path)) as journal:
        sessions = [each.about for each in journal.records(SESSION) if is_session(each.about)]
        asked = sessions[-1].get("asked") if sessions else None
        name = sessions[-1].get("kind") if sessions else None
        if not matches(asked, ASKED) or name not in STUDIES:
            raise FileError(
                f"{path} is not a journal of an unfinished run, or has only just begun: try again"
            )
        kind = STUDIES[name].part("study").KINDS[0]
        store, notes, unread = store_of(journal, sessions, kind.row)
        try:
            results, done, of = contents_of(name).so_far(store, asked)
        except UNREADABLE as error:
            raise FileError(f"{path} cannot be read: {error}") from error
        return Unfinished(journal.path, name, results, done, of, notes, sessions, unread, kind.noun)


def plan_text(plan: Plan) -> str:
    """A plan as JSON."""
    first = next(iter(plan.values()))
    common = {
        name: value for name, value in first.items()
        if all(name in each and each[name] == value for each in plan.values())
    }  # fmt: skip
    own = {
        part: {name: value for name, value in facts.items() if name not in common}
        for part, facts in plan.items()
    }
    return json.dumps({"common": common, "parts": own}, sort_keys=True)


def plan_of(text: str | bytes, path: str | os.PathLike) -> Plan:
    """The plan in a text of the file at a path; FileError for what is none."""
    try:
        found = read_json(text, PLAN)
        parts = {name: found["common"] | facts for name, facts in found["parts"].items()}
        if not all(matches(facts, {"asked": ASKED}) for facts in parts.values()):
            raise ValueError("its form is unknown")
    except (ValueError, TypeError) as error:
        raise FileError(f"{path} has no plan of a sweep: {error}; move it away") from error
    return parts


def write_plan(folder: Path, plan: Plan) -> None:
    """Put a plan beside the parts, in the place of an earlier one."""
    write_file(folder / NAME, plan_text(plan).encode(), lambda _: Old.REPLACED)


def read_plan(path: str | os.PathLike) -> Plan:
    """The plan in a file, {} where there is none; FileError for one that cannot be read."""
    try:
        text = Path(path).read_bytes()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise FileError(f"{path} could not be read: {error.strerror}; move it away") from error
    return plan_of(text, path)


def apart(there: Mapping[str, Any], planned: Mapping[str, Any], whole: bool = False) -> str:
    """What keeps a part that is there from being the planned one; "" for nothing.

    It may have less, as rows can be added; ``whole``: it may not.
    """
    identities = ({k: v for k, v in each.items() if k != "asked"} for each in (there, planned))
    if unlike := differences(*identities):
        return unlike[0]
    has, wants = there["asked"], planned["asked"]
    for axis in ORDER:
        if has[axis] != wants[axis] if whole else not set(has[axis]) <= set(wants[axis]):
            return f"{axis} are {listed(has[axis])} in the file, {listed(wants[axis])} now"
    if has["replicates"] > wants["replicates"] or (
        whole and has["replicates"] < wants["replicates"]
    ):
        return f"replicates are {has['replicates']} in the file, {wants['replicates']} now"
    return ""


def listed(values):
    return ", ".join(f"{each:g}" if isinstance(each, float) else str(each) for each in values)


def hold(before: Plan, plan: Plan, folder: Path) -> None:
    """UsageError where a sweep that began with the plan ``before`` would go on with another."""
    for name, facts in before.items():
        wrong = apart(facts, plan[name]) if name in plan else "it is not asked for now"
        if wrong:
            raise UsageError(
                f"{folder / name} began as another part: {wrong}; ask for the values that the "
                "sweep began with, in their order, with further ones at the end, or name another "
                "output"
            )


def refuse_other_part(path: str, output: str, identity: Facts) -> None:
    """UsageError where the identity of a study is not that of the part of a sweep which the plan
    in a file has under the name of the output."""
    planned = read_plan(path).get(Path(output).name)
    if planned is None:
        raise UsageError(f"{path} has no part {Path(output).name}")
    if unlike := differences({k: v for k, v in planned.items() if k != "asked"}, identity):
        raise UsageError(
            f"{output} is no longer the study that the sweep began with: {unlike[0]}; undo that "
            "and resume the sweep, or begin a new one"
        )
