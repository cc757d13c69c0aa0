"""Forces and torques of two bodies from an energy that depends on their orientations.

The energy U(d, α_i, α_j) depends on the distance d of the centroids and on both angles, measured
from the line between them. The force on j is −∂U/∂d along that line and (∂U/∂α_i + ∂U/∂α_j)/d
across it, as the line turns if j moves sideways; torques are −∂U/∂α. Derivatives are central
differences, of second order in the step.
"""

import math

from flocsim.constants import MINIMUM_GAP
from flocsim.geometry.contact.points import length_of, separation
from flocsim.hooks import oriented_energy
from flocsim.integrators.rhs.views import effective_mass
from flocsim.state.bodies import ANGLE
from flocsim.state.views import OrientedView
from flocsim.state.work import NOW

DIFFERENCE = 1e-4
"""Difference step of angles [rad], and of the distance as a fraction of the gap. The error of a
central difference is of the order of its square."""


def oriented_view(scene, time, j, i, distance, angle_i, angle_j):
    radius_i = scene.bodies[i].equivalent_radius
    radius_j = scene.bodies[j].equivalent_radius
    return OrientedView(
        time, distance - radius_i - radius_j, distance, angle_i, angle_j, radius_i, radius_j,
        radius_i * radius_j / (radius_i + radius_j), effective_mass(scene, j, i),
    )  # fmt: skip


def oriented_from(scene, time, j, i, x, y, angle_j, angle_i):
    """Return the OrientedView of two bodies, j being seen from i at x, y [m]."""
    bearing = math.atan2(y, x)
    # Angles to the line of centres do not change when the pair turns as a whole.
    one, other = angle_i - bearing, angle_j - bearing
    return oriented_view(scene, time, j, i, length_of(x, y), one, other)


def oriented_now(scene, work, time, j, i):
    """Return the OrientedView of two bodies in the state NOW."""
    x, y = separation(scene, work, NOW, j, i)
    angle_j, angle_i = work.place[NOW, j, ANGLE], work.place[NOW, i, ANGLE]
    return oriented_from(scene, time, j, i, x, y, angle_j, angle_i)


def energy_at(scene, time, j, i, distance, angle_i, angle_j):
    """Return U [J]."""
    return oriented_energy(scene, oriented_view(scene, time, j, i, distance, angle_i, angle_j))


def distance_step(view):
    """Return the difference step of the distance [m]; no law varies faster than over d_min."""
    return DIFFERENCE * max(abs(view.gap), MINIMUM_GAP)


def oriented_forces_at(scene, time, j, i, x, y, angle_j, angle_i):
    """Return (fx, fy, torque on j, torque on i) [N, N, N m, N m] on the later body j, seen from i
    at x, y.

    i feels the reverse of fx, fy. All are 0 if the centroids coincide.
    """
    view = oriented_from(scene, time, j, i, x, y, angle_j, angle_i)
    distance, one, other = view.centre_distance, view.angle_i, view.angle_j
    if distance == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    by = distance_step(view)
    # −∂U/∂d, −∂U/∂α_i and −∂U/∂α_j.
    rise = energy_at(scene, time, j, i, distance + by, one, other)
    rise -= energy_at(scene, time, j, i, distance - by, one, other)
    of_i = energy_at(scene, time, j, i, distance, one + DIFFERENCE, other)
    of_i -= energy_at(scene, time, j, i, distance, one - DIFFERENCE, other)
    of_j = energy_at(scene, time, j, i, distance, one, other + DIFFERENCE)
    of_j -= energy_at(scene, time, j, i, distance, one, other - DIFFERENCE)
    along, torques = -0.5 * rise / by, -0.5 / DIFFERENCE
    torque_i, torque_j = torques * of_i, torques * of_j
    # Balance of torques about i.
    across = -(torque_i + torque_j) / distance
    nx, ny = x / distance, y / distance
    return along * nx - across * ny, along * ny + across * nx, torque_j, torque_i
