"""What is wrong with a study can mostly be known before anything is compiled or run."""

from collections.abc import Iterator, Sequence

import attrs
import numpy as np

import flocsim.arrays as at
from flocsim.arrays import ContactView, OutlineView, PairView, work_of
from flocsim.compiler.interpreter_calls import refuse_interpreter
from flocsim.ensembles.collision.checking import exact_method
from flocsim.ensembles.collision.encounter import Encounter, make_encounter
from flocsim.ensembles.collision.flocs import Floc, pool_of, read_flocs
from flocsim.ensembles.collision.pairings import Pairing, pairings_of
from flocsim.ensembles.collision.thermal.release import refuse_release
from flocsim.ensembles.collision.zone import zone_distance
from flocsim.ensembles.config.pair_scene import BROWNIAN
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.impact import too_deep
from flocsim.errors import ConfigError, KernelError
from flocsim.forces import ContactForce
from flocsim.forces.codegen import laws_of
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.sphere import Sphere
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon
from flocsim.integrators.loop.driver import advance
from flocsim.integrators.rhs.views import body_view
from flocsim.io.outputs import loaded_sources
from flocsim.system import System
from flocsim.trajectories.blame import wrong_answer

CLOSE_GAPS = (1e-9, 1e-12, 0.0, -1e-12)
"""Gaps [m] that every two bodies that collide come through: a pole at 0 turns a repulsion into an
attraction there."""

CLOSE_OVERLAPS = (1e-12, 1e-10)
""" [m] The same of contacts, at rates of either sign."""


def measured_flocs(config: Config) -> list[Floc]:
    """The flocs whose own sizes a study has; none where flocs are resized."""
    return read_flocs(config.shapes) if config.shapes.size == "own" else []


def pairings(config: Config, flocs: Sequence[Floc] | None = None) -> tuple[Pairing, ...]:
    """Who meets whom in a config's study; ``flocs``, where measured ones are read already."""
    return pairings_of(config, measured_flocs(config) if flocs is None else flocs)


def sphere_pairs(
    config: Config, flocs: Sequence[Floc] | None = None, which: str = "radii"
) -> Iterator[tuple[str, Encounter]]:
    """(name, Encounter) of the equivalent spheres of every collision type.

    ``which`` of flocs of measured sizes: "radii", those that stand for all, "fastest" or "largest"
    of a Pairing; ``flocs`` as in `pairings`.
    """
    for pairing in pairings(config, flocs):
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
    least = min(min(each.radii) for each in pairings(config, flocs))
    resized = config.shapes.own is None and config.shapes.size == "scene"
    if resized and max(config.shapes.vertices) > 1 and config.shapes.radius >= least:
        raise ConfigError(
            f"shapes.radius = {config.shapes.radius:g} m leaves no room for a core in the smallest "
            f"body, of r_eq = {least:g} m: choose a smaller shapes.radius"
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
        for each in pairings(config, flocs) for radius in each.radii
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
        ContactView(overlap, rate, 0.0, 0.0, mass, *radii)
        for overlap in CLOSE_OVERLAPS for rate in (-1e-4, 1e-4)
    ]  # fmt: skip
    bodies = [body_view(scene, work, 0.0, at.NOW, body) for body in range(2)]
    points = [
        OutlineView(0.0, gap, max(gap, 1e-10), radii[0], *radii, reduced, mass)
        for gap in CLOSE_GAPS
    ]
    views = {
        "body": bodies, "centre": pairs, "surface": pairs, "contact": contacts, "outline": points,
    }  # fmt: skip
    for name, force in system.pieces.used.items():
        pieces = laws_of([force], system.fluid)
        if words := wrong_answer(force, pieces, views, system.fluid):
            raise KernelError(
                f"{name}: {words}, where every collision comes: bound what it divides by, or takes "
                "a root, power or logarithm of, as in max(pair.gap, 1e-10)"
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
    return attrs.evolve(system, bodies=bodies)


def kinds(config: Config, spheres: Sequence[Shape]) -> Iterator[Sequence[Shape]]:
    """Shapes of i and j for polygons, if the study has any, and for spheres, if it has any."""
    if max(config.shapes.vertices) > 1:
        yield [stand_in(shape, config.shapes) for shape in spheres]
    if min(config.shapes.vertices) == 1:
        yield spheres
