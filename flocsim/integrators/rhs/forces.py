"""The right-hand side: all forces and torques in a state.

    m dv/dt = Σ F,   I dω/dt = Σ τ.

The sum runs over bodies (weight, drag), over pairs of bodies (centre forces, forces along outlines,
resistance of the water between them) and over candidate rows, vertex beside edge (surface and
contact forces). A row contributes only while it is flagged as closed, or as near (surface_gap.py).
An integrator that freezes these flags for a step has a smooth right-hand side within it.

Every force on a pair is added with opposite signs at one point, so momentum and angular momentum
are conserved to rounding.
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
from flocsim.integrators.rhs.outline_sum import has_outline_forces, outline_forces_in
from flocsim.integrators.rhs.pair_resistance import add_pair_resistance
from flocsim.integrators.rhs.surface_gap import pair_end, surface_view
from flocsim.integrators.rhs.views import (
    add_force,
    add_pair_force,
    body_view,
    centre_view,
    contact_view,
    soft_centre_line,
    tangential_rate,
)
from flocsim.state.contacts import CLOSED, GRAZING, OPEN
from flocsim.state.work import NEW, NOW


def copy_motion(work, source, target):
    """Copy the motion of all bodies from one state to another."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[target, body, axis] = work.place[source, body, axis]
            work.velocity[target, body, axis] = work.velocity[source, body, axis]


def adopt_stage(work, stage):
    """Make a stage the new state: its motion, and the geometry and displacements of closed
    pairs."""
    copy_motion(work, stage, NEW)
    # Geometry of open pairs is located only when the step is accepted.
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.contact_mode == CLOSED:
            work.slip[NEW, row] = work.slip[stage, row]
        if candidate.contact_mode != OPEN:
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
        # The softened centre line fades out towards d_c = 0, so nested flocs feel no jump.
        nx, ny, _ = soft_centre_line(scene, work, state, a, b)
        repulsion = centre_force(scene, view)
        add_force(work, state, a, repulsion * nx, repulsion * ny, 0.0)
        add_force(work, state, b, -repulsion * nx, -repulsion * ny, 0.0)


def add_surface_forces(scene, work, time, state):
    row = 0
    while row < work.tally.candidates:
        # Rows of the same two bodies share one force F(g̃), in the fractions s_k = ∂g̃/∂g_k.
        end = pair_end(work, row)
        repulsion = surface_force(scene, surface_view(scene, work, time, state, row, end))
        for each in range(row, end):
            share = work.geometry[state, each].force_share
            if share > 0.0:
                add_pair_force(work, state, each, share * repulsion, 0.0)
        row = end


@hook
def add_outline_forces(scene, work, time, state):
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        fx, fy, torque_a, torque_b = outline_forces_in(scene, work, time, state, a, b)
        if state == NOW:
            # Stored for add_outline_derivatives, which takes differences from this value.
            work.outline_forces[pair, 0], work.outline_forces[pair, 1] = fx, fy
            work.outline_forces[pair, 2], work.outline_forces[pair, 3] = torque_a, torque_b
        add_force(work, state, a, fx, fy, torque_a)
        add_force(work, state, b, -fx, -fy, torque_b)


def add_contact_forces(scene, work, state):
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.contact_mode == CLOSED:
            view = contact_view(scene, work, state, row)
            normal, tangential = contact_force(scene, view)
            add_pair_force(work, state, row, normal, tangential)
        elif candidate.contact_mode == GRAZING:
            add_pair_force(work, state, row, 0.0, grazing_force(work, state, row))


def write_slip_rates(work, state):
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == CLOSED:
            work.slip_rate[state, row] = tangential_rate(work, state, row)


def locate_for_forces(scene, work, state):
    """Locate the pairs through which forces act in a state, if the scene has such forces."""
    if has(scene, CONTACT_FORCE) or scene.listed_reach > 0.0:
        locate_acting(scene, work, state)


def locate_with_slip_rates(scene, work, state):
    """Locate the acting pairs of a state, and write the rates of their tangential displacements."""
    locate_for_forces(scene, work, state)
    write_slip_rates(work, state)


def sum_forces_without_contacts(scene, work, time, state):
    """Sum all forces and torques except contact forces into ``work.force[state]``. Geometry is
    located."""
    work.tally.evaluations += 1
    # Start from zero in this state.
    for body in range(work.poses.shape[0]):
        for axis in range(3):
            work.force[state, body, axis] = 0.0
    # Each kind runs only if the scene has a law for it.
    if has(scene, BODY_FORCE):
        add_body_forces(scene, work, time, state)
    if has(scene, CENTRE_FORCE):
        add_centre_forces(scene, work, time, state)
    if scene.surface_reach > 0.0:
        add_surface_forces(scene, work, time, state)
    if has_outline_forces(scene):
        add_outline_forces(scene, work, time, state)
    add_pair_resistance(scene, work, state)


def sum_forces(scene, work, time, state):
    """Sum all forces and torques of a state into ``work.force[state]``. Geometry must be
    located."""
    sum_forces_without_contacts(scene, work, time, state)
    if has(scene, CONTACT_FORCE):
        add_contact_forces(scene, work, state)
