"""One backward Euler step by a semismooth Newton method for the velocities at its end.

    M (v₁ − v₀)/h = F(x₀ + h v₁, v₁, contacts of the end)

The derivatives are those of the contacts that are closed, stick and slide at the iterate. With
contacts as springs, these are the active sets of the complementarity problem that rigid contacts
pose (Moreau 1988, Jean 1999; for the method Christensen, Klarbring, Pang & Strömberg 1998). It
converges where the active sets are known; otherwise interior.py comes first.

The iterate is in NOW, with contacts that may close marked as closed. The start of the step is in
START, and its contacts are in TRIAL. NOW keeps the tangential displacements of the start.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.constants import DEEPEST_OVERLAP
from flocsim.geometry.contact.points import locate_acting, locate_contacts
from flocsim.hooks import CONTACT_FORCE, has
from flocsim.integrators.backward_euler.contact_mean import (
    add_all_derivatives,
    add_mean_forces,
    flag_close,
    takes_part,
)
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.elimination import solve_blocks
from flocsim.integrators.radau.systems import factorise_euler
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.error import ITERATION_TOLERANCE, end_of_run, rounding_error
from flocsim.integrators.rhs.forces import copy_motion, sum_forces_without_contacts
from flocsim.integrators.rhs.jacobian import assemble_without_contacts
from flocsim.integrators.rhs.surface_gap import flag_near
from flocsim.integrators.rhs.views import inertia, lever
from flocsim.state.bodies import X, Y
from flocsim.state.contacts import CLOSED, OPEN
from flocsim.state.work import CHANGE, NEW, NOW, START, TRIAL

MAX_ITERATIONS = 50
"""Iterations after which a search for the end has failed."""


def begin_step(work, clock):
    """Store the start of the step, and unmark all contacts."""
    copy_motion(work, NOW, START)
    for row in range(work.tally.candidates):
        work.geometry[TRIAL, row] = work.geometry[NOW, row]
        work.candidates[row].contact_mode = OPEN
        # Where a contact opens, friction fades over its overlap at the start. With a tiny overlap
        # it would vanish at once, so the length has a lower bound (contact_mean.py).
        least = ITERATION_TOLERANCE * clock.tolerance
        work.interior[row].fade_length = max(-work.geometry[NOW, row].gap, least)


def end_step(work):
    """Move the iterate to NEW, mark the contacts that took part, and restore the start in NOW."""
    copy_motion(work, NOW, NEW)
    copy_motion(work, START, NOW)
    for row in range(work.tally.candidates):
        work.candidates[row].contact_mode = CLOSED if takes_part(work, row) else OPEN
        work.geometry[NOW, row] = work.geometry[TRIAL, row]


def update_positions(work, step):
    """Compute the positions at the end from the velocities there."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            start = work.place[START, body, axis]
            work.place[NOW, body, axis] = start + step * work.velocity[NOW, body, axis]


@apart
def evaluate_other_forces(scene, work, time, step):
    """Compute all forces at the end of the step except those of contacts, which are located."""
    update_positions(work, step)
    locate_contacts(scene, work, NOW)
    if scene.surface_reach > 0.0:
        flag_near(scene, work, NOW, 0.0)
    sum_forces_without_contacts(scene, work, time + step, NOW)


def evaluate_included(scene, work, time, step):
    """Compute all forces at the end of the step except those of contacts; locate marked pairs only.

    Surface forces need all pairs located.
    """
    if scene.surface_reach > 0.0:
        evaluate_other_forces(scene, work, time, step)
        return
    update_positions(work, step)
    locate_acting(scene, work, NOW)
    sum_forces_without_contacts(scene, work, time + step, NOW)


def evaluate_end(scene, work, time, step):
    """Compute all forces at the end of the step; return False if bodies overlap too deeply."""
    evaluate_other_forces(scene, work, time, step)
    if has(scene, CONTACT_FORCE):
        add_mean_forces(scene, work, step)
    # Reject such an end well before the contact law loses its meaning: a smaller step follows.
    return not exceeds_half_limit(scene, work)


def exceeds_half_limit(scene, work):
    """Return True if a pair overlaps by more than half of the limit of the contact law."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        a, b = candidate.vertex_body, candidate.edge_body
        size = scene.bodies[a].radius + scene.bodies[b].radius
        if -work.geometry[NOW, row].gap > 0.5 * DEEPEST_OVERLAP * size:
            return True
    return False


def momentum_change(scene, work, body, axis, step):
    """Return mass times acceleration over the step [N or N m]."""
    before = work.velocity[START, body, axis]
    return inertia(scene, body, axis) * (work.velocity[NOW, body, axis] - before) / step


def residual(scene, work, body, axis, step):
    """Return force minus mass times acceleration [N or N m]."""
    force = work.force[NOW, body, axis]
    return force - momentum_change(scene, work, body, axis, step)


def write_residual(scene, work, step):
    """Write the residual to the loads, with the momentum balance of each cluster for its first
    body.

    Forces are summed apart from accelerations: mutual forces then cancel exactly.
    """
    n = work.poses.shape[0]
    for body in range(n):
        cluster = work.clusters[body]
        cluster.force_x = cluster.force_y = cluster.rate_x = cluster.rate_y = 0.0
    # Sum the forces and accelerations of each cluster into the record of its first body.
    for body in range(n):
        cluster = work.clusters[work.cluster[body]]
        cluster.force_x += work.force[NOW, body, X]
        cluster.force_y += work.force[NOW, body, Y]
        cluster.rate_x += momentum_change(scene, work, body, 0, step)
        cluster.rate_y += momentum_change(scene, work, body, 1, step)
    for body in range(n):
        free = scene.bodies[body].free
        x = residual(scene, work, body, 0, step)
        y = residual(scene, work, body, 1, step)
        # The first body of a cluster stands for the momentum balance of all.
        if work.cluster[body] == body:
            cluster = work.clusters[body]
            x, y = cluster.force_x - cluster.rate_x, cluster.force_y - cluster.rate_y
        work.loads[REAL, 3 * body] = free * x
        work.loads[REAL, 3 * body + 1] = free * y
        work.loads[REAL, 3 * body + 2] = free * residual(scene, work, body, 2, step)


@apart
def assemble_other_derivatives(scene, work, clock, step):
    """Assemble the derivatives of all forces at the end of the step except those of contacts."""
    # A velocity error displaces a body until it has decayed, or until the run ends.
    remaining = max(end_of_run(clock) - clock.time, step)
    assemble_without_contacts(scene, work, clock.time + step, remaining)


def refactorise(scene, work, clock, step):
    """Assemble and factorise the system at the iterate; return False if that fails."""
    # Contacts that have come close extend the pattern and may join clusters.
    flag_close(scene, work)
    gather_clusters(scene, work)
    assemble_other_derivatives(scene, work, clock, step)
    if has(scene, CONTACT_FORCE):
        add_all_derivatives(scene, work, step)
    return factorise_euler(scene, work, step)


@apart
def solve_change(scene, work, step):
    """Write Newton's change of the velocities to CHANGE; return the largest resulting displacement
    [m]."""
    write_residual(scene, work, step)
    solve_blocks(work, False)
    work.tally.solves += 1
    largest = 0.0
    for body in range(work.poses.shape[0]):
        # A change of the velocity displaces the body in this step, and later until it has decayed.
        memory = step + work.errors[body].velocity_lifetime
        for axis in range(3):
            change = work.loads[REAL, 3 * body + axis].real * scene.bodies[body].free
            work.velocity[CHANGE, body, axis] = change
            # The system was singular.
            if not abs(change) < math.inf:
                return math.inf
            largest = max(largest, lever(scene, body, axis) * memory * abs(change))
    return largest


def apply_change(work):
    """Add the change to the velocities."""
    for body in range(work.poses.shape[0]):
        for axis in range(3):
            work.velocity[NOW, body, axis] += work.velocity[CHANGE, body, axis]


def final_tolerance(scene, work, clock, step):
    """Return the largest displacement of a last change [m]: a fraction of the tolerance, or
    rounding."""
    return max(ITERATION_TOLERANCE * clock.tolerance, rounding_error(scene, work, NOW, step))


@apart
def solve_end(scene, work, clock, step):
    """Solve for the end of the step from velocities near it; return False if that fails.

    begin_step has stored the start.
    """
    for _ in range(MAX_ITERATIONS):
        if not evaluate_end(scene, work, clock.time, step):
            return False
        if not refactorise(scene, work, clock, step):
            return False
        change = solve_change(scene, work, step)
        if not change < math.inf:
            return False
        apply_change(work)
        # Newton converges quadratically here: the change after this one is negligible.
        if change <= final_tolerance(scene, work, clock, step):
            return evaluate_end(scene, work, clock.time, step)
    return False
