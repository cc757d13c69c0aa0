"""Studies of single flocs past a wall: their draw and run, and what rank 0 asks of them."""

import json
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, ClassVar

import attrs
import numpy as np
from flocsim.ensembles.lone.file import FORMAT, ROW, LoneResults, read_lone, write_lone
from flocsim.ensembles.lone.scene import LoneScene

import flocsim.arrays as at
from flocsim.body import Body
from flocsim.ensembles.chunks import Condition
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import Code, Going, Keep, Kind, Place, StudyKind
from flocsim.ensembles.storage.identity import (
    PHYSICS,
    config_facts,
    digest,
    machine_facts,
    shape_numbers,
)
from flocsim.ensembles.storage.row_store import OldTable, ReadOnlyJournal, RowStore
from flocsim.ensembles.storage.unfinished import Unfinished, store_of
from flocsim.ensembles.study import flocs_of
from flocsim.geometry.shapes.shape import Sphere
from flocsim.geometry.shapes.spheropolygon import WallShape
from flocsim.integrators.base import Status
from flocsim.io.terminal import aligned
from flocsim.system import System

CODE = (*PHYSICS, "ensembles/lone")
LONG, THIN = 100.0, 0.1
"""Half the length and the thickness of the wall, over the radius of a floc."""


@attrs.define(eq=False)
class LoneStudy(StudyKind):
    """Every replicate is one floc, drawn and turned at random, beside the wall."""

    config: Config
    flocs: list
    row: ClassVar[np.dtype] = ROW
    compared: ClassVar[tuple[str, ...]] = ("speed", "drift", "turned", "steps")
    noun: ClassVar[str] = "flocs"

    def system(self, place: Place, replicate: int) -> System:
        """The floc and the wall at the start."""
        config, scene, n = self.config, self.scene, place[1]
        numbers = np.random.default_rng((config.seed, replicate)).random(2)
        radius = scene.radius
        shape = Sphere(radius)
        if n > 1:
            floc = self.flocs[int(numbers[0] * len(self.flocs))]
            shape = floc.resized(n, radius, config.shapes.radius)
        angle, half = 2.0 * np.pi * float(numbers[1]), LONG * radius
        wall = WallShape([(0.0, -half), (0.0, half)], THIN * radius)
        away = THIN * radius + scene.gap + shape.bounding_radius
        body = Body(shape, (away, 0.0), angle=angle, **config.body_options(shape))
        fixed = Body(wall, (0.0, 0.0), surface_density=1.0, fixed=True)
        return System((fixed, body), config.forces, config.integrator.method, config.fluid)

    @property
    def title(self) -> str:
        """The study in a few words."""
        return f"{self.size} flocs past a wall"

    def asked(self) -> dict[str, Any]:
        """What the study consists of, by which its journal is known."""
        return super().asked() | {"lone": self.size}

    def compile(self, kinds: Iterable[Code]) -> dict[Code, dict | None]:
        """Run the first floc of each number of vertices."""
        return {code: self.run_task((*code, 0.0), 0, lambda: False)[0] for code in kinds}

    @property
    def kinds(self) -> list[Code]:
        """One for each number of vertices."""
        return [(0, n) for n in self.config.shapes.vertices]

    def run_task(
        self, place: Place, replicate: int, halted: Callable[[], bool], left: Any = None,
        keep: Keep | None = None, going: Going | None = None,
    ) -> tuple[dict | None, dict | None]:  # fmt: skip
        """How fast a floc sinks, how far it drifts away and turns."""
        until, most = self.scene.duration, self.config.integrator.max_steps
        run = self.system(place, replicate).begin(until, max_steps=most)
        before = run.work.motion[at.NOW, 1, :3].copy()
        status = run.to_end(halted)
        if status == Status.PAUSED:
            return None, None
        moved = run.work.motion[at.NOW, 1, :3] - before
        row = {
            "speed": -moved[1] / until, "drift": moved[0], "turned": moved[2], "steps": run.steps,
            "failed": int(status != Status.FINISHED),
        }  # fmt: skip
        note = {"type": "lone", "vertices": place[1], "delta": 0.0, "replicate": replicate,
                "why": status.name}  # fmt: skip
        return row, note if row["failed"] else None

    def check_rows(self, column: Callable[[str], np.ndarray]) -> None:
        """ValueError for rows that no run can have given."""
        if np.any(column("failed") > 1) or np.any(column("steps") < 0):
            raise ValueError("a floc has ended as none does")

    def has_failed(self, column: Callable[[str], np.ndarray]) -> np.ndarray:
        """Which came to no end."""
        return column("failed") == 1


def check(config: Config) -> None:
    """The FlocsimError that the study would meet: at the latest when its first floc is placed."""
    LoneStudy(config, flocs_of(config)).system((0, config.shapes.vertices[0], 0.0), 0)


def identity_of(study: LoneStudy, machine: dict | None = None) -> dict:
    """All that the rows follow from."""
    facts = config_facts(study.config, ("scene", "shapes", "bodies", "fluid"))
    facts |= machine or machine_facts(CODE)
    for n in study.config.shapes.vertices if study.flocs else ():
        numbers = [shape_numbers(floc.shapes[n]) for floc in study.flocs if n in floc.shapes]
        facts[f"flocs.{n}"] = digest(np.concatenate([np.zeros(1), *numbers]))
    return dict(json.loads(json.dumps(facts)))


def old_rows(output: Any, resources: ExitStack) -> OldTable:
    """The flocs of a results file."""
    found = read_lone(output)
    places = {Condition("lone", n, 0.0): (k,) for k, n in enumerate(found.vertices.tolist())}
    return OldTable(found.columns, places, found.count, found.run, found)


def gathered(store: RowStore, count: int) -> dict[str, np.ndarray]:
    """{name: (vertices, replicate)} of the rows of a store; blank where there is none yet."""
    found = {}
    for name in ROW.names or ():
        blank = np.nan if ROW[name].kind == "f" else 0
        found[name] = np.full((len(store.conditions), count), blank, ROW[name])
        for place in range(len(store.conditions)):
            for first, stop in store.intervals(place):
                stop = min(stop, count)
                if first < stop:
                    found[name][place, first:stop] = store.read(place, name, first, stop)
    return found


def results(
    study: LoneStudy, start: Any, count: int, run: dict, comm: Any, output: Any, warn: Any,
    in_memory: bool,
) -> LoneResults:  # fmt: skip
    """The LoneResults of so many replicates, written to the output if there is one."""
    vertices = np.array(study.config.shapes.vertices)
    found = LoneResults(vertices, gathered(start.store, count), run)
    if output is not None:
        write_lone(output, found, start.replacing)
    return found


def table(found: LoneResults) -> str:
    """Means over flocs, a row for each number of vertices."""
    with np.errstate(invalid="ignore"):
        means = {name: np.nanmean(found.columns[name], axis=1) for name in ("speed", "drift")}
    rows = [("N", "flocs", "speed [um/s]", "drift [nm]")]
    for place, n in enumerate(found.vertices.tolist()):
        known = int(np.isfinite(found.columns["speed"][place]).sum())
        speed, drift = 1e6 * means["speed"][place], 1e9 * means["drift"][place]
        rows.append((str(n), str(known), f"{speed:.4g}", f"{drift:.4g}"))
    return "\n".join(aligned(rows))


def verdict(found: LoneResults) -> tuple[int, str]:
    """How many flocs came to no end."""
    failed = int(found.columns["failed"].sum())
    return (0, f"warning: {failed} flocs came to no end") if failed else (0, "")


def so_far(path: Path, sessions: list[dict], found: list) -> Unfinished:
    """What a journal has."""
    asked = sessions[-1]["asked"]
    check = LoneStudy.check_rows
    with ReadOnlyJournal(str(path)) as journal:
        store, notes, unread = store_of(
            journal, sessions, found, asked, ROW, lambda column: check(None, column)
        )  # fmt: skip
        made = LoneResults(np.array(asked["vertices"]), gathered(store, asked["replicates"]), {})
    return Unfinished(path, FORMAT, made, store.there(), asked["lone"], notes, sessions, unread)


KIND = Kind(
    scenes=(LoneScene,),
    make=lambda config, flocs=None, methods=None: LoneStudy(
        config, flocs_of(config) if flocs is None else flocs
    ),
    flocs=flocs_of, identity=identity_of, code=CODE, check=check,
    prepare=lambda study, comm: None, doubts=lambda study: [], facts=lambda study: {},
    old_rows=old_rows, results=results, read=read_lone, table=table,
    total=lambda found: found.columns["speed"].size, verdict=verdict,
    dry_run=lambda config, ranks, pilot: LoneStudy(config, []).title,
    so_far=so_far, asked={"lone": int},
)  # fmt: skip
