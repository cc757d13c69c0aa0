"""Studies of single flocs past a wall: their draw and run, and what rank 0 asks of them."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import attrs
import numpy as np
from flocsim.ensembles.lone.file import FORMAT, ROW, LoneResults, read_lone, write_lone
from flocsim.ensembles.lone.scene import LoneScene

import flocsim.arrays as at
from flocsim.body import Body
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import Code, Condition, Kind, OldResults, Place, StudyKind
from flocsim.ensembles.storage.identity import (
    PHYSICS,
    config_facts,
    digest,
    machine_facts,
    shape_numbers,
)
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.storage.unfinished import Unfinished, store_of
from flocsim.ensembles.study import flocs_of
from flocsim.errors import FileError
from flocsim.geometry.shapes.shape import Sphere
from flocsim.integrators.base import Status
from flocsim.io.journal import JournalReader
from flocsim.swarms.placement import wall
from flocsim.system import System

CODE = (*PHYSICS, "swarms/placement.py", "ensembles/lone")
LONG, THIN = 100.0, 0.1
"""Half the length and the thickness of the wall, over the radius of a floc."""


def check_rows(column: Callable[[str], np.ndarray]) -> None:
    """ValueError for rows that no run can have given."""
    if np.any(column("failed") > 1) or np.any(column("steps") < 0):
        raise ValueError("a floc has ended as none does")


@attrs.define(eq=False)
class LoneStudy(StudyKind):
    """Every replicate is one floc, drawn and turned at random, beside the wall."""

    config: Config
    flocs: list
    row: ClassVar[np.dtype] = ROW
    noun: ClassVar[str] = "flocs"
    check_rows = staticmethod(check_rows)

    def system(self, vertices: int, replicate: int) -> System:
        """The wall and the floc at the start."""
        config, radius = self.config, self.scene.radius
        which, turn = np.random.default_rng((config.seed, replicate)).random(2).tolist()
        shape = Sphere(radius)
        if vertices > 1:
            floc = self.flocs[int(which * len(self.flocs))]
            shape = floc.resized(vertices, radius, config.shapes.radius)
        half, thin = LONG * radius, THIN * radius
        place = thin + self.scene.gap + shape.bounding_radius, 0.0
        body = Body(shape, place, angle=2.0 * np.pi * turn, **config.body_options(shape))
        bodies = wall((0.0, -half), (0.0, half), thin), body
        return System(bodies, config.forces, config.integrator.method, config.fluid)

    def asked(self) -> dict[str, Any]:
        """What the study consists of, by which its journal is known."""
        return super().asked() | {"lone": self.size}

    def compile(self, kinds: Iterable[Code]) -> None:
        """Run the first floc."""
        for code in kinds:
            self.run_task((*code, 0.0), 0, lambda: False)

    def run_task(
        self, place: Place, replicate: int, halted: Callable[[], bool], *_: Any
    ) -> tuple[dict | None, dict | None]:
        """How fast a floc sinks, and how far it drifts away."""
        until, most = self.scene.duration, self.config.integrator.max_steps
        run = self.system(place[1], replicate).begin(until, max_steps=most)
        before = run.work.motion[at.NOW, 1, :2].copy()
        status = run.to_end(halted)
        if status == Status.PAUSED:
            return None, None
        x, y = run.work.motion[at.NOW, 1, :2] - before
        failed = status != Status.FINISHED
        row = {"speed": -y / until, "drift": x, "steps": run.steps, "failed": failed}
        return row, self.note(place, replicate, status.name) if failed else None

    def has_failed(self, column: Callable[[str], np.ndarray]) -> np.ndarray:
        """Which came to no end."""
        return column("failed") == 1


def identity_of(study: LoneStudy, machine: dict | None = None) -> dict:
    """All that the rows follow from."""
    facts = config_facts(study.config, ("scene", "shapes", "bodies", "fluid"))
    for n in study.config.shapes.vertices if study.flocs else ():
        shapes = [shape_numbers(floc.shapes[n]) for floc in study.flocs if n in floc.shapes]
        facts[f"flocs.{n}"] = digest(np.concatenate([np.zeros(1), *shapes]))
    return facts | (machine or machine_facts(CODE))


@contextmanager
def old_rows(output: Any) -> Iterator[OldResults]:
    """Open a results file that is to be extended."""
    found = read_lone(output)
    conditions = [Condition("lone", n, 0.0) for n in found.vertices.tolist()]
    rows = np.zeros((len(conditions), found.count), ROW)
    for name, values in found.columns.items():
        rows[name] = values
    chunks = [(condition, 0, each) for condition, each in zip(conditions, rows, strict=True)]
    yield OldResults(conditions, found.count, chunks, found.run)


def results_in(store: RowStore, count: int, run: dict) -> LoneResults:
    """The first so many flocs of each number of vertices that a store has."""
    rows = np.stack([store.rows(k, 0, count) for k in range(len(store.conditions))])
    columns = {name: rows[name].copy() for name in ROW.names or ()}
    return LoneResults(np.array([each.vertices for each in store.conditions]), columns, run)


def results(
    study: LoneStudy, start: Any, count: int, run: dict, output: Any, in_memory: bool
) -> LoneResults:
    """The LoneResults of so many replicates, written to the output if there is one."""
    found = results_in(start.store, count, run)
    if output is not None:
        write_lone(output, found, start.replacing)
    return found


def so_far(journal: JournalReader, sessions: list[dict]) -> Unfinished:
    """What a journal has: as many flocs as there are of each number of vertices."""
    store, notes, unread = store_of(journal, sessions, ROW, check_rows)
    runs = [store.intervals(place)[:1] for place in range(len(store.conditions))]
    there = min(each[0][1] if each and each[0][0] == 0 else 0 for each in runs)
    path, asked = journal.path, sessions[-1]["asked"]["lone"]
    if there == 0:
        raise FileError(f"{path} has no floc of some number of vertices yet: try again later")
    made = results_in(store, there, {})
    return Unfinished(path, FORMAT, made, store.there(), asked, notes, sessions, unread)


KIND = Kind(
    scenes=(LoneScene,), make=lambda config, flocs: LoneStudy(config, flocs),
    flocs=flocs_of, identity=identity_of, code=CODE, old_rows=old_rows, results=results,
    total=lambda found: found.columns["speed"].size, so_far=so_far,
    asked={"lone": int},
)  # fmt: skip
