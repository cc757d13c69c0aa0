"""The equivalent spheres of every collision type, and simple polygons of their size: what a study
is judged by before its flocs are made."""

from collections.abc import Iterator, Sequence

import attrs
import numpy as np

from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.flocs import Floc, read_flocs
from flocsim.ensembles.collision.mechanisms import make_encounter
from flocsim.ensembles.collision.pairings import pairings_of
from flocsim.ensembles.collision.start import zone_distance
from flocsim.ensembles.config.schema import Config
from flocsim.geometry.shapes.shape import Shape, Sphere
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon, resized
from flocsim.system import System


def measured_flocs(config: Config) -> list[Floc]:
    """Return the flocs of a study that keep their own sizes; none where flocs are resized."""
    return read_flocs(config.shapes) if config.shapes.size == "own" else []


def sphere_pairs(
    config: Config, flocs: Sequence[Floc] | None = None, which: str = "radii"
) -> Iterator[tuple[str, Encounter]]:
    """Yield (name, Encounter) of the equivalent spheres of every collision type.

    ``which`` of flocs of measured sizes: "radii", those that stand for all, "fastest" or "largest"
    of a Pairing; ``flocs``, where measured ones are read already.
    """
    flocs = measured_flocs(config) if flocs is None else flocs
    for pairing in pairings_of(config, flocs):
        radius_i, radius_j = getattr(pairing, which)
        zone = zone_distance(config.zone, config.forces, radius_i, radius_j)
        spheres = (Sphere(radius_i), Sphere(radius_j))
        yield pairing.name, make_encounter(config, spheres, zone, meeting=pairing.meeting)


def stand_in(shape, options):
    """Return a polygon as large as a sphere; ShapeError where the spheroradius leaves no core."""
    if options.own is not None:
        return options.own.scaled(shape.radius / options.own.equivalent_radius)
    # Measured flocs have spheroradii of their own.
    radius = options.radius if options.size == "scene" else min(options.radius, 0.5 * shape.radius)
    angles = np.arange(6) * np.pi / 3.0
    hexagon = SpheroPolygon(np.column_stack([np.cos(angles), np.sin(angles)]), 1.0)
    return resized(hexagon, shape.radius, radius)


def placed_system(config: Config, system: System, shapes: Sequence[Shape]) -> System:
    """Return the system with these shapes, the start gap apart."""
    gap = config.scene.start_gap
    reach = sum(shape.bounding_radius for shape in shapes) + (0.0 if isinstance(gap, str) else gap)
    places = ((0.0, 0.0), (0.0, reach))
    bodies = [
        attrs.evolve(body, shape=shape, position=place)
        for body, shape, place in zip(system.bodies, shapes, places, strict=True)
    ]
    return system.changed(bodies=tuple(bodies))


def kinds(config: Config, spheres: Sequence[Shape]) -> Iterator[Sequence[Shape]]:
    """Yield shapes of i and j for polygons, if the study has any, and spheres, if it has any."""
    if max(config.shapes.vertices) > 1:
        yield [stand_in(shape, config.shapes) for shape in spheres]
    if min(config.shapes.vertices) == 1:
        yield spheres
