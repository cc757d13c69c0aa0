"""Studies of swarms as rank 0 has them: checks, identity, what they tell before and after a
run, results from records.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import Condition, OldResults
from flocsim.ensembles.storage.resume import Beginning
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.swarms import records
from flocsim.ensembles.swarms.study import ROW, SwarmStudy
from flocsim.errors import FileError, FlocsimError
from flocsim.explain import force_lines, scale_lines
from flocsim.io.results import swarm_file
from flocsim.io.terminal import duration
from flocsim.plausibility import settled

BODY_BYTES = 8 * 6 + 4
"""Bytes of a body in a snapshot."""


def dry_run(config: Config, ranks: int, pilot: bool = False) -> str:
    """All that is known of a study before it is run."""
    study = SwarmStudy(config)
    study.check_code()
    scene = study.scene
    swarm, drawn, (width, height) = study.swarm(0)
    radii = 1e6 * np.array([shape.equivalent_radius for shape in drawn.shapes])
    area = sum(shape.area for shape in drawn.shapes)
    method, moments = config.integrator.method, len(study.stops)
    pair = study.largest_pair()
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


KINDS = (SwarmStudy,)


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


def so_far(store: RowStore, asked: dict[str, Any]) -> tuple[swarm_file.SwarmResults, int, int]:
    """Make results of the swarms that have begun."""
    path = store.journal.path
    form = records.Form(**{each.name: asked[each.name] for each in attrs.fields(records.Form)})
    swarms = {
        replicate: parts for (_, replicate), parts in sorted(store.parts.items())
        if records.BODIES in parts and replicate < asked["replicates"]
    }  # fmt: skip
    seen_of = [
        [place for place in range(form.moments) if records.moment_name(place) in parts]
        for parts in swarms.values()
    ]
    done = sum(map(len, seen_of))
    if not done:
        raise FileError(f"{path} has no snapshot yet: try again later")
    known = max(max(each, default=0) for each in seen_of) + 1
    seen = attrs.evolve(form, times=form.times[:known])
    groups = records.groups_of(seen, list(swarms.values()))
    groups["ends"] = {
        name: np.zeros(len(swarms), kind) for name, (kind, _, _) in swarm_file.ENDS.items()
    }
    made = records.results_from(seen, groups, {"periodic": form.periodic}, np.array(list(swarms)))
    return made, done, asked["replicates"] * len(form.times)
