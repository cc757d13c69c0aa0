"""The settings that a pilot tries, and one replicate at one of them: what came out, at what cost.

A tolerance has its meaning against the lengths of a scene: 1e-6 m is a spheroradius of `tang2014`,
so the ladder begins at the smallest length of the outlines, rounded to a decade.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flocsim.arrays import EVALUATIONS
from flocsim.ensembles.collision.failures import FAILED, replicate_row
from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.pilot.sample import Task
from flocsim.ensembles.preflight import measured_flocs, pairings
from flocsim.ensembles.study import Study
from flocsim.integrators import DormandPrince54, Implicit
from flocsim.integrators.base import Integrator
from flocsim.io.results.schema import NOT_APPLICABLE

RUNGS = tuple(
    float(f"{digit}e{-decade}") for decade in range(5) for digit in (1, 0.3)
)[:-1]  # fmt: skip
"""Tolerances over the scene's length, from 1 to 1e-4: in steps of half a decade."""

DECADES = tuple(rung for rung in RUNGS if math.log10(rung).is_integer())
"""The rungs that are run; what lies between is interpolated."""

REFERENCE = 1e-2
"""Tolerance of the runs that rungs are held against, over the tightest rung that is expected."""

CORE = 0.25
"""Smallest length of an equivalent sphere, which has no spheroradius, over r_eq."""

WEIGHTS: dict[type, float] = {Implicit: 1.0, DormandPrince54: 0.5}
"""CPU time of one evaluation of the forces, all that is done besides included, over that of
Implicit: `python -m benchmarks.accuracy.pilot_weights`."""


class Job(NamedTuple):
    """A Task by a method, within a step budget."""

    task: Task
    integrator: Integrator
    max_steps: int


class Trial(NamedTuple):
    """What came of a Job: outcome and inside as in the results file, its cost [evaluations of
    Implicit], and the time [s] that it simulated."""

    outcome: int
    inside: int
    cost: float
    time: float


def scene_length(config: Config, condition: int, flocs: Sequence[Floc] | None = None) -> float:
    """Length [m] at which the ladder of a collision type begins: a power of ten.

    ``flocs``: those of the study, where they have been read.
    """
    shapes, known = config.shapes, measured_flocs(config) if flocs is None else flocs
    length = CORE * min(pairings(config, known)[condition].radii)
    if max(shapes.vertices) > 1 and shapes.size == "own":
        measured = [each.radius for floc in known for each in floc.shapes.values()]
        length = min(length, float(np.median(measured)))
    elif max(shapes.vertices) > 1 and shapes.own is None:
        length = min(length, shapes.radius)
    return float(f"1e{round(math.log10(length))}")


def at_rung(integrator: Integrator, tolerance: float) -> Integrator:
    """The method with that tolerance [m], to as many digits as a person would write."""
    return type(integrator)(tolerance=float(f"{tolerance:.6g}"))  # type: ignore[call-arg]


def trial(study: Study, job: Job) -> Trial:
    """Run a replicate as the study would, once and by another method.

    An exception costs no more than this replicate, which has failed then.
    """
    try:
        draw = study.draw(*job.task)
        driver = study.driver(draw.encounter, job.integrator)
        run = draw.begin(driver, job.max_steps, integrator=job.integrator)
        row = replicate_row(run.to_end(), draw.angles, run)
    except MemoryError:
        raise
    except Exception:
        return Trial(FAILED, NOT_APPLICABLE, 0.0, 0.0)
    cost = WEIGHTS[type(job.integrator)] * int(run.work.tally[EVALUATIONS])
    return Trial(int(row["outcome"]), int(row["inside"]), cost, run.time)


def is_flip(found: Trial, exact: Trial) -> bool:
    """Whether an outcome is another than that of the reference, as the column n_flipped counts."""
    return (found.outcome, found.inside) != (exact.outcome, exact.inside)
