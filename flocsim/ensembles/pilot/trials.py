"""Replicates tried out: one by a method within a step budget, what came of it, and at what cost.

Pilots, forecasts, what is needless and work-precision are tables of such trials, each held against
another of the same replicate: where the outcome is another one, it has flipped.
"""

import time
from collections.abc import Callable
from typing import NamedTuple

import flocsim.arrays as at
from flocsim.ensembles.collision.draw import Draw
from flocsim.ensembles.collision.failures import FAILED
from flocsim.ensembles.pilot.sample import Task
from flocsim.ensembles.study import Study
from flocsim.integrators import DormandPrince54, Implicit
from flocsim.integrators.base import Integrator
from flocsim.io.results.schema import NOT_APPLICABLE
from flocsim.run import Run

WEIGHTS: dict[type, float] = {Implicit: 1.0, DormandPrince54: 0.5}
"""CPU time of one evaluation of the forces, all that is done besides included, over that of
Implicit: `python -m benchmarks.accuracy.pilot_weights`."""


class Job(NamedTuple):
    """A Task by a method, within a step budget."""

    task: Task
    integrator: Integrator
    max_steps: int


class Trial(NamedTuple):
    """What came of a Job: outcome, inside and bond as in the results file, its cost [evaluations of
    Implicit], the time [s] that it simulated; CPU times [s] of its run, and of what was made for
    its two flocs before (0: it was there)."""

    outcome: int = FAILED
    inside: int = NOT_APPLICABLE
    cost: float = 0.0
    time: float = 0.0
    cpu: float = 0.0
    setup: float = 0.0
    bond: int = NOT_APPLICABLE


def try_out(
    study: Study, job: Job, record: bool = False, changed: Callable[[Draw], Draw] | None = None
) -> tuple[Trial, Run | None]:
    """(Trial, its Run) of a replicate, run once as the study would, by another method.

    ``record``: every step; ``changed``, optional, gives what is run instead of the study's Draw.
    An exception, as of a force of the user's own, costs no more than this replicate, which has
    failed then: no Run.
    """
    clock, known, setup = time.process_time, len(study.encounters), 0.0
    began = clock()
    try:
        draw = study.draw(*job.task)
        draw = draw if changed is None else changed(draw)
        driver = study.driver(draw.encounter, job.integrator)
        _ = draw.encounter.scene  # made here, where it is not timed
        if len(study.encounters) > known:
            setup = clock() - began
        began = clock()
        run = draw.begin(driver, job.max_steps, record=record, integrator=job.integrator)
        row = draw.row(run, run.to_end())
    except MemoryError:
        raise
    except Exception:
        return Trial(cpu=clock() - began, setup=setup), None
    cost = WEIGHTS.get(type(job.integrator), 1.0) * int(run.work.tally[at.EVALUATIONS])
    outcome, inside, bond = (int(row[name]) for name in ("outcome", "inside", "bond"))
    found = Trial(outcome, inside, cost, run.time, clock() - began, setup, bond)
    return found, run


def is_flip(found: Trial, exact: Trial) -> bool:
    """Whether an outcome is another than that of the reference, as the column n_flipped counts."""
    return (found.outcome, found.inside) != (exact.outcome, exact.inside)
