"""Studies of swarms as rank 0 has them: checks, identity, what they tell before and after a
run, results from records.
"""

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.compiler.fingerprint import fingerprint, refuse_interpreter
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import Condition, Kind, OldResults
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.preflight import names_in
from flocsim.ensembles.storage import identity
from flocsim.ensembles.storage.resume import Beginning
from flocsim.ensembles.storage.unfinished import Unfinished, store_of
from flocsim.ensembles.swarms import records
from flocsim.ensembles.swarms.scene import SwarmScene
from flocsim.ensembles.swarms.study import ROW, SwarmStudy, flocs_of
from flocsim.errors import ConfigError, FileError, FlocsimError, UsageError
from flocsim.explain import force_lines, scale_lines
from flocsim.forces import ContactForce
from flocsim.io.journal import JournalReader
from flocsim.io.results import swarm_file
from flocsim.io.terminal import duration
from flocsim.plausibility import doubts_of, settled
from flocsim.swarms.islands import run_islands
from flocsim.swarms.swarm import Swarm, check_box
from flocsim.system import System

BODY_BYTES = 8 * 6 + 4
"""Bytes of a body in a snapshot."""


def dry_run(config: Config, ranks: int) -> str:
    """All that is known of a study before it is run."""
    study = SwarmStudy(config)
    check_code(study)
    scene = study.scene
    swarm, drawn, (width, height) = study.swarm(0)
    radii = 1e6 * np.array([shape.equivalent_radius for shape in drawn.shapes])
    area = sum(shape.area for shape in drawn.shapes)
    method, moments = config.integrator.method, len(study.stops)
    pair = largest_pair(swarm)
    largest = settled(pair, pair.bodies[0])
    repeats = {"xy": "along x and y", "x": "along x", "none": "along no axis"}[scene.periodic]
    size = config.replicates * moments * len(swarm.bodies) * BODY_BYTES
    speed = ""
    if largest is not None:
        speed = (
            f", {1e3 * largest.speed:.4g} mm/s alone for the largest, of Re = "
            f"{largest.reynolds:.2g}, St = {largest.stokes:.2g}"
        )
    sizes = "measured" if scene.is_measured else f"lognormal, ln r_eq of sd {scene.spread:g}"
    lines = [
        f"{config.replicates} swarms of {scene.number} bodies, N = {study.vertices}, seed "
        f"{config.seed}, on {ranks} rank{'s' * (ranks != 1)}, results in {config.output.file}",
        f"  r_eq {radii.min():.4g} to {radii.max():.4g} um, "
        f"median {np.median(radii):.4g} ({sizes})",
        f"  box {1e6 * width:.5g} x {1e6 * height:.5g} um, periodic {repeats}"
        f"{', with a floor' if scene.floor else ''}; bodies cover {area / (width * height):.4f}",
        f"  {scene.duration:g} s{speed}",
        f"  {moments} snapshots, one every {scene.interval:g} s; a state to resume from every "
        f"{duration(scene.checkpoint)}; results file about {size / 1e6:.3g} MB",
        *([f"  {words}"] if (words := config.fluid.words) else []),
        f"  integrator: {config.integrator.label}, tolerance {method.tolerance:g} m",
        "forces:",
        *(f"  {line}" for line in force_lines(pair)),
        "stiffness, of the two largest:",
        *(f"  {line}" for line in scale_lines(pair)),
        "nothing was run (--dry-run)",
    ]
    return "\n".join(lines)


def largest_pair(swarm: Swarm) -> System:
    """A System of the two largest bodies, for what is said of a swarm."""
    bodies = sorted((body for body in swarm.bodies if not body.fixed),
                    key=lambda body: -body.shape.equivalent_radius)[:2]  # fmt: skip
    return attrs.evolve(swarm.system, bodies=bodies)


CODE = (*identity.PHYSICS, "swarms", "ensembles/swarms/study.py", "ensembles/swarms/replicate.py")
"""The modules that decide what a swarm does."""


def check_study(config: Config) -> None:
    """ConfigError for a swarm whose bodies have no contact force."""
    if not any(isinstance(force, ContactForce) for force in config.forces):
        raise ConfigError(
            "bodies that meet need a contact force, found none among "
            f"{', '.join(config.force_names)}: add [forces.contact]"
        )


def check_code(study: SwarmStudy) -> None:
    """Raise the FlocsimError that the laws of forces would meet when they are compiled."""
    swarm = study.first
    for law in swarm.system.pieces.laws.values():
        refuse_interpreter(law)
    refuse_interpreter(run_islands, swarm.fillings())


def check_room(study: SwarmStudy, comm: Communicator) -> None:
    """UsageError on rank 0 where the bodies of a replicate find no place, or its box is too small
    for them: before the first runs for hours. Every rank looks at its share, but for the first
    replicate, which all have placed by now."""
    reach, first = study.first.reach, None
    for replicate in range(comm.rank or comm.size, study.config.replicates, comm.size):
        try:
            drawn, box, _ = study.placed(replicate)
            check_box(drawn.shapes, study.periods(box), reach)
        except UsageError as error:
            first = replicate, str(error)
            break
    found = comm.gather(first)
    if found is None:
        return
    if faults := sorted(each for each in found if each is not None):
        replicate, why = faults[0]
        raise UsageError(f"swarm {replicate} of {study.config.replicates} (from 0): {why}")
    check_code(study)


def identity_of(study: SwarmStudy, machine: dict | None = None) -> dict:
    """{name: text or number} of all that the replicates of a study follow from."""
    config, swarm = study.config, study.first
    facts = identity.config_facts(study.config, ("scene", "shapes", "bodies", "fluid"))
    facts |= machine or identity.machine_facts(CODE)
    facts["shapes.vertices"] = list(config.shapes.vertices)
    shapes = [floc.shapes.get(study.vertices) for floc in study.flocs]
    numbers = [identity.shape_numbers(shape) for shape in shapes if shape is not None]
    sizes = [[floc.ratio, floc.size or 0.0] for floc in study.flocs]
    if any(floc.weight != 1.0 for floc in study.flocs):
        facts["flocs.weight"] = identity.digest(np.array([floc.weight for floc in study.flocs]))
    facts[f"flocs.{study.vertices}"] = identity.digest(np.concatenate([np.ravel(sizes), *numbers]))
    pieces = swarm.system.pieces
    numbers = [*pieces.parameters, pieces.surface_reach, *pieces.smoothness, pieces.events]
    facts["numbers.the swarm"] = identity.digest(np.array(numbers, float))
    codes = [fingerprint(run_islands, swarm.fillings())]
    codes += [f"{law} {fingerprint(each, {})}" for law, each in sorted(pieces.laws.items())]
    facts["kernels.swarms"] = hashlib.blake2b("\n".join(codes).encode(), digest_size=12).hexdigest()
    facts.pop("scene.checkpoint", None)  # changes nothing that is computed
    return json.loads(json.dumps(facts))


def doubts(study: SwarmStudy) -> list[str]:
    """Lines on what is implausible."""
    names = names_in(study.config, study.config.forces)
    return doubts_of([largest_pair(study.first)], names)


@contextmanager
def old_rows(output: str | Path) -> Iterator[OldResults]:
    """Open a results file that is to be extended."""
    found = swarm_file.read_swarm(output)
    ends, run = found.groups["ends"], found.run
    count, vertices = len(ends["finished"]), int(run.get("vertices", 0))
    rows = np.zeros(count, ROW)
    for name, values in ends.items():
        rows[name] = values
    condition = Condition("swarm", vertices, 0.0)
    yield OldResults([condition], count, [(condition, 0, rows)], run, found)


def results(
    study: SwarmStudy, start: Beginning, count: int, run: dict, output: str | Path | None,
    in_memory: bool,
) -> swarm_file.SwarmResults:  # fmt: skip
    """The SwarmResults of so many replicates; written to ``output`` where there is one."""
    store, form, groups = start.store, study.form, {}
    begun = min(start.old.count, count) if start.old else 0
    if start.old:
        groups = first_of(start.old.found, begun)
    if begun < count:
        new = records.groups_of(form, [store.parts[0, each] for each in range(begun, count)])
        groups = records.appended(groups, new) if groups else new
    rows = store.rows(0, 0, count)
    groups["ends"] = {name: rows[name].copy() for name in swarm_file.ENDS}
    made = records.results_from(form, groups, run)
    if output is not None:
        swarm_file.write_swarm(output, made, start.replacing)
    return made


def first_of(found: swarm_file.SwarmResults, count: int) -> dict[str, dict[str, np.ndarray]]:
    """The groups of the first replicates of results."""
    groups = {}
    for group, columns in found.groups.items():
        listed = [columns[name] for name in records.PLACED if name in columns]
        kept = listed[0] < count if listed else slice(count)
        groups[group] = {name: values[kept] for name, values in columns.items()}
    return groups


def facts(study: SwarmStudy) -> dict[str, Any]:
    """What the results say of a study besides their groups."""
    return {"periodic": study.scene.periodic, "vertices": study.vertices}


def verdict(found: swarm_file.SwarmResults) -> tuple[int, str]:
    """0, or the code of an error where no swarm has come to its end; what to say of those."""
    finished = found.groups["ends"]["finished"]
    missed = int(np.count_nonzero(finished == 0))
    if not missed:
        return 0, ""
    notes = json.loads(found.run.get("failed", "[]"))
    first = f"swarm {notes[0]['replicate']}: {notes[0]['why']}" if notes else "see `flocsim info`"
    line = f"{missed} of {len(finished)} swarms ended early; the first: {first}"
    return (FlocsimError.exit_code, line) if missed == len(finished) else (0, f"warning: {line}")


def so_far(journal: JournalReader, sessions: list[dict]) -> Unfinished:
    """What a journal has of swarms, of which those appear that have begun."""
    path, told = journal.path, sessions[-1]["asked"]
    asked = told["replicates"]
    form = records.Form(**{name: told["swarm"][name] for name in records.FORM})
    if not form.times or form.bodies < 1:
        raise FileError(f"{path} does not record what is kept of a swarm")

    def check_part(name: str, about: dict, data: bytes) -> None:
        records.check_part(name, records.part_of(about, data), form)

    store, notes, unread = store_of(journal, sessions, ROW, records.check_ends, check_part)
    swarms = {
        replicate: parts for (_, replicate), parts in sorted(store.parts.items())
        if records.BODIES in parts and replicate < asked
    }  # fmt: skip
    seen_of = [
        [place for place in range(form.moments) if records.moment_name(place) in parts]
        for parts in swarms.values()
    ]
    done = sum(map(len, seen_of))
    if not done:
        raise FileError(f"{path} has no snapshot yet: try again later")
    known = max(max(each, default=0) for each in seen_of) + 1
    if known > done:
        raise FileError(f"{path} has no readable swarms: snapshots of it are missing")
    seen = attrs.evolve(form, times=form.times[:known])
    groups = records.groups_of(seen, list(swarms.values()))
    groups["ends"] = {
        name: np.zeros(len(swarms), kind) for name, (kind, _, _) in swarm_file.ENDS.items()
    }
    made = records.results_from(seen, groups, {"periodic": form.periodic}, np.array(list(swarms)))
    try:
        swarm_file.check_swarm(made.scales, groups)
    except ValueError as error:
        raise FileError(f"{path} has no readable swarms: {error}") from error
    return Unfinished(
        path,
        swarm_file.FORMAT,
        made,
        done,
        asked * len(form.times),
        notes,
        sessions,
        unread,
        "snapshots",
    )


KIND = Kind(
    scenes=(SwarmScene,), make=lambda config, flocs: SwarmStudy(config, flocs),
    flocs=flocs_of, identity=identity_of, code=CODE, check=check_study, prepare=check_room,
    doubts=doubts, facts=facts, old_rows=old_rows, results=results,
    total=lambda found: len(found.scales["replicate"]), verdict=verdict,
    dry_run=lambda config, ranks, pilot: dry_run(config, ranks),
    so_far=so_far, asked={"swarm": records.FORM},
)  # fmt: skip
