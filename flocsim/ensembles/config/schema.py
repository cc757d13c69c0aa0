"""The schema of a config file: one attrs class per table, and Config, which holds them all.

An attribute is a key of the table; its metadata say what it takes (flocsim.fields). The loader
(flocsim.ensembles.config.loader) makes these objects from TOML; docs/config.md is generated from
them.

The table [scene] of a config file.

The table [stop] of a config file: when a study ends before all replicates are run.
"""

from decimal import Decimal
from pathlib import Path

import attrs

from flocsim.body import Fluid
from flocsim.ensembles.config.fields import (
    LARGEST_LENGTH,
    items_reader,
    optional_quantity,
    read_by,
    read_text,
    whole,
    whole_reader,
    word,
)
from flocsim.ensembles.config.presets import PRESETS
from flocsim.ensembles.config.values import number_reader, read_choice, vector_reader
from flocsim.errors import ConfigError
from flocsim.fields import choice, quantity, word_or_quantity

TYPES = {"I": (16.41e-6, 23.02e-6), "II": (4.95e-6, 23.02e-6), "III": (4.62e-6, 4.95e-6)}
"""Equivalent radii (receiving, approaching) [m] of the paper's three types of collision."""


@attrs.frozen
class SceneConfig:
    """[scene]: who meets whom, and how the meeting begins and ends."""

    pairs: tuple = attrs.field(
        default=(),
        metadata={
            "read": items_reader(
                vector_reader(2, "m", above=0.0, at_most=LARGEST_LENGTH),
                "a list of pairs such as [['16.41 um', '23.02 um']]",
            ),
            "allowed": "a list of pairs [r_i, r_j], each above 0 and at most 0.01",
            "unit": "m",
            "shown": "none",
            "help": "equivalent radii (receiving, approaching), instead of `types`",
        },
    )
    types: tuple = attrs.field(
        default=attrs.Factory(lambda self: () if self.pairs else tuple(TYPES), takes_self=True),
        metadata={
            "read": items_reader(
                lambda value: read_choice(value, tuple(TYPES)), "a list of 'I', 'II', 'III'"
            ),
            "allowed": 'a list of "I", "II", "III"',
            "shown": '["I", "II", "III"]',
            "help": "the paper's collision types: (r_i, r_j) = I (16.41, 23.02), "
            "II (4.95, 23.02), III (4.62, 4.95) µm",
        },
    )
    delta: tuple = read_by(
        items_reader(number_reader("", at_least=0.0), "a list of fractions such as [0.0, 0.5]"),
        "a list of distinct numbers, each at least 0",
        default=(0.0, 0.25, 0.5, 0.75, 1.0),
        help="horizontal displacements of the centres, as fractions of δ_max",
    )
    delta_max: str = choice(
        "projected",
        "radius",
        default="projected",
        help="δ_max: the facing horizontal half-extents at the drawn orientations (1 just grazes), "
        "or R_i + R_j, the largest centroid-to-outline distances (1 always misses)",
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

    @property
    def conditions(self):
        """(name, r_i, r_j) [-, m, m] of every collision type or pair, in the config's order."""
        if self.pairs:
            return tuple((pair_name(*pair), *pair) for pair in self.pairs)
        return tuple((name, *TYPES[name]) for name in self.types)


def pair_name(radius_i, radius_j):
    """ "16.41um-23.02um", of radii in metres."""
    return f"{micrometres(radius_i)}um-{micrometres(radius_j)}um"


def micrometres(length):
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

    half_width: float | None = optional_quantity(
        "", above=0.0, at_most=0.5, help="largest half-width of the 95 % intervals; none: run all"
    )
    of: tuple = read_by(
        items_reader(lambda value: read_choice(value, ESTIMATES), "a list of estimates"),
        f"a list of {', '.join(ESTIMATES)}",
        default=("pr_inside", "pr_a"),
        help="the estimates whose intervals count",
    )
    least: int = whole(1, 10**9, default=100, help="replicates after which the rule first looks")
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

    source: str = choice(
        "synthetic", "library", default="synthetic", help="grown by flocsim, or fitted to images"
    )
    file: Path | None = attrs.field(
        default=None,
        converter=attrs.converters.optional(Path),
        metadata={
            "read": read_text,
            "allowed": "a path, relative to the config file",
            "shown": "none",
            "help": 'shape library that `flocsim fit` wrote; with source = "library" only',
        },
    )
    vertices: tuple = read_by(
        items_reader(whole_reader(1, MOST_VERTICES), "a list of integers such as [1, 4, 16]"),
        f"a list of distinct integers from 1 to {MOST_VERTICES}",
        default=(1, 4, 16, 64),
        help="N, numbers of vertices of the spheropolygons; 1 is the equivalent sphere",
    )
    radius: float = quantity(
        "m", above=0.0, at_most=LARGEST_LENGTH, default=1e-6, help="spheroradius r"
    )
    pool: int = whole(
        1,
        10**6,
        default=10,
        help="number of flocs, nearest in size-to-spheroradius ratio, from which each replicate "
        "draws its two",
    )
    fractal_dimension: float = quantity(
        "", at_least=1.2, at_most=1.95, default=1.8, help="of the synthetic flocs, in the plane"
    )
    primary_particles: int = whole(2, 2000, default=60, help="number in each synthetic floc")

    def __attrs_post_init__(self):
        if self.source == "library" and self.file is None:
            raise ConfigError(
                'source = "library" needs file, the shape library that `flocsim fit` wrote'
            )
        if self.source == "synthetic" and self.file is not None:
            raise ConfigError(
                'file goes with source = "library", but source is "synthetic": remove file or '
                "change source"
            )


@attrs.frozen
class BodiesConfig:
    """[bodies]: what the flocs weigh; either ``surface_density``, or ``density`` and ``depth``."""

    surface_density: float | None = optional_quantity(
        "kg/m^2", above=0.0, help="ρ_s: mass m = ρ_s A, A the floc's area"
    )
    density: float | None = optional_quantity(
        "kg/m^3", above=0.0, help="ρ of the solid: ρ_s = ρ · depth"
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

    distance: float | None = optional_quantity("m", at_least=0.0, help="d_0: D_0 = r_i + r_j + d_0")
    centre: float | None = optional_quantity("m", above=0.0, help="D_0 itself")
    root: str | None = attrs.field(
        default=attrs.Factory(
            lambda self: "outer" if self.distance is None and self.centre is None else None,
            takes_self=True,
        ),
        validator=attrs.validators.optional(attrs.validators.in_(("inner", "outer"))),
        metadata={
            "choices": ("inner", "outer"),
            "shown": '"outer"',
            "help": "d_0 is this root of attraction = repulsion; it must exist",
        },
    )


@attrs.frozen
class IntegratorConfig:
    """[integrator]: how time goes on."""

    name: str = word(
        default="implicit", help="implicit, overdamped, dormand_prince54 or velocity_verlet"
    )
    tolerance: float = quantity(
        "m", above=0.0, default=1e-9, help="largest error of a step, what it leads to included"
    )
    max_steps: int = whole(
        1, MOST_STEPS, default=200_000, help="steps after which a replicate ends undecided"
    )
    step: float | None = optional_quantity("s", above=0.0, help="for methods with a fixed step")


@attrs.frozen
class OutputConfig:
    """[output]: where the results go."""

    file: str = word(default="results.h5", help="results file, relative to the current folder")


@attrs.frozen(eq=False)
class Config:
    """A whole config file, checked, with the preset's values filled in. SI units.

    ``forces`` (Force objects) and ``force_names`` go in step: gravity, drag, van_der_waals,
    double_layer, contact, then the user's own as in the file. ``text`` is the file's source and
    ``folder`` where it lies; ``overrides`` what was laid over it.
    """

    preset: str | None = attrs.field(
        default=None,
        metadata={
            "choices": tuple(PRESETS),
            "shown": "none",
            "help": "values that lie under the file's own",
        },
    )
    seed: int = whole(0, LARGEST_SEED, default=1, help="of all random numbers")
    replicates: int = whole(
        1, MOST_REPLICATES, default=100, help="pairs of orientations drawn per condition"
    )
    scene: SceneConfig = attrs.Factory(SceneConfig)
    shapes: ShapesConfig = attrs.Factory(ShapesConfig)
    bodies: BodiesConfig = attrs.field(kw_only=True)
    fluid: Fluid = attrs.Factory(Fluid)
    forces: tuple = attrs.field(kw_only=True)
    force_names: tuple = attrs.field(kw_only=True)
    zone: ZoneConfig = attrs.Factory(ZoneConfig)
    integrator: IntegratorConfig = attrs.Factory(IntegratorConfig)
    stop: StopConfig = attrs.Factory(StopConfig)
    output: OutputConfig = attrs.Factory(OutputConfig)
    text: str = ""
    folder: Path = attrs.Factory(Path)
    overrides: dict = attrs.Factory(dict)

    @property
    def body_options(self):
        """The bodies' weight as keyword arguments of flocsim.body.Body."""
        if self.bodies.density is None:
            return {"surface_density": self.bodies.surface_density}
        return {"density": self.bodies.density, "depth": self.bodies.depth}
