"""What is wrong with a study can mostly be known before anything is compiled or run; what is
implausible in it, for the terminal and for the file.

Impacts: how deep two spheres run into each other where they meet, against what the contact law
covers. The contact law, whatever it is, is taken as the spring and dashpot that are worth it: as
much work up to the deepest overlap, as much damping half way. A spring k with damping ζ of critical
stops a mass M of speed v at v √(M/k) exp(−ζ acos ζ/√(1 − ζ²)), for critical damping v √(M/k)/e.

Doubts: of flocs of measured sizes they look at the largest of each collision type, which settle
fastest. ``flocs`` are those of the study, where they have been read.
"""

import math
from collections.abc import Iterator, Sequence

import attrs
import numpy as np

import flocsim.arrays as at
from flocsim.arrays import ContactView, OutlineView, PairView, work_of
from flocsim.compiler.fingerprint import refuse_interpreter
from flocsim.constants import DEEPEST_OVERLAP
from flocsim.ensembles.collision.draw import exact_method
from flocsim.ensembles.collision.encounter import Encounter, make_encounter
from flocsim.ensembles.collision.flocs import Floc, pool_of, read_flocs
from flocsim.ensembles.collision.meetings import refuse_release
from flocsim.ensembles.collision.pairings import pairings_of
from flocsim.ensembles.collision.start import zone_distance
from flocsim.ensembles.config.pair_scene import BROWNIAN, SETTLING
from flocsim.ensembles.config.schema import PRESETS, Config
from flocsim.errors import ConfigError, KernelError
from flocsim.explain import pairs_of
from flocsim.forces import Contact, ContactForce, Force
from flocsim.forces.codegen import laws_of
from flocsim.forces.contact import impact_exponent
from flocsim.geometry.shapes.shape import Shape, Sphere
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon
from flocsim.integrators.loop.driver import advance
from flocsim.integrators.rhs.orientation import oriented_view
from flocsim.integrators.rhs.views import body_view
from flocsim.io.outputs import loaded_sources
from flocsim.plausibility import ROUNDING, Names, doubts_of, settled
from flocsim.run import wrong_answer
from flocsim.system import System

PARTS = 16
"""Intervals of the work of the contact force, an even number."""


def depth(speed: float, mass: float, stiffness: float, damping: float) -> float:
    """Deepest overlap [m] of a mass [kg] at a speed [m/s] on a spring [N/m] and dashpot [N s/m]."""
    omega = math.sqrt(stiffness / mass)
    return speed / omega * math.exp(-impact_exponent(0.5 * damping / (mass * omega)))


def spring_and_dashpot(
    pair: Encounter, mass: float, radii: Sequence[float], speed: float
) -> tuple[float, float] | None:
    """(stiffness [N/m], damping [N s/m]) of the pair's contact law up to the deepest overlap.

    None where it has no such thing: it gives no numbers, or does not push apart.
    """
    law, known = pair.system.pieces.laws["contact_force"], pair.system.pieces.parameters
    deepest = DEEPEST_OVERLAP * sum(radii)
    smaller = min(body.shape.equivalent_radius for body in pair.system.bodies)

    def normal(overlap, rate):
        return float(law(ContactView(overlap, rate, 0.0, 0.0, mass, *radii, smaller), known)[0])

    try:
        with np.errstate(all="ignore"):
            values = [normal(deepest * k / PARTS, 0.0) for k in range(1, PARTS + 1)]
            middle, half = values[PARTS // 2 - 1], 0.5 * speed
            damping = (normal(0.5 * deepest, half) - middle) / half
    except (ArithmeticError, ValueError):
        return None
    # Simpson's rule; no force at no overlap.
    work = (4.0 * sum(values[0::2]) + 2.0 * sum(values[1:-1:2]) + values[-1]) / (3.0 * PARTS)
    stiffness = 2.0 * work / deepest
    if not (0.0 < stiffness < math.inf and -math.inf < damping < math.inf):
        return None
    return stiffness, max(damping, 0.0)


def stiffness_for(
    deepest: float, speed: float, mass: float, stiffness: float, damping: float, scales: bool
) -> float:
    """Least stiffness [N/m] at which the overlap stays below ``deepest`` [m].

    ``scales``: the damping is a share of critical damping, and grows with the stiffness.
    """

    def found(factor):
        more = math.sqrt(factor) if scales else 1.0
        return depth(speed, mass, factor * stiffness, more * damping)

    from scipy.optimize import brentq

    high = 2.0
    while found(high) > deepest:
        high *= 2.0
    return stiffness * float(brentq(lambda factor: found(factor) - deepest, 1.0, high))


def rounded_up(value: float) -> float:
    """A value to two digits, not below it."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit * (1.0 - 1e-12)) * unit:.2g}")


def too_deep(
    name: str, pair: Encounter, radii: Sequence[float], what: str
) -> tuple[float, str] | None:
    """How many times too soft the contact is for the equivalent spheres of a collision type, and
    that in words with what would do; None where it is stiff enough, or has no stiffness.

    ``radii`` [m] are those of the outlines that touch, of ``what``: spheroradii, or the spheres'.
    The speed is that at which the spheres settle onto each other.
    """
    speed, deepest = math.hypot(*pair.drift), DEEPEST_OVERLAP * sum(radii)
    [mass] = [mass for _, _, mass in pairs_of(pair.system)]
    law = spring_and_dashpot(pair, mass, radii, speed)
    if law is None or depth(speed, mass, *law) <= deepest:
        return None
    forces = [each for each in pair.system.forces if isinstance(each, ContactForce)]
    alone = forces[0] if len(forces) == 1 else None
    scales = isinstance(alone, Contact) and alone.dashpots[0] > 0.0
    wanted = stiffness_for(deepest, speed, mass, *law, scales)
    cure = f"make the contact {rounded_up(wanted / law[0]):g} times as stiff"
    if type(alone) is Contact:
        key, unit = alone.stiffness_key
        given = getattr(alone, key) * wanted / law[0]
        cure = f"give forces.contact.{key} {rounded_up(given):g} {unit} or more"
    return wanted / law[0], (
        f"{name}: an impact at {1e3 * speed:.4g} mm/s is {1e6 * depth(speed, mass, *law):.3g} um "
        f"deep, more than the {1e6 * deepest:.3g} um for which the contact law is valid (half of "
        f"r_i + r_j of {what}): {cure}, or lighter bodies"
    )


CLOSE_GAPS = (1e-9, 1e-12, 0.0, -1e-12)
"""Gaps [m] that every two bodies that collide come through: a pole at 0 turns a repulsion into an
attraction there."""

CLOSE_OVERLAPS = (1e-12, 1e-10)
""" [m] The same of contacts, at rates of either sign."""


def measured_flocs(config: Config) -> list[Floc]:
    """The flocs whose own sizes a study has; none where flocs are resized."""
    return read_flocs(config.shapes) if config.shapes.size == "own" else []


def resizes(config: Config) -> bool:
    """Whether flocs are resized to the radii of the scene, their spheroradius given."""
    shapes = config.shapes
    return shapes.own is None and shapes.size == "scene" and max(shapes.vertices) > 1


def smallest(config: Config) -> float:
    """The smallest radius of a scene that gives them [m]."""
    return min(min(radii) for _, radii in config.scene.given)


def sphere_pairs(
    config: Config, flocs: Sequence[Floc] | None = None, which: str = "radii"
) -> Iterator[tuple[str, Encounter]]:
    """(name, Encounter) of the equivalent spheres of every collision type.

    ``which`` of flocs of measured sizes: "radii", those that stand for all, "fastest" or "largest"
    of a Pairing; ``flocs``, where measured ones are read already.
    """
    flocs = measured_flocs(config) if flocs is None else flocs
    for pairing in pairings_of(config, flocs):
        radius_i, radius_j = getattr(pairing, which)
        zone = zone_distance(config.zone, config.forces, radius_i, radius_j)
        spheres = (Sphere(radius_i), Sphere(radius_j))
        yield pairing.name, make_encounter(config, spheres, zone, meeting=pairing.meeting)


def check_study(config: Config) -> None:
    """Raise the FlocsimError that the study would meet: zone, method, settling, sizes, library,
    impacts."""
    if not any(isinstance(force, ContactForce) for force in config.forces):
        raise ConfigError(
            "a collision needs a contact force, found none among "
            f"{', '.join(config.force_names)}: add [forces.contact]"
        )
    flocs = read_flocs(config.shapes) if config.shapes.source == "library" else []
    if resizes(config) and config.shapes.radius >= smallest(config):
        raise ConfigError(
            f"shapes.radius = {config.shapes.radius:g} m leaves no room for a core in the smallest "
            f"body, of r_eq = {smallest(config):g} m: choose a smaller shapes.radius"
        )
    if config.scene.meeting == BROWNIAN:
        check_release(config, flocs)
    for name, pair in sphere_pairs(config, flocs):
        check_approach(config, name, pair)
        check_compilable(pair)
        check_numbers(pair.system)
    if not isinstance(config.integrator.check_share, str) and (
        config.integrator.check_share > 0.0 and exact_method(config.integrator.method) is None
    ):
        raise ConfigError(
            f"integrator.check_share = {config.integrator.check_share:g} cannot be: "
            f"{config.integrator.label} has no parameter `tolerance` or `step` that could be made "
            "smaller for a second run: give it one, or leave check_share out"
        )
    check_impacts(config, flocs)


def check_release(config: Config, flocs: Sequence[Floc]) -> None:
    """ConfigError where outlines may touch as they are let go; of grown flocs it is not known."""
    pool = pool_of(config.shapes, flocs)
    shapes: list[Shape] = [config.shapes.own or Sphere(1.0)]
    shapes += [
        pool.shape(place, n, radius)
        for each in pairings_of(config, flocs, pool) for radius in each.radii
        for place, floc in enumerate(flocs) for n in floc.shapes
    ]  # fmt: skip
    farthest = max(shapes, key=lambda shape: shape.bounding_radius / shape.equivalent_radius)
    refuse_release(config.scene, [farthest, farthest])


def check_compilable(pair: Encounter) -> None:
    """KernelError where a kernel calls what compiled code cannot, as print, or does not compile."""
    system = pair.system
    for law in system.pieces.laws.values():
        refuse_interpreter(law)
    refuse_interpreter(advance, system.fillings(pair.observer))
    if any(type(force).__module__.partition(".")[0] != "flocsim" for force in system.forces):
        system.laws()


def check_numbers(system: System) -> None:
    """KernelError where a force gives no number at the start or where two bodies touch."""
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    i, j = system.bodies
    radii = i.shape.equivalent_radius, j.shape.equivalent_radius
    reduced = radii[0] * radii[1] / sum(radii)
    mass = j.mass if i.fixed else i.mass * j.mass / (i.mass + j.mass)
    pairs = [
        PairView(0.0, gap, rate, sum(radii) + gap, *radii, reduced, mass)
        for gap in CLOSE_GAPS for rate in (-1e-4, 1e-4)
    ]  # fmt: skip
    contacts = [
        ContactView(overlap, rate, 0.0, 0.0, mass, *radii, min(radii))
        for overlap in CLOSE_OVERLAPS for rate in (-1e-4, 1e-4)
    ]  # fmt: skip
    bodies = [body_view(scene, work, 0.0, at.NOW, body) for body in range(2)]
    points = [
        OutlineView(
            0.0, gap, gap, max(gap, 1e-10), max(gap, 1e-10), radii[0], *radii, reduced, mass
        )
        for gap in CLOSE_GAPS
    ]
    oriented = [
        oriented_view(scene, 0.0, 1, 0, sum(radii) + gap, angle, 1.0 - angle)
        for gap in CLOSE_GAPS for angle in (0.0, 2.0)
    ]  # fmt: skip
    views = {
        "body": bodies, "centre": pairs, "surface": pairs, "contact": contacts, "outline": points,
        "oriented": oriented,
    }  # fmt: skip
    for name, force in system.pieces.used.items():
        pieces = laws_of([force], system.fluid)
        if words := wrong_answer(force, pieces, views, system.fluid):
            raise KernelError(
                f"{name}: {words}, which every collision reaches: bound whatever it divides by or "
                "takes a root, power or logarithm of, as in max(pair.gap, 1e-10)"
            )


def check_approach(config, name, pair):
    """ConfigError where the upper body j never reaches the lower one; a shear flow may bring it."""
    if pair.drift[1] >= 0.0 and not any(config.fluid.gradient):
        fall_i, fall_j = (-1e3 * velocity[1] for velocity, _ in pair.settling)
        raise ConfigError(
            f"{name}: the approaching body j (above) settles at {fall_j:.4g} mm/s and never "
            f"reaches the receiving body i (below) at {fall_i:.4g} mm/s: give scene.pairs as "
            "[smaller radius, larger radius], or set scene.receiver = 'fixed'"
        )


def check_impacts(config: Config, flocs: Sequence[Floc]) -> None:
    """ConfigError where bodies meet so fast that they leave the contact law: of the worst pair."""
    found = []
    for name, pair in sphere_pairs(config, flocs, "fastest"):
        spheres = pair.shapes
        for shapes in kinds(config, spheres):
            radii = [shape.radius for shape in shapes]
            what = "the spheres" if shapes is spheres else "the outlines, their spheroradii"
            if flocs and config.shapes.size == "own" and shapes is not spheres:
                measured = [shape.radius for floc in flocs for shape in floc.shapes.values()]
                radii = [float(np.median(measured))] * 2
            found.append(too_deep(name, pair, radii, what))
    if wrong := [each for each in found if each is not None]:
        raise ConfigError(max(wrong)[1])


def inputs_of(config: Config, path: str) -> list[str]:
    """The files that a study is made from: the config at ``path``, its library, its own classes."""
    library = [str(config.shapes.file)] if config.shapes.file else []
    return [path, *library, *loaded_sources()]


def stand_in(shape, options):
    """A polygon about as large as a sphere: what matters here is that it has edges."""
    if options.own is not None:
        return options.own.scaled(shape.radius / options.own.equivalent_radius)
    # Measured flocs have spheroradii of their own.
    radius = options.radius if options.size == "scene" else min(options.radius, 0.5 * shape.radius)
    angles = np.arange(6) * np.pi / 3.0
    hexagon = np.column_stack([np.cos(angles), np.sin(angles)])
    return SpheroPolygon((shape.radius - radius) * hexagon, radius)


def placed_system(config: Config, system: System, shapes: Sequence[Shape]) -> System:
    """The system with these shapes, the start gap apart."""
    gap = config.scene.start_gap
    reach = sum(shape.bounding_radius for shape in shapes) + (0.0 if isinstance(gap, str) else gap)
    places = ((0.0, 0.0), (0.0, reach))
    bodies = [
        attrs.evolve(body, shape=shape, position=place)
        for body, shape, place in zip(system.bodies, shapes, places, strict=True)
    ]
    return system.changed(bodies=tuple(bodies))


def kinds(config: Config, spheres: Sequence[Shape]) -> Iterator[Sequence[Shape]]:
    """Shapes of i and j for polygons, if the study has any, and for spheres, if it has any."""
    if max(config.shapes.vertices) > 1:
        yield [stand_in(shape, config.shapes) for shape in spheres]
    if min(config.shapes.vertices) == 1:
        yield spheres


def names_in(config: Config, acting: Sequence[Force]) -> Names:
    """What a config calls the fluid, the bodies, and those of its forces that are acting."""
    known = [id(force) for force in acting]
    forces = zip(config.force_names, config.forces, strict=True)
    return Names(
        fluid="fluid", body="bodies", buoyancy="fluid.buoyancy = true", drop="give {} = false",
        forces=tuple(f"forces.{name}" for name, force in forces if id(force) in known),
    )  # fmt: skip


IMPLIED = (
    "preset tang2014 gives flocs the paper's 2 kg/m2 of projected area, 65 to 325 times as dense "
    "as water at its sizes: they settle too fast for Stokes's drag, and shape decides the outcome. "
    'At real weight (preset = "si") whatever touches stays together: see docs/presets.md'
)


def paper_weight(config: Config) -> bool:
    """Whether bodies have the weight of the paper's preset, which implies what is doubtful of their
    settling."""
    given = PRESETS.get(config.preset or "", {}).get("bodies", {}).get("surface_density")
    return given is not None and given == config.bodies.surface_density


def said_doubts(config: Config, doubts: Sequence[str]) -> list[str]:
    """Those of the doubts that every run says: not that the drag falls short, where the preset
    implies it. The dry run says IMPLIED once in its place; the results file keeps all."""
    if not paper_weight(config):
        return list(doubts)
    return [line for line in doubts if "settles at" not in line or "Re = " not in line]


def study_doubts(config: Config, flocs: Sequence[Floc] | None = None) -> list[str]:
    """Lines on a study, by the equivalent spheres of its collision types; none where all is
    usual."""
    systems = [pair.system for _, pair in sphere_pairs(config, flocs, "largest")]
    # In a flow bodies meet without their weight.
    lines = doubts_of(systems, names_in(config, systems[0].forces))
    if resizes(config):
        share = config.shapes.radius / smallest(config)
        lines.append(ROUNDING.doubt("shapes.radius over the smallest equivalent radius", share))
    return [line for line in lines if line] + trivial_values(config, flocs)


def trivial_values(config: Config, flocs: Sequence[Floc] | None = None) -> list[str]:
    """Lines on the values of a study whose answer they make known beforehand."""
    scene, shapes, lines = config.scene, config.shapes, []
    if shapes.source == "library" and shapes.vertices == (1,):
        lines.append(
            "shapes.vertices = [1] takes every floc of the library for its equivalent sphere, so "
            "that no shape counts: add a number of vertices, as in [1, 16]"
        )
    if scene.kind != "binary" or scene.meeting == BROWNIAN:
        return lines
    # D_0 over r_i + r_j of every collision type.
    reaches = [
        zone_distance(config.zone, config.forces, *pairing.largest) / sum(pairing.largest)
        for pairing in pairings_of(config, measured_flocs(config) if flocs is None else flocs)
    ]
    beyond = [delta for delta in scene.delta if delta > max(1.0, *reaches)]
    if beyond and scene.meeting == SETTLING:
        lines.append(
            f"scene.delta = {beyond[-1]:g} misses by construction: offsets are fractions of "
            "delta_max, at 1 of which the outlines just graze, and the attraction zone ends at "
            f"{max(reaches):.3g} of it: give fractions up to 1, as 0.5 for 50 %"
        )
    # Ten times as far as the farthest offset: a body that falls past is inside however it moves.
    if min(reaches) > 10.0 * max(1.0, *scene.delta):
        lines.append(
            f"[zone] reaches to {min(reaches):.3g} (r_i + r_j) of the centres at least, farther "
            "than any offset of scene.delta, so that every pair is inside: give a smaller distance"
        )
    return lines


def settling_facts(config: Config, flocs: Sequence[Floc] | None = None) -> list[dict]:
    """[{type, body, radius [m], speed [m/s], reynolds, stokes}] of every free equivalent sphere.

    It is the same at every N: a floc settles as the sphere of its area. Nothing where bodies meet
    by thermal motion alone, without their weight.
    """
    found = []
    for name, pair in sphere_pairs(config, flocs, "largest"):
        if pair.meeting == BROWNIAN:
            continue
        for letter, body in zip("ij", pair.system.bodies, strict=True):
            if (each := settled(pair.system, body)) is not None:
                found.append({"type": name, "body": letter, **each._asdict()})
    return found
