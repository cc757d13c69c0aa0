"""Random scenes of two or three bodies of every kind, most of them in contact."""

import numpy as np
import shapely

from tests.reference.contacts import all_pairs, measure
from tests.reference.outline import core_geometry
from tests.reference.shapes import Scene, make_body, world_vertices

MOST_VERTICES = 24
DEEPEST_SHARE = 0.3
"""Deepest overlap of a random scene, as a share of r_i + r_j."""


def random_scene(rng, surface_density=2.0):
    """A Scene of 2 or 3 random bodies, slightly overlapping or slightly apart, in random motion.

    Cores neither cross nor hold one another's vertices, and no overlap exceeds
    0.3 (r_i + r_j). Bodies have the given ρ_s [kg/m²]. The same generator state gives the same
    scene.
    """
    bodies, positions = [], []
    for _ in range(rng.integers(2, 4)):
        body = random_body(rng, surface_density)
        positions.append(random_place(rng, body, bodies, positions))
        bodies.append(body)
    spread = np.array([1e-3, 1e-3, 100.0])
    return Scene(tuple(bodies), np.array(positions), spread * rng.normal(size=(len(bodies), 3)))


def random_body(rng, surface_density):
    """A sphere, segment, convex, star-shaped, C-shaped or spiral body of 1 to 30 µm."""
    size = 1e-6 * 30.0 ** rng.uniform()
    make_core = rng.choice([sphere, segment, convex, star, star, c_shape, spiral])
    if make_core is sphere:
        return make_body([[0.0, 0.0]], size, surface_density)
    core = make_core(rng)
    while len(core) > 2 and not shapely.Polygon(core).is_valid:
        core = make_core(rng)
    return make_body(size * core, rng.uniform(0.3e-6, 2e-6), surface_density)


def sphere(rng):
    """One vertex."""
    return np.zeros((1, 2))


def segment(rng):
    """Two vertices."""
    return np.array([[-1.0, 0.0], [1.0, 0.0]])


def convex(rng):
    """Points in order around an ellipse."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, MOST_VERTICES + 1)))
    return polar(1.0, angles) * [1.0, rng.uniform(0.2, 1.0)]


def star(rng):
    """Star-shaped about its middle, with very unequal rays."""
    count = rng.integers(4, MOST_VERTICES + 1)
    angles = (np.arange(count) + rng.uniform(-0.4, 0.4, count)) * 2 * np.pi / count
    return polar(rng.uniform(0.25, 1.0, count), angles)


def c_shape(rng):
    """A band along most of a circle, whose mouth the sweep may close."""
    mouth, count = rng.uniform(0.3, 2.5), rng.integers(4, MOST_VERTICES // 2 + 1)
    angles = np.linspace(0, 2 * np.pi - mouth, count)
    return band(1.0, rng.uniform(0.15, 0.5), angles)


def spiral(rng):
    """A band along more than one turn of a spiral."""
    angles = np.linspace(0, 2 * np.pi * rng.uniform(1.1, 1.5), MOST_VERTICES // 2)
    return band(0.3 + 0.7 * angles / angles[-1], rng.uniform(0.08, 0.2), angles)


def band(outer, thickness, angles):
    """The strip between the outer curve and the same curve `thickness` further in."""
    return np.concatenate([polar(outer, angles), polar(outer - thickness, angles)[::-1]])


def polar(radius, angles):
    """Points (N, 2) at the given radii and angles."""
    return (radius * np.array([np.cos(angles), np.sin(angles)])).T


def random_place(rng, body, bodies, positions):
    """A position x, y, θ at which the body just overlaps, or nearly reaches, those in place."""
    if not bodies:
        return np.array([0.0, 0.0, rng.uniform(0, 2 * np.pi)])
    share = rng.uniform(0.0, DEEPEST_SHARE) if rng.uniform() < 0.85 else rng.uniform(-0.5, 0.0)
    while True:
        start = random_start(rng, body, bodies, positions)
        place = advance(start, rng.uniform(0, 2 * np.pi), body, bodies, positions, share)
        if place is not None:
            return crowd(rng, place, body, bodies, positions)


def random_start(rng, body, bodies, positions):
    """A position near one of the bodies in place, within its hollows too."""
    k = rng.integers(len(bodies))
    box = reach(body) + reach(bodies[k])
    return np.array([*(positions[k][:2] + box * rng.uniform(-1, 1, 2)), rng.uniform(0, 2 * np.pi)])


def reach(body):
    """Largest distance from the centroid to the outline [m]."""
    return np.hypot(*body.vertices.T).max() + body.radius


def clearance(place, body, bodies, positions, share):
    """Least of: distance of the cores minus (1 − share)(r_i + r_j) [m]; < 0 is too deep."""
    core = core_geometry(world_vertices(body, place))
    return min(
        core.distance(core_geometry(world_vertices(other, position)))
        - (1 - share) * (body.radius + other.radius)
        for other, position in zip(bodies, positions, strict=True)
    )


def advance(place, direction, body, bodies, positions, share):
    """Move straight on until the clearance is used up; None if it starts below 0 or never is.

    A step of the clearance's own length can never overshoot.
    """
    for _ in range(60):
        room = clearance(place, body, bodies, positions, share)
        if room < 0 or np.hypot(*place[:2]) > 300e-6:
            return None
        if room < 1e-3 * body.radius:
            return place
        place = place + room * np.array([np.cos(direction), np.sin(direction), 0.0])
    return None


def crowd(rng, place, body, bodies, positions, proposals=12):
    """Of the place and some near it, the permitted one with the most touching pairs."""
    nearby = [place + rng.normal(size=3) * [1e-6, 1e-6, 0.2] for _ in range(proposals)]
    permitted = [p for p in nearby if clearance(p, body, bodies, positions, DEEPEST_SHARE) >= 0]
    return max([place, *permitted], key=lambda p: touching_count(p, body, bodies, positions))


def touching_count(place, body, bodies, positions):
    """The number of pairs in contact when the body is at the place."""
    everyone = (*bodies, body)
    scene = Scene(everyone, np.array([*positions, place]), np.zeros((len(everyone), 3)))
    return int(np.sum(measure(scene, all_pairs(everyone)).overlap > 0))
