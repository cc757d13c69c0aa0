"""The settings that a pilot tries: the rungs of a ladder, and a collision type's climb.

A tolerance has its meaning against the lengths of a scene: 1e-6 m is a spheroradius of `tang2014`,
so the ladder begins at the smallest length of the outlines, rounded to a decade.

How many outcomes flip at a tolerance is told from the few that were seen to. An error of size e
flips what comes within about e of another outcome, and motion amplifies errors by factors that
scatter over many decades. So the rate of flips falls with a small power of the tolerance, and
levels off where the tolerance comes near the scene's length, as steps are then kept short by other
things: at rung s (tolerance over that length) it is q g(s), with g(s) = sᵝ (1 + b)/(sᵝ + b), b =
LEVEL to the power β, so that g(1) = 1. β is one for all types of a study, q belongs to a type; a
reference at s₀ is off by itself, and adds q g(s₀).

Flips seen are Poisson distributed around n q (g(s) + g(s₀)). Before anything is seen q has a gamma
distribution of mean FLIPS and shape SHAPE, β a normal one, of those that the scenes of
benchmarks/accuracy/auto.py have. What is then known of a rate is a mixture of gamma distributions
over β. Few flips thus leave a wide distribution, and none at
all the width of what was there before and of how many were run.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import attrs
import numpy as np

from flocsim.ensembles.collision.checking import Z
from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.collision.pairings import pairings_of
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.pilot.trials import Job, Task, Trial, is_flip
from flocsim.ensembles.preflight import measured_flocs
from flocsim.integrators import Implicit
from flocsim.integrators.base import Integrator

FLIPS = 0.025
"""Share of outcomes that flip where the tolerance is the scene's length, before any is seen."""

SHAPE = 1.0
"""Of the gamma distribution of q before any is seen: as wide as its mean."""

LEVEL = 0.1
"""Rung at which the rate of flips begins to level off."""

EXPONENTS = np.linspace(0.25, 0.85, 25)
EXPONENT, EXPONENT_SPREAD = 0.5, 0.1
"""The exponents that are weighed, and their normal distribution before any flip is seen."""


def falls(rung: float) -> np.ndarray:
    """g of a rung for each of EXPONENTS: the rate of flips over that at rung 1."""
    power, level = rung**EXPONENTS, LEVEL**EXPONENTS
    return power * (1.0 + level) / (power + level)


class Seen(NamedTuple):
    """How many of so many runs at a rung flip, held against a reference at another."""

    rung: float
    reference: float
    runs: int
    flips: int


class Belief(NamedTuple):
    """What is known of the q of one type: gamma distributions of ``shape`` and ``rates`` (k,), of
    the ``weights`` (k,) that EXPONENTS have."""

    shape: float
    rates: np.ndarray
    weights: np.ndarray

    def expected(self, rung: float) -> float:
        """Mean rate of flips at a rung."""
        return float(np.sum(self.weights * self.shape / self.rates * falls(rung)))

    def bound(self, rung: float, confidence: float) -> float:
        """What the rate of flips at a rung stays below with that probability."""
        from scipy.optimize import brentq
        from scipy.special import gammainc

        scaled, high = self.rates / falls(rung), 1.0

        def beyond(rate):
            return float(np.sum(self.weights * gammainc(self.shape, scaled * rate))) - confidence

        while beyond(high) < 0.0:
            high *= 2.0
        return float(brentq(beyond, 0.0, high, xtol=1e-15))


def beliefs(seen: Sequence[Sequence[Seen]]) -> list[Belief]:
    """What is known of every type after these have been Seen of it."""
    logs = -0.5 * ((EXPONENTS - EXPONENT) / EXPONENT_SPREAD) ** 2
    shapes, rates = [], []
    for each in seen:
        shape, rate = SHAPE, np.full(len(EXPONENTS), SHAPE / FLIPS)
        for rung, reference, runs, flips in each:
            power = falls(rung) + falls(reference)
            shape, rate = shape + flips, rate + runs * power
            logs = logs + flips * np.log(power)
        logs = logs - shape * np.log(rate)
        shapes.append(shape)
        rates.append(rate)
    weights = np.exp(logs - np.max(logs))
    weights /= np.sum(weights)
    return [Belief(*each, weights) for each in zip(shapes, rates, strict=True)]


def sampling_half_width(count: int) -> float:
    """Half of Wilson's 95 % interval of a probability of ½ seen in so many replicates."""
    return 0.5 * Z / math.sqrt(count + Z * Z)


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
    length = CORE * min(pairings_of(config, known)[condition].radii)
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
