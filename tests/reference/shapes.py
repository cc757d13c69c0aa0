"""Bodies made of core points and a radius, and scenes of them."""

from dataclasses import dataclass

import numpy as np

from tests.reference.outline import area_centroid_inertia


@dataclass(frozen=True)
class Body:
    """Core vertices (N, 2) [m] about the centroid of the swept outline, and the inertial data.

    A `fixed` body counts as infinitely heavy in the damping of its contacts, and no force moves it.
    """

    vertices: np.ndarray
    radius: float
    mass: float
    inertia: float
    equivalent_radius: float
    density: float | None = None
    fixed: bool = False


@dataclass(frozen=True)
class Scene:
    """Bodies, positions (n, 3) as x, y, θ [m, m, rad], and velocities (n, 3) as vx, vy, ω."""

    bodies: tuple
    positions: np.ndarray
    velocities: np.ndarray


def make_body(vertices, radius, surface_density=None, density=None, depth="sphere"):
    """A body with m = ρ_s A and I = ρ_s J (MODEL 1); ρ_s is given or `density` times `depth`.

    Depth "sphere" is 4/3 r_eq, so that m is the mass of the equivalent solid sphere.
    """
    vertices = np.array(vertices, dtype=float).reshape(-1, 2)
    area, centroid, second_moment = area_centroid_inertia(vertices, radius)
    equivalent_radius = np.sqrt(area / np.pi)
    if surface_density is None:
        surface_density = density * (4 / 3 * equivalent_radius if depth == "sphere" else depth)
    return Body(
        vertices=vertices - centroid,
        radius=float(radius),
        mass=surface_density * area,
        inertia=surface_density * second_moment,
        equivalent_radius=equivalent_radius,
        density=density,
    )


def rotation(angle):
    """The matrix that turns counter-clockwise by `angle` [rad]."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def world_vertices(body, position):
    """Core vertices (N, 2) [m] of a body at x, y, θ."""
    return body.vertices @ rotation(position[2]).T + position[:2]
