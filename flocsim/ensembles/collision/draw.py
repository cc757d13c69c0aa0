"""Draw: a replicate as its random numbers have it; from there to its outcome, and how that is
written down, or the reason where it has none.

An exception, or a number that is none, costs that one replicate: a row says so, and a note has
what is needed to run it again.
"""

import math
from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

import flocsim.arrays as at
from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.outcomes import BOUND, DEPARTED, HELD, MISSED
from flocsim.ensembles.collision.start import orientations
from flocsim.integrators.base import Integrator, Status
from flocsim.io.results.checks import FURTHER_RUNS
from flocsim.io.results.schema import (
    AGGREGATED,
    BLANKS,
    FAILED,
    NOT_APPLICABLE,
    OUTCOMES,
    REPLICATES,
    SHAPE_COLUMNS,
)
from flocsim.run import Run
from flocsim.system import System
from flocsim.trajectories.blame import UNABLE, force_to_blame

FAILURES = ("none", "time limit", "step budget", "stalled", "too deep", "not finite", "exception")
"""Reasons of an undecided or failed outcome; a code is a place here."""

ENDS = {
    Status.FINISHED: ("undecided", "time limit"),
    Status.STEP_BUDGET: ("undecided", "step budget"),
    Status.STALLED: ("undecided", "stalled"),
    Status.TOO_DEEP: ("failed", "too deep"),
    Status.NOT_FINITE: ("failed", "not finite"),
}
"""Ends without a decision, or in which the model was left: outcomes and reasons."""

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
        name = APART.get(code) or CLASSES[int(observed[outcomes.INSIDE]), code]
        return OUTCOMES.index(name), 0
    name, reason = ENDS[status]
    return OUTCOMES.index(name), FAILURES.index(reason)


def replicate_row(status, angles, run):
    """What the table of replicates holds of a Run that has ended."""
    observed = run.observed
    outcome, failure = outcome_of(status, run.code, observed)
    touched = bool(observed[outcomes.COLLIDED] == 1.0)
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


def columns_of(run: str) -> dict[str, str]:
    """{column of a replicate's further run: the same of the first}."""
    return {f"{run}_{name}": name for name in ("outcome", "inside", "bond")}


CHECKED, THIRD = map(columns_of, ("checked", "third"))
FURTHER = tuple(name for run in FURTHER_RUNS for name in columns_of(run))
"""The columns of all further runs."""


@attrs.frozen(eq=False)
class Draw:
    """Who meets whom in a replicate, and from where.

    ``angles`` of i and j [rad]; ``share``: the displacement over δ_max, in a flow and in studies of
    rates over R_i + R_j, in a brownian meeting the direction of j over a full turn; ``flocs``:
    places of the two in the study's list. Every run starts anew from it.
    """

    encounter: Encounter
    angles: tuple[float, float]
    share: float
    flocs: tuple[int, int] = (NO_FLOC, NO_FLOC)

    def begin(
        self, driver: Callable, max_steps: int, until: float = math.inf, record: bool = False,
        integrator: Integrator | None = None,
    ) -> Run:  # fmt: skip
        """A Run that has yet to take its first step, to a time [s] at most.

        ``driver``: the compiled one of the encounter's scene; ``integrator``: another one than the
        encounter's, of the driver's method.
        """
        encounter = self.encounter
        return Run(
            driver, encounter.scene, encounter.start(self.angles, self.share),
            integrator or encounter.system.integrator,
            min(encounter.time_limit(self.share), until), max_steps=max_steps,
            observed=encounter.observed(), record=record,
        )  # fmt: skip

    def run(
        self, driver: Callable, max_steps: int, halted: Callable[[], bool] | None = None,
        integrator: Integrator | None = None,
    ) -> dict | None:  # fmt: skip
        """Run the replicate; the row of the table of replicates as a dict.

        ``halted()``, optional, is asked every some thousand steps whether to give up; the row is
        None then. Others: as in begin.
        """
        run = self.begin(driver, max_steps, integrator=integrator)
        status = run.to_end(halted)
        room = self.encounter.room
        room[0] = max(room[0], len(run.work.candidates))
        if status == Status.PAUSED:
            return None
        return self.row(run, status)

    def row(self, run: Run, status: Status) -> dict:
        """The row of a Run that has ended so; failed where a force gives no number."""
        row = replicate_row(status, self.angles, run) | dict.fromkeys(FURTHER, NOT_APPLICABLE)
        row |= dict(zip(("floc_i", "floc_j"), self.flocs, strict=True))
        row |= self.encounter.measures
        if status in UNABLE and (why := force_to_blame(self.encounter.system, run)):
            row |= {"outcome": FAILED, "failure": FAILURES.index("not finite"), WHY: why}
        return row

    def system(self) -> System:
        """The plain System where the replicate starts."""
        system, bodies = self.encounter.system, []
        starts = self.encounter.start(self.angles, self.share).motion[at.NOW].tolist()
        for body, (x, y, angle, vx, vy, spin) in zip(system.bodies, starts, strict=True):
            place = {"position": (x, y), "angle": angle, "velocity": (vx, vy), "spin": spin}
            bodies.append(attrs.evolve(body, **place))
        return system.changed(bodies=tuple(bodies))
