"""[scene] kind = "swarm": many bodies in a box, how they begin, for how long, what is kept."""

from collections.abc import Iterator
from typing import Any, ClassVar

import attrs

from flocsim.ensembles.config.pair_scene import (
    SIZE,
    Problem,
    outline_problems,
    size_limits,
)
from flocsim.errors import ConfigError
from flocsim.fields import choice, field, flag, number, quantity, several, whole, word_or_quantity
from flocsim.forces.dlvo import has_unlike_potentials

BOX = several(number("m", above=0.0), 2, distinct=False)
"""Reader of a width and a height."""

SNAPSHOTS = 10
"""How many are kept where nothing is said, the start not counted."""


@attrs.frozen
class SwarmScene:
    """With `kind = "swarm"`: the number and sizes of the bodies, their initial positions, the
    simulated time, and the results to store."""

    without: ClassVar[frozenset[str]] = frozenset({"zone", "stop", "sampling"})
    """Tables and keys that such a study has no use for."""

    usual_replicates: ClassVar[int | None] = None

    names: ClassVar[tuple[str]] = ("swarm",)
    """The one collision type of its conditions, as other scenes have several."""

    delta: ClassVar[tuple[float]] = (0.0,)
    """Its one displacement: there is none."""

    kind: str = choice("swarm", default="swarm")
    """Many bodies, which this table describes."""

    number: int = field(whole(1, 100_000), default=1000)
    """Bodies of each replicate."""

    area_fraction: float | None = quantity("", above=0.0, at_most=0.9, default=None)
    """Fraction of the box that bodies cover at the start; it sets the size of the box, which is
    square unless `aspect` is given. Flocs, placed at random one after another, reach about 0.3."""

    box: tuple[float, float] | None = field(BOX, default=None)
    """Width and height of the box, instead of `area_fraction`."""

    aspect: float = quantity("", above=0.0, at_most=1e3, default=1.0)
    """Height of the box over its width."""

    periodic: str = choice("xy", "x", "none", default="xy")
    """Axes along which the box is periodic; along the others bodies start inside the box and may
    leave it."""

    floor: bool = flag(default=False)
    """A fixed wall below the box, which must not be periodic in y."""

    leaving: str = choice("keep", "remove", "reenter", default="keep")
    """What happens to clusters that leave through a side at which the box is not periodic: keep:
    they continue outside; remove: they are removed; reenter: they enter again at the opposite
    side."""

    radius: float | None = field(SIZE, default=None)
    """Median equivalent radius; without it, bodies are measured flocs of a library, each at its
    own size."""

    spread: float = quantity("", at_least=0.0, at_most=1.5, default=0.0)
    """Standard deviation of ln r_eq, of a lognormal distribution about `radius`."""

    weight: str = choice("number", "area", "volume", default="number")
    """How often a measured floc is drawn: number, as often as in its pictures; area or volume, in
    proportion to r_eq² or r_eq³."""

    min_radius: float | None = field(SIZE, default=None)
    """Smallest r_eq that is drawn; none: no limit."""

    max_radius: float | None = field(SIZE, default=None)
    """Largest r_eq that is drawn; none: no limit."""

    gap: float = quantity("m", at_least=0.0, default=0.0)
    """Smallest distance of outlines at the start."""

    duration: float = quantity("s", above=0.0, default=1.0)
    """Simulated time."""

    every: float | str = word_or_quantity("auto", "s", above=0.0, default="auto")
    """Time between two snapshots; auto: a tenth of `duration`."""

    link: float = quantity("m", at_least=0.0, default=0.0)
    """Bodies nearer to each other than this belong to one cluster; 0: those that touch."""

    classes: tuple[float, ...] | None = field(several(SIZE), default=None)
    """Ascending equivalent radii √(A/π) that separate the size classes in which clusters are
    counted, for population balances."""

    checkpoint: float = quantity("s", above=0.0, default=60.0)
    """Wall time after which the state of a replicate is saved, from which --resume continues."""

    all_pairs: bool = flag(default=False)
    """Allow forces of unlimited reach for more than 200 bodies."""

    def __attrs_post_init__(self):
        if (self.area_fraction is None) == (self.box is None):
            found = "neither" if self.box is None else "both"
            raise ConfigError(f"a swarm needs area_fraction or box, found {found}")
        if self.box is not None and self.aspect != 1.0:
            raise ConfigError("aspect goes with area_fraction: box already gives the height")
        if self.periodic == "xy" and (self.floor or self.leaving != "keep"):
            key = "floor = true" if self.floor else f'leaving = "{self.leaving}"'
            raise ConfigError(
                f'{key} needs periodic = "x" or "none": the box is periodic on all sides'
            )
        low, high = size_limits(self.min_radius, self.max_radius)
        if self.radius is not None and not low < self.radius < high:
            raise ConfigError(
                f"radius = {self.radius:g} m is not between min_radius and max_radius"
            )
        if self.spread > 0.0 and self.radius is None:
            raise ConfigError("spread needs radius, the median of the distribution")
        if list(self.bounds) != sorted(self.bounds):
            raise ConfigError("classes must be ascending radii")
        if self.interval > self.duration:
            raise ConfigError(
                f"every = {self.interval:g} s is longer than duration = {self.duration:g} s"
            )

    @property
    def repeats(self) -> tuple[bool, bool]:
        """Whether the box is periodic along x, and y."""
        return "x" in self.periodic, "y" in self.periodic

    @property
    def interval(self) -> float:
        """Time between two snapshots [s]."""
        return self.duration / SNAPSHOTS if isinstance(self.every, str) else self.every

    @property
    def bounds(self) -> tuple[float, ...]:
        """Equivalent radii between the size classes of clusters [m]."""
        return self.classes or ()

    @property
    def is_measured(self) -> bool:
        """Whether bodies are flocs of a library, each at its own size."""
        return self.radius is None

    def problems(self, config: Any) -> Iterator[Problem]:
        """Yield what does not go together with the other tables of a config."""
        yield from outline_problems(config, settles=False)
        for name, force in zip(config.force_names, config.forces, strict=True):
            if has_unlike_potentials(force):
                text = "must be one number in a swarm, whose bodies are alike"
                yield f"forces.{name}.potential", text
        shapes = config.shapes
        if len(shapes.vertices) > 1:
            text = f"must be one number in a swarm, found {list(shapes.vertices)}"
            yield "shapes.vertices", text
        if shapes.pairs_alike_in == "error":
            yield "shapes.pairs_alike_in", "is for studies of pairs: leave it out of a swarm"
        if self.is_measured and shapes.source != "library":
            text = 'needs radius, the median r_eq, or measured flocs (shapes.source = "library")'
            yield "scene", text
        if not self.is_measured and shapes.size == "own":
            text = '"own" takes every floc at its own size: leave out scene.radius'
            yield "shapes.size", text


SCENE = SwarmScene
