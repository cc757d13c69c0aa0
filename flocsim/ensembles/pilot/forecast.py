"""What some replicates of a study say, for `--dry-run`: what it will take, core-hours and bytes on
the disk, and which parts of its physics changed no outcome.

The replicates of `sample` are run in turn, until SECONDS of this process's time are spent, and each
third of them again as `check_share` has it. What they took is extrapolated type by type, as they
are spread evenly over N and δ; the interval is that of samples drawn anew from them (bootstrap).
What is made once for two flocs at one N, is counted once. It looks at the clock, and changes no
result.

The same replicates are run again without every force in turn, and without inertia, from the same
start and judged by the same zone. Nothing is left out of the study: what is found is said, and what
it would save.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import attrs
import numpy as np

from flocsim.ensembles.collision.draw import MORE_STEPS, THIRD_COST, THIRD_OF, Draw, expected_checks
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.estimates import summary
from flocsim.ensembles.estimates.statistics import COUNTED
from flocsim.ensembles.kind import ROW
from flocsim.ensembles.pilot.trials import (
    Job,
    Task,
    Trial,
    expected_replicates,
    is_flip,
    sample_of,
    try_out,
)
from flocsim.ensembles.preflight import sphere_pairs
from flocsim.ensembles.study import Study
from flocsim.errors import FlocsimError
from flocsim.explain import RELAXATION, body_scales
from flocsim.forces import ContactForce
from flocsim.integrators import Overdamped
from flocsim.io.confidence import wilson
from flocsim.io.results import schema
from flocsim.io.results.events import flips_easily
from flocsim.io.results.file import size_of
from flocsim.system import System

MOST = 900
"""Replicates that are timed, of all types together."""

SECONDS = 5.0
"""CPU time of the replicates that are timed, their second runs included."""

LEAST = 6
"""Replicates of a type, and without a part of the physics, that are run, however long they take."""

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

TRYING = 4.0
"""CPU time of all that is run without a part."""

ENOUGH = 8
"""Outcomes changed after which no more are run."""

LARGEST_STOKES = 1.0
"""Stokes number beyond which inertia matters, tried or not."""

INERTIA = "inertia"


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
    method, steps = study.config.integrator.method, study.config.integrator.max_steps
    first, _ = try_out(study, Job(task, method, steps))
    for end in schema.BAND_ENDS if study.is_banded else ():
        job = Job(task, method, MORE_STEPS * steps)

        def otherwise(_: Draw, end: str = end) -> Draw:
            return study.draw(*task, end)

        more, _ = try_out(study, job, changed=otherwise)
        first = first._replace(cpu=first.cpu + more.cpu, setup=first.setup + more.setup)
    exact = study.exact if again else None
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
    """The Forecast for so many ranks; ``before`` [s]: flocs grown."""
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
    tables = size_of(summary.results_of(study, 0, sums, {}))
    run = RUN_BYTES + len(config.text) + FLOC_BYTES * len(study.flocs)
    return float(tables + run + count * (math.prod(shape) * ROW.itemsize + 8))


class Part(NamedTuple):
    """Something that a scene may do without: its name, and the System without it."""

    name: str
    left_out: Callable[[System], System]


class Finding(NamedTuple):
    """What came of leaving a part out: ``changed`` of ``runs`` outcomes, and CPU time without it
    over that with it; or ``why`` it was not tried."""

    name: str
    changed: int = 0
    runs: int = 0
    time: float = 1.0
    why: str = ""


def stokes_number(config: Config, flocs: Sequence[Floc] | None = None) -> float:
    """Largest τ v/(r_i + r_j) of the collision types: relaxation time, relative settling speed.

    ``flocs``: those of the study, where they have been read.
    """
    numbers = []
    for _, pair in sphere_pairs(config, flocs, "fastest"):
        time = body_scales(pair.system).get(RELAXATION)
        numbers += [] if time is None else [time / pair.turn_time]
    return max(numbers, default=0.0)


def without_force(force, system):
    """The System without one of its forces."""
    return attrs.evolve(system, forces=[each for each in system.forces if each is not force])


def without_inertia(system):
    """The System moved by Overdamped, at the tolerance that it has."""
    tolerance = getattr(system.integrator, "tolerance", None)
    method = Overdamped(tolerance) if tolerance else Overdamped()
    return attrs.evolve(system, integrator=method)


def parts_of(config: Config, flocs: Sequence[Floc] | None = None) -> Iterator[Part | Finding]:
    """The parts that may be left out; a Finding for those that cannot, or need not be tried."""
    contacts = [force for force in config.forces if isinstance(force, ContactForce)]
    pairs = [pair for _, pair in sphere_pairs(config, flocs)]
    # By themselves: where bodies meet without their weight, its place is another force's.
    acting = {id(each) for pair in pairs for each in pair.system.forces}
    for name, force in zip(config.force_names, config.forces, strict=True):
        if force.absent or id(force) not in acting:
            continue
        if contacts == [force]:
            yield Finding(name, why="a collision needs a contact force")
            continue
        part = Part(name, partial(without_force, force))
        try:
            for pair in pairs:
                attrs.evolve(pair, system=part.left_out(pair.system))
        except FlocsimError:
            yield Finding(name, why="the pair would not meet")
            continue
        yield part
    if isinstance(config.integrator.method, Overdamped):
        return
    number = stokes_number(config, flocs)
    if number > LARGEST_STOKES:
        yield Finding(INERTIA, why=f"it matters at a Stokes number of {number:.2g}")
    else:
        yield Part(INERTIA, without_inertia)


def findings(
    study: Study, runs: Sequence[Timed], go_on: Callable[[], None], seconds: float = TRYING
) -> list[Finding]:
    """A Finding for every force of a study, and for inertia, from replicates that were run."""
    parts = list(parts_of(study.config, study.flocs))
    tried = sum(isinstance(part, Part) for part in parts)
    return [
        tried_without(study, runs, part, go_on, seconds / tried) if isinstance(part, Part) else part
        for part in parts
    ]


def tried_without(
    study: Study, runs: Sequence[Timed], part: Part, go_on: Callable[[], None], seconds: float
) -> Finding:
    """Run replicates without a part until it matters, or the time [s] is up."""
    # With the encounters themselves, as an id is another's once its owner has gone.
    made: dict[int, tuple[Encounter, Encounter]] = {}
    warm: set[str] = set()
    changed, count, spent, before, whole = 0, 0, 0.0, 0.0, 0.0

    def bare(draw: Draw) -> Draw:
        encounter = draw.encounter
        if id(encounter) not in made:
            system = part.left_out(encounter.system)
            made[id(encounter)] = attrs.evolve(encounter, system=system), encounter
        return attrs.evolve(draw, encounter=made[id(encounter)][0])

    for run in runs:
        go_on()
        if count >= LEAST and (whole > seconds or changed >= ENOUGH):
            break
        system = bare(study.draw(*run.task)).encounter.system
        job = Job(run.task, system.integrator, study.config.integrator.max_steps)
        if system.family not in warm:  # compiled before it is timed
            try_out(study, job, changed=bare)
            warm.add(system.family)
        began = time.process_time()
        found, _ = try_out(study, job, changed=bare)
        count += 1
        changed += is_flip(found, run.first)
        spent, before = spent + found.cpu, before + run.first.cpu
        whole += time.process_time() - began
    return Finding(part.name, changed, count, spent / max(before, 1e-12))


def finding_words(finding: Finding, runs: Sequence[Timed]) -> str:
    """A Finding for people, in one line.

    What changes no more outcomes than a tighter tolerance does in the ``runs`` of the pilot that
    were run again (95 % intervals overlap), may have changed none.
    """
    name, changed, count = finding.name, finding.changed, finding.runs
    if finding.why:
        return f"{name}: stays, {finding.why}"
    saved = 100.0 * (1.0 - finding.time)
    cost = f"leaving it out would save {f'{saved:.0f} %' if saved >= 1.0 else 'none'} of the time"
    low, most = (float(end) for end in wilson(changed, count))
    if not changed:
        agrees = " (Overdamped agrees)" if name == INERTIA else ""
        return (
            f"{name}: never changed an outcome of {count} replicates{agrees} (rate below "
            f"{100.0 * most:.2g} %); {cost}"
        )
    again = [run for run in runs if run.second is not None]
    flips = sum(run.flipped for run in again)
    if again and low <= float(wilson(flips, len(again))[1]):
        return (
            f"{name}: {changed} of {count} outcomes change, which may be numerical error ({flips} "
            f"of {len(again)} change when run again more accurately); {cost}"
        )
    return f"{name}: matters, without it {changed} of {count} outcomes change"
