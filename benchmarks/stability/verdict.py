"""One case run and judged: right, a typed failure, wrong, not finite, or crashed."""

import time
import traceback
from itertools import combinations

import attrs

from benchmarks.stability.case import ROUND_OFF, ReferenceGaveUpError, distance_of
from benchmarks.stability.cases import case_of, family_of
from benchmarks.stability.invariants import TOLERANCES, complaints, is_finite
from benchmarks.stability.places import outline_gap
from flocsim.constants import DEEPEST_OVERLAP
from flocsim.errors import UsageError
from flocsim.integrators import Status

KINDS = ("right", "stated", "typed", "wrong", "not finite", "crash", "hang")
"""``stated``: less accurate than asked for, but within the error that the result itself states."""

USEFUL = 1e-3
"""An error stated is of use up to this share of the smallest radius."""


@attrs.define
class Verdict:
    """How a case came out. ``error`` and ``allowed`` [m], where a reference has judged."""

    index: int
    family: str
    kind: str = "right"
    detail: str = ""
    status: str = ""
    judged_by: str = "invariants"
    error: float = float("nan")
    allowed: float = float("nan")
    tolerance: float = float("nan")
    estimate: float = float("nan")
    amplification: float = float("nan")
    steps: int = 0
    wall: float = 0.0
    places: dict = attrs.Factory(dict)


def judge(index, tell=lambda stage: None):
    """The Verdict of a case; ``tell`` hears how far it has come."""
    verdict = Verdict(index, family_of(index))
    try:
        case, verdict.places = case_of(index)
        verdict.tolerance = case.tolerance
        tell("running")
        run(case, verdict, tell)
    except Exception as error:
        verdict.kind = "crash"
        line = traceback.extract_tb(error.__traceback__)[-1]
        verdict.detail = f"{type(error).__name__}: {error} ({line.filename}:{line.lineno})"
    return verdict


def run(case, verdict, tell):
    """Run the case and write what came of it into the Verdict."""
    began = time.perf_counter()
    try:
        found = case.run()
    except UsageError as error:
        refused(case, verdict, str(error))
        return
    finally:
        verdict.wall = time.perf_counter() - began
    verdict.status, verdict.steps = found.status.name, found.steps + found.rejected
    verdict.estimate = found.error
    tell("judging")
    if not is_finite(found):
        verdict.kind = "not finite"
    elif case.refused:
        verdict.kind, verdict.detail = "wrong", "too deep a start was not refused"
    elif found.status != Status.FINISHED:
        verdict.kind, verdict.detail = "typed", found.status.name
        compare_depth(case, verdict)
    else:
        finished(case, verdict, found)


def refused(case, verdict, words):
    """A refusal is right where the bodies do start too deep in each other."""
    deep = any(
        outline_gap(a.shape, (*a.position, a.angle), b.shape, (*b.position, b.angle))
        < -DEEPEST_OVERLAP * (1.0 - 1e-9) * (a.shape.radius + b.shape.radius)
        for a, b in combinations(case.bodies, 2)
    )
    verdict.status = "REFUSED"
    verdict.kind, verdict.detail = ("typed", "REFUSED") if deep else ("wrong", f"refused: {words}")


def reference_of(case):
    """The reference's Answer, or None where there is none."""
    try:
        return case.answer(case) if case.answer else None
    except ReferenceGaveUpError:
        return None


def compare_depth(case, verdict):
    """A run that ended as too deep: whether the reference agrees."""
    if verdict.status != Status.TOO_DEEP.name:
        return
    answer = reference_of(case)
    if answer is not None and answer.deepest < 0.9 * DEEPEST_OVERLAP:
        verdict.detail = "TOO_DEEP in doubt"


def finished(case, verdict, found):
    """Hold a finished run against the reference and the invariants."""
    answer = reference_of(case)
    if answer is not None:
        compare(case, verdict, found, answer)
    wrong = complaints(case, found)
    if wrong:
        verdict.kind = "wrong"
        verdict.detail = "; ".join(filter(None, [verdict.detail, *wrong]))


def compare(case, verdict, found, answer):
    """End positions: the error may be 100 tolerances, grown as errors of the start grow."""
    verdict.judged_by = "reference"
    if answer.deepest > 1.01 * DEEPEST_OVERLAP:
        verdict.kind = "wrong"
        verdict.detail = f"an overlap of {answer.deepest:.3g} of r_i + r_j went unseen"
        return
    error = TOLERANCES * case.tolerance + ROUND_OFF * answer.span
    verdict.amplification = answer.amplification
    verdict.allowed = float(error * answer.amplification + 3.0 * answer.uncertainty)
    verdict.error = distance_of(case.bodies, found.position[-1], answer.position)
    if not verdict.error <= verdict.allowed:
        smallest = min(body.shape.equivalent_radius for body in case.bodies)
        stated = verdict.error <= verdict.estimate <= USEFUL * smallest
        verdict.kind = "stated" if stated else "wrong"
        ratio = verdict.error / case.tolerance
        verdict.detail = f"place off by {verdict.error:.3g} m = {ratio:.3g} tolerances"
