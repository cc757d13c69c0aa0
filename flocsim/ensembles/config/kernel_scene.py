"""[scene] kind = "kernel": rates of encounters, of size classes by size classes."""

import itertools
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import attrs

from flocsim.ensembles.config import pair_scene, values
from flocsim.errors import ConfigError
from flocsim.fields import choice, number_range, quantity, word_or_quantity
from flocsim.forces.body_forces import thermal_in

MOST_SCRAMBLES = 64

KERNEL_REPLICATES = 4096
"""Of every condition of a kernel study where nothing is said."""

read_meetings = values.list_of(
    values.one_of(pair_scene.MECHANISMS), "one of, or a list of, 'settling', 'shear', 'extension'"
)


def as_tuple(value: Any) -> tuple[str, ...]:
    """One word as a tuple of it."""
    return (value,) if isinstance(value, str) else tuple(value)


@attrs.frozen
class KernelScene(pair_scene.DrivenScene):
    """With `kind = "kernel"`: the sizes of the bodies, what brings them together, how their
    orientations and offsets are sampled, and how their meetings begin and end."""

    usual_replicates: ClassVar[int | None] = KERNEL_REPLICATES

    kind: str = choice("kernel", default="kernel", help="rates of encounters")
    meeting: tuple[str, ...] = attrs.field(
        default=(pair_scene.SETTLING,),
        converter=as_tuple,
        metadata={
            "read": lambda value: read_meetings([value] if isinstance(value, str) else value),
            "allowed": '"settling", "shear" or "extension", or a list of them',
            "shown": '"settling"',
            "help": "mechanisms that bring bodies together, one at a time: weight alone, or a "
            "flow alone, u = (G y, 0) or u = (s x, -s y), without weight",
        },
    )
    rate: float | None = quantity(
        "1/s", above=0.0, default=None, help="G or s of the flow in which they meet"
    )
    sizes: tuple[float, ...] | None = values.read_by(
        values.list_of(
            values.number("m", *number_range(above=0.0, at_most=pair_scene.LARGEST_LENGTH)),
            "a list of radii such as ['5 um', '10 um']",
        ),
        "a list of ascending radii, each above 0 and at most 0.01",
        default=None,
        unit="m",
        help='equivalent radii of the size classes; without it, pairs = "measured"',
    )
    pairs: str | None = choice(
        pair_scene.MEASURED,
        default=None,
        help="measured: instead of `sizes`, flocs of a library at their own sizes, in `classes`",
    )
    weight: str | None = pair_scene.WEIGHT
    classes: int | tuple[float, ...] | None = pair_scene.CLASSES
    types: None = attrs.field(init=False, default=None)
    delta: tuple[float, ...] = attrs.field(init=False, default=(1.0,))
    delta_max: str = attrs.field(init=False, default="radius")
    start_gap: float | str = word_or_quantity(  # type: ignore[assignment]
        "auto",
        "m",
        above=0.0,
        at_most=pair_scene.LARGEST_LENGTH,
        default="auto",
        help="distance of the outlines at the start; auto: where the forces between them have "
        "fallen to `far`",
    )
    far: float = quantity(
        "",
        above=0.0,
        at_most=0.1,
        default=1e-3,
        help="speed that the forces between two bodies may cause at an automatic start, as a share "
        "of the speed at which the bodies approach each other",
    )
    scrambles: int = values.whole_field(
        2,
        MOST_SCRAMBLES,
        default=8,
        help="independent scrambles of the Sobol sequence among which the replicates are divided, "
        "from whose scatter the intervals follow; replicates = scrambles times a power of 2",
    )

    flow_in_fluid = pair_scene.FlowScene.flow_in_fluid

    def __attrs_post_init__(self):
        if (self.sizes is None) == (self.pairs is None):
            found = "neither" if self.sizes is None else "both"
            raise ConfigError(
                f'needs sizes, the radii of size classes, or pairs = "measured", found {found}'
            )
        if list(self.sizes or ()) != sorted(self.sizes or ()):
            raise ConfigError("sizes must be ascending radii")
        if len(self.sizes or ()) > pair_scene.MOST_CLASSES:
            raise ConfigError(
                f"there may be at most {pair_scene.MOST_CLASSES} sizes, found {len(self.sizes)}"
            )
        if self.sizes and len(self.sizes) == 1 and pair_scene.SETTLING in self.meeting:
            raise ConfigError(
                "bodies of one size settle equally fast and never meet: give several sizes, or "
                "a meeting in shear or extension"
            )
        if any(each in pair_scene.FLOWS for each in self.meeting) != (self.rate is not None):
            raise ConfigError(
                'rate belongs to a flow: meeting = "shear" or "extension" needs it, as in '
                'rate = "10 1/s", and "settling" alone has none'
            )
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
        """The mechanism of the collision type at a place of `names`."""
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

    def only(self, places: Any) -> "KernelScene":
        """The scene as it is: its classes stay together."""
        return self

    def problems(self, parts: Mapping[str, Any]) -> Iterator[pair_scene.Problem]:
        """What does not go together with the other tables of a config, by their names."""
        yield from super().problems(parts)
        if thermal_in(parts["forces"]):
            text = (
                "brings bodies together from beyond the offsets that a study of rates samples, "
                "and the rates would miss them: leave it out, or let two bodies meet by "
                'scene.meeting = "brownian"'
            )
            yield ("forces", "thermal"), text
        given = {"replicates": KERNEL_REPLICATES, **parts}
        yield from pair_scene.uneven_points(
            given, self.scrambles, f"scene.scrambles = {self.scrambles}"
        )
