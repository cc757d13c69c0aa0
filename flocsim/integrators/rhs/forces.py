"""The right-hand side as it stands: all forces and torques in a state.

Forces act through the listed pairs that are flagged as closed, or as near (surface_gap.py).
An integrator that freezes these flags for a step has a smooth right-hand side in it.
"""

from flocsim.geometry.contact.points import locate_acting
from flocsim.hooks import (
    BODY_FORCE,
    CENTRE_FORCE,
    CONTACT_FORCE,
    body_force,
    centre_force,
    contact_force,
    has,
    hook,
    surface_force,
)
from flocsim.integrators.rhs.friction import grazing_force
from flocsim.integrators.rhs.outline_sum import acts_along, outlines_in
from flocsim.integrators.rhs.pair_resistance import add_pair_resistance
from flocsim.integrators.rhs.surface_gap import run_end, surface_view
from flocsim.integrators.rhs.views import (
    add_force,
    body_view,
    centre_view,
    contact_view,
    push_pair,
    soft_centre_line,
    tangential_rate,
)
from flocsim.state.contacts import GRAZES, OPEN, TOUCHES
from flocsim.state.work import NEW, NOW, START


def keep_start(work):
    """Keep the motion at the start of the step, in START."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[START, body, axis] = work.place[NOW, body, axis]
            work.velocity[START, body, axis] = work.velocity[NOW, body, axis]


def take_stage(work, stage):
    """Make a stage the new state: its motion, and what closed pairs need."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[NEW, body, axis] = work.place[stage, body, axis]
            work.velocity[NEW, body, axis] = work.velocity[stage, body, axis]
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.closed == TOUCHES:
            work.slip[NEW, row] = work.slip[stage, row]
        if candidate.closed != OPEN:
            work.geometry[NEW, row] = work.geometry[stage, row]


def add_body_forces(scene, work, time, state):
    for body in range(scene.bodies.shape[0]):
        view = body_view(scene, work, time, state, body)
        fx, fy, torque = body_force(scene, view)
        add_force(work, state, body, fx, fy, torque)


def add_centre_forces(scene, work, time, state):
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        view = centre_view(scene, work, time, state, a, b)
        nx, ny, _ = soft_centre_line(scene, work, state, a, b)
        repulsion = centre_force(scene, view)
        add_force(work, state, a, repulsion * nx, repulsion * ny, 0.0)
        add_force(work, state, b, -repulsion * nx, -repulsion * ny, 0.0)


def add_surface_forces(scene, work, time, state):
    row = 0
    while row < work.tally.candidates:
        end = run_end(work, row)
        repulsion = surface_force(scene, surface_view(scene, work, time, state, row, end))
        for each in range(row, end):
            share = work.geometry[state, each].share
            if share > 0.0:
                push_pair(work, state, each, share * repulsion, 0.0)
        row = end


@hook
def add_outline_forces(scene, work, time, state):
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        fx, fy, torque_a, torque_b = outlines_in(scene, work, time, state, a, b)
        if state == NOW:
            # Derivatives, which are taken next, begin from it.
            work.along[pair, 0], work.along[pair, 1] = fx, fy
            work.along[pair, 2], work.along[pair, 3] = torque_a, torque_b
        add_force(work, state, a, fx, fy, torque_a)
        add_force(work, state, b, -fx, -fy, torque_b)


def add_contact_forces(scene, work, state):
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.closed == TOUCHES:
            view = contact_view(scene, work, state, row)
            normal, tangential = contact_force(scene, view)
            push_pair(work, state, row, normal, tangential)
        elif candidate.closed == GRAZES:
            push_pair(work, state, row, 0.0, grazing_force(work, state, row))


def rate_slips(work, state):
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == TOUCHES:
            work.slip_rate[state, row] = tangential_rate(work, state, row)


def locate_touching(scene, work, state):
    """Contact geometry of a state, of the pairs through which forces act."""
    if has(scene, CONTACT_FORCE) or scene.listed_reach > 0.0:
        locate_acting(scene, work, state)


def locate_and_rate(scene, work, state):
    """Contact geometry of a state, and the rates of its tangential displacements."""
    locate_touching(scene, work, state)
    rate_slips(work, state)


def sum_other_forces(scene, work, time, state):
    """All forces and torques of a state but those of contacts into ``work.force[state]``; its
    geometry is located."""
    work.tally.evaluations += 1
    for body in range(work.poses.shape[0]):
        for axis in range(3):
            work.force[state, body, axis] = 0.0
    if has(scene, BODY_FORCE):
        add_body_forces(scene, work, time, state)
    if has(scene, CENTRE_FORCE):
        add_centre_forces(scene, work, time, state)
    if scene.surface_reach > 0.0:
        add_surface_forces(scene, work, time, state)
    if acts_along(scene):
        add_outline_forces(scene, work, time, state)
    add_pair_resistance(scene, work, state)


def sum_forces(scene, work, time, state):
    """All forces and torques of a state into ``work.force[state]``; its geometry is located."""
    sum_other_forces(scene, work, time, state)
    if has(scene, CONTACT_FORCE):
        add_contact_forces(scene, work, state)
