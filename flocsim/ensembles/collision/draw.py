"""One replicate: its random numbers, where its two bodies begin, how it runs from there to its
outcome (Draw), and how that is written down, or the reason where it has none.

With Sobol's sequences replicate k is point k // S of scramble k mod S, S scrambles being dealt in
turn: all of them grow evenly with the number of replicates, and no number of ranks changes a point.

Some replicates are run again, more exactly, so that what numerics change is seen and counted. Which
follows from the seed, the replicate's index and how it ended: whatever ranks, kills, and later
extensions there are, the same ones are run again. An index does nothing but name random numbers, so
that a choice which does not look at them is a random sample of those that ended alike. More are
taken of those that flip easily (`io.results.events.flips_easily`), and each kind counts for as many
as there are of it (`estimates.numerical`). One in THIRD_OF of these is run a third time, more
exactly still: first and second runs may lie on one plateau.
"""

import math
from collections.abc import Callable
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import attrs
import numpy as np

from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.outcomes import BOUND, DEPARTED, HELD, MISSED
from flocsim.ensembles.kind import Numbers
from flocsim.integrators.base import Integrator, Status
from flocsim.io.results.schema import (
    AGGREGATED,
    BLANKS,
    FAILED,
    OUTCOMES,
    REPLICATES,
)
from flocsim.run import UNABLE, Run, force_to_blame
from flocsim.state.clock import Clock, Counts
from flocsim.state.work import work_of
from flocsim.system import System

if TYPE_CHECKING:
    from flocsim.ensembles.collision.encounter import Encounter

OFFSET, ANGLE_I, ANGLE_J, FLOC_I, FLOC_J = range(5)
"""What the dimensions of a Sobol point are for: the offset comes first, as the first dimensions of
the sequence are the most even ones."""
POINTS_STREAM = (0, 0, 2)
"""Spawn key, with the scramble's number behind it, of the numbers that scramble the sequence."""

FIRST_POINTS = 256
SAMPLE = 16
"""Points of each scramble that stand for the sequence."""

FAILURES = ("none", "time limit", "step budget", "stalled", "too deep", "not finite", "exception")
"""Reasons of an undecided or failed outcome; a code is a place here."""

ENDS: dict[int, tuple[str, str]] = {
    Status.FINISHED: ("undecided", "time limit"),
    Status.STEP_BUDGET: ("undecided", "step budget"),
    Status.STALLED: ("undecided", "stalled"),
    Status.TOO_DEEP: ("failed", "too deep"),
    Status.NOT_FINITE: ("failed", "not finite"),
}
"""Ends without a decision, or in which the model was left: outcomes and reasons."""

APART = {MISSED: "missed", HELD: "held"}
"""Outcomes of pairs that never touched."""

CLASSES = {(1, BOUND): "A", (1, DEPARTED): "B", (0, BOUND): "C", (0, DEPARTED): "D"}
"""Class by (inside, decision)."""

NO_FLOC = -1
"""In ``floc_i`` and ``floc_j``: a sphere."""

BLANK = {name: BLANKS[kind] for name, (kind, *_) in REPLICATES.items()}
"""A row of which nothing is known."""

LONGEST_REASON = 300
"""Letters of an exception's words in a note."""


def generator(seed: int, *key: int) -> np.random.Generator:
    """Return a generator of random numbers that nothing but these numbers decides."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=key)))


@lru_cache(maxsize=4096)
def draws(seed: int, replicate: int) -> np.ndarray:
    """Return five uniform numbers in [0, 1) of one replicate: two orientations, two choices of
    floc, and the direction of j in a brownian meeting.

    They depend on the seed and the replicate's index alone, so that no number of ranks changes
    them, and one replicate has the same orientations and the same flocs at every displacement,
    number of vertices and type.
    """
    found = generator(seed, replicate).random(5)
    found.flags.writeable = False
    return found


def orientations(numbers: Numbers) -> tuple[float, float]:
    """Return angles θ = 2πn [rad] of bodies i and j."""
    return 2.0 * math.pi * float(numbers[0]), 2.0 * math.pi * float(numbers[1])


@lru_cache(maxsize=128)
def points(seed: int, scramble: int, size: int) -> np.ndarray:
    """Return the first ``size`` points (size, 5) of a scramble, in [0, 1); ``size`` a power of
    2."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(5, scramble=True, seed=generator(seed, *POINTS_STREAM, scramble))
    found = np.asarray(sequence.random_base2(size.bit_length() - 1))
    found.flags.writeable = False
    return found


def point(seed: int, scrambles: int, replicate: int) -> np.ndarray:
    """Return the point (5,) of a replicate."""
    # Dealt in turn; the table of points grows by doubling, as Sobol's sequence is even at powers of
    # 2.
    place, scramble = divmod(replicate, scrambles)
    size = max(FIRST_POINTS, 1 << place.bit_length())
    return points(seed, scramble, size)[place]


def points_of(seed: int, scrambles: int, first: int, stop: int) -> np.ndarray:
    """Return the points (stop − first, 5) of replicates."""
    return np.array([point(seed, scrambles, replicate) for replicate in range(first, stop)])


def as_draws(point: np.ndarray) -> np.ndarray:
    """Return a point in the order of `draws`, the offset last."""
    return point[[ANGLE_I, ANGLE_J, FLOC_I, FLOC_J, OFFSET]]


def outcome_of(status: int, code: int, observed: np.ndarray) -> tuple[int, int]:
    """Return (outcome code, failure code) of a replicate whose run ended so."""
    if status == Status.STOPPED:
        name = APART.get(code) or CLASSES[int(observed[outcomes.INSIDE]), code]
        return OUTCOMES.index(name), 0
    name, reason = ENDS[status]
    return OUTCOMES.index(name), FAILURES.index(reason)


def failed(reason: str) -> dict[str, int]:
    """Return {column: value} of a replicate that has failed for one of FAILURES."""
    return {"outcome": FAILED, "failure": FAILURES.index(reason)}


def columns_of(run: str) -> dict[str, str]:
    """Return {column of a replicate's further run: the same of the first}."""
    return {f"{run}_{name}": name for name in ("outcome", "inside", "bond")}


@attrs.frozen(eq=False)
class Draw:
    """Who meets whom in a replicate, and from where.

    ``angles`` of i and j [rad]; ``share``: the displacement over δ_max, in a flow and in studies of
    rates over R_i + R_j, in a brownian meeting the direction of j over a full turn; ``flocs``:
    places of the two in the study's list. Every run starts anew from it.
    """

    encounter: "Encounter"
    angles: tuple[float, float]
    share: float
    flocs: tuple[int, int] = (NO_FLOC, NO_FLOC)

    def begin(
        self, driver: Callable, max_steps: int, until: float = math.inf, record: bool = False,
        integrator: Integrator | None = None,
    ) -> Run:  # fmt: skip
        """Return a Run that has yet to take its first step, to a time [s] at most.

        ``driver``: the compiled one of the encounter's scene; ``integrator``: another one than the
        encounter's, of the driver's method.
        """
        encounter = self.encounter
        motion = encounter.motion(self.angles, self.share)
        return Run(
            driver, encounter.scene, work_of(encounter.scene, *motion),
            integrator or encounter.system.integrator,
            min(encounter.time_limit(self.share), until),
            max_steps=max_steps, observed=encounter.given.copy(), record=record,
        )  # fmt: skip

    def row_of_run(self, run: Run, status: Status) -> dict:
        """Return the row of a Run that has ended so; failed where a force gives no number."""
        row = self.row(status, run.observed, run.clock, run.counts, run.error)
        if status in UNABLE and force_to_blame(self.encounter.system, run.work, run.time):
            row |= failed("not finite")
        return row

    def row(
        self, status: int, observed: np.ndarray, clock: Clock, counts: Counts, error: float
    ) -> dict:  # fmt: skip
        """Return the row of a run that has ended so: with these arrays, and a stated error [m]."""
        outcome, failure = outcome_of(status, counts.code, observed)
        row = BLANK | self.encounter.described
        row |= {
            "angle_i": self.angles[0],
            "angle_j": self.angles[1],
            "floc_i": self.flocs[0],
            "floc_j": self.flocs[1],
            "outcome": outcome,
            "failure": failure,
            "d_c_last": observed[outcomes.D_LAST],
            "t_end": clock.time,
            "steps": counts.steps,
            "rejected": counts.rejected,
            "error": error,
        }
        if observed[outcomes.COLLIDED] == 1.0:
            row |= {
                "inside": int(observed[outcomes.INSIDE]),
                "crossed_zone": int(observed[outcomes.CROSSED]),
                "d_c_collision": observed[outcomes.D_COLLISION],
                "d_c_over_D_0": observed[outcomes.D_COLLISION] / observed[outcomes.ZONE],
                "d_c_max": observed[outcomes.D_MAX],
                "t_collision": observed[outcomes.T_COLLISION],
            }
        if OUTCOMES[outcome] in AGGREGATED:
            row["bond"] = int(observed[outcomes.BOND])
        return row

    def system(self) -> System:
        """Return the plain System where the replicate starts."""
        system, bodies = self.encounter.system, []
        motion = (each.tolist() for each in self.encounter.motion(self.angles, self.share))
        for body, (x, y, angle), (*velocity, spin) in zip(system.bodies, *motion, strict=True):
            bodies.append(
                attrs.evolve(
                    body, position=(x, y), angle=angle, velocity=tuple(velocity), spin=spin
                )
            )
        return system.changed(bodies=tuple(bodies))


TIGHTER = 0.01
"""Tolerance of a second run over that of the first."""

THIRD_TIGHTER, FINEST, LEAST_TIGHTER = 1e-3, 1e-12, 0.1
"""Tolerance of a third run over that of the second; the tolerance [m] at which it ends, unless it
is to be tighter than the second at least by the last."""

SHORTER = 0.25
"""The same for a fixed step: 16 times less error of a method of second order."""

MORE_STEPS = 5
"""By how much a run may take more steps than the one before."""

THIRD_OF = 8
"""One in so many second runs has a third one behind it."""

FEW, CHECKED_FRACTION = 24, 0.035
"""How many replicates of a condition "auto" has run again at least, and the fraction of them where
that is more: less than a fifth of the cost of a study of 1,000
(benchmarks.accuracy.numerical_error)."""

EASILY = 3
"""Times as many "auto" has run again of those that flip easily."""

CHOICE_STREAM = (0, 0, 1)
"""Spawn key of the number that the choice starts from; replicates have keys of one part."""


def expected_checks(replicates: int, share: float | str, easily: bool = False) -> float:
    """Return how many of the first so many replicates are run again, before rounding.

    ``easily``: if all of them were of those that flip easily, EASILY times as many by "auto".

    "auto": all of the first FEW, and later CHECKED_FRACTION of them. Never falls, nor rises by more
    than 1 from one replicate to the next.
    """
    if isinstance(share, str):
        wanted = max(FEW, CHECKED_FRACTION * replicates)
        return min(EASILY * wanted if easily else wanted, replicates)
    return share * replicates


@cache
def beginning(seed: int) -> float:
    """Return a number in [0, 1) that says where the choice begins."""
    return float(generator(seed, *CHOICE_STREAM).random())


def further_runs(seed: int, replicate: int, share: float | str, easily: bool = False) -> int:
    """Return how often a replicate is run again, up to twice: a systematic sample.

    Of the first n of any condition expected_checks(n) would be, up or down to a whole number, if
    all ended alike, the first of these and one in THIRD_OF twice; ``easily``: whether it is of
    those that flip easily.
    """
    # One is run wherever the expected number, from a random start, passes a whole number.
    start = beginning(seed)
    before, after = (
        math.floor(expected_checks(n, share, easily) + start) for n in (replicate, replicate + 1)
    )
    return 0 if after == before else 1 if before % THIRD_OF else 2


def count_checks(seed: int, replicates: int, share: float | str) -> int:
    """Return how many of the first so many replicates of a condition are run again."""
    return math.floor(expected_checks(replicates, share) + beginning(seed))


def exact_method(
    method: Integrator, tighter: Callable[[float], float] = lambda value: TIGHTER * value
) -> Integrator | None:
    """Return the method with a 100 times tighter tolerance, or a quarter of its step; None for
    neither.

    ``tighter`` gives another tolerance. A class of a user's own has them as parameters of these
    names, or cannot be checked.
    """
    names = {field.alias for field in attrs.fields(type(method)) if field.init}
    for name, smaller in (("tolerance", tighter), ("step", lambda value: SHORTER * value)):
        value = getattr(method, name, math.inf)
        if name in names and value < math.inf:
            return attrs.evolve(method, **{name: float(f"{smaller(value):.15g}")})
    return None


def third_tolerance(second: float) -> float:
    """Return that of a third run behind a second one [m]."""
    return max(THIRD_TIGHTER * second, min(FINEST, LEAST_TIGHTER * second))


def exact_methods(method: Integrator) -> tuple[Integrator, Integrator] | None:
    """Return those of the second and the third run; None where a method cannot be made more
    exact."""
    second = exact_method(method)
    third = second and exact_method(second, third_tolerance)
    return (second, third) if second and third else None
