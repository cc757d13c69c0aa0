"""What two bodies do to each other by how they are turned: from an energy, by differences.

The energy U is one of the distance d of the centroids and of both angles from the line between
them, α_i and α_j. On j act −∂U/∂d along that line, and (∂U/∂α_i + ∂U/∂α_j)/d across it, as that
line turns where j moves aside; torques are −∂U/∂α.
"""

import math

from flocsim.geometry.contact.points import length_of, separation
from flocsim.hooks import oriented_energy
from flocsim.integrators.rhs.views import effective_mass
from flocsim.state.bodies import ANGLE
from flocsim.state.views import OrientedView
from flocsim.state.work import NOW

TURN = 1e-4
"""Angle by which bodies are turned for a difference [rad]: its square is what differences leave."""

SHARE, LEAST = 1e-4, 1e-12
"""How far they are moved: a share of the gap, and this [m] at least."""


def oriented_view(scene, time, j, i, distance, angle_i, angle_j):
    radius_i = scene.bodies[i].equivalent_radius
    radius_j = scene.bodies[j].equivalent_radius
    return OrientedView(
        time, distance - radius_i - radius_j, distance, angle_i, angle_j, radius_i, radius_j,
        radius_i * radius_j / (radius_i + radius_j), effective_mass(scene, j, i),
    )  # fmt: skip


def oriented_from(scene, time, j, i, x, y, angle_j, angle_i):
    """The OrientedView of two bodies, j being seen from i at x, y [m]."""
    bearing = math.atan2(y, x)
    one, other = angle_i - bearing, angle_j - bearing
    return oriented_view(scene, time, j, i, length_of(x, y), one, other)


def oriented_now(scene, work, time, j, i):
    """The same in the state NOW."""
    x, y = separation(scene, work, NOW, j, i)
    angle_j, angle_i = work.place[NOW, j, ANGLE], work.place[NOW, i, ANGLE]
    return oriented_from(scene, time, j, i, x, y, angle_j, angle_i)


def energy_at(scene, time, j, i, distance, angle_i, angle_j):
    """U [J]."""
    return oriented_energy(scene, oriented_view(scene, time, j, i, distance, angle_i, angle_j))


def between_oriented(scene, time, j, i, x, y, angle_j, angle_i):
    """(fx, fy, torque on j, torque on i) on body j, the later one, which is seen from i at x, y
    [m]; i feels the reverse of fx, fy [N, N, N m, N m]. Nothing where centroids are at one place.
    """
    view = oriented_from(scene, time, j, i, x, y, angle_j, angle_i)
    distance, one, other = view.centre_distance, view.angle_i, view.angle_j
    if distance == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    by = SHARE * abs(view.gap) + LEAST
    rise = energy_at(scene, time, j, i, distance + by, one, other)
    rise -= energy_at(scene, time, j, i, distance - by, one, other)
    of_i = energy_at(scene, time, j, i, distance, one + TURN, other)
    of_i -= energy_at(scene, time, j, i, distance, one - TURN, other)
    of_j = energy_at(scene, time, j, i, distance, one, other + TURN)
    of_j -= energy_at(scene, time, j, i, distance, one, other - TURN)
    along, torque_i, torque_j = -0.5 * rise / by, -0.5 * of_i / TURN, -0.5 * of_j / TURN
    across = -(torque_i + torque_j) / distance
    nx, ny = x / distance, y / distance
    return along * nx - across * ny, along * ny + across * nx, torque_j, torque_i
