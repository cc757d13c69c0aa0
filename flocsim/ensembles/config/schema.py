"""The schema of a config file: one attrs class per table, and Config, which holds them all.

To add a key, add an attribute here, and nothing else: its name is the key, its metadata say what
it takes (flocsim.fields, and ``read_by`` of values.py for what those cannot say). The loader reads
it, its messages name it, `--set` sets it, and `python docs/schema_tables.py` writes it into
docs/config.md. A new table is a class here and an attribute of Config. Keys that exclude each
other stand in ALTERNATIVES and INSTEAD_OF, what is checked between tables in ``contradictions``.
Metadata of this schema alone: ``shown`` is the default where it depends on other keys, ``only_for``
the one source of flocs that a key goes with; ``beside_class`` marks keys that stay where a class is
named.
"""

import itertools
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any

import attrs

from flocsim.body import Fluid
from flocsim.ensembles.config.own_classes import (
    INTEGRATOR,
    SHAPE,
    check_integrator,
    check_shape,
    full_name,
    named_class,
)
from flocsim.ensembles.config.presets import PRESETS
from flocsim.ensembles.config.values import (
    count_or,
    list_of,
    number,
    one_of,
    read_by,
    read_text,
    vector,
    whole,
    whole_field,
    word_or,
)
from flocsim.errors import ConfigError
from flocsim.fields import choice, number_range, quantity, word_or_quantity
from flocsim.forces import (
    Contact,
    DoubleLayer,
    Gravity,
    Lubrication,
    StokesDrag,
    Thermal,
    VanDerWaals,
)
from flocsim.forces.base import Force
from flocsim.forces.thermal import thermal_in
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators import (
    BackwardEuler,
    DormandPrince54,
    Implicit,
    Integrator,
    Overdamped,
    VelocityVerlet,
)

LARGEST_LENGTH = 0.01
"""[m] Upper limit of sizes: a larger one is a length in µm whose unit was forgotten."""

TYPES = {"I": (16.41e-6, 23.02e-6), "II": (4.95e-6, 23.02e-6), "III": (4.62e-6, 4.95e-6)}
"""Equivalent radii (receiving, approaching) [m] of the paper's three types of collision."""


def unless_own(value: Any, of_own: Callable[[Any], Any] = lambda own: None) -> Any:
    """A default: the value, or what follows from the user's own object where there is one."""
    return attrs.Factory(
        lambda self: value if self.own is None else of_own(self.own), takes_self=True
    )


MEASURED = "measured"
"""Value of `[scene] pairs`, and the name of the one collision type that it makes by itself."""

MOST_CLASSES = 20


def of_measured(value: Any) -> Any:
    """A default where pairs are measured; None elsewhere."""
    return attrs.Factory(lambda self: value if self.pairs == MEASURED else None, takes_self=True)


SETTLING, SHEAR, EXTENSION = MECHANISMS = ("settling", "shear", "extension")
"""What drives two bodies together: their weight, or a flow u = (G y, 0) or u = (s x, −s y)."""

FLOWS = (SHEAR, EXTENSION)

BROWNIAN = "brownian"
"""Thermal motion alone brings two bodies together, or does not."""

MEETINGS = (*MECHANISMS, BROWNIAN)


def of_brownian(value: Any, otherwise: Any = None) -> Any:
    """A default where thermal motion alone brings bodies together, and elsewhere."""
    return attrs.Factory(
        lambda self: value if self.meeting == BROWNIAN else otherwise, takes_self=True
    )


def check_rate(meetings: Collection[str], rate: float | None) -> None:
    """ConfigError where a flow has no rate, or a rate no flow."""
    flows = [each for each in meetings if each in FLOWS]
    if flows and rate is None:
        raise ConfigError(
            f'meeting = "{flows[0]}" needs rate, how fast the flow shears or stretches, as in '
            'rate = "10 1/s"'
        )
    if rate is not None and not flows:
        raise ConfigError(
            f'rate is that of a flow, but meeting is "{next(iter(meetings))}": give "shear" or '
            '"extension", or remove rate'
        )


@attrs.frozen
class SceneConfig:
    """[scene]: who meets whom, and how the meeting begins and ends."""

    kind: str = choice(
        "binary",
        default="binary",
        help='encounters of two bodies; "swarm": many bodies in a box, "kernel": rates of '
        "encounters, with keys of their own below",
    )
    meeting: str = choice(
        *MEETINGS,
        default=SETTLING,
        help="what brings the two together: settling, the faster from above; or a flow alone, "
        "their weight left out: shear, u = (G y, 0), or extension, u = (s x, -s y), in which δ is "
        "how near the centres would come to each other, as a share of R_i + R_j; or thermal motion "
        "alone, brownian, their weight left out: let go `release` apart, in any direction, they "
        "touch, or miss each other once they are `escape` apart; needs [forces.thermal]",
    )
    rate: float | None = quantity(
        "1/s", above=0.0, default=None, help="G or s of a flow in which they meet"
    )
    release: float | None = quantity(
        "",
        above=1.0,
        default=of_brownian(2.0),
        shown="2.0",
        help="in a brownian meeting: distance of the centres at the start, over r_i + r_j; there "
        "outlines of any angle have to be clear of each other",
    )
    escape: float | None = quantity(
        "",
        above=1.0,
        default=of_brownian(4.0),
        shown="4.0",
        help="in a brownian meeting: distance of the centres, over r_i + r_j, at which a pair has "
        "missed, or departed",
    )
    pairs: tuple[tuple[float, float], ...] | str | None = read_by(
        word_or(
            MEASURED,
            list_of(
                vector(2, "m", above=0.0, at_most=LARGEST_LENGTH),
                "a list of pairs such as [['16.41 um', '23.02 um']], or 'measured'",
            ),
        ),
        'a list of pairs [r_i, r_j], each above 0 and at most 0.01, or "measured"',
        default=None,
        unit="m",
        help="equivalent radii (receiving, approaching), instead of `types`; measured: two flocs "
        "of the library are drawn from all, each at its own size, the faster of the two approaches",
    )
    types: tuple[str, ...] | None = read_by(
        list_of(one_of(tuple(TYPES)), "a list of 'I', 'II', 'III'"),
        'a list of "I", "II", "III"',
        default=attrs.Factory(lambda self: None if self.pairs else tuple(TYPES), takes_self=True),
        shown='["I", "II", "III"]',
        help="the paper's collision types: (r_i, r_j) = I (16.41, 23.02), "
        "II (4.95, 23.02), III (4.62, 4.95) µm",
    )
    weight: str | None = choice(
        "number",
        "area",
        "volume",
        default=of_measured("number"),
        shown='"number"',
        only_measured=True,
        help="how often a measured floc is drawn: number, each alike; area, in proportion to its "
        "area, the volume of a floc in the plane; volume, to r_eq³, that of equivalent spheres, as "
        "laser diffraction and Coulter counters give it",
    )
    min_radius: float | None = quantity(
        "m",
        above=0.0,
        at_most=LARGEST_LENGTH,
        default=None,
        only_measured=True,
        help="least r_eq of the measured flocs that are drawn; none: of all",
    )
    max_radius: float | None = quantity(
        "m",
        above=0.0,
        at_most=LARGEST_LENGTH,
        default=None,
        only_measured=True,
        help="largest r_eq of the measured flocs that are drawn; none: of all",
    )
    classes: int | tuple[float, ...] | None = read_by(
        count_or(
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
        only_measured=True,
        help="size classes of the measured flocs, each pair of which is a collision type: so many, "
        "of equal weight (`q1` of the smallest to `q2`, …), or the r_eq between them (`to10um`, "
        "`10to20um`, `from20um`)",
    )
    delta: tuple[float, ...] = read_by(
        list_of(number("", *number_range(at_least=0.0)), "a list of fractions such as [0.0, 0.5]"),
        "a list of distinct numbers, each at least 0",
        default=of_brownian((0.0,), (0.0, 0.25, 0.5, 0.75, 1.0)),
        shown="[0.0, 0.25, 0.5, 0.75, 1.0]",
        help="horizontal displacements of the centres, as fractions of δ_max",
    )
    delta_max: str = choice(
        "projected",
        "radius",
        default="projected",
        help="δ_max: the facing horizontal half-extents at the drawn orientations (1 just grazes), "
        "or R_i + R_j, the largest centroid-to-outline distances (beyond any touch in a straight "
        "fall; at 1 two spheres just graze, and attraction may draw any pair together)",
    )
    receiver: str = choice(
        "free", "fixed", default="free", help="whether the receiving body i settles or is held"
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
        help="a pair that touched and is further apart than this, and parting, has departed",
    )
    rest_time: float | str = word_or_quantity(
        "auto",
        "s",
        above=0.0,
        default="auto",
        help="how long a doublet must rest as a rigid body to count as bound",
    )
    time_limit: float | str = word_or_quantity(
        "auto",
        "s",
        above=0.0,
        default="auto",
        help="simulated time after which a replicate ends undecided",
    )

    def __attrs_post_init__(self):
        check_rate(self.meetings, self.rate)
        self.check_brownian()
        if self.meetings != (SETTLING,) and self.receiver == "fixed":
            raise ConfigError(
                'receiver = "fixed" goes with meeting = "settling": a body that is held is met by '
                "others, and otherwise, than one that a flow or thermal motion carries along"
            )
        if not self.is_measured:
            for field in attrs.fields(type(self)):
                given = getattr(self, field.name)
                if field.metadata.get("only_measured") and given is not None:
                    raise ConfigError(
                        f'{field.name} goes with pairs = "measured", which draws measured flocs: '
                        "remove it or give that"
                    )
            return
        low, high = self.min_radius or 0.0, self.max_radius or LARGEST_LENGTH
        if low >= high:
            raise ConfigError(
                f"min_radius = {low:g} m is not below max_radius = {high:g} m: no floc is between"
            )
        borders = self.classes if isinstance(self.classes, tuple) else ()
        if list(borders) != sorted(borders) or any(not low < each < high for each in borders):
            raise ConfigError(
                "classes must be ascending radii between min_radius and max_radius, found "
                f"{', '.join(f'{micrometres(each)} um' for each in borders)}"
            )
        count = len(self.class_labels)
        if count > MOST_CLASSES:
            raise ConfigError(f"classes may be {MOST_CLASSES} at most, found {count}")

    def check_brownian(self) -> None:
        """ConfigError where keys of brownian meetings are given to others, or the other way."""
        if self.meeting != BROWNIAN:
            for name in ("release", "escape"):
                if getattr(self, name) is not None:
                    raise ConfigError(f'{name} goes with meeting = "brownian": remove it')
            return
        assert self.release is not None and self.escape is not None
        if not self.release < self.escape:
            raise ConfigError(
                f"release = {self.release:g} must be below escape = {self.escape:g}: bodies are "
                "let go nearer than where they have missed"
            )
        fields: Any = attrs.fields_dict(type(self))
        for name in ("delta", "delta_max", "start_gap", "escape_gap", "rest_time"):
            default = (0.0,) if name == "delta" else fields[name].default
            if getattr(self, name) != default:
                raise ConfigError(
                    f"{name} is for bodies that are driven together: in a brownian meeting they "
                    "are let go at release, in any direction, until they are escape apart; remove "
                    "it"
                )

    @property
    def meetings(self) -> tuple[str, ...]:
        """All that brings bodies together in this scene, of MEETINGS."""
        return (self.meeting,)

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

    def only(self, places: Iterable[int]) -> "SceneConfig":
        """The scene with the collision types, or pairs, at these places alone.

        Pairs of size classes stay together: there the scene is as it was.
        """
        if isinstance(self.pairs, str):
            return self
        if self.pairs:
            return attrs.evolve(self, pairs=tuple(self.pairs[place] for place in places))
        names = self.types or ()
        return attrs.evolve(self, types=tuple(names[place] for place in places))


def micrometres(length: float) -> str:
    """A length [m] in µm, with just the digits that it has: 16.41e-6 → "16.41"."""
    return format(Decimal(repr(float(length))).scaleb(6).normalize(), "f")


ESTIMATES = ("pr_inside", "pr_a_given_inside", "pr_a_given_outside", "pr_a")


@attrs.frozen
class StopConfig:
    """[stop]: when to end before all `replicates` are run.

    With `half_width`, the rule looks at fixed numbers of replicates (`least`, then 5/4 as many
    each time), the same for any number of ranks, and the study ends at the first at which the 95 %
    interval of every estimate in every condition is narrow enough. A condition without events
    holds nothing up. As any sequential rule, it makes intervals cover a little less often than
    they say.
    """

    half_width: float | None = quantity(
        "",
        above=0.0,
        at_most=0.5,
        default=None,
        help="largest half-width of the 95 % intervals; none: run all",
    )
    of: tuple[str, ...] = read_by(
        list_of(one_of(ESTIMATES), "a list of estimates"),
        f"a list of {', '.join(ESTIMATES)}",
        default=("pr_inside", "pr_a"),
        help="the estimates whose intervals count",
    )
    least: int = whole_field(
        1, 10**9, default=100, help="replicates after which the rule first looks"
    )
    failed: float = quantity(
        "",
        at_least=0.0,
        at_most=1.0,
        default=0.1,
        help="share of all replicates that may fail; a study of more is given up, exit code 70",
    )


LARGEST_SEED = 2**63 - 1
MOST_REPLICATES = 10**9
MOST_STEPS = 10**12
MOST_VERTICES = 512


@attrs.frozen
class ShapesConfig:
    """[shapes]: the flocs that collide."""

    own: Shape | None = attrs.field(
        default=None,
        kw_only=True,
        metadata=named_class(
            SHAPE,
            "a shape of your own instead of a `source`, the same for both bodies, scaled to "
            "their sizes; its parameters are further keys, and of those here only `vertices` goes "
            "with it",
        ),
    )
    source: str | None = choice(
        "synthetic",
        "library",
        default=unless_own("synthetic"),
        shown='"synthetic"',
        help="grown by flocsim, or fitted to images",
    )
    file: str | os.PathLike | None = attrs.field(
        default=None,
        metadata={
            "read": read_text,
            "allowed": "a path, relative to the config file",
            "help": 'shape library that `flocsim fit` wrote, or "synthetic", the one that ships '
            'with flocsim (24 grown flocs at N = 4, 8, 16, 32, 64); with source = "library" only',
            "only_for": "library",
        },
    )
    vertices: tuple[int, ...] = read_by(
        list_of(whole(1, MOST_VERTICES), "a list of integers such as [1, 4, 16]"),
        f"a list of distinct integers from 1 to {MOST_VERTICES}",
        default=unless_own((1, 4, 16, 64), lambda own: (len(own.vertices),)),
        shown="[1, 4, 16, 64]",
        beside_class=True,
        help="N, numbers of vertices of the spheropolygons; 1 is the equivalent sphere",
    )
    radius: float = quantity(
        "m",
        above=0.0,
        at_most=LARGEST_LENGTH,
        default=1e-6,
        help="spheroradius r of the flocs once they are resized",
    )
    pool: int = whole_field(
        1,
        10**6,
        default=10,
        help="number of flocs, nearest in size-to-spheroradius ratio, from which each replicate "
        "draws its two",
    )
    size: str = choice(
        "scene",
        "own",
        default="scene",
        help="scene: every floc is resized to the radius that its collision type asks for; own: it "
        "keeps the size at which it was measured, its spheroradius with it, and is drawn from the "
        '`pool` flocs nearest to that radius, or as `scene.pairs = "measured"` says, which '
        "implies it; the faster of the two approaches",
        only_for="library",
    )
    pairs_alike_in: str = choice(
        "vertices",
        "error",
        default="vertices",
        help="vertices: both flocs have N vertices; error: the receiver has that number of "
        "vertices, of those it was fitted with, whose relative error RE is nearest to that of the "
        "approaching floc with N",
    )
    fractal_dimension: float = quantity(
        "",
        at_least=1.2,
        at_most=1.95,
        default=1.8,
        only_for="synthetic",
        help="of the synthetic flocs, in the plane",
    )
    primary_particles: int = whole_field(
        2, 2000, default=60, only_for="synthetic", help="number in each synthetic floc"
    )

    def __attrs_post_init__(self):
        if self.own is not None:
            check_shape(self.own)
            known = (1, len(self.own.vertices))
            for count in self.vertices:
                if count not in known:
                    raise ConfigError(
                        f"vertices may be 1, the equivalent sphere, and {known[1]}, the core "
                        f"points of {full_name(self.own)}, found {count}"
                    )
        if self.source == "library" and self.file is None:
            raise ConfigError(
                'source = "library" needs file, the shape library that `flocsim fit` wrote'
            )
        if self.size == "own" and self.source != "library":
            raise ConfigError(
                'size = "own" goes with source = "library", whose flocs were measured: leave size '
                "out or change source"
            )
        if self.pairs_alike_in == "error" and self.own is not None:
            raise ConfigError(
                f'pairs_alike_in = "error" cannot be: {full_name(self.own)} was not fitted to a '
                "floc; leave pairs_alike_in out"
            )
        if self.source == "synthetic" and self.file is not None:
            raise ConfigError(
                'file goes with source = "library", but source is "synthetic": remove file or '
                "change source"
            )

    @property
    def label(self) -> str:
        """The source, or the name of the user's own class."""
        return self.source or full_name(self.own)


@attrs.frozen
class BodiesConfig:
    """[bodies]: what the flocs weigh; either ``surface_density``, or ``density`` and ``depth``."""

    surface_density: float | None = quantity(
        "kg/m^2", above=0.0, default=None, help="ρ_s: mass m = ρ_s A, A the floc's area"
    )
    density: float | None = quantity(
        "kg/m^3", above=0.0, default=None, help="ρ of the solid: ρ_s = ρ · depth"
    )
    depth: float | str = word_or_quantity(
        "sphere",
        "m",
        above=0.0,
        default="sphere",
        help='thickness of the flocs; "sphere" = 4/3 r_eq, the mass of the equivalent sphere',
    )

    def __attrs_post_init__(self):
        if (self.surface_density is None) == (self.density is None):
            raise ConfigError(
                "needs either surface_density [kg/m^2], or density [kg/m^3] with depth: add e.g. "
                "surface_density = 2.0 (the paper's weights), or density = 2650.0"
            )


@attrs.frozen
class ZoneConfig:
    """[zone]: the attraction zone d_c < D_0; one of ``root``, ``distance`` and ``centre``."""

    distance: float | None = quantity(
        "m", at_least=0.0, default=None, help="d_0: D_0 = r_i + r_j + d_0"
    )
    centre: float | None = quantity("m", above=0.0, default=None, help="D_0 itself")
    root: str | None = choice(
        "inner",
        "outer",
        default=attrs.Factory(
            lambda self: "outer" if self.distance is None and self.centre is None else None,
            takes_self=True,
        ),
        shown='"outer"',
        help="d_0 is this root of attraction = repulsion; it must exist",
    )


METHODS: dict[str, type] = {
    "implicit": Implicit,
    "dormand_prince54": DormandPrince54,
    "overdamped": Overdamped,
    "velocity_verlet": VelocityVerlet,
    "backward_euler": BackwardEuler,
}
"""Name of an integrator in a config → class; each takes those keys of [integrator] that it has."""


@attrs.frozen
class IntegratorConfig:
    """[integrator]: how time goes on."""

    own: Integrator | None = attrs.field(
        default=None,
        kw_only=True,
        metadata=named_class(
            INTEGRATOR,
            "an integrator of your own instead of a `name`; its parameters are further keys, and "
            "of those here only `max_steps` goes with it",
        ),
    )
    name: str | None = choice(
        *METHODS,
        default=unless_own("implicit"),
        shown='"implicit"',
        help="the method: see `flocsim.integrators`",
    )
    accuracy: str | None = choice(
        "auto",
        default=None,
        help="instead of a `name` and a `tolerance`: a pilot tries methods and tolerances on up to "
        "900 replicates before the first, and takes for every collision type the cheapest whose "
        "flips it expects to stay below a fifth of the sampling error that so many `replicates` "
        "leave; the results file holds what was taken and why",
    )
    tolerance: float = quantity(
        "m", above=0.0, default=1e-9, help="largest error of a step, what it leads to included"
    )
    max_steps: int = whole_field(
        1,
        MOST_STEPS,
        default=200_000,
        beside_class=True,
        help="steps after which a replicate ends undecided; of a swarm, those that an island may "
        "try from one common time to the next, of more than 50 bodies 50 times so many over its "
        "bodies",
    )
    step: float | None = quantity(
        "s", above=0.0, default=None, help="for methods with a fixed step"
    )
    check_share: float | str = word_or_quantity(
        "auto",
        "",
        at_least=0.0,
        at_most=1.0,
        default="auto",
        beside_class=True,
        help="share of the replicates that are run again at a 100 times tighter tolerance (a fixed "
        "step: at a quarter of it); the outcomes that change are the numerical error of the "
        'probabilities. "auto": of n replicates 1.96 √(n + 3.84) − 3.84, which makes the interval '
        "of a flip rate of 0 as narrow as a sampling interval, and at least 1 %; 0: none",
    )

    def __attrs_post_init__(self):
        if self.own is not None:
            check_integrator(self.own)
        if self.name == "velocity_verlet" and self.step is None:
            raise ConfigError(
                'name = "velocity_verlet" needs integrator.step, the fixed step in seconds'
            )

    @property
    def label(self) -> str:
        """The name, or that of the user's own class."""
        return self.name or full_name(self.own)

    @property
    def is_chosen(self) -> bool:
        """Whether a pilot chooses the method of every collision type (flocsim.ensembles.pilot)."""
        return self.accuracy is not None

    @property
    def method(self) -> Integrator:
        """The method; where a pilot is to choose it, one that stands in for what it chooses."""
        if self.own is not None:
            return self.own
        made = METHODS[self.name or "implicit"]
        keys = attrs.fields_dict(type(self)).keys() & attrs.fields_dict(made).keys()
        return made(**{key: getattr(self, key) for key in keys})


@attrs.frozen
class OutputConfig:
    """[output]: where the results go."""

    file: str = read_by(
        read_text,
        "a string",
        default="study.h5",
        shown='"study.h5"',
        help="results file, relative to the current folder; the default has the config's name",
    )


@attrs.frozen(eq=False)
class Config:
    """A whole config file, checked, with the preset's values filled in. SI units.

    ``forces`` (Force objects) and ``force_names`` go in step: gravity, drag, van_der_waals,
    double_layer, contact, then the user's own as in the file. ``text`` is the file's source and
    ``folder`` where it lies; ``overrides`` what was laid over it.
    """

    preset: str | None = choice(*PRESETS, default=None, help="values that lie under the file's own")
    seed: int = whole_field(0, LARGEST_SEED, default=1, help="of all random numbers")
    replicates: int = whole_field(
        1, MOST_REPLICATES, default=100, help="pairs of orientations drawn per condition"
    )
    scene: SceneConfig = attrs.Factory(SceneConfig)
    shapes: ShapesConfig = attrs.Factory(ShapesConfig)
    bodies: BodiesConfig = attrs.field(kw_only=True)
    fluid: Fluid = attrs.Factory(Fluid)
    forces: tuple[Force, ...] = attrs.field(kw_only=True)
    force_names: tuple[str, ...] = attrs.field(kw_only=True)
    zone: ZoneConfig = attrs.Factory(ZoneConfig)
    integrator: IntegratorConfig = attrs.Factory(IntegratorConfig)
    stop: StopConfig = attrs.Factory(StopConfig)
    output: OutputConfig = attrs.Factory(OutputConfig)
    text: str = ""
    folder: Path = attrs.Factory(Path)
    overrides: dict[str, Any] = attrs.Factory(dict)

    @property
    def is_swarm(self) -> bool:
        """Whether the scene is a SwarmScene, and the study one of many bodies."""
        return bool(self.scene.kind == "swarm")

    @property
    def is_kernel(self) -> bool:
        """Whether the scene is a KernelScene, and the study one of rates of encounters."""
        return bool(self.scene.kind == "kernel")

    @property
    def body_options(self) -> dict[str, Any]:
        """The bodies' weight as keyword arguments of flocsim.body.Body."""
        if self.bodies.density is None:
            return {"surface_density": self.bodies.surface_density}
        return {"density": self.bodies.density, "depth": self.bodies.depth}


def keys_of(some_class: type) -> dict[str, attrs.Attribute]:
    """Key in the config → attrs field, for all fields that the class is made with."""
    return {
        field.metadata.get("key", field.alias): field
        for field in attrs.fields(some_class)
        if field.init
    }


TABLES = {
    field.name: field.type for field in attrs.fields(Config) if field.type and attrs.has(field.type)
}
"""Name of a top-level table → class; [forces] is read by itself."""

STUDY_KEYS = {key: field for key, field in keys_of(Config).items() if "allowed" in field.metadata}
"""The keys above all tables."""

TOP_KEYS = (*STUDY_KEYS, *TABLES, "forces")

FORCES: dict[str, type] = {
    "gravity": Gravity,
    "drag": StokesDrag,
    "van_der_waals": VanDerWaals,
    "double_layer": DoubleLayer,
    "contact": Contact,
    "lubrication": Lubrication,
    "thermal": Thermal,
}
"""Name of the table [forces.NAME] → class, in the order of Config.forces."""

ALTERNATIVES: dict[str, tuple[set[str], ...]] = {
    "scene": ({"types"}, {"pairs"}),
    "shapes": ({"source"}, {"class"}),
    "bodies": ({"surface_density"}, {"density", "depth"}),
    "zone": ({"root"}, {"distance"}, {"centre"}),
    "integrator": ({"name"}, {"class"}, {"accuracy"}),
}
"""Table → sets of keys that exclude each other: one of them replaces the others from below."""

INSTEAD_OF = {"integrator": {"accuracy": {"tolerance", "step"}}}
"""Table → key → further keys that it excludes, and that go with one another."""


def excluded_by(table: str, given: Collection[str]) -> set[str]:
    """The keys of a table that do not go with the given ones."""
    alternatives = ALTERNATIVES.get(table, ())
    chosen = [keys for keys in alternatives if keys & set(given)]
    found = set().union(*(keys for keys in alternatives if chosen and keys not in chosen))
    for key, others in INSTEAD_OF.get(table, {}).items():
        found |= others if key in given else set()
        found |= {key} if others & set(given) else set()
    return found


def implied(table: Mapping[str, Any]) -> dict[str, Any]:
    """Values that follow from others of a config's nested dicts, where they are not given."""
    scene, shapes = (table.get(name) for name in ("scene", "shapes"))
    found: dict[str, Any] = {}
    if isinstance(scene, Mapping) and scene.get("kind") == "kernel":
        found["replicates"] = KERNEL_REPLICATES
    if not isinstance(scene, Mapping) or not isinstance(shapes, Mapping):
        return found
    if scene.get("pairs") != MEASURED or shapes.get("source") != "library":
        return found
    return found | {"shapes": {"size": "own"}}


KERNEL_REPLICATES = 4096
"""Of every condition of a kernel study where nothing is said."""


def contradictions(parts: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], str]]:
    """(place, what is wrong) of values that do not go together though each is right by itself.

    ``parts``: the tables of a config by name.
    """
    yield from weight_contradictions(parts["bodies"], parts["fluid"])
    yield from flow_contradictions(parts["scene"], parts["fluid"])
    yield from thermal_contradictions(parts["scene"], parts["forces"])
    if parts["scene"].is_measured:
        yield from measured_contradictions(parts["shapes"])


def flow_contradictions(scene: SceneConfig, fluid: Fluid) -> Iterator[tuple[tuple[str, ...], str]]:
    """What of [fluid] does not go with bodies that meet in a flow of their own."""
    if scene.meetings == (SETTLING,) and scene.kind == "binary":
        return
    if scene.meetings == (BROWNIAN,):
        text = "carries bodies along, and thermal motion alone is to move them: leave it out"
        for name in ("velocity", "gradient"):
            if any(getattr(fluid, name)):
                yield ("fluid", name), text
        return
    text = (
        "is another flow than that of scene.meeting, along which bodies come from afar; in a flow "
        "that turns faster than it strains all ways are closed, and none do: leave it out"
    )
    for name in ("velocity", "gradient"):
        if any(getattr(fluid, name)):
            yield ("fluid", name), text


def thermal_contradictions(
    scene: SceneConfig, forces: Iterable[Force]
) -> Iterator[tuple[tuple[str, ...], str]]:
    """What of a scene does not go with thermal motion, or without."""
    warm = bool(thermal_in(forces))
    if scene.meetings == (BROWNIAN,):
        if not warm:
            text = '"brownian" needs kicks: add [forces.thermal], of a temperature above 0 K'
            yield ("scene", "meeting"), text
    elif warm and scene.kind == "kernel":
        text = (
            "brings bodies together from beyond the offsets that a study of rates samples, which "
            "would cut its widths off: leave it out, or let two bodies meet by scene.meeting = "
            '"brownian"'
        )
        yield ("forces", "thermal"), text
    elif warm and SHEAR in scene.meetings:
        text = (
            '"shear" has no end with [forces.thermal]: across a shear flow kicks bring a pair back '
            'from any distance, so that none has departed; give "extension", "settling" or '
            '"brownian", or leave forces.thermal out'
        )
        yield ("scene", "meeting"), text


def measured_contradictions(shapes: ShapesConfig) -> Iterator[tuple[tuple[str, ...], str]]:
    """What of [shapes] does not go with measured pairs."""
    if shapes.source != "library":
        text = '"measured" draws flocs that were measured, but shapes.source is no library: give '
        yield ("scene", "pairs"), text + 'source = "library" and file, which `flocsim fit` wrote'
    elif shapes.size != "own":
        text = 'scene.pairs = "measured", which takes every floc at its own size: leave size out'
        yield ("shapes", "size"), f'"{shapes.size}" does not go with {text}'


def weight_contradictions(
    bodies: BodiesConfig, fluid: Fluid
) -> Iterator[tuple[tuple[str, ...], str]]:
    """What of the bodies' weight does not go with buoyancy."""
    if not fluid.buoyancy:
        return
    if bodies.density is None:
        text = "true needs bodies.density, but bodies.surface_density is given: give density and "
        yield ("fluid", "buoyancy"), text + "depth instead, or buoyancy = false"
    elif bodies.density <= fluid.density:
        text = f"{bodies.density:g} kg/m^3 does not sink in the fluid of {fluid.density:g} kg/m^3: "
        yield ("bodies", "density"), text + "give a larger density, or fluid.buoyancy = false"
