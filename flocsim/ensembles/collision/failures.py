"""How the end of a replicate's run is written down: outcome and reason."""

from flocsim.ensembles.collision.memo import COLLIDED, INSIDE
from flocsim.ensembles.collision.outcomes import BOUND, DEPARTED, MISSED
from flocsim.integrators.base import Status
from flocsim.io.results.schema import BLANKS, OUTCOMES, REPLICATES

FAILURES = ("none", "time limit", "step budget", "stalled", "too deep", "not finite", "exception")
"""Reasons of an undecided or failed outcome; a code is a place here."""

UNDECIDED = {
    Status.FINISHED: "time limit",
    Status.STEP_BUDGET: "step budget",
    Status.STALLED: "stalled",
}
"""Ends without a decision, and their reasons."""

FAILED = {Status.TOO_DEEP: "too deep", Status.NOT_FINITE: "not finite"}
"""Ends in which the model was left, and their reasons."""

CLASSES = {(1, BOUND): "A", (1, DEPARTED): "B", (0, BOUND): "C", (0, DEPARTED): "D"}
"""Class by (inside, decision)."""


def outcome_of(status, code, memo):
    """(outcome code, failure code) of a replicate whose run ended so."""
    if status == Status.STOPPED:
        if code == MISSED:
            return OUTCOMES.index("missed"), 0
        return OUTCOMES.index(CLASSES[int(memo[INSIDE]), int(code)]), 0
    if status in UNDECIDED:
        return OUTCOMES.index("undecided"), FAILURES.index(UNDECIDED[status])
    return OUTCOMES.index("failed"), FAILURES.index(FAILED[status])


EXCEPTION = FAILURES.index("exception")
NOT_FINITE = FAILURES.index("not finite")


def failed_row(failure, angles=(float("nan"), float("nan"))):
    """The row of a replicate that ended without a result, as a dict."""
    blank = {name: BLANKS[kind] for name, (kind, _, _) in REPLICATES.items()}
    told = {"outcome": OUTCOMES.index("failed"), "failure": failure}
    return blank | {"angle_i": angles[0], "angle_j": angles[1]} | told


def collided(memo):
    """Whether the outlines touched."""
    return memo[COLLIDED] == 1.0
