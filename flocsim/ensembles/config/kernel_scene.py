"""[scene] kind = "kernel": rates of encounters, of size classes by size classes."""

import itertools
from collections.abc import Iterator
from typing import Any, ClassVar

import attrs

from flocsim.ensembles.config import pair_scene
from flocsim.errors import ConfigError
from flocsim.fields import choice, field, one_of, quantity, several, whole, word_or_quantity
from flocsim.forces.body_forces import thermal_forces


@attrs.frozen
class KernelScene(pair_scene.PairScene):
    """With `kind = "kernel"`: the sizes of the bodies, what brings them together, how their
    orientations and offsets are sampled, and how their meetings begin and end. `pairs`, `weight`,
    `classes`, `min_radius`, `max_radius`, `rate`, `escape_gap`, `rest_time` and `time_limit` are as
    above; these are its own:"""

    usual_replicates: ClassVar[int | None] = 4096

    kind: str = choice("kernel", default="kernel")
    """Rates of encounters."""

    meeting: tuple[str, ...] = field(
        several(one_of(*pair_scene.MECHANISMS), or_word=True), default=(pair_scene.SETTLING,)
    )
    """Mechanisms that bring bodies together, one at a time (a single one may stand without a list):
    weight alone, or a flow alone, u = (G y, 0) or u = (s x, -s y), without weight."""

    sizes: tuple[float, ...] | None = field(several(pair_scene.SIZE), default=None)
    """Ascending equivalent radii of the size classes; or give `pairs = "measured"` (flocs of a
    library at their own sizes) and `classes`."""

    start_gap: float | str = word_or_quantity(
        "auto", "m", above=0.0, at_most=pair_scene.LARGEST_LENGTH, default="auto"
    )
    """Distance of the outlines at the start; auto: where the forces between them have fallen to
    `far`."""

    far: float = quantity("", above=0.0, at_most=0.1, default=1e-3)
    """Speed that the forces between two bodies may cause at an automatic start, as a fraction of
    the speed at which the bodies approach each other."""

    scrambles: int = field(whole(2, 64), default=8)
    """Number of independent scrambles of the Sobol sequence, whose scatter gives the intervals; the
    number of replicates must be a power of 2 times this number."""

    types: None = attrs.field(init=False, default=None)
    delta: tuple[float, ...] = attrs.field(init=False, default=(1.0,))
    delta_max: str = attrs.field(init=False, default="radius")
    receiver: str = attrs.field(init=False, default="free")
    release: Any = attrs.field(init=False, default=None)
    escape: Any = attrs.field(init=False, default=None)

    def __attrs_post_init__(self):
        if (self.sizes is None) == (self.pairs is None) or isinstance(self.pairs, tuple):
            found = "neither" if self.sizes is self.pairs is None else "both, or other pairs"
            raise ConfigError(
                f'needs sizes (radii of the size classes) or pairs = "measured", found {found}'
            )
        sizes = self.sizes or ()
        if list(sizes) != sorted(sizes):
            raise ConfigError("sizes must be ascending radii")
        if len(sizes) == 1 and pair_scene.SETTLING in self.meeting:
            raise ConfigError("needs two or more sizes: bodies of one size settle equally fast")
        super().__attrs_post_init__()

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of the size classes, the smallest first."""
        if self.sizes is None:
            return self.class_labels
        return tuple(f"{pair_scene.micrometres(each)}um" for each in self.sizes)

    @property
    def conditions(self) -> tuple[tuple[int, int, int], ...]:
        """(place of the mechanism, of class i, of class j) of every collision type, in order.

        Class i is not above class j. Bodies of one size do not meet by settling.
        """
        places = range(len(self.labels))
        return tuple(
            (place, i, j)
            for place, meeting in enumerate(self.meeting)
            for i, j in itertools.combinations_with_replacement(places, 2)
            if i != j or meeting != pair_scene.SETTLING or self.is_measured
        )

    def meeting_of(self, place: int) -> str:
        """Return the mechanism of the collision type at a place of `names`."""
        return self.meeting[self.conditions[place][0]]

    @property
    def names(self) -> tuple[str, ...]:
        """The name of every collision type: "settling:5um-10um"."""
        labels = self.labels
        return tuple(f"{self.meeting[m]}:{labels[i]}-{labels[j]}" for m, i, j in self.conditions)

    @property
    def given(self) -> tuple[tuple[str, tuple[float, float]], ...]:
        """(name, (r_i, r_j) [m]) of every collision type of given sizes."""
        if self.sizes is None:
            return ()
        pairs = [(self.sizes[i], self.sizes[j]) for _, i, j in self.conditions]
        return tuple(zip(self.names, pairs, strict=True))

    @property
    def class_pairs(self) -> tuple[tuple[int, int], ...]:
        """Places of the two size classes of every collision type."""
        return tuple((i, j) for _, i, j in self.conditions)

    def problems(self, config: Any) -> Iterator[pair_scene.Problem]:
        """Yield what does not go together with the other tables of a config."""
        yield from super().problems(config)
        if thermal_forces(config.forces):
            text = "brings bodies together from beyond the offsets that are sampled: leave it out"
            yield "forces.thermal", text
        yield from pair_scene.uneven_points(
            config, self.scrambles, f"scene.scrambles = {self.scrambles}"
        )
