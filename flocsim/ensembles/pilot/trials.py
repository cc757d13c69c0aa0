"""Single replicates of a study, each run once by a method of one's choice within a step budget.

Forecasts (`--dry-run --pilot`) and `flocsim work-precision` are tables of such trials, spread
evenly over all conditions. Two trials of the same replicate that end differently are a flip.
"""

import math
import time
from collections.abc import Callable
from typing import NamedTuple

from flocsim.ensembles.collision.draw import FAILED, Draw
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.study import Study
from flocsim.integrators.base import Integrator
from flocsim.io.results.schema import NOT_APPLICABLE
from flocsim.run import Run

GOLDEN = 0.6180339887498949


class Task(NamedTuple):
    """One replicate: index of the collision type, N, share of δ_max, index of the replicate."""

    condition: int
    vertices: int
    delta: float
    replicate: int


def expected_replicates(config: Config) -> int:
    """Return the number of replicates of each condition that a study is likely to run.

    With a rule that ends it early, those that narrow the interval of a probability of ½ to what the
    rule wants.
    """
    if config.stop.half_width is None:
        return config.replicates
    wanted = math.ceil((0.98 / config.stop.half_width) ** 2)
    return min(config.replicates, max(wanted, config.stop.least))


def sample_of(config: Config, size: int) -> list[list[Task]]:
    """Return Tasks of ``size`` replicates of each collision type, fewer where the study has fewer.

    The first few of a list are spread over all N and δ as evenly as all of them, and no replicate
    of a condition comes twice. An index only names random numbers, so that any choice that does not
    look at these is a random sample.
    """
    vertices, deltas = config.shapes.vertices, config.scene.delta
    cells = [(n, delta) for n in vertices for delta in deltas]
    stride = stride_through(len(cells))
    # After so many tasks a cell would meet the same indices again.
    period = math.lcm(len(cells), config.replicates)
    size = min(size, len(cells) * config.replicates)
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
    """Return a step that visits all positions of a ring, and any region of it soon."""
    wanted = max(round(GOLDEN * count), 1)
    return min(
        (step for step in range(1, count + 1) if math.gcd(step, count) == 1),
        key=lambda step: (abs(step - wanted), step),
    )


class Job(NamedTuple):
    """A Task by a method, within a step budget."""

    task: Task
    integrator: Integrator
    max_steps: int


class Trial(NamedTuple):
    """The result of a Job: outcome, inside and bond as in the results file, simulated time [s], CPU
    time of the run and of preparing its two flocs (0 where that had been done) [s]."""

    outcome: int = FAILED
    inside: int = NOT_APPLICABLE
    time: float = 0.0
    cpu: float = 0.0
    setup: float = 0.0
    bond: int = NOT_APPLICABLE


def try_out(
    study: Study, job: Job, record: bool = False, changed: Callable[[Draw], Draw] | None = None
) -> tuple[Trial, Run | None]:
    """Run a replicate once as the study would, by another method; return (Trial, its Run).

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
    outcome, inside, bond = (int(row[name]) for name in ("outcome", "inside", "bond"))
    return Trial(outcome, inside, run.time, clock() - began, setup, bond), run


def is_flip(found: Trial, exact: Trial) -> bool:
    """Return True if two trials end differently, as the column n_flipped counts."""
    return (found.outcome, found.inside) != (exact.outcome, exact.inside)
