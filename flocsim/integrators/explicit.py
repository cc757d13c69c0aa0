"""The right-hand side as it stands: all forces and torques at a position and velocity.

The place is taken from one state of ``Work.motion`` and the velocity from another.
"""

from flocsim.geometry.contacts import locate_contacts
from flocsim.integrators.views import (
    add_force,
    body_view,
    centre_line,
    centre_view,
    closest_rows,
    contact_view,
    normal_rate,
    push_pair,
    surface_view,
    tangential_rate,
)
from flocsim.layout import CANDIDATES, EVALUATIONS, FORCE
from flocsim.slots import (
    body_force,
    centre_force,
    contact_force,
    has_centre_force,
    has_contact,
    surface_force,
    surface_reach,
)


def clear_forces(work):
    """No force yet on any body."""
    for body in range(work.bodies.shape[0]):
        for axis in range(3):
            work.bodies[body, FORCE + axis] = 0.0


def add_body_forces(scene, work, time, place, speed):
    """Weight, drag and their like."""
    for body in range(scene.bodies.shape[0]):
        view = body_view(scene, work, time, place, speed, body)
        fx, fy, torque = body_force(view, scene.parameters)
        add_force(work, body, fx, fy, torque)


def add_centre_forces(scene, work, time, place, speed):
    """Forces along the lines of centres."""
    for a in range(scene.bodies.shape[0]):
        for b in range(a):
            view = centre_view(scene, work, time, place, speed, a, b)
            nx, ny, _ = centre_line(work, place, a, b)
            repulsion = centre_force(view, scene.parameters)
            add_force(work, a, repulsion * nx, repulsion * ny, 0.0)
            add_force(work, b, -repulsion * nx, -repulsion * ny, 0.0)


def add_surface_forces(scene, work, time, place, speed):
    """Forces at the closest points of the outlines."""
    row = 0
    while row < work.tally[CANDIDATES]:
        row, closest = closest_rows(work, row)
        view = surface_view(scene, work, time, place, speed, closest)
        push_pair(work, closest, surface_force(view, scene.parameters), 0.0)


def add_contact_forces(scene, work, speed, slips):
    """Visco-elastic forces of all listed pairs that overlap."""
    for row in range(work.tally[CANDIDATES]):
        overlap = -work.geometry[row, 2]
        if overlap > 0.0:
            rate = -normal_rate(work, speed, row)
            slip_rate = tangential_rate(work, speed, row)
            slip = work.slip[slips, row]
            view = contact_view(scene, work, row, overlap, rate, slip, slip_rate)
            normal, tangential = contact_force(view, scene.parameters)
            push_pair(work, row, normal, tangential)


def sum_forces(scene, work, time, place, speed, slips):
    """All forces and torques into ``work.bodies``; the contact geometry is left in ``work``."""
    work.tally[EVALUATIONS] += 1
    clear_forces(work)
    add_body_forces(scene, work, time, place, speed)
    if has_centre_force():
        add_centre_forces(scene, work, time, place, speed)
    if has_contact() or surface_reach(scene.parameters) > 0.0:
        locate_contacts(scene, work, place)
    if surface_reach(scene.parameters) > 0.0:
        add_surface_forces(scene, work, time, place, speed)
    if has_contact():
        add_contact_forces(scene, work, speed, slips)
