"""Replicates tried out: one by a method within a step budget, what came of it, and at what cost.

Pilots, forecasts, what is needless and work-precision are tables of such trials, each held against
another of the same replicate: where the outcome is another one, it has flipped.

A pilot runs replicates spread over all conditions, and no more than the study can bear. An index
does nothing but name random numbers, so that any choice that does not look at them is a random
sample of the replicates.
"""

import math
import time
from collections.abc import Callable
from typing import NamedTuple

import flocsim.arrays as at
from flocsim.ensembles.collision.draw import FAILED, Draw
from flocsim.ensembles.config.schema import Config, StopConfig
from flocsim.ensembles.study import Study
from flocsim.integrators import DormandPrince54, Implicit
from flocsim.integrators.base import Integrator
from flocsim.io.results.schema import NOT_APPLICABLE
from flocsim.run import Run

MOST = 900
"""Replicates of a pilot."""

SHARE = 0.1
"""Of what the study costs, for the whole pilot."""

LADDER = 6.0
"""What all settings that a pilot tries on a replicate cost, over what the study spends on one: a
hundred times tighter a reference 3, the chosen setting 1, those before and beside it 2."""

LEAST = 10
"""Replicates of a type: with fewer a pilot would see nothing, and is not run."""

GOLDEN = 0.6180339887498949


class Task(NamedTuple):
    """One replicate: place of the collision type, N, share of δ_max, index."""

    condition: int
    vertices: int
    delta: float
    replicate: int


def expected_replicates(replicates: int, stop: StopConfig) -> int:
    """Replicates of each condition that a study is likely to have: with a rule that ends it early,
    those that narrow the interval of a probability of ½ to what the rule wants."""
    if stop.half_width is None:
        return replicates
    wanted = math.ceil((0.98 / stop.half_width) ** 2)
    return min(replicates, max(wanted, stop.least))


def pilot_size(config: Config) -> int:
    """Replicates of each type that a pilot of the config runs; 0: the study is too small for one.

    All types together at most MOST, and so many that the ladder costs SHARE of the study.
    """
    types = len(config.scene.names)
    cells = len(config.shapes.vertices) * len(config.scene.delta)
    replicates = expected_replicates(config.replicates, config.stop)
    found = int(min(MOST / types, SHARE * cells * replicates / LADDER))
    return found if found >= LEAST else 0


def sample_of(config: Config, size: int | None = None) -> list[list[Task]]:
    """The Tasks of a pilot, or of ``size`` replicates of each type: a list for each type.

    The first few of a list are spread over all N and δ as evenly as all of them, and no two are the
    same replicate of the same condition.
    """
    vertices, deltas = config.shapes.vertices, config.scene.delta
    cells = [(n, delta) for n in vertices for delta in deltas]
    stride = stride_through(len(cells))
    # After so many tasks a cell would meet the same indices again.
    period = math.lcm(len(cells), config.replicates)
    size = pilot_size(config) if size is None else min(size, len(cells) * config.replicates)
    return [
        [
            Task(
                condition,
                *cells[place * stride % len(cells)],
                (place + place // period) % config.replicates,
            )
            for place in range(size)
        ]
        for condition in range(len(config.scene.names))
    ]


def stride_through(count: int) -> int:
    """A step through so many places in a ring that comes to all of them, and soon everywhere."""
    wanted = max(round(GOLDEN * count), 1)
    return min(
        (step for step in range(1, count + 1) if math.gcd(step, count) == 1),
        key=lambda step: (abs(step - wanted), step),
    )


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
