"""The plan of a sweep: all that the rows of each of its parts follow from, and their axes, fixed
when it begins. What is found or made in the place of a part is held against it.

A file sweep.json beside the parts, and in the joined file: {"common": facts of all, "parts": {name
of the results file: its own facts}}; facts are those of the identity, and "asked", the axes.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flocsim.ensembles.chunks import ORDER
from flocsim.ensembles.storage.identity import differences
from flocsim.errors import FileError, UsageError
from flocsim.io.files import Old, write_file
from flocsim.io.records import matches, read_json

Facts = dict[str, Any]

NAME = "sweep.json"
ASKED = {"types": [str], "vertices": [int], "delta": [float], "replicates": int}
PLAN: Facts = {"common": {}, "parts": {}}

Plan = dict[str, Facts]
"""{name of a part's results file: its Facts}."""


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
