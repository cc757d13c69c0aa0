"""Replicates of a collision, run under the ensemble's observer by any integrator of flocsim."""

import math
import time

import attrs
import numpy as np

from flocsim.ensembles.collision.draw import Draw, draws, orientations, outcome_of
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.outcomes import OBSERVER
from flocsim.integrators.base import Status

VERTICES = 64
DELTAS = (0.0, 0.25, 0.5, 0.75)
"""Displacements over δ_max, which the replicates take in turn."""

CHUNK = 100_000
"""Steps between two looks at the clock."""

NO_LIMITS = math.inf, math.inf


@attrs.frozen(eq=False)
class Case:
    """One replicate, ready to be run by any method."""

    encounter: Encounter
    angles: tuple
    share: float

    def with_integrator(self, integrator):
        """The case's encounter with another integrator."""
        system = attrs.evolve(self.encounter.system, integrator=integrator)
        return attrs.evolve(self.encounter, system=system)


@attrs.frozen(eq=False)
class Result:
    """Outcomes (k,) of the cases, when they ended [s], and CPU time [s] for each on average."""

    outcomes: np.ndarray
    ends: np.ndarray
    cpu: float

    def first(self, count):
        """The same of the first cases alone."""
        return Result(self.outcomes[:count], self.ends[:count], self.cpu)


def make_cases(study, condition, count):
    """The first ``count`` replicates of a condition."""
    cases = []
    for replicate in range(count):
        numbers = draws(study.config.seed, replicate)
        encounter = study.encounter(condition, VERTICES, numbers)
        share = DELTAS[replicate % len(DELTAS)]
        cases.append(Case(encounter, orientations(numbers), share))
    return cases


def run_case(case, encounter, driver, limits):
    """(outcome, end [s], CPU time [s]) of a replicate from its start on.

    ``limits``: most simulated time [s] and most CPU time [s]; beyond them it is undecided.
    """
    run = Draw(encounter, case.angles, case.share).begin(driver, 10**12, limits[0])
    began = time.process_time()
    while (status := run.advance(CHUNK)) == Status.PAUSED:
        if time.process_time() - began > limits[1]:
            status = Status.STEP_BUDGET
            break
    cpu = time.process_time() - began
    return outcome_of(status, run.code, run.observed)[0], run.time, cpu


def run_cases(cases, integrator, limits=None, allowed=None, exact=None):
    """The Result of an integrator; None once more than ``allowed`` differ from ``exact``."""
    encounters = [case.with_integrator(integrator) for case in cases]
    driver = encounters[0].system.compose(observer=OBSERVER)
    run_case(cases[0], encounters[0], driver, (1e-12, math.inf))
    found = []
    for k, (case, encounter) in enumerate(zip(cases, encounters, strict=True)):
        most = NO_LIMITS if limits is None else limits[k]
        found.append(run_case(case, encounter, driver, most))
        if allowed is not None and differing([each[0] for each in found], exact) > allowed:
            return None
    outcomes, ends, cpu = (np.array(column) for column in zip(*found, strict=True))
    return Result(outcomes, ends, float(cpu.mean()))


def differing(outcomes, exact):
    """How many outcomes differ from the exact ones."""
    return int(np.count_nonzero(np.asarray(outcomes) != exact[: len(outcomes)]))
