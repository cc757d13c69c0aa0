"""Derivatives of the forces: DAMPING = −∂F/∂v and STIFFNESS = −∂F/∂q, of all bodies' coordinates.

A force along a direction J (its entries on two bodies, three each) whose size depends on J·q and
J·v gives products JᵀJ. What turning does to the directions is kept where it is of first order in
the contact forces; the rest is left to Newton's iterations, whose result it does not touch.
"""

from flocsim.integrators.contact_derivatives import add_contacts
from flocsim.integrators.memory import remember_velocities
from flocsim.integrators.products import add_product, normal_rows
from flocsim.integrators.turning import add_turning
from flocsim.integrators.views import (
    body_view,
    centre_line,
    centre_view,
    surface_view,
)
from flocsim.layout import CANDIDATES, CLOSEST, DAMPING, NOW, STIFFNESS
from flocsim.slots import (
    centre_damping,
    centre_force,
    centre_slope,
    has_centre_force,
    has_contact,
    position_force,
    reads_position,
    reads_velocity,
    surface_damping,
    surface_force,
    surface_reach,
    surface_slope,
    velocity_force,
)
from flocsim.state import BodyView


def shifted(view, axis, by):
    """A BodyView with one of x, y, angle (axis 0–2) or vx, vy, spin (axis 3–5) changed."""
    return BodyView(
        view.time,
        view.x + by * (axis == 0), view.y + by * (axis == 1), view.angle + by * (axis == 2),
        view.vx + by * (axis == 3), view.vy + by * (axis == 4), view.spin + by * (axis == 5),
        view.mass, view.buoyant_mass, view.inertia, view.radius,
    )  # fmt: skip


def add_velocity_derivative(scene, work, view, body):
    """One body's forces by its velocity, by differences of the kernels."""
    speeds = (view.vx, view.vy, view.spin)
    before = velocity_force(view, scene.parameters)
    for axis in range(3):
        floor = 1e-9 / view.radius if axis == 2 else 1e-9
        size = 1e-3 * abs(speeds[axis]) + floor
        after = velocity_force(shifted(view, 3 + axis, size), scene.parameters)
        for part in range(3):
            damping = -(after[part] - before[part]) / size
            work.jacobian[DAMPING, 3 * body + part, 3 * body + axis] += damping


def add_position_derivative(scene, work, view, body):
    """One body's forces by its place, by differences of the kernels."""
    before = position_force(view, scene.parameters)
    for axis in range(3):
        size = 1e-6 if axis == 2 else 1e-6 * view.radius
        after = position_force(shifted(view, axis, size), scene.parameters)
        for part in range(3):
            stiffness = -(after[part] - before[part]) / size
            work.jacobian[STIFFNESS, 3 * body + part, 3 * body + axis] += stiffness


def clear_jacobian(work):
    """No derivative yet."""
    for which in range(2):
        for row in range(work.jacobian.shape[1]):
            for column in range(work.jacobian.shape[2]):
                work.jacobian[which, row, column] = 0.0


def add_bodies(scene, work, time):
    """Derivatives of the body forces."""
    for body in range(scene.bodies.shape[0]):
        view = body_view(scene, work, time, NOW, body)
        if reads_velocity():
            add_velocity_derivative(scene, work, view, body)
        if reads_position():
            add_position_derivative(scene, work, view, body)


def add_centres(scene, work, time):
    """Derivatives of the centre forces."""
    for a in range(scene.bodies.shape[0]):
        for b in range(a):
            view = centre_view(scene, work, time, NOW, a, b)
            nx, ny, distance = centre_line(work, NOW, a, b)
            along = ((nx, ny, 0.0), (-nx, -ny, 0.0))
            across = ((-ny, nx, 0.0), (ny, -nx, 0.0))
            slope = centre_slope(view, scene.parameters)
            damping = centre_damping(view, scene.parameters)
            add_product(work, STIFFNESS, a, b, along, along, -slope)
            add_product(work, DAMPING, a, b, along, along, damping)
            if distance > 0.0:
                turning = -centre_force(view, scene.parameters) / distance
                add_product(work, STIFFNESS, a, b, across, across, turning)


def add_surfaces(scene, work, time):
    """Derivatives of the surface forces, at the closest pair of every two bodies."""
    for row in range(work.tally[CANDIDATES]):
        if work.candidates[row, CLOSEST] == 1:
            view = surface_view(scene, work, time, NOW, row)
            along = normal_rows(work, row)
            a, b = work.candidates[row, 0], work.candidates[row, 2]
            slope = surface_slope(view, scene.parameters)
            damping = surface_damping(view, scene.parameters)
            add_product(work, STIFFNESS, a, b, along, along, -slope)
            add_product(work, DAMPING, a, b, along, along, damping)
            add_turning(scene, work, row, surface_force(view, scene.parameters), 0.0)


def weigh_velocities(scene, work, time, remaining):
    """Derivatives of the body forces, and from them how long each body remembers its velocity."""
    clear_jacobian(work)
    add_bodies(scene, work, time)
    remember_velocities(scene, work, remaining)


def assemble_jacobian(scene, work, time, remaining):
    """DAMPING and STIFFNESS of the current state, whose contact geometry is located."""
    weigh_velocities(scene, work, time, remaining)
    if has_centre_force():
        add_centres(scene, work, time)
    if surface_reach(scene.parameters) > 0.0:
        add_surfaces(scene, work, time)
    if has_contact():
        add_contacts(scene, work)
