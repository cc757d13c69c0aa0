"""What is wrong or implausible in a study, known before anything is compiled or run.

`check_study` raises the error that the study would meet; `study_warnings` collects warnings, of
which `flocsim.plausibility` asks those that any scene has. Measured flocs are judged by the largest
of each collision type, which settle fastest.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from flocsim.compiler.fingerprint import fingerprint
from flocsim.constants import DEEPEST_OVERLAP
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.equivalent import kinds, sphere_pairs
from flocsim.ensembles.collision.flocs import Floc, read_flocs
from flocsim.ensembles.collision.outcomes import OBSERVER
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.config.sources import RUN
from flocsim.errors import ConfigError, KernelError
from flocsim.explain import pairs_of
from flocsim.forces import Contact, ContactForce, Force, PairForce
from flocsim.forces.body_forces import kick_parameters
from flocsim.forces.check import samples_of
from flocsim.forces.codegen import laws_of
from flocsim.forces.contact import impact_exponent
from flocsim.integrators.loop.driver import advance
from flocsim.plausibility import ROUNDING, Names, plausibility_warnings
from flocsim.run import invalid_value
from flocsim.state.views import ContactView
from flocsim.system import System

Flocs = Sequence[Floc]

PARTS = 16
"""Intervals of the work of the contact force."""


def inputs_of(config: Config, path: str) -> list[str]:
    """Return the files of a study: the config at ``path``, its library, the user's modules."""
    library = [str(config.shapes.file)] if config.shapes.file else []
    return [path, *library, *(str(file) for file, _ in RUN.values())]


def check_study(config: Config) -> None:
    """Raise the FlocsimError that a study of pairs or rates would meet."""
    flocs = read_flocs(config.shapes) if config.shapes.source == "library" else []
    require_contact(config)
    require_meeting(config, flocs)
    require_stiffness(config, flocs)


def require_contact(config: Config) -> None:
    """Raise ConfigError without a contact force."""
    if not any(isinstance(force, ContactForce) for force in config.forces):
        raise ConfigError(
            "colliding bodies need a contact force, found none among "
            f"{', '.join(config.force_names)}: add [forces.contact]"
        )


def require_meeting(config: Config, flocs: Flocs) -> None:
    """Raise the error of spheres that never meet, and of forces that cannot act on them."""
    for name, pair in sphere_pairs(config, flocs):
        # The upper body j never reaches the lower one; a shear flow may bring it.
        if pair.drift[1] >= 0.0 and not any(config.fluid.gradient):
            fall_i, fall_j = (-1e3 * velocity[1] for velocity, _ in pair.settling)
            raise ConfigError(
                f"{name}: the approaching body j (above) settles at {fall_j:.4g} mm/s and never "
                f"reaches the receiving body i (below) at {fall_i:.4g} mm/s: give scene.pairs as "
                "[smaller radius, larger radius], or set scene.receiver = 'fixed'"
            )
        check_laws(pair)


def check_laws(pair: Encounter) -> None:
    """Raise KernelError where a kernel cannot be compiled, or gives no number at touch, and
    UsageError where thermal kicks cannot act on the bodies."""
    system = pair.system
    kick_parameters(system.forces, system.bodies, system.fluid)
    for law in system.pieces.laws.values():
        fingerprint(law, {})
    fingerprint(advance, system.fillings(OBSERVER))
    if any(type(force).__module__.partition(".")[0] != "flocsim" for force in system.forces):
        system.laws()
    # Colliding bodies come through all gaps that samples have, a gap of 0 among them: a pole there
    # would turn a repulsion into an attraction.
    for name, force in system.pieces.used.items():
        if not isinstance(force, PairForce | ContactForce):
            continue
        own = laws_of([force], system.fluid)
        if words := invalid_value(force, own, samples_of(force), system.fluid):
            raise KernelError(
                f"{name}: {words}, which every collision reaches: bound whatever it divides by or "
                "takes a root, power or logarithm of, as in max(pair.gap, 1e-10)"
            )


def require_stiffness(config: Config, flocs: Flocs) -> None:
    """Raise ConfigError where bodies meet so fast that they leave the contact law: the worst pair.

    Polygons touch with their spheroradii, measured ones with about their median.
    """
    found: list[tuple[float, str]] = []
    for name, pair in sphere_pairs(config, flocs, "fastest"):
        spheres = pair.shapes
        for shapes in kinds(config, spheres):
            radii = [shape.radius for shape in shapes]
            if flocs and config.shapes.size == "own" and shapes is not spheres:
                measured = [shape.radius for floc in flocs for shape in floc.shapes.values()]
                radii = [float(np.median(measured))] * 2
            found += impact(name, pair, radii)
    if found:
        raise ConfigError(max(found)[1])


def depth(speed: float, mass: float, stiffness: float, damping: float) -> float:
    """Return the deepest overlap [m] of a mass at a speed on a spring and a dashpot [N s/m].

    v √(M/k) exp(−ζ acos ζ/√(1 − ζ²)), for critical damping v √(M/k)/e.
    """
    # Undamped the depth is v/ω; damping by ζ of the critical one lessens it by the exponent.
    omega = math.sqrt(stiffness / mass)
    return speed / omega * math.exp(-impact_exponent(0.5 * damping / (mass * omega)))


def spring_and_dashpot(
    pair: Encounter, mass: float, radii: Sequence[float], speed: float
) -> tuple[float, float] | None:
    """Return (stiffness [N/m], damping [N s/m]) that stand for the pair's contact law.

    As much work up to the deepest overlap, as much damping half way. None for a law that gives
    no numbers, or does not push apart.
    """
    law, known = pair.system.pieces.laws["contact_force"], pair.system.pieces.parameters
    deepest = DEEPEST_OVERLAP * sum(radii)
    smaller = min(shape.equivalent_radius for shape in pair.shapes)

    def normal(overlap: float, rate: float = 0.0) -> float:
        view = ContactView(overlap, rate, 0.0, 0.0, mass, radii[0], radii[1], smaller)
        return float(law(view, known)[0])

    try:
        with np.errstate(all="ignore"):
            # Midpoint rule; the force is the spring's at no rate.
            mean = sum(normal(deepest * (k + 0.5) / PARTS) for k in range(PARTS)) / PARTS
            damped = normal(0.5 * deepest, 0.5 * speed) - normal(0.5 * deepest)
    except (ArithmeticError, ValueError):
        return None
    if not (0.0 < mean < math.inf and math.isfinite(damped)):
        return None
    return 2.0 * mean / deepest, max(2.0 * damped / speed, 0.0)


def impact(name: str, pair: Encounter, radii: Sequence[float]) -> Iterator[tuple[float, str]]:
    """Yield how many times too soft a contact is and the words on it, where it is too soft.

    ``radii`` [m] of spheres, or spheroradii of outlines: the law is valid to half of their sum.
    The speed is that at which the spheres settle onto each other.
    """
    speed, deepest = math.hypot(*pair.drift), DEEPEST_OVERLAP * sum(radii)
    [mass] = [mass for _, _, mass in pairs_of(pair.system)]
    law = spring_and_dashpot(pair, mass, radii, speed)
    if law is None or (reached := depth(speed, mass, *law)) <= deepest:
        return
    # At a given share of critical damping the depth falls as 1/√k.
    factor = (reached / deepest) ** 2
    [alone, *others] = [each for each in pair.system.forces if isinstance(each, ContactForce)]
    cure = f"make the contact {rounded_up(factor):g} times as stiff"
    if type(alone) is Contact and not others:
        key, unit = alone.stiffness_key
        wanted = rounded_up(getattr(alone, key) * factor)
        cure = f"give forces.contact.{key} {wanted:g} {unit} or more"
    words = (
        f"{name}: an impact at {1e3 * speed:.4g} mm/s makes bodies overlap by {1e6 * reached:.3g} "
        f"um, but the contact law is valid only up to {1e6 * deepest:.3g} um (half the sum of the "
        f"radii, of outlines of their spheroradii): {cure}, or use lighter bodies"
    )
    yield factor, words


def rounded_up(value: float) -> float:
    """Return a value to two digits, not below it."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit * (1.0 - 1e-12)) * unit:.2g}")


OF_THE_PAPER, PAPER_WEIGHT = ("tang2014", "tang2014-literal"), 2.0
"""Presets with the paper's mass per projected area [kg/m²]."""

IMPLIED = (
    "preset tang2014 gives flocs the paper's 2 kg/m2 of projected area, 65 to 325 times as dense "
    "as water at its sizes: they settle too fast for Stokes's drag, and shape decides the outcome. "
    'At real weight (presets "clay" and "si") whatever touches stays together: see docs/presets.md'
)
"""Stands for the doubt about the drag that the paper's preset implies; no run repeats it."""


def warning_lines(doubts: Sequence[str]) -> list[str]:
    """Return what a dry run prints of doubts."""
    return [f"{'note' if line == IMPLIED else 'warning'}: {line}" for line in doubts]


def config_warnings(
    config: Config, systems: Sequence[System], acting: Sequence[Force]
) -> list[str]:
    """Return lines on what is implausible of scenes of a config, in its own words.

    ``acting``: those of its forces that the scenes have.
    """
    known = [id(force) for force in acting]
    forces = zip(config.force_names, config.forces, strict=True)
    names = Names(
        fluid="fluid", body="bodies", buoyancy="fluid.buoyancy = true", drop="give {} = false",
        forces=tuple(f"forces.{name}" for name, force in forces if id(force) in known),
    )  # fmt: skip
    lines = plausibility_warnings(systems, names)
    if config.preset in OF_THE_PAPER and config.bodies.surface_density == PAPER_WEIGHT:
        lines = [IMPLIED, *(line for line in lines if "Re = " not in line)]
    return lines


def study_warnings(config: Config, flocs: Flocs | None = None) -> list[str]:
    """Return lines on what is implausible in a study; none where all is usual.

    ``flocs``: those of the study, where they have been read.
    """
    systems = [pair.system for _, pair in sphere_pairs(config, flocs, "largest")]
    # In a flow bodies meet without their weight.
    lines = config_warnings(config, systems, systems[0].forces)
    shapes = config.shapes
    if shapes.own is None and shapes.size == "scene" and max(shapes.vertices) > 1:
        share = shapes.radius / min(min(radii) for _, radii in config.scene.given)
        lines.append(ROUNDING.warning("shapes.radius over the smallest equivalent radius", share))
    return [line for line in lines if line]
