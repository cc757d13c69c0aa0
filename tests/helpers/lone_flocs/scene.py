"""[scene] kind = "lone": a floc settles along an upright wall."""

from collections.abc import Iterator
from typing import Any, ClassVar

import attrs

from flocsim.ensembles.config.pair_scene import SIZE, Problem
from flocsim.fields import choice, field, quantity


@attrs.frozen
class LoneScene:
    """With `kind = "lone"`: how large the floc is, how far from the wall, and for how long."""

    without: ClassVar[frozenset[str]] = frozenset({"zone", "stop", "sampling"})
    usual_replicates: ClassVar[int | None] = None
    names: ClassVar[tuple[str, ...]] = ("lone",)
    delta: ClassVar[tuple[float, ...]] = (0.0,)

    kind: str = choice("lone", default="lone")
    """A floc that settles alone past a wall."""

    radius: float = field(SIZE, default=1e-5)
    """Equivalent radius."""

    gap: float = quantity("m", above=0.0, default=1e-7)
    """From the wall, at the start."""

    duration: float = quantity("s", above=0.0, default=0.01)
    """Simulated time."""

    def problems(self, config: Any) -> Iterator[Problem]:
        """Nothing in it contradicts another table."""
        yield from ()


SCENE = LoneScene
