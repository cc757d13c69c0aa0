"""[scene] kind = "binary": who meets whom; a class for each way in which two bodies meet."""

import itertools
from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from typing import Any, ClassVar, Self

import attrs

from flocsim.ensembles.config import SCENE_WORDS
from flocsim.ensembles.config.values import (
    either,
    list_of,
    number,
    one_of,
    read_by,
    vector,
    whole,
)
from flocsim.errors import ConfigError
from flocsim.fields import (
    checked_field,
    choice,
    list_words,
    number_range,
    quantity,
    word_or_quantity,
)
from flocsim.forces.body_forces import thermal_in
from flocsim.forces.drag import shields_clusters
from flocsim.forces.outline import ASK_FOR_BOTH, asks_for_both

LARGEST_LENGTH = 0.01
"""[m] Upper limit of sizes: a larger one is a length in µm whose unit was forgotten."""

TYPES = {"I": (16.41e-6, 23.02e-6), "II": (4.95e-6, 23.02e-6), "III": (4.62e-6, 4.95e-6)}
"""Equivalent radii (receiving, approaching) [m] of the paper's three types of collision."""

MEASURED = "measured"
"""Value of `[scene] pairs`, and the name of the one collision type that it makes by itself."""

MOST_CLASSES = 20

SETTLING, SHEAR, EXTENSION = MECHANISMS = ("settling", "shear", "extension")
"""What drives two bodies together: their weight, or a flow u = (G y, 0) or u = (s x, −s y)."""

FLOWS = (SHEAR, EXTENSION)

BROWNIAN = "brownian"
"""Thermal motion alone brings two bodies together, or does not."""

MEETINGS = (*MECHANISMS, BROWNIAN)

KINDS_OF_SCENES = ("binary", *SCENE_WORDS, "kernel")

Problem = tuple[tuple[str, ...], str]
"""(place in the config, what is wrong there)"""


def of_measured(value: Any) -> Any:
    """A default where pairs are measured; None elsewhere."""
    return attrs.Factory(lambda self: value if self.pairs == MEASURED else None, takes_self=True)


def size_limit(which: str, **more: Any) -> Any:
    """The least or largest size that is drawn."""
    help = f"{which} r_eq that is drawn; none: no limit"
    return quantity("m", above=0.0, at_most=LARGEST_LENGTH, default=None, help=help, **more)


WEIGHT: Any = choice(
    "number",
    "area",
    "volume",
    default=of_measured("number"),
    shown='"number"',
    only_for=("pairs", MEASURED),
    help="how often a measured floc is drawn: number, as often as in its pictures; area, in "
    "proportion to its area, the volume of a floc in the plane; volume, in proportion to r_eq³, "
    "the volume of the equivalent sphere, as laser diffraction and Coulter counters report it",
)
CLASSES: Any = read_by(
    either(
        int,
        whole(1, MOST_CLASSES),
        list_of(
            number("m", *number_range(above=0.0, at_most=LARGEST_LENGTH)),
            "a list of radii such as ['10 um', '20 um'], or a number of classes",
        ),
    ),
    f"a list of distinct radii, each above 0 and at most 0.01, or a number of classes from 1 "
    f"to {MOST_CLASSES}",
    default=of_measured(1),
    shown="1",
    unit="m",
    only_for=("pairs", MEASURED),
    help="size classes of the measured flocs, each pair of which is a collision type: their "
    "number, for classes of equal weight (`q1`, the smallest, `q2`, …), or the r_eq that separate "
    "them (`to10um`, `10to20um`, `from20um`)",
)
"""Keys of measured flocs."""


def one_tag(word: str, of: tuple[str, ...], help: str) -> Any:
    """A key that takes one word in this class of scenes, and any that it is ``of`` in a config."""
    return checked_field(
        lambda value: value == word, list_words(of), word,
        choices=(word,), read=one_of(of), help=help,
    )  # fmt: skip


SOBOL = "sobol"
SOBOL_SCRAMBLES = 16
"""Of studies of pairs: with fewer the intervals are wider, with more the points are less even."""


def uneven_points(parts: Mapping[str, Any], scrambles: int, of_what: str) -> Iterator[Problem]:
    """What does not go with replicates that are points of ``scrambles`` Sobol sequences."""
    replicates = parts.get("replicates")
    if replicates is None:  # it is wrong by itself
        return
    points, rest = divmod(replicates, scrambles)
    if rest or points < 1 or points & (points - 1):
        least = scrambles << (max(points, 1).bit_length() - 1)
        text = (
            f"must be {of_what} times a power of 2, as only then are Sobol's points even: found "
            f"{replicates}, give {least} or {2 * least}"
        )
        yield ("replicates",), text
    if parts["stop"] is not None and parts["stop"].half_width is not None:
        text = "is for independent replicates, and Sobol's points have to be run to the last: "
        yield ("stop", "half_width"), text + "give more replicates and --resume instead"


def outline_problems(parts: Mapping[str, Any], *, settles: bool) -> Iterator[Problem]:
    """What does not go with forces along outlines, or by how bodies are turned; ``settles``:
    whether the scene is one of two bodies that settle."""
    found = next(filter(asks_for_both, parts["forces"]), None)
    if found is None:
        return
    words, advice = ASK_FOR_BOTH[found.acts_on]
    name = type(found).__name__
    if not settles:
        yield ("forces",), f"{name} {words}, which is for pairs that settle: {advice}"
    elif thermal_in(parts["forces"]):
        text = f"cannot yet be combined with {name}, which {words}: leave one of them out"
        yield ("forces", "thermal"), text


@attrs.frozen
class PairScene:
    """Of what sizes two bodies meet, and what all ways to meet have in common.

    What is a key of some ways alone is fixed in the others.
    """

    without: ClassVar[frozenset[str]] = frozenset()
    """Tables and keys that such a study has no use for."""
    usual_replicates: ClassVar[int | None] = None
    """Where nothing is said; None for that of the key."""

    kind: str = one_tag(
        "binary",
        of=KINDS_OF_SCENES,
        help='"binary": encounters of two bodies; the other kinds have keys of their own, below',
    )
    pairs: tuple[tuple[float, float], ...] | str | None = read_by(
        either(
            str,
            one_of((MEASURED,)),
            list_of(
                vector(2, "m", above=0.0, at_most=LARGEST_LENGTH),
                "a list of pairs such as [['16.41 um', '23.02 um']], or 'measured'",
            ),
        ),
        'a list of pairs [r_i, r_j], each above 0 and at most 0.01, or "measured"',
        default=None,
        unit="m",
        help="equivalent radii (receiving, approaching), instead of `types`; measured: two flocs "
        "are drawn from the whole library, each at its own size; the faster of the two approaches",
    )
    types: tuple[str, ...] | None = read_by(
        list_of(one_of(tuple(TYPES)), "a list of 'I', 'II', 'III'"),
        'a list of "I", "II", "III"',
        default=attrs.Factory(lambda self: None if self.pairs else tuple(TYPES), takes_self=True),
        shown='["I", "II", "III"]',
        help="the paper's collision types: (r_i, r_j) = I (16.41, 23.02), "
        "II (4.95, 23.02), III (4.62, 4.95) µm",
    )
    weight: str | None = WEIGHT
    min_radius: float | None = size_limit("least", only_for=("pairs", MEASURED))
    max_radius: float | None = size_limit("largest", only_for=("pairs", MEASURED))
    classes: int | tuple[float, ...] | None = CLASSES
    time_limit: float | str = word_or_quantity(
        "auto",
        "s",
        above=0.0,
        default="auto",
        help="simulated time after which a replicate ends undecided",
    )

    meeting: Any = attrs.field(init=False, default="")
    delta: Any = attrs.field(init=False, default=(0.0,))
    delta_max: Any = attrs.field(init=False, default="projected")
    receiver: Any = attrs.field(init=False, default="free")
    start_gap: Any = attrs.field(init=False, default=2e-6)
    escape_gap: Any = attrs.field(init=False, default="start_gap")
    rest_time: Any = attrs.field(init=False, default="auto")
    rate: Any = attrs.field(init=False, default=None)
    release: Any = attrs.field(init=False, default=None)
    escape: Any = attrs.field(init=False, default=None)

    far = 0.0
    """Share of the speed that forces may make at an automatic start: of rates alone."""

    flow_in_fluid = ""
    """Why [fluid] may have no flow of its own; "" where it may."""

    takes_outlines = False
    """Whether forces may act all along the outlines."""

    def __attrs_post_init__(self):
        if not self.is_measured:
            return
        low, high = self.min_radius or 0.0, self.max_radius or LARGEST_LENGTH
        if low >= high:
            raise ConfigError(
                f"min_radius = {low:g} m is not below max_radius = {high:g} m: no floc lies "
                "between them"
            )
        borders = self.classes if isinstance(self.classes, tuple) else ()
        if list(borders) != sorted(borders) or any(not low < each < high for each in borders):
            raise ConfigError(
                "classes must be ascending radii between min_radius and max_radius, found "
                f"{', '.join(f'{micrometres(each)} um' for each in borders)}"
            )
        count = len(self.class_labels)
        if count > MOST_CLASSES:
            raise ConfigError(f"there may be at most {MOST_CLASSES} classes, found {count}")

    def meeting_of(self, place: int) -> str:
        """What brings the bodies of the collision type at a place of `names` together."""
        return self.meeting

    @property
    def is_measured(self) -> bool:
        """Whether pairs are drawn from the measured distribution of a library."""
        return self.pairs == MEASURED

    @property
    def given(self) -> tuple[tuple[str, tuple[float, float]], ...]:
        """(name, (r_i, r_j) [m]) of every collision type or pair of radii, in the config's order.

        A pair is called "16.41um-23.02um". None where pairs are measured.
        """
        if isinstance(self.pairs, str):
            return ()
        if self.pairs:
            return tuple((f"{micrometres(i)}um-{micrometres(j)}um", (i, j)) for i, j in self.pairs)
        return tuple((name, TYPES[name]) for name in self.types or ())

    @property
    def class_labels(self) -> tuple[str, ...]:
        """The names of the size classes of measured flocs, the smallest first."""
        if not isinstance(self.classes, tuple):
            return tuple(f"q{place}" for place in range(1, (self.classes or 1) + 1))
        words = [micrometres(each) for each in self.classes]
        inner = [f"{low}to{high}um" for low, high in itertools.pairwise(words)]
        return (f"to{words[0]}um", *inner, f"from{words[-1]}um")

    @property
    def class_pairs(self) -> tuple[tuple[int, int], ...]:
        """Places of the two size classes of every pair of them that is a collision type."""
        places = range(len(self.class_labels))
        return tuple(itertools.combinations_with_replacement(places, 2))

    @property
    def names(self) -> tuple[str, ...]:
        """The name of every collision type, pair of radii or pair of size classes, in order."""
        if not self.is_measured:
            return tuple(name for name, _ in self.given)
        labels = self.class_labels
        if len(labels) == 1:
            return (MEASURED,)
        return tuple(f"{labels[a]}-{labels[b]}" for a, b in self.class_pairs)

    def only(self, places: Iterable[int]) -> Self:
        """The scene with the collision types, or pairs, at these places alone.

        Pairs of size classes stay together: there the scene is as it was.
        """
        if isinstance(self.pairs, str):
            return self
        if self.pairs:
            return attrs.evolve(self, pairs=tuple(self.pairs[place] for place in places))
        names = self.types or ()
        return attrs.evolve(self, types=tuple(names[place] for place in places))

    def problems(self, parts: Mapping[str, Any]) -> Iterator[Problem]:
        """What does not go together with the other tables of a config, by their names."""
        yield from outline_problems(parts, settles=self.takes_outlines)
        if shields_clusters(parts["forces"]):
            yield ("forces", "drag", "clusters"), "is for swarms: leave it out"
        for name in ("velocity", "gradient") if self.flow_in_fluid else ():
            if any(getattr(parts["fluid"], name)):
                yield ("fluid", name), f"{self.flow_in_fluid}: leave it out"
        shapes = parts["shapes"]
        if self.is_measured and shapes.source != "library":
            text = '"measured" draws measured flocs, but shapes.source is not a library: '
            text += 'give source = "library" and file, written by `flocsim fit`'
            yield ("scene", "pairs"), text
        elif self.is_measured and shapes.size != "own":
            text = 'scene.pairs = "measured", which takes every floc at its own size: leave size '
            yield ("shapes", "size"), f'"{shapes.size}" cannot be combined with {text}out'


@attrs.frozen
class DrivenScene(PairScene):
    """Two bodies that are driven together, and how their meeting begins and ends."""

    delta: tuple[float, ...] = read_by(
        list_of(number("", *number_range(at_least=0.0)), "a list of fractions such as [0.0, 0.5]"),
        "a list of distinct numbers, each at least 0",
        default=(0.0, 0.25, 0.5, 0.75, 1.0),
        help="horizontal displacements of the centres, as fractions of δ_max",
    )
    delta_max: str = choice(
        "projected",
        "radius",
        default="projected",
        help="δ_max: projected, the sum of the facing horizontal half-extents at the drawn "
        "orientations (at 1 the outlines just graze), or radius, R_i + R_j, the largest "
        "centroid-to-outline distances (at 1 two spheres just graze; no other pair would touch in "
        "a straight fall, but attraction may draw it together)",
    )
    start_gap: float = quantity(
        "m",
        above=0.0,
        at_most=LARGEST_LENGTH,
        default=2e-6,
        help="distance of the outlines at the start",
    )
    escape_gap: float | str = word_or_quantity(
        "start_gap",
        "m",
        above=0.0,
        default="start_gap",
        help="a pair that has touched, is farther apart than this and is separating has departed",
    )
    rest_time: float | str = word_or_quantity(
        "auto",
        "s",
        above=0.0,
        default="auto",
        help="how long a doublet must keep its pose to count as bound",
    )


@attrs.frozen
class SettlingScene(DrivenScene):
    """[scene]: who meets whom, and how the meeting begins and ends."""

    meeting: str = one_tag(
        SETTLING,
        of=MEETINGS,
        help="what brings the two together. settling: their weight, the faster comes from above; "
        "shear, u = (G y, 0), or extension, u = (s x, -s y): a flow alone, without weight, where δ "
        "is the distance to which the centres would approach each other, as a fraction of "
        "R_i + R_j; brownian: thermal motion alone, without weight: released at a distance "
        "`release`, in any direction, they either touch, or miss each other once they are `escape` "
        "apart; needs [forces.thermal]",
    )
    receiver: str = choice(
        "free", "fixed", default="free", help="whether the receiving body i settles or is fixed"
    )

    takes_outlines = True


@attrs.frozen
class FlowScene(DrivenScene):
    """With `meeting = "shear"` or `"extension"` a flow alone brings bodies together; there is no
    key `receiver` then, but there is this one:"""

    meeting: str = choice(*FLOWS, default=SHEAR, help="the flow, see above")
    rate: float = quantity(
        "1/s",
        above=0.0,
        shown="none",
        help="G or s of the flow; needed",
        kw_only=True,
        as_in=', how fast the flow shears or stretches, as in rate = "10 1/s"',
    )

    flow_in_fluid = (
        "adds to the flow of scene.meeting, along which bodies come from far away; in a flow that "
        "turns faster than it strains all paths are closed, so that none do"
    )

    def problems(self, parts: Mapping[str, Any]) -> Iterator[Problem]:
        yield from super().problems(parts)
        if self.meeting == SHEAR and thermal_in(parts["forces"]):
            text = (
                '"shear" never ends with [forces.thermal]: across a shear flow kicks bring a pair '
                'back from any distance, so that no pair departs; give "extension", "settling" '
                'or "brownian", or leave forces.thermal out'
            )
            yield ("scene", "meeting"), text


@attrs.frozen
class BrownianScene(PairScene):
    """With `meeting = "brownian"` two bodies meet, or miss each other, by thermal motion alone; of
    the keys above only those of sizes and `time_limit` apply, and these:"""

    meeting: str = choice(BROWNIAN, default=BROWNIAN, help="thermal motion alone, see above")
    release: float = quantity(
        "",
        above=1.0,
        default=2.0,
        help="distance of the centres at the start, over r_i + r_j; there "
        "the outlines must not overlap at any angle",
    )
    escape: float = quantity(
        "",
        above=1.0,
        default=4.0,
        help="distance of the centres, over r_i + r_j, at which a pair has missed, or departed",
    )

    flow_in_fluid = "would carry the bodies, which thermal motion alone must move"

    def __attrs_post_init__(self):
        super().__attrs_post_init__()
        if not self.release < self.escape:
            raise ConfigError(
                f"release = {self.release:g} must be below escape = {self.escape:g}: bodies are "
                "released inside the distance at which they have missed"
            )

    def problems(self, parts: Mapping[str, Any]) -> Iterator[Problem]:
        yield from super().problems(parts)
        if not thermal_in(parts["forces"]):
            text = '"brownian" needs kicks: add [forces.thermal], with a temperature above 0 K'
            yield ("scene", "meeting"), text


PAIR_SCENES = {
    SETTLING: SettlingScene,
    SHEAR: FlowScene,
    EXTENSION: FlowScene,
    BROWNIAN: BrownianScene,
}
"""`[scene] meeting` → class."""


def micrometres(length: float) -> str:
    """A length [m] in µm, with just the digits that it has: 16.41e-6 → "16.41"."""
    return format(Decimal(repr(float(length))).scaleb(6).normalize(), "f")
