"""[scene] kind = "binary": who meets whom, and how."""

import itertools
import math
from collections.abc import Iterable, Iterator
from decimal import Decimal
from typing import Any, ClassVar

import attrs

from flocsim.ensembles.config import SCENE_WORDS
from flocsim.errors import ConfigError
from flocsim.fields import (
    choice,
    either,
    field,
    number,
    one_of,
    quantity,
    several,
    whole,
    word_or_quantity,
)
from flocsim.forces.body_forces import thermal_forces
from flocsim.forces.drag import shields_clusters
from flocsim.forces.outline import NEEDS_BOTH_SHAPES, needs_both_shapes

LARGEST_LENGTH = 0.01
"""[m] Upper limit of sizes: a larger one is a length in µm whose unit was forgotten."""

SIZE = number("m", above=0.0, at_most=LARGEST_LENGTH)
"""Reader of a size."""

TYPES = {"I": (16.41e-6, 23.02e-6), "II": (4.95e-6, 23.02e-6), "III": (4.62e-6, 4.95e-6)}
"""Equivalent radii (receiving, approaching) [m] of the paper's three types of collision."""

MEASURED = "measured"
"""Value of `[scene] pairs`, and the name of the one collision type that it makes by itself."""

SETTLING, SHEAR, EXTENSION = MECHANISMS = ("settling", "shear", "extension")
"""What drives two bodies together: their weight, or a flow u = (G y, 0) or u = (s x, −s y)."""

FLOWS = (SHEAR, EXTENSION)

BROWNIAN = "brownian"
"""Thermal motion alone brings two bodies together, or does not."""

SOBOL = "sobol"
SOBOL_SCRAMBLES = 16
"""Of studies of pairs: with fewer the intervals are wider, with more the points are less even."""

Problem = tuple[str, str]
"""(dotted key, what is wrong there)"""


def applies(value: Any, words: Iterable[str]) -> bool:
    """Return True if a value, or one of several, is among these words."""
    return any(each in words for each in (value if isinstance(value, list | tuple) else [value]))


def applies_with(
    other: str, *words: str, value: Any = None, elsewhere: Any = ...
) -> dict[str, Any]:
    """Return default and metadata of a key that applies only where another key is one of the words.

    ``value`` is its default there; ``elsewhere`` what the attribute is otherwise (by default the
    same), which may be given there, too.
    """
    elsewhere = value if elsewhere is ... else elsewhere

    def default(self: Any) -> Any:
        return value if applies(getattr(self, other), words) else elsewhere

    return {
        "default": value if value == elsewhere else attrs.Factory(default, takes_self=True),
        "only_for": (other, words, elsewhere),
        "usual": value,
    }


def uneven_points(config: Any, scrambles: int, of_what: str) -> Iterator[Problem]:
    """Yield what does not go with replicates that are points of ``scrambles`` Sobol sequences."""
    points, rest = divmod(config.replicates, scrambles)
    if rest or points < 1 or points & (points - 1):
        least = scrambles << (max(points, 1).bit_length() - 1)
        text = f"must be {of_what} times a power of 2: found {config.replicates}, give {least} or "
        yield "replicates", f"{text}{2 * least}"
    if config.stop.half_width is not None:
        text = "is for independent replicates, not for Sobol points: give more replicates instead"
        yield "stop.half_width", text


def outline_problems(config: Any, *, settles: bool) -> Iterator[Problem]:
    """Yield what does not go with forces along outlines, or by how bodies are turned.

    ``settles``: whether the scene is one of two bodies that settle.
    """
    found = next(filter(needs_both_shapes, config.forces), None)
    if found is None:
        return
    words, advice = NEEDS_BOTH_SHAPES[found.acts_on]
    name = type(found).__name__
    if not settles:
        yield "forces", f"{name} {words}, which only settling pairs can have: {advice}"
    elif thermal_forces(config.forces):
        yield "forces.thermal", f"cannot be combined with {name}, which {words}"


def size_limits(low: float | None, high: float | None) -> tuple[float, float]:
    """Return the least and the largest size that are drawn [m]; ConfigError where none is."""
    low, high = low or 0.0, high or math.inf
    if low >= high:
        raise ConfigError(f"min_radius = {low:g} m is not below max_radius = {high:g} m")
    return low, high


@attrs.frozen
class PairScene:
    """[scene]: which bodies meet, and how an encounter starts and ends."""

    without: ClassVar[frozenset[str]] = frozenset()
    """Tables and keys that such a study has no use for."""

    usual_replicates: ClassVar[int | None] = None
    """Where nothing is said; None for that of the key."""

    kind: str = choice("binary", *SCENE_WORDS, "kernel", default="binary")
    """binary: encounters of two bodies; the other kinds have their own keys, see below."""

    meeting: str | tuple[str, ...] = choice(*MECHANISMS, BROWNIAN, default=SETTLING)
    """What brings the two bodies together. settling: their weight; the faster one comes from above.
    shear, u = (G y, 0), or extension, u = (s x, -s y): a flow without weight; δ is the distance to
    which the centres would approach each other, as a fraction of R_i + R_j. brownian: thermal
    motion without weight; the bodies are released at a distance `release` in a random direction,
    and miss each other if they are `escape` apart before they touch; needs [forces.thermal]."""

    pairs: tuple[tuple[float, float], ...] | str | None = field(
        either(one_of(MEASURED), several(several(SIZE, 2, distinct=False))), default=None
    )
    """Equivalent radii [receiving, approaching], instead of `types`; measured: two flocs are drawn
    from the whole library, each at its own size; the faster of the two approaches."""

    types: tuple[str, ...] | None = field(
        several(one_of(*TYPES)),
        default=attrs.Factory(lambda self: None if self.pairs else tuple(TYPES), takes_self=True),
        usual=tuple(TYPES),
    )
    """The paper's collision types: (r_i, r_j) = I (16.41, 23.02), II (4.95, 23.02), III (4.62,
    4.95) µm."""

    weight: str | None = choice(
        "number",
        "area",
        "volume",
        **applies_with("pairs", MEASURED, value="number", elsewhere=None),
    )
    """How often a measured floc is drawn: number, as often as in its pictures; area, in proportion
    to its area, the volume of a floc in the plane; volume, in proportion to r_eq³, the volume
    of the equivalent sphere, as laser diffraction and Coulter counters report it."""

    min_radius: float | None = field(SIZE, **applies_with("pairs", MEASURED))
    """Smallest r_eq that is drawn; none: no limit."""

    max_radius: float | None = field(SIZE, **applies_with("pairs", MEASURED))
    """Largest r_eq that is drawn; none: no limit."""

    classes: int | tuple[float, ...] | None = field(
        either(whole(1, 20), several(SIZE)),
        **applies_with("pairs", MEASURED, value=1, elsewhere=None),
    )
    """Size classes of the measured flocs, each pair of which is a collision type: their number,
    for classes of equal weight (`q1`, the smallest, `q2`, …), or the r_eq that separate them
    (`to10um`, `10to20um`, `from20um`)."""

    delta: tuple[float, ...] = field(
        several(number(at_least=0.0)),
        **applies_with("meeting", *MECHANISMS, value=(0.0, 0.25, 0.5, 0.75, 1.0), elsewhere=(0.0,)),
    )
    """Horizontal displacements of the centres, as fractions of δ_max."""

    delta_max: str = choice(
        "projected",
        "radius",
        **applies_with("meeting", *MECHANISMS, value="projected"),
    )
    """δ_max: projected, the sum of the facing horizontal half-extents at the drawn orientations
    (at 1 the outlines just graze), or radius, R_i + R_j, the largest centroid-to-outline
    distances (at 1 two spheres just graze; no other pair would touch in a straight fall, but
    attraction may draw it together)."""

    receiver: str = choice("free", "fixed", **applies_with("meeting", SETTLING, value="free"))
    """Whether the receiving body i settles or is fixed."""

    rate: float | None = quantity("1/s", above=0.0, **applies_with("meeting", *FLOWS))
    """G or s of the flow; required."""

    release: float = quantity(
        "", above=1.0, **applies_with("meeting", BROWNIAN, value=2.0, elsewhere=None)
    )
    """Distance of the centres at the start, over r_i + r_j; at this distance the outlines must not
    overlap at any angle."""

    escape: float = quantity(
        "", above=1.0, **applies_with("meeting", BROWNIAN, value=4.0, elsewhere=None)
    )
    """Distance of the centres, over r_i + r_j, at which a pair has missed, or departed."""

    start_gap: float | str = field(SIZE, **applies_with("meeting", *MECHANISMS, value=2e-6))
    """Distance of the outlines at the start."""

    escape_gap: float | str = word_or_quantity(
        "start_gap",
        "m",
        above=0.0,
        **applies_with("meeting", *MECHANISMS, value="start_gap"),
    )
    """A pair that has touched, is farther apart than this and is separating has departed."""

    rest_time: float | str = word_or_quantity(
        "auto",
        "s",
        above=0.0,
        **applies_with("meeting", *MECHANISMS, value="auto"),
    )
    """How long a doublet must keep its pose to count as bound."""

    time_limit: float | str = word_or_quantity("auto", "s", above=0.0, default="auto")
    """Simulated time after which a replicate ends undecided."""

    far = 0.0
    """Share of the speed that forces may make at an automatic start: of rates alone."""

    def __attrs_post_init__(self):
        if self.rate is None and applies(self.meeting, FLOWS):
            raise ConfigError('needs rate, the rate of the flow, as in rate = "10 1/s"')
        if self.meeting == BROWNIAN and not self.release < self.escape:
            raise ConfigError(f"release = {self.release:g} must be below escape = {self.escape:g}")
        if not self.is_measured:
            return
        low, high = size_limits(self.min_radius, self.max_radius)
        borders = self.classes if isinstance(self.classes, tuple) else ()
        if list(borders) != sorted(borders) or any(not low < each < high for each in borders):
            raise ConfigError(
                "classes must be ascending radii between min_radius and max_radius, found "
                f"{', '.join(f'{micrometres(each)} um' for each in borders)}"
            )

    def meeting_of(self, place: int) -> str:
        """Return what brings the bodies of the collision type at a place of `names` together."""
        return str(self.meeting)

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

    def problems(self, config: Any) -> Iterator[Problem]:
        """Yield what does not go together with the other tables of a config."""
        yield from outline_problems(config, settles=self.meeting == SETTLING)
        if shields_clusters(config.forces):
            yield "forces.drag.clusters", "is for swarms: leave it out"
        for name in ("velocity", "gradient") if self.meeting != SETTLING else ():
            if any(getattr(config.fluid, name)):
                text = "would move the bodies in addition to scene.meeting: leave it out"
                yield f"fluid.{name}", text
        kicks = thermal_forces(config.forces)
        if self.meeting == BROWNIAN and not kicks:
            text = '"brownian" needs kicks: add [forces.thermal], with a temperature above 0 K'
            yield "scene.meeting", text
        if self.meeting == SHEAR and kicks:
            text = (
                '"shear" never ends with [forces.thermal]: kicks bring pairs back from any distance'
            )
            yield "scene.meeting", text
        shapes = config.shapes
        if self.is_measured and shapes.source != "library":
            text = '"measured" needs a library of flocs: give shapes.source = "library" and file'
            yield "scene.pairs", text
        elif self.is_measured and shapes.size != "own":
            text = 'must be "own" with scene.pairs = "measured": leave it out'
            yield "shapes.size", text


def micrometres(length: float) -> str:
    """Return a length [m] in µm, with just the digits that it has: 16.41e-6 → "16.41"."""
    return format(Decimal(repr(float(length))).scaleb(6).normalize(), "f")
