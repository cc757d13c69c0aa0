"""The settings that a pilot tries: the rungs of a ladder, and a collision type's climb.

A tolerance has its meaning against the lengths of a scene: 1e-6 m is a spheroradius of `tang2014`,
so the ladder begins at the smallest length of the outlines, rounded to a decade.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import attrs
import numpy as np

from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.pilot.model import Seen
from flocsim.ensembles.pilot.sample import Task
from flocsim.ensembles.pilot.trials import Job, Trial, is_flip
from flocsim.ensembles.preflight import measured_flocs, pairings
from flocsim.integrators import Implicit
from flocsim.integrators.base import Integrator

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

USUAL = 0.6
"""Cost of a good setting over that of the reference: where none is below, coarse steps are dear (a
coarse step that is tried again and again, a pair that ends at the step budget), and finer ones are
tried as well."""

DEARER = 0.13
"""Cost goes with this power of 1/tolerance where no two rungs say."""


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


@attrs.define
class Ladder:
    """A type's climb by one method: what its replicates came to at each rung."""

    condition: int
    method: Integrator
    length: float
    tasks: list[Task]
    reference: float
    exact: list[Trial]
    tried: dict[float, list[Trial]] = attrs.Factory(dict)
    max_steps: int = 0

    def cost(self, rung: float) -> float:
        """Evaluations of the mean replicate at a rung that was run."""
        return mean([each.cost for each in self.tried[rung]])

    def flips(self, rung: float) -> int:
        return sum(map(is_flip, self.tried[rung], self.exact))

    def seen(self) -> list[Seen]:
        """For `model.beliefs`."""
        count = len(self.tasks)
        return [Seen(rung, self.reference, count, self.flips(rung)) for rung in self.tried]

    def jobs(self, rung: float) -> list[Job]:
        made = at_rung(self.method, rung * self.length)
        return [Job(task, made, self.max_steps) for task in self.tasks]

    def is_dear(self) -> bool:
        """Whether even the cheapest rung that was run costs about as much as the reference."""
        if not isinstance(self.method, Implicit):
            return False
        return min(map(self.cost, self.tried)) > USUAL * mean([each.cost for each in self.exact])

    def mean_cost(self, rung: float) -> float:
        """Evaluations of a replicate at a rung, from those that were run, by powers of it."""
        known = sorted((each, max(self.cost(each), 1.0)) for each in self.tried)
        if len(known) == 1:
            [(at, cost)] = known
            return float(cost * (at / rung) ** DEARER)
        (a, cost_a), (b, cost_b) = next(
            (pair for pair in pairwise(known) if rung <= pair[1][0]), known[-2:]
        )
        share = math.log(rung / a) / math.log(b / a)
        return float(cost_a * (cost_b / cost_a) ** share)


def mean(values):
    return sum(values) / len(values)
