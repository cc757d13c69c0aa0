"""How the end of a replicate is written down: its outcome, and the reason where it has none.

An exception, or a number that is none, costs that one replicate: a row says so, and a note has
what is needed to run it again.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

import flocsim.arrays as at
from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.outcomes import BOUND, COLLIDED, DEPARTED, HELD, INSIDE, MISSED
from flocsim.ensembles.collision.start import orientations
from flocsim.integrators.base import Status
from flocsim.io.results.schema import (
    AGGREGATED,
    BLANKS,
    FAILED,
    NOT_APPLICABLE,
    OUTCOMES,
    REPLICATES,
    SHAPE_COLUMNS,
)

FAILURES = ("none", "time limit", "step budget", "stalled", "too deep", "not finite", "exception")
"""Reasons of an undecided or failed outcome; a code is a place here."""

UNDECIDED_ENDS = {
    Status.FINISHED: "time limit",
    Status.STEP_BUDGET: "step budget",
    Status.STALLED: "stalled",
}
"""Ends without a decision, and their reasons."""

FAILED_ENDS = {Status.TOO_DEEP: "too deep", Status.NOT_FINITE: "not finite"}
"""Ends in which the model was left, and their reasons."""

WHY = "why"
"""Key of a row, beside the columns, for the words on a failure."""

APART = {MISSED: "missed", HELD: "held"}
"""Outcomes of pairs that never touched."""

CLASSES = {(1, BOUND): "A", (1, DEPARTED): "B", (0, BOUND): "C", (0, DEPARTED): "D"}
"""Class by (inside, decision)."""

ALWAYS_FINITE = ("angle_i", "angle_j", "d_c_last", "t_end")
"""Columns that are numbers in every row of a replicate that has not failed."""

DRAWN = ("r_i", "r_j", "D_0", "floc_i", "floc_j", *SHAPE_COLUMNS)
"""Columns that are known of every replicate that was begun."""

NO_FLOC = -1
"""In ``floc_i`` and ``floc_j``: a sphere."""

LONGEST_REASON = 300
"""Letters of an exception's words in a note."""


def outcome_of(status: Status, code: int, observed: np.ndarray) -> tuple[int, int]:
    """(outcome code, failure code) of a replicate whose run ended so."""
    if status == Status.STOPPED:
        if code in APART:
            return OUTCOMES.index(APART[code]), 0
        return OUTCOMES.index(CLASSES[int(observed[INSIDE]), int(code)]), 0
    if status in UNDECIDED_ENDS:
        return OUTCOMES.index("undecided"), FAILURES.index(UNDECIDED_ENDS[status])
    return FAILED, FAILURES.index(FAILED_ENDS[status])


def replicate_row(status, angles, run):
    """What the table of replicates holds of a Run that has ended."""
    observed = run.observed
    outcome, failure = outcome_of(status, run.code, observed)
    touched = bool(observed[COLLIDED] == 1.0)
    zone = observed[outcomes.ZONE]
    return {
        "angle_i": angles[0],
        "angle_j": angles[1],
        "r_i": run.scene.bodies[outcomes.BODY_I, at.EQUIVALENT_RADIUS],
        "r_j": run.scene.bodies[outcomes.BODY_J, at.EQUIVALENT_RADIUS],
        "D_0": zone,
        "outcome": outcome,
        "inside": int(observed[outcomes.INSIDE]) if touched else NOT_APPLICABLE,
        "crossed_zone": int(observed[outcomes.CROSSED]) if touched else NOT_APPLICABLE,
        "bond": int(observed[outcomes.BOND]) if OUTCOMES[outcome] in AGGREGATED else NOT_APPLICABLE,
        "d_c_collision": observed[outcomes.D_COLLISION] if touched else np.nan,
        "d_c_over_D_0": observed[outcomes.D_COLLISION] / zone if touched else np.nan,
        "d_c_max": observed[outcomes.D_MAX] if touched else np.nan,
        "d_c_last": observed[outcomes.D_LAST],
        "t_collision": observed[outcomes.T_COLLISION] if touched else np.nan,
        "t_end": run.time,
        "steps": run.steps,
        "rejected": run.rejected,
        "error": run.error,
        "failure": failure,
    }


def run_safely(
    study: Any, place: tuple[int, int, float], replicate: int,
    halted: Callable[[], bool] | None = None,
) -> tuple[dict | None, dict | None]:  # fmt: skip
    """(row, None) of one replicate, or (row, note) where it failed; row None where halted.

    ``study``: a Study; ``place``: of a condition, as Study.places has it. Running out of memory is
    nobody's fault but the machine's, and goes on.
    """
    condition, vertices, share = place
    try:
        row = study.run(condition, vertices, share, replicate, halted=halted)
    except MemoryError:
        raise
    except Exception as error:
        angles = orientations(study.numbers(replicate))
        why = f"{type(error).__name__}: {' '.join(str(error).split())}"[:LONGEST_REASON]
        return failed_row("exception", angles), study.note(place, replicate, why)
    if row is None:
        return None, None
    why = row.pop(WHY, "")
    if row["outcome"] != FAILED and not all(math.isfinite(row[name]) for name in ALWAYS_FINITE):
        drawn = {name: row[name] for name in DRAWN}
        row = failed_row("not finite", (row["angle_i"], row["angle_j"])) | drawn
    if row["outcome"] == FAILED:
        reason = FAILURES[row["failure"]] + (f": {why}" if why else "")
        return row, study.note(place, replicate, reason)
    return row, None


def failed_row(reason, angles):
    blank = {name: BLANKS[kind] for name, (kind, _, _) in REPLICATES.items()}
    told = {"outcome": FAILED, "failure": FAILURES.index(reason)}
    return blank | {"angle_i": angles[0], "angle_j": angles[1]} | told
