"""Which parts of the physics changed no outcome: every force in turn, and inertia, left out.

The replicates of a pilot are run again without the part, from the same start and judged by the same
zone. Nothing is left out of the study: what is found is said, and what it would save.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import attrs

from flocsim.ensembles.collision.draw import Draw
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.pilot.forecast import Timed
from flocsim.ensembles.pilot.ladder import Job, is_flip, try_out
from flocsim.ensembles.preflight import sphere_pairs
from flocsim.ensembles.study import Study
from flocsim.errors import FlocsimError
from flocsim.explain import RELAXATION, body_scales
from flocsim.forces import ContactForce
from flocsim.integrators import Overdamped
from flocsim.io.confidence import wilson
from flocsim.system import System

SECONDS = 4.0
"""CPU time of all that is run without a part."""

ENOUGH = 8
"""Outcomes changed after which no more are run."""

LEAST = 6
"""Replicates run without a part, however long they take."""

LARGEST_STOKES = 1.0
"""Stokes number beyond which inertia matters, tried or not."""

INERTIA = "inertia"


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


def without_force(force):
    """A System → the same without one of its forces."""

    def left_out(system):
        forces = [each for each in system.forces if each is not force]
        return attrs.evolve(system, forces=forces)

    return left_out


def without_inertia(system):
    """The System moved by Overdamped, at the tolerance that it has."""
    tolerance = getattr(system.integrator, "tolerance", None)
    method = Overdamped(tolerance) if tolerance else Overdamped()
    return attrs.evolve(system, integrator=method)


def parts_of(
    config: Config, methods: Sequence[object], flocs: Sequence[Floc] | None = None
) -> Iterator[Part | Finding]:
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
        part = Part(name, without_force(force))
        try:
            for pair in pairs:
                attrs.evolve(pair, system=part.left_out(pair.system))
        except FlocsimError:
            yield Finding(name, why="the pair would not meet")
            continue
        yield part
    if all(isinstance(each, Overdamped) for each in methods):
        return
    number = stokes_number(config, flocs)
    if number > LARGEST_STOKES:
        yield Finding(INERTIA, why=f"it matters at a Stokes number of {number:.2g}")
    else:
        yield Part(INERTIA, without_inertia)


def find(
    study: Study, runs: Sequence[Timed], go_on: Callable[[], None], seconds: float = SECONDS
) -> list[Finding]:
    """A Finding for every force of a study, and for inertia, from replicates that were run."""
    parts = list(parts_of(study.config, list(study.methods.values()), study.flocs))
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


def words_of(finding: Finding, runs: Sequence[Timed]) -> str:
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
