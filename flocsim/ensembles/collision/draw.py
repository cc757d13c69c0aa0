"""Draw: a replicate as its random numbers have it; from there to its outcome."""

import math
from collections.abc import Callable

import attrs

import flocsim.arrays as at
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.failures import FAILED, FAILURES, NO_FLOC, WHY, replicate_row
from flocsim.integrators.base import Integrator, Status
from flocsim.io.results.checks import FURTHER_RUNS
from flocsim.io.results.schema import NOT_APPLICABLE
from flocsim.run import Run
from flocsim.system import System
from flocsim.trajectories.blame import UNABLE, force_to_blame


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
        return attrs.evolve(system, bodies=bodies)
