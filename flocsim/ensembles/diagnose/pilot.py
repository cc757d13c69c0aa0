"""A pilot of `--dry-run --pilot`: some replicates are timed, and their mean is scaled to the study.

The replicates are run as the study runs them, several of a condition one after another and second
runs included, for some seconds of CPU time. Preparing two flocs that meet (outlines, start,
compiled laws) is timed apart, because it is done once for all replicates that draw the same two.
Nothing of the study is changed.
"""

import math
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import Overseer
from flocsim.io.results.schema import OUTCOMES
from flocsim.process import stop_requested

SECONDS = 5.0
"""CPU time of the replicates [s]."""

LEAST = 12
"""Replicates that are run at least, however long they take."""

AT_ONCE = 8
"""Most replicates of a condition that are run before the next one takes its turn."""

CLOCK = 0.1
"""Fraction by which the same work takes more or less time from one hour to the next."""

START = 0.8
"""CPU time [s] of a rank besides its replicates: reading, comparing with other ranks, writing."""

EACH = 5e-5
"""CPU time [s] of handing out, storing and counting a replicate (benchmarks.accuracy.dry_run)."""


T = TypeVar("T")


class Forecast(NamedTuple):
    """The cost of a study with so many ``replicates`` of each condition.

    ``cpu`` and its 95 % interval ``low`` to ``high`` [s], compiling left out; ``ended``: how many
    replicates of the pilot had which outcome.
    """

    replicates: int
    cpu: float
    low: float
    high: float
    ended: Counter


def expected_replicates(config: Config) -> int:
    """Return the number of replicates of each condition that a study is likely to run.

    With a rule that ends it early, those that narrow the interval of a probability of ½ enough.
    """
    if config.stop.half_width is None:
        return config.replicates
    wanted = math.ceil((0.98 / config.stop.half_width) ** 2)
    return min(config.replicates, max(wanted, config.stop.least))


def sample_of(config: Config, places: Sequence[T], at_once: int = 1) -> Iterator[tuple[T, int]]:
    """Yield all (condition, replicate) in a random order in which the conditions take turns.

    The first few are spread over the conditions as evenly as all. ``at_once``: size of the groups
    of consecutive replicates of a condition, of which only the first one is given.
    """
    random = np.random.default_rng(config.seed)
    order = random.permutation(len(places)).tolist()
    starts = range(0, config.replicates, at_once)
    first = random.integers(len(starts), size=len(places))
    for turn in range(len(starts)):
        for each in order:
            yield places[each], starts[(first[each] + turn) % len(starts)]


def pairs_made(study: Any, count: int, ranks: int) -> float:
    """Return how often two flocs are prepared for each other, on all ranks together.

    Of m possible pairs, ``count`` random draws meet m (1 − exp(−count/m)) different ones.
    """
    pairs = max(len(study.flocs), 1) ** 2
    met = -pairs * math.expm1(-count / pairs)
    once = sum(met if n > 1 else 1.0 for n in study.config.shapes.vertices)
    deltas = len(study.config.scene.delta)
    return len(study.config.scene.names) * min(once * ranks, once * count * deltas)


def forecast_of(study: Any, ranks: int, seconds: float = SECONDS) -> Forecast:
    """Run replicates until the CPU time [s] is up; return the Forecast of the whole study.

    A signal ends it early.
    """
    runs: list[float] = []
    setups: list[float] = []
    ended: Counter[str] = Counter()
    began = time.process_time()
    for condition, first in sample_of(study.config, study.conditions, AT_ONCE):
        known, start = len(study.encounters), time.process_time()
        if ended.total() >= LEAST and start - began > seconds:
            break
        name, vertices, delta = condition
        index = study.scene.names.index(name)
        stop = min(first + min(AT_ONCE, study.at_a_time), study.config.replicates)
        for replicate in range(first, stop):
            _ = study.draw(index, vertices, delta, replicate).encounter.scene
        ready = time.process_time()
        # A group shares the cost of entering compiled code, as the batches of a study do.
        rows, _ = study.run_some(condition, first, stop, Overseer(stop_requested))
        if not len(rows):
            break
        runs.append((time.process_time() - ready) / len(rows))
        if len(study.encounters) > known:
            setups.append((ready - start) / (len(study.encounters) - known))
        ended.update(OUTCOMES[each] for each in rows["outcome"])
    count = expected_replicates(study.config)
    size = count * len(study.conditions)
    mean = float(np.mean(runs or [0.0]))
    cpu = START * ranks + size * (mean + EACH)
    if setups:
        cpu += pairs_made(study, count, ranks) * float(np.mean(setups))
    spread = float(np.std(runs or [0.0])) / max(mean, 1e-9) / math.sqrt(max(len(runs), 1))
    factor = math.exp(2.0 * math.hypot(spread, CLOCK))
    return Forecast(count, cpu, cpu / factor, cpu * factor, ended)
