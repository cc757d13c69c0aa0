"""The linear system of an implicit step: mass + h · damping + h² · stiffness.

Unknown are the end velocities v′ of all bodies, three rows each. Without contacts,
(M + h D + h² K) v′ = M v + h F + h D v with D = −∂F/∂v and K = −∂F/∂q of body, centre and surface
forces; attraction that grows towards contact has a negative K and is left to the error control.
"""

from flocsim.integrators.views import (
    body_view,
    centre_line,
    centre_view,
    closest_rows,
    surface_view,
)
from flocsim.layout import BASE, CANDIDATES, FREE, INERTIA, MASS
from flocsim.slots import (
    body_force,
    centre_damping,
    centre_force,
    centre_slope,
    has_centre_force,
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


def add_load(work, which, row, value):
    """Add to the load of one equation."""
    work.system[which, row, work.system.shape[1]] += value


def shifted(view, axis, by):
    """A BodyView with one of x, y, angle (axis 0–2) or vx, vy, spin (axis 3–5) changed."""
    return BodyView(
        view.time,
        view.x + by * (axis == 0), view.y + by * (axis == 1), view.angle + by * (axis == 2),
        view.vx + by * (axis == 3), view.vy + by * (axis == 4), view.spin + by * (axis == 5),
        view.mass, view.buoyant_mass, view.inertia, view.radius,
    )  # fmt: skip


def add_velocity_derivative(scene, work, view, body, step):
    """h D of one body's forces, and h D v, by differences of the kernels."""
    speeds = (view.vx, view.vy, view.spin)
    before = velocity_force(view, scene.parameters)
    for axis in range(3):
        floor = 1e-9 / view.radius if axis == 2 else 1e-9
        size = 1e-3 * abs(speeds[axis]) + floor
        after = velocity_force(shifted(view, 3 + axis, size), scene.parameters)
        for part in range(3):
            damping = -step * (after[part] - before[part]) / size
            work.system[BASE, 3 * body + part, 3 * body + axis] += damping
            add_load(work, BASE, 3 * body + part, damping * speeds[axis])


def add_position_derivative(scene, work, view, body, step):
    """h² K of one body's forces, by differences of the kernels."""
    before = position_force(view, scene.parameters)
    for axis in range(3):
        size = 1e-6 if axis == 2 else 1e-6 * view.radius
        after = position_force(shifted(view, axis, size), scene.parameters)
        for part in range(3):
            stiffness = -step * step * (after[part] - before[part]) / size
            work.system[BASE, 3 * body + part, 3 * body + axis] += stiffness


def start_system(scene, work, speed):
    """M and M v."""
    system = work.system
    for row in range(system.shape[1]):
        for column in range(system.shape[2]):
            system[BASE, row, column] = 0.0
    for body in range(scene.bodies.shape[0]):
        for axis in range(3):
            inertia = scene.bodies[body, INERTIA] if axis == 2 else scene.bodies[body, MASS]
            system[BASE, 3 * body + axis, 3 * body + axis] = inertia
            add_load(work, BASE, 3 * body + axis, inertia * work.motion[speed, body, 3 + axis])


def add_bodies(scene, work, time, state, step):
    """Body forces and their derivatives."""
    for body in range(scene.bodies.shape[0]):
        view = body_view(scene, work, time, state, state, body)
        force = body_force(view, scene.parameters)
        for part in range(3):
            add_load(work, BASE, 3 * body + part, step * force[part])
        if reads_velocity():
            add_velocity_derivative(scene, work, view, body, step)
        if reads_position():
            add_position_derivative(scene, work, view, body, step)


def add_direction(work, which, a, b, on_a, on_b, weight, value):
    """weight · JᵀJ and value · Jᵀ of a direction with entries on_a and on_b on two bodies."""
    system = work.system
    for i in range(3):
        for j in range(3):
            system[which, 3 * a + i, 3 * a + j] += weight * on_a[i] * on_a[j]
            system[which, 3 * a + i, 3 * b + j] += weight * on_a[i] * on_b[j]
            system[which, 3 * b + i, 3 * a + j] += weight * on_b[i] * on_a[j]
            system[which, 3 * b + i, 3 * b + j] += weight * on_b[i] * on_b[j]
        add_load(work, which, 3 * a + i, value * on_a[i])
        add_load(work, which, 3 * b + i, value * on_b[i])


def add_pair_force(work, a, b, on_a, on_b, view, repulsion, slope, damping, step):
    """A pair force along the direction in which its gap opens, with its derivatives."""
    resistance = max(damping, 0.0)
    weight = step * resistance + step * step * max(-slope, 0.0)
    value = step * (repulsion + resistance * view.gap_rate)
    add_direction(work, BASE, a, b, on_a, on_b, weight, value)


def add_centres(scene, work, time, state, step):
    """Centre forces and their derivatives."""
    for a in range(scene.bodies.shape[0]):
        for b in range(a):
            view = centre_view(scene, work, time, state, state, a, b)
            nx, ny, _ = centre_line(work, state, a, b)
            force = centre_force(view, scene.parameters)
            slope = centre_slope(view, scene.parameters)
            damping = centre_damping(view, scene.parameters)
            on_a, on_b = (nx, ny, 0.0), (-nx, -ny, 0.0)
            add_pair_force(work, a, b, on_a, on_b, view, force, slope, damping, step)


def normal_rows(work, row):
    """Entries of a pair's normal direction on its two bodies."""
    g = work.geometry
    nx, ny = g[row, 0], g[row, 1]
    return (nx, ny, g[row, 3]), (-nx, -ny, -g[row, 5])


def tangent_rows(work, row):
    """Entries of a pair's tangential direction on its two bodies."""
    g = work.geometry
    tx, ty = -g[row, 1], g[row, 0]
    return (tx, ty, g[row, 4]), (-tx, -ty, -g[row, 6])


def add_surfaces(scene, work, time, state, step):
    """Surface forces and their derivatives, at the closest pair of every two bodies."""
    row = 0
    while row < work.tally[CANDIDATES]:
        row, closest = closest_rows(work, row)
        view = surface_view(scene, work, time, state, state, closest)
        on_a, on_b = normal_rows(work, closest)
        a, b = work.candidates[closest, 0], work.candidates[closest, 2]
        force = surface_force(view, scene.parameters)
        slope = surface_slope(view, scene.parameters)
        damping = surface_damping(view, scene.parameters)
        add_pair_force(work, a, b, on_a, on_b, view, force, slope, damping, step)


def assemble_base(scene, work, time, state, step):
    """All but the contacts, into the BASE system."""
    start_system(scene, work, state)
    add_bodies(scene, work, time, state, step)
    if has_centre_force():
        add_centres(scene, work, time, state, step)
    if surface_reach(scene.parameters) > 0.0:
        add_surfaces(scene, work, time, state, step)


def hold_fixed(scene, work, which):
    """Fixed bodies do not move: their equations become v′ unchanged."""
    system = work.system
    for body in range(scene.bodies.shape[0]):
        if scene.bodies[body, FREE] == 0.0:
            for i in range(3 * body, 3 * body + 3):
                for j in range(system.shape[1]):
                    system[which, i, j] = 0.0
                    system[which, j, i] = 0.0
                system[which, i, i] = 1.0
                system[which, i, system.shape[1]] = 0.0
