"""Replicates tried out: one by a method within a step budget, what came of it, and at what cost;
the settings that a pilot tries, the rungs of a ladder, and a collision type's climb.

Pilots, forecasts and work-precision are tables of such trials, each held against another of the
same replicate: where the outcome is another one, it has flipped. A pilot runs replicates spread
over all conditions, and no more than the study can bear. An index does nothing but name random
numbers, so that any choice that does not look at them is a random sample.

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
over β. Few flips thus leave a wide distribution, and none at all the width of what was there before
and of how many were run.
"""

import math
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import attrs
import numpy as np

import flocsim.arrays as at
from flocsim.ensembles.collision.draw import FAILED, Draw, Z
from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.collision.pairings import pairings_of
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.preflight import measured_flocs
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


def expected_replicates(config: Config) -> int:
    """Replicates of each condition that a study is likely to have: with a rule that ends it early,
    those that narrow the interval of a probability of ½ to what the rule wants."""
    if config.stop.half_width is None:
        return config.replicates
    wanted = math.ceil((0.98 / config.stop.half_width) ** 2)
    return min(config.replicates, max(wanted, config.stop.least))


def pilot_size(config: Config) -> int:
    """Replicates of each type that a pilot of the config runs; 0: the study is too small for one.

    All types together at most MOST, and so many that the ladder costs SHARE of the study.
    """
    types = len(config.scene.names)
    cells = len(config.shapes.vertices) * len(config.scene.delta)
    replicates = expected_replicates(config)
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
