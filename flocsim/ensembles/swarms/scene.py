"""[scene] kind = "swarm": many bodies in a box, how they begin, for how long, what is kept."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import attrs

from flocsim.ensembles.config.pair_scene import (
    LARGEST_LENGTH,
    Problem,
    outline_problems,
    size_limit,
)
from flocsim.ensembles.config.values import list_of, number, read_by, vector, whole_field
from flocsim.errors import ConfigError
from flocsim.fields import choice, flag, number_range, quantity, word_or_quantity
from flocsim.forces.dlvo import unlike

MOST_BODIES = 100_000
SNAPSHOTS = 10
"""How many are kept where nothing is said, the start not counted."""


RADIUS = number("m", *number_range(above=0.0, at_most=LARGEST_LENGTH))
"""Reader of a radius."""


@attrs.frozen
class SwarmScene:
    """With `kind = "swarm"`: the number and sizes of the bodies, where they start, for how long
    they are followed, and what is kept."""

    without: ClassVar[frozenset[str]] = frozenset({"zone", "stop", "sampling"})
    """Tables and keys that such a study has no use for."""
    usual_replicates: ClassVar[int | None] = None

    kind: str = choice("swarm", default="swarm", help="many bodies, which this table describes")
    number: int = whole_field(1, MOST_BODIES, default=1000, help="bodies of each replicate")
    area_fraction: float | None = quantity(
        "",
        above=0.0,
        at_most=0.9,
        default=None,
        help="share of the box that bodies cover at the start; it sets the size of the box, which "
        "is as high as it is wide unless `aspect` says otherwise. Placed at random one after "
        "another, flocs reach about 0.3",
    )
    box: tuple[float, float] | None = read_by(
        vector(2, "m", above=0.0),
        "a list of 2 numbers, each above 0",
        default=None,
        unit="m",
        help="width and height of the box, instead of `area_fraction`",
    )
    aspect: float = quantity(
        "", above=0.0, at_most=1e3, default=1.0, help="height of the box over its width"
    )
    periodic: str = choice(
        "xy",
        "x",
        "none",
        default="xy",
        help="axes along which the box is periodic; along the others bodies start inside it, and "
        "may leave it",
    )
    floor: bool = flag(
        default=False, help="a fixed wall below the box, which must not be periodic in y"
    )
    leaving: str = choice(
        "keep",
        "remove",
        "reenter",
        default="keep",
        help="what happens to clusters that leave through a side at which the box is not periodic: "
        "keep: they continue outside; remove: they are taken out; reenter: they come in again at "
        "the opposite side",
    )
    radius: float | None = quantity(
        "m",
        above=0.0,
        at_most=LARGEST_LENGTH,
        default=None,
        help="median equivalent radius; without it, bodies are measured flocs of a library, each "
        "at its own size",
    )
    spread: float = quantity(
        "",
        at_least=0.0,
        at_most=1.5,
        default=0.0,
        help="standard deviation of ln r_eq, of a lognormal distribution about `radius`",
    )
    weight: str = choice(
        "number",
        "area",
        "volume",
        default="number",
        help="how often a measured floc is drawn: number, as often as in its pictures; area or "
        "volume, in proportion to r_eq² or r_eq³",
    )
    min_radius: float | None = size_limit("least")
    max_radius: float | None = size_limit("largest")
    gap: float = quantity(
        "m", at_least=0.0, default=0.0, help="least distance of outlines at the start"
    )
    duration: float = quantity("s", above=0.0, default=1.0, help="simulated time")
    every: float | str = word_or_quantity(
        "auto",
        "s",
        above=0.0,
        default="auto",
        help=f"time between two snapshots; auto: {SNAPSHOTS} of them",
    )
    link: float = quantity(
        "m",
        at_least=0.0,
        default=0.0,
        help="bodies nearer to each other than this belong to one cluster; 0: those that touch",
    )
    classes: tuple[float, ...] | None = read_by(
        list_of(
            RADIUS,
            "a list of radii such as ['10 um', '20 um']",
        ),
        "a list of ascending radii",
        default=None,
        unit="m",
        help="equivalent radii √(A/π) that separate the size classes in which clusters are "
        "counted, for population balances",
    )
    checkpoint: float = quantity(
        "s",
        above=0.0,
        default=60.0,
        help="wall time after which the state of a replicate is saved, from which --resume "
        "continues",
    )
    all_pairs: bool = flag(
        default=False, help="allow forces of unlimited reach for more than 200 bodies"
    )

    def __attrs_post_init__(self):
        if (self.area_fraction is None) == (self.box is None):
            found = "neither" if self.box is None else "both"
            raise ConfigError(f"a swarm needs area_fraction or box, found {found}")
        if self.box is not None and self.aspect != 1.0:
            raise ConfigError("aspect belongs to area_fraction: box gives the height already")
        if self.floor and self.periodic == "xy":
            raise ConfigError('a floor needs periodic = "x" or "none": the box is periodic in y')
        if self.leaving != "keep" and self.periodic == "xy":
            raise ConfigError(
                f'leaving = "{self.leaving}" needs periodic = "x" or "none": nothing leaves a box '
                "that is periodic on all sides"
            )
        low, high = self.min_radius or 0.0, self.max_radius or math.inf
        if low >= high:
            raise ConfigError(f"min_radius = {low:g} m is not below max_radius = {high:g} m")
        if self.radius is not None and not low < self.radius < high:
            raise ConfigError(
                f"radius = {self.radius:g} m is not between min_radius and max_radius"
            )
        if self.spread > 0.0 and self.radius is None:
            raise ConfigError("spread needs radius, the median of the distribution")
        if list(self.bounds) != sorted(set(self.bounds)):
            raise ConfigError("classes must be ascending radii")
        if self.interval > self.duration:
            raise ConfigError(
                f"every = {self.interval:g} s is longer than duration = {self.duration:g} s"
            )

    @property
    def names(self) -> tuple[str]:
        """The one collision type of its conditions, as other scenes have several."""
        return ("swarm",)

    @property
    def delta(self) -> tuple[float]:
        """Its one displacement: there is none."""
        return (0.0,)

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

    def problems(self, parts: Mapping[str, Any]) -> Iterator[Problem]:
        """What does not go together with the other tables of a config, by their names."""
        yield from outline_problems(parts, settles=False)
        for name, force in zip(parts["force_names"], parts["forces"], strict=True):
            if unlike(force):
                text = "is given for two unlike bodies, but those of a swarm are alike: give one"
                text += " number"
                yield ("forces", name, "potential"), text
        shapes = parts["shapes"]
        if len(shapes.vertices) > 1:
            found = f"found {list(shapes.vertices)}: give one"
            yield ("shapes", "vertices"), f"a swarm has bodies of one number of vertices, {found}"
        if shapes.pairs_alike_in == "error":
            yield ("shapes", "pairs_alike_in"), "is for pairs, which a swarm does not have"
        if self.is_measured and shapes.source != "library":
            text = 'needs radius, the median r_eq, or measured flocs (shapes.source = "library")'
            yield ("scene",), text
        if not self.is_measured and shapes.size == "own":
            text = '"own" takes every floc at its own size: leave out scene.radius'
            yield ("shapes", "size"), text


SCENE = SwarmScene
