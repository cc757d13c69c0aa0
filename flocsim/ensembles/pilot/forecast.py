"""What a study will take, from some of its replicates: core-hours, and bytes on the disk.

The replicates of `sample` are run in turn, until SECONDS of this process's time are spent, and each
third of them again as `check_share` has it. What they took is extrapolated type by type, as they
are spread evenly over N and δ; the interval is that of samples drawn anew from them (bootstrap).
What is made once for two flocs at one N, is counted once. Unlike a choice of accuracy it looks at
the clock: it changes no result.
"""

import math
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import attrs
import numpy as np

from flocsim.ensembles.collision.draw import MORE_STEPS, THIRD_COST, THIRD_OF, Draw, expected_checks
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.estimates import summary
from flocsim.ensembles.estimates.statistics import COUNTED
from flocsim.ensembles.pilot.ladder import (
    MOST,
    Job,
    Task,
    Trial,
    expected_replicates,
    is_flip,
    sample_of,
    try_out,
)
from flocsim.ensembles.study import Study
from flocsim.io.results import schema
from flocsim.io.results.events import flips_easily
from flocsim.io.results.layout import frame_of, plan_of
from flocsim.io.seals import seal_size

SECONDS = 5.0
"""CPU time of the replicates that are timed, their second runs included."""

LEAST = 6
"""Replicates of a type that are run, however long they take."""

EVERY = 3
"""Of so many replicates one is run again."""

RESAMPLES = 400

CLOCK = 0.1
"""Share by which the same work takes more or less time, from one hour to the next."""

START = 0.8
"""CPU time [s] that a run takes before its first replicate and after its last one, compiling left
out: what it reads, compares with other ranks, and writes."""

EACH = 2.5e-4
"""CPU time [s] of all that is done with a replicate besides running it: handed out, kept, counted
(`python -m benchmarks.accuracy.dry_run`, spheres)."""

RUN_BYTES = 9_000
"""Bytes of the group ``run`` beside the config's text: versions, identity, processors."""

FLOC_BYTES = 300
"""The same for each floc."""


class Timed(NamedTuple):
    """One replicate of a pilot: the Trial that the study would have of it, and that of a second,
    more exact run, where there is one."""

    task: Task
    first: Trial
    second: Trial | None = None

    @property
    def flipped(self) -> bool:
        """Whether the second run ended otherwise."""
        return self.second is not None and is_flip(self.second, self.first)


class Estimate(NamedTuple):
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float


@attrs.frozen
class Forecast:
    """What a study of so many ``replicates`` of each condition takes.

    ``hours``: core-hours, compiling left out, of which ``again`` is the share of second runs;
    ``size``: bytes of the results file; ``runs``: the Timed replicates that say so, of
    ``conditions`` out of all.
    """

    hours: Estimate
    again: float
    size: Estimate
    runs: list[Timed]
    conditions: int
    replicates: int


def in_turn(config: Config) -> list[Task]:
    """Tasks of all types in turn, at most MOST: any first few are spread over all conditions."""
    types = len(config.scene.names)
    lists = sample_of(config, max(MOST // types, LEAST))
    return [task for tasks in zip(*lists, strict=True) for task in tasks]


def timed(study: Study, task: Task, again: bool) -> Timed:
    """Run a replicate as the study would, and ``again`` as its second runs are."""
    name, steps = study.config.scene.names[task.condition], study.config.integrator.max_steps
    first, _ = try_out(study, Job(task, study.methods[name], steps))
    for end in schema.BAND_ENDS if study.is_banded else ():
        job = Job(task, study.methods[name], MORE_STEPS * steps)

        def otherwise(_: Draw, end: str = end) -> Draw:
            return study.draw(*task, end)

        more, _ = try_out(study, job, changed=otherwise)
        first = first._replace(cpu=first.cpu + more.cpu, setup=first.setup + more.setup)
    exact = study.exact[name] if again else None
    if exact is None:
        return Timed(task, first)
    return Timed(task, first, try_out(study, Job(task, exact[0], MORE_STEPS * steps))[0])


def time_replicates(
    study: Study, tasks: Sequence[Task], go_on: Callable[[], None], seconds: float = SECONDS
) -> list[Timed]:
    """Run replicates until the time [s] is up; LEAST of each type at any rate.

    ``go_on()`` is called before each one, and may raise.
    """
    least = LEAST * len(study.config.scene.names)
    checks = study.config.integrator.check_share != 0.0
    began, runs = time.process_time(), []
    for place, task in enumerate(tasks):
        go_on()
        if place >= least and time.process_time() - began > seconds:
            break
        again = checks and (place // len(study.config.scene.names)) % EVERY == 0
        runs.append(timed(study, task, again))
    return runs


def pairs_made(study: Study, ranks: int) -> float:
    """How many pairs of flocs the study makes ready, on all ranks together."""
    config = study.config
    count = expected_replicates(config)
    numbers = [study.numbers(k) for k in range(min(count, 1000))]
    total = 0
    for condition in range(len(config.scene.names)):
        for vertices in config.shapes.vertices:
            found = {study.choose_flocs(condition, vertices, each) for each in numbers}
            total += min(len(found) * ranks, count * len(config.scene.delta))
    return total


def setting_up(study: Study, runs: Sequence[Timed], ranks: int) -> float:
    """CPU time [s] of making all pairs of flocs ready, on all ranks together.

    As seen, and the others as the later half of those that were: the first ones bring every floc
    to its size.
    """
    seen = [run.first.setup for run in runs if run.first.setup > 0.0]
    if not seen:
        return 0.0
    others = max(pairs_made(study, ranks) - len(seen), 0.0)
    return sum(seen) + others * float(np.mean(seen[len(seen) // 2 :]))


class Spent(NamedTuple):
    """Two CPU times [s] of each replicate of a type: ``first`` (n,), ``second`` (n,), NaN where
    it was not run again."""

    first: np.ndarray
    second: np.ndarray

    def work(self, firsts: float, seconds: float, places: np.ndarray) -> np.ndarray:
        """CPU time [s] (k, 2) of so many first and of so many second runs, as the replicates at
        the ``places`` (k, n) have it: of the second ones by their ratio to the first."""
        mean = self.first[places].mean(axis=1)
        both = np.isfinite(self.second)[places]
        before = np.where(both, self.first[places], 0.0).sum(axis=1)
        again = np.where(both, np.nan_to_num(self.second)[places], 0.0).sum(axis=1)
        ratio = again / np.maximum(before, 1e-12)
        return np.stack([firsts * mean, seconds * ratio * mean], axis=1)


def estimated(
    groups: Sequence[Spent], count: int, checks: Sequence[float], fixed: float, seed: int
) -> tuple[Estimate, float]:
    """(CPU time [s] of all, share of second runs) from the types' replicates.

    ``count``, ``checks``: first and second runs of each type; ``fixed`` [s] comes on top.
    """
    random = np.random.default_rng(seed)
    sizes = [len(each.first) for each in groups]
    whole = sum(
        each.work(count, seconds, np.arange(n)[None])[0]
        for each, n, seconds in zip(groups, sizes, checks, strict=True)
    )
    drawn = sum(
        each.work(count, seconds, random.integers(0, n, (RESAMPLES, n))).sum(axis=1)
        for each, n, seconds in zip(groups, sizes, checks, strict=True)
    )
    value = fixed + float(np.sum(whole))
    # What has been run of the study is known; few replicates vary less than what they are of.
    unknown = max(1.0 - min(sizes) / count, 0.0) * min(sizes) / max(min(sizes) - 1, 1)
    spread = math.hypot(float(np.std(np.log(fixed + drawn))) * math.sqrt(unknown), CLOCK)
    from scipy.special import stdtrit

    width = math.exp(float(stdtrit(max(sum(sizes) - len(sizes), 1), 0.975)) * spread)
    return Estimate(value, value / width, value * width), float(whole[1]) / value


def forecast_of(study: Study, runs: Sequence[Timed], ranks: int, before: float) -> Forecast:
    """The Forecast for so many ranks; ``before`` [s]: flocs grown, a choice made."""
    config = study.config
    count = expected_replicates(config)
    cells = len(config.shapes.vertices) * len(config.scene.delta)
    fixed = START * ranks + before + setting_up(study, runs, ranks)
    fixed += EACH * cells * count * len(config.scene.names)
    groups, checks = [], []
    for place in range(len(config.scene.names)):
        mine = [run for run in runs if run.task.condition == place]
        third = 1.0 + THIRD_COST / THIRD_OF
        seconds = [third * run.second.cpu if run.second else math.nan for run in mine]
        groups.append(Spent(np.array([run.first.cpu for run in mine]), np.array(seconds)))
        checks.append(cells * second_runs(mine, count, config.integrator.check_share))
    work, again = estimated(groups, cells * count, checks, fixed, config.seed)
    size = file_size(study, count)
    least = count if config.stop.half_width is None else min(config.stop.least, count)
    bounds = Estimate(
        size, 0.98 * file_size(study, least), 1.02 * file_size(study, config.replicates)
    )
    seen = {run.task[:3] for run in runs}
    hours = Estimate(*(part / 3600.0 for part in work))
    return Forecast(hours, again, bounds, list(runs), len(seen), count)


def second_runs(runs: Sequence[Timed], count: int, share: float | str) -> float:
    """How many of ``count`` replicates of a condition are run again, if as many flip easily as of
    these."""
    easily = np.mean([flips_easily(run.first.outcome, run.first.bond) for run in runs])
    few, many = (expected_checks(count, share, each) for each in (False, True))
    return few + float(easily) * (many - few)


def file_size(study: Study, count: int) -> float:
    """Bytes of the results file with so many replicates of each condition."""
    config = study.config
    shape = study.shape[:3]
    none = (np.zeros((*shape, 0), "u1"),) * len(COUNTED)
    sums = summary.sums_of(lambda *_: none, math.prod(shape), 0, 0, study.scrambles)
    draft = summary.results_of(study, count, sums, {})
    plan = plan_of(frame_of(draft), math.prod(shape) * count)
    run = RUN_BYTES + len(config.text) + FLOC_BYTES * len(study.flocs)
    return float(plan.size + run + seal_size(len(plan.cuts())))
