"""The schema of a config file: one attrs class per table, and Config, which holds them all.

To add a key, add an attribute here, and nothing else: its name is the key, its field
(flocsim.fields) has type, unit, range and default, and the text below it says what it means. The
loader reads it, its messages name it, `--set` sets it, and docs/schema_tables.py puts it into
docs/config.md when the site is built. A new table is a class here and an attribute of Config.
[scene] has a class for each kind of it, SCENES. Keys that exclude each other stand in EXCLUSIVE,
those that follow from the water in FOLLOWING; what is checked between tables, in ``problems`` of
the scene.

Metadata of this schema alone: ``only_for`` says with which other key a key applies, ``usual`` is
what a default that depends on other keys is mostly; ``beside_class`` marks keys that stay where a
class of the user's own is named, whose kind is ``own``; ``table`` is a class that a table is read
as.
"""

import os
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs

from flocsim.body import Fluid, FractalDensity
from flocsim.ensembles.config import own_classes, pair_scene, scenes
from flocsim.ensembles.config.kernel_scene import KernelScene
from flocsim.ensembles.config.pair_scene import applies_with
from flocsim.errors import ConfigError
from flocsim.fields import (
    choice,
    field,
    one_of,
    quantity,
    several,
    text,
    whole,
    word_or_quantity,
)
from flocsim.forces import (
    Contact,
    DoubleLayer,
    Gravity,
    Lubrication,
    PairResistance,
    StokesDrag,
    Thermal,
    VanDerWaals,
)
from flocsim.forces.base import Force
from flocsim.forces.contact import REPLACED_BY
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators import (
    BackwardEuler,
    DormandPrince54,
    Implicit,
    Integrator,
    Overdamped,
    VelocityVerlet,
)
from flocsim.io.results.events import MOST_UNKNOWN
from flocsim.io.results.schema import BAND_ENDS
from flocsim.io.shape_library import SHIPPED

PRESETS: dict[str, Any] = tomllib.loads(Path(__file__).with_name("presets.toml").read_text("utf-8"))
"""Name → values, nested like the config file, for keys that the file does not give."""


def unless_own(value: Any, of_own: Callable[[Any], Any] = lambda own: None) -> dict[str, Any]:
    """Return a default: the value, or what follows from the user's own object, if there is one."""
    default = attrs.Factory(lambda self: value if self.own is None else of_own(self.own), True)
    return {"default": default, "usual": value}


ESTIMATES = ("pr_inside", "pr_a_given_inside", "pr_a_given_outside", "pr_a")


@attrs.frozen
class StopConfig:
    """[stop]: when to end before all `replicates` are run.

    With `half_width`, the rule is applied at fixed numbers of replicates (`least`, then 5/4 as many
    each time), the same for any number of ranks. The study ends when the 95 % interval of every
    probability in every condition is narrow enough. A condition without events does not keep the
    study running. As with any sequential rule, intervals cover a little less often than 95 %.
    """

    half_width: float | None = quantity("", above=0.0, at_most=0.5, default=None)
    """Largest half-width of the 95 % intervals; none: run all."""

    of: tuple[str, ...] = field(several(one_of(*ESTIMATES)), default=("pr_inside", "pr_a"))
    """The probabilities whose intervals must be narrow enough."""

    least: int = field(whole(1, 10**9), default=100)
    """Replicates after which the rule is applied for the first time."""

    failed: float = quantity("", at_least=0.0, at_most=1.0, default=0.1)
    """Fraction of all replicates that may fail; if more do, the study stops with exit code 70."""

    undecided: float = quantity("", at_least=0.0, at_most=1.0, default=MOST_UNKNOWN)
    """Fraction of the replicates of a condition, or of the encounters of a rate, that may be
    undecided or failed; if more are, the study is completed but ends with exit code 65, and such
    rates are given as intervals only."""


CUT, BAND = "cut", "band"
"""`[shapes] outlines`: as they were cut, and with both ends of their bands beside."""


@attrs.frozen
class ShapesConfig:
    """[shapes]: the flocs that collide."""

    own: Shape | None = attrs.field(
        default=None, kw_only=True, metadata={"key": "class", "own": (Shape,)}
    )
    """Your own shape instead of a `source`, the same for both bodies, scaled to their sizes; its
    parameters are further keys, and of the other keys only `vertices` can be given with it."""

    source: str | None = choice("synthetic", "library", **unless_own("synthetic"))
    """Flocs grown by flocsim, or fitted to images."""

    file: str | os.PathLike | None = field(
        text("a path, relative to the config file"), **applies_with("source", "library")
    )
    """Shape library written by `flocsim fit`, or "synthetic", the one included in flocsim (24
    grown flocs at N = 4, 8, 16, 32, 64, 128)."""

    vertices: tuple[int, ...] = field(
        several(whole(1, 512)),
        **unless_own((1, 4, 16, 64), lambda own: (len(own.vertices),)),
        beside_class=True,
    )
    """Numbers N of vertices of the spheropolygons; 1 is the equivalent sphere."""

    radius: float = quantity("m", above=0.0, at_most=pair_scene.LARGEST_LENGTH, default=1e-6)
    """Spheroradius r of the resized flocs."""

    pool: int = field(whole(1, 10**6), default=10)
    """Number of flocs, nearest in size-to-spheroradius ratio, from which each replicate draws its
    pair."""

    size: str = choice("scene", "own", **applies_with("source", "library", value="scene"))
    """scene: every floc is resized to the radius of its collision type; own: it keeps its measured
    size and spheroradius, and is drawn from the `pool` flocs nearest to that radius. `scene.pairs =
    "measured"` implies "own". With "own" the faster of the two bodies approaches the other."""

    pairs_alike_in: str = choice("vertices", "error", default="vertices")
    """vertices: both flocs have N vertices; error: the approaching floc has N vertices, and the
    receiver the number of vertices whose relative error RE is nearest to that floc's."""

    outlines: str = choice(CUT, *BAND_ENDS, BAND, **applies_with("source", "library", value=CUT))
    """cut: outlines as they were cut from the pictures; closer, wider: the tightest and the widest
    outlines that another observer might have cut; band: every replicate is run with the outlines
    as cut, and again with closer and with wider ones, which gives every probability of a study of
    pairs a third error, shape. All except cut need a library made by `flocsim fit --band`."""

    fractal_dimension: float = quantity(
        "", at_least=1.2, at_most=1.95, **applies_with("source", "synthetic", value=1.8)
    )
    """Fractal dimension of the synthetic flocs, in the plane."""

    primary_particles: int = field(whole(2, 2000), **applies_with("source", "synthetic", value=60))
    """Number of primary particles in each synthetic floc."""

    def __attrs_post_init__(self):
        if self.own is not None:
            own_classes.check_shape(self.own)
            known = (1, len(self.own.vertices))
            if other := set(self.vertices).difference(known):
                raise ConfigError(
                    f"vertices may be 1, the sphere, and {known[1]}, its core points, found {other}"
                )
        if self.source == "library" and self.file is None:
            raise ConfigError('source = "library" needs file, written by `flocsim fit`')

    @property
    def label(self) -> str:
        """The source, or the name of the user's own class."""
        return self.source or own_classes.full_name(self.own)

    def described(self, count: int, drawn: int | None = None, measured: bool = False) -> str:
        """Return which flocs a study takes; ``count`` of them, none where all are spheres, of which
        so many are ``drawn``, all by default; ``measured`` ones keep their sizes."""
        if self.own is not None or not count:
            return self.label if self.own is not None else "spheres"
        if self.file is None:
            return f"{count} synthetic flocs grown by flocsim"
        if Path(self.file) == SHIPPED:
            return f"{count} synthetic flocs included in flocsim"
        some = f"{drawn} of " * (drawn is not None and drawn < count)
        resized = ", resized" * (self.size == "scene" and not measured)
        return f"{some}{count} flocs of {Path(self.file).name}{resized}"


@attrs.frozen
class BodiesConfig:
    """[bodies]: the weight of the flocs: ``surface_density``, or ``density`` and ``depth``."""

    surface_density: float | None = quantity("kg/m^2", above=0.0, default=None)
    """ρ_s: mass m = ρ_s A, A the floc's area."""

    density: float | FractalDensity | None = quantity(
        "kg/m^3", above=0.0, default=None, table=FractalDensity
    )
    """ρ: ρ_s = ρ · depth; as a table {law = "fractal", primary = "4 um", dimension = 2.1, solid =
    2650.0}, for flocs that are less dense the larger they are: ρ = ρ_f + (solid −
    ρ_f)(primary/D)^(3 − dimension), D = 2 r_eq, ρ_f of the fluid."""

    depth: float | str = word_or_quantity("sphere", "m", above=0.0, default="sphere")
    """Thickness of the flocs; "sphere" = 4/3 r_eq, the mass of the equivalent sphere."""

    def __attrs_post_init__(self):
        if (self.surface_density is None) == (self.density is None):
            example = "surface_density = 2.0 (the paper's weights), or density = 2650.0"
            found = "neither" if self.density is None else "both"
            raise ConfigError(f"needs surface_density or density, found {found}: give {example}")


@attrs.frozen
class ZoneConfig:
    """[zone]: the attraction zone d_c < D_0; one of ``root``, ``distance`` and ``centre``."""

    distance: float | None = quantity("m", at_least=0.0, default=None)
    """d_0: D_0 = r_i + r_j + d_0."""

    centre: float | None = quantity("m", above=0.0, default=None)
    """D_0 itself."""

    root: str | None = choice(
        "inner",
        "outer",
        default=attrs.Factory(
            lambda self: "outer" if self.distance is None and self.centre is None else None, True
        ),
        usual="outer",
    )
    """d_0 is this root of attraction = repulsion, which must exist."""


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
    """[integrator]: how the motion is integrated in time."""

    own: Integrator | None = attrs.field(
        default=None, kw_only=True, metadata={"key": "class", "own": (Integrator,)}
    )
    """Your own integrator instead of a `name`; its parameters are further keys, and of the other
    keys only `max_steps` and `check_share` can be given with it."""

    name: str | None = choice(*METHODS, **unless_own("implicit"))
    """The method: see `flocsim.integrators`."""

    tolerance: float = quantity("m", above=0.0, default=1e-9)
    """Largest error of a step, including its effect on later steps."""

    max_steps: int = field(whole(1, 10**12), default=200_000, beside_class=True)
    """Largest number of steps of a replicate. A replicate that has not ended by then, or has
    failed, is tried once more with five times as many, and is undecided if that is not enough. In
    a swarm, the largest number of steps of an island between two common times (for an island of n
    > 50 bodies, 50/n times this number)."""

    step: float | None = quantity("s", above=0.0, default=None)
    """For methods with a fixed step."""

    check_share: float | str = word_or_quantity(
        "auto", "", at_least=0.0, at_most=1.0, default="auto", beside_class=True
    )
    """Fraction of the replicates that are run again at a 100 times tighter tolerance (with a fixed
    step: at a quarter of it); the outcomes that change give the numerical error of the
    probabilities. "auto": the first 24 of each condition, and 3.5 % where
    that is more. Hooks, rests and misses, which flip most often, are run again three times as
    often. One in eight of these runs is repeated a third time at an even tighter tolerance. 0:
    none."""

    def __attrs_post_init__(self):
        if self.own is not None:
            own_classes.check_integrator(self.own)
        if self.name == "velocity_verlet" and self.step is None:
            raise ConfigError('name = "velocity_verlet" needs step, the fixed step')

    @property
    def label(self) -> str:
        """The name, or that of the user's own class."""
        return self.name or own_classes.full_name(self.own)

    @property
    def method(self) -> Integrator:
        """The method, made of its keys."""
        if self.own is not None:
            return self.own
        made = METHODS[self.name or "implicit"]
        keys = attrs.fields_dict(type(self)).keys() & attrs.fields_dict(made).keys()
        return made(**{key: getattr(self, key) for key in keys})


@attrs.frozen
class OutputConfig:
    """[output]: where the results go."""

    file: str = field(text(), default="study.h5")
    """Results file, relative to the current folder; by default it has the config's name."""


def usual_replicates(config: Any) -> int:
    """Return the replicates of a condition where nothing is said; a power of 2 of Sobol points."""
    return config.scene.usual_replicates or (128 if config.sampling == pair_scene.SOBOL else 100)


@attrs.frozen(eq=False)
class Config:
    """A whole config file, checked, with the preset's values filled in. SI units.

    ``forces`` (Force objects) and ``force_names`` go in step: gravity, drag, van_der_waals,
    double_layer, contact, then the user's own as in the file. ``text`` is the file's source and
    ``folder`` where it lies; ``overrides`` what was laid over it; ``modules``
    {place: source} of the user's own classes.
    """

    preset: str | None = choice(*PRESETS, default=None)
    """Set of values for keys that the file does not give."""

    seed: int = field(whole(0, 2**63 - 1), default=1)
    """Seed of all random numbers."""

    sampling: str = choice("random", pair_scene.SOBOL, default="random")
    """How the orientations and flocs of pairs are drawn. random: independently; sobol: evenly, as
    points of 16 scrambled Sobol sequences, whose scatter gives the intervals. Kernel studies
    always use Sobol sequences."""

    scene: pair_scene.PairScene = attrs.Factory(pair_scene.PairScene)
    replicates: int = field(
        whole(1, 10**9), default=attrs.Factory(usual_replicates, takes_self=True), usual=100
    )
    """Number of runs of each condition, each with its own orientations and flocs."""

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
    modules: dict[str, bytes] = attrs.field(factory=dict, repr=False)

    @property
    def scrambles(self) -> int:
        """Of how many scrambles of a Sobol sequence the replicates of two bodies are points; 0
        where they are drawn independently."""
        even = self.sampling == pair_scene.SOBOL and self.scene.kind == "binary"
        return pair_scene.SOBOL_SCRAMBLES if even else 0

    @property
    def is_kernel(self) -> bool:
        """Whether the scene is a KernelScene, and the study one of rates of encounters."""
        return bool(self.scene.kind == "kernel")

    def body_options(self, shape: Shape) -> dict[str, Any]:
        """The weight of a body of a shape as keyword arguments of flocsim.body.Body."""
        density = self.bodies.density
        if density is None:
            return {"surface_density": self.bodies.surface_density}
        if isinstance(density, FractalDensity):
            density = density.at(shape.equivalent_radius, self.fluid.density)
        return {"density": density, "depth": self.bodies.depth}


def keys_of(some_class: type) -> dict[str, attrs.Attribute]:
    """Key in the config → attrs field, for all fields that the class is made with."""
    return {
        field.metadata.get("key", field.alias): field
        for field in attrs.fields(some_class)
        if field.init
    }


TABLES: dict[str, Any] = {
    field.name: field.type for field in attrs.fields(Config) if field.type and attrs.has(field.type)
}
"""Name of a top-level table → class; [forces] is read by itself."""

STUDY_KEYS = {key: field for key, field in keys_of(Config).items() if "reader" in field.metadata}
"""The keys above all tables."""

SCENES: dict[str, Any] = {"binary": pair_scene.PairScene, **scenes(), "kernel": KernelScene}
"""`[scene] kind` → class of the table."""

TOP_KEYS = (*STUDY_KEYS, *TABLES, "forces")

FORCES: dict[str, type] = {
    "gravity": Gravity,
    "drag": StokesDrag,
    "van_der_waals": VanDerWaals,
    "double_layer": DoubleLayer,
    "contact": Contact,
    "lubrication": Lubrication,
    "hydrodynamics": PairResistance,
    "thermal": Thermal,
}
"""Name of the table [forces.NAME] → class, in the order of Config.forces."""

EXCLUSIVE = [
    ("scene.types", "scene.pairs"),
    ("shapes.class", "shapes.source"),
    ("bodies.surface_density", "bodies.density"),
    ("bodies.surface_density", "bodies.depth"),
    ("fluid.salinity", "fluid.ionic_strength"),
    ("zone.root", "zone.distance"),
    ("zone.root", "zone.centre"),
    ("zone.distance", "zone.centre"),
    ("integrator.class", "integrator.name"),
    *((f"forces.contact.{key}", f"forces.contact.{other}") for key, other in REPLACED_BY.items()),
]
"""Pairs of keys that cannot both be given: one of them replaces the other from below."""

WATER = ("fluid.temperature", "fluid.salinity", "fluid.ionic_strength")

FOLLOWING = {
    "fluid.viscosity": WATER[:2],
    "fluid.density": WATER[:2],
    "forces.double_layer.permittivity": WATER,
    "forces.double_layer.debye_length": WATER[1:],
    "forces.thermal.temperature": WATER[:1],
}
"""Key → the keys that it follows from: these replace it from below. Those of forces are properties
of Fluid, and are not given beside these."""
