"""[scene] kind = "lone": a trial kind of study, of single flocs that settle past a wall."""

from collections.abc import Callable, Iterator
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.ensembles.kind import PHYSICS, Condition, Overseer, StudyKind
from flocsim.ensembles.one_table import OneTable
from flocsim.fields import choice, quantity
from flocsim.geometry.shapes.shape import Sphere
from flocsim.integrators.base import Status
from flocsim.state.work import NOW
from flocsim.swarms.placement import wall
from flocsim.system import System

LONG, THIN = 100.0, 0.1
"""Half the length and the thickness of the wall, over the radius of a floc."""

TABLE = OneTable("flocsim lone", "results of single flocs past a wall", {
    "speed": ("f8", "m s-1", "downward velocity"),
    "drift": ("f8", "m", "distance moved away from the wall"),
    "steps": ("i8", "1", "accepted integrator steps"),
    "failed": ("u1", "1", "1: its run came to no end"),
})  # fmt: skip


@attrs.frozen
class LoneScene:
    """With `kind = "lone"`: how large the floc is, how far from the wall, and for how long."""

    without: ClassVar[frozenset[str]] = frozenset({"zone", "stop", "sampling"})
    usual_replicates: ClassVar[int | None] = None
    names: ClassVar[tuple[str, ...]] = ("lone",)
    delta: ClassVar[tuple[float, ...]] = (0.0,)

    kind: str = choice("lone", default="lone")
    """A floc that settles alone past a wall."""

    radius: float = quantity("m", above=0.0, at_most=0.01, default=1e-5)
    """Equivalent radius."""

    gap: float = quantity("m", above=0.0, default=1e-7)
    """From the wall, at the start."""

    duration: float = quantity("s", above=0.0, default=0.01)
    """Simulated time."""

    def problems(self, config: Any) -> Iterator[Any]:
        """Nothing in it contradicts another table."""
        yield from ()


@attrs.define(eq=False)
class LoneStudy(StudyKind):
    """Every replicate is one floc, drawn and turned at random, beside the wall."""

    config: Any
    flocs: list
    scenes: ClassVar = (LoneScene,)
    format: ClassVar = TABLE.name
    row: ClassVar = TABLE.row
    code: ClassVar = (*PHYSICS, "swarms/placement.py", "ensembles/lone.py")
    noun: ClassVar = "flocs"

    @staticmethod
    def flocs_of(config: Any) -> list:
        """Grow or read the flocs of the config."""
        from flocsim.ensembles.study import Study

        return Study.flocs_of(config)

    def system(self, vertices: int, replicate: int) -> System:
        """Return the wall and the floc at the start."""
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

    def run_task(
        self, condition: Condition, replicate: int, overseer: Overseer, left: Any = None
    ) -> tuple[dict | None, dict | None]:
        """Run a floc: how fast it sinks, and how far it drifts away."""
        until, most = self.scene.duration, self.config.integrator.max_steps
        run = self.system(condition.vertices, replicate).begin(until, max_steps=most)
        before = run.work.place[NOW, 1, :2].copy()
        status = run.to_end(overseer.halted)
        if status == Status.PAUSED:
            return None, None
        x, y = run.work.place[NOW, 1, :2] - before
        failed = status != Status.FINISHED
        row = {"speed": -y / until, "drift": x, "steps": run.steps, "failed": failed}
        return row, self.note(condition, replicate, status.name) if failed else None

    def has_failed(self, column: Callable[[str], np.ndarray]) -> np.ndarray:
        """Return flags of those that came to no end."""
        return column("failed") == 1


SCENE, KINDS, CONTENTS = LoneScene, (LoneStudy,), TABLE
