"""One step of backward Euler: the velocities at its end, by a semismooth Newton method.

    M (v₁ − v₀)/h = F(x₀ + h v₁, v₁, contacts of the end)

The derivatives are those of the contacts that are closed, stick and slide at the iterate, and
follow it: with contacts as springs these are the active sets of the complementarity problem that
hard contacts pose (Moreau 1988, Jean 1999; Christensen, Klarbring, Pang & Strömberg 1998 for the
method). It finds the end alone from where the sets are known; interior.py leads there.

The iterate stands in NOW, the contacts that may close in it flagged as closed; the step's start
meanwhile in START, its contacts in TRIAL; NOW keeps its displacements.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.constants import DEEPEST_OVERLAP
from flocsim.geometry.contact.points import locate_acting, locate_contacts
from flocsim.hooks import CONTACT_FORCE, has
from flocsim.integrators.backward_euler.contact_mean import (
    FADING,
    add_all_derivatives,
    add_mean_forces,
    flag_close,
    takes_part,
)
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.systems import factorise_euler, solve_real
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.error import end_of_run, rounding_error
from flocsim.integrators.rhs.forces import save_start, sum_other_forces
from flocsim.integrators.rhs.jacobian import assemble_without_contacts
from flocsim.integrators.rhs.surface_gap import flag_near
from flocsim.integrators.rhs.views import inertia, lever
from flocsim.state.bodies import X, Y
from flocsim.state.contacts import CLOSED, OPEN
from flocsim.state.work import CHANGE, NEW, NOW, START, TRIAL

NEWTON_SHARE = 0.01
"""Newton's method goes on until what is left is below this share of the tolerance."""

MOST_ITERATIONS = 8
"""Iterations in which it has to find the end: where it does not by then, the sets are not known."""


def begin_step(work, clock):
    """Keep the start of the step."""
    save_start(work)
    for row in range(work.tally.candidates):
        work.geometry[TRIAL, row] = work.geometry[NOW, row]
        work.candidates[row].contact_mode, work.interior[row].held_overlap = OPEN, 0.0
        least = FADING * clock.tolerance
        work.interior[row].fading_gap = max(-work.geometry[NOW, row].gap, least)


def put_back(work):
    """Go back to the motion at the start of the step."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[NOW, body, axis] = work.place[START, body, axis]
            work.velocity[NOW, body, axis] = work.velocity[START, body, axis]


def end_step(work):
    """Make the iterate the new state, its contacts flagged that take part in the step, and its
    start the current one again."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[NEW, body, axis] = work.place[NOW, body, axis]
            work.velocity[NEW, body, axis] = work.velocity[NOW, body, axis]
    put_back(work)
    for row in range(work.tally.candidates):
        work.candidates[row].contact_mode = CLOSED if takes_part(work, row) else OPEN
        work.geometry[NOW, row] = work.geometry[TRIAL, row]


def place_ends(work, step):
    """Places at the end from the velocities there."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            start = work.place[START, body, axis]
            work.place[NOW, body, axis] = start + step * work.velocity[NOW, body, axis]


@apart
def evaluate_others(scene, work, time, step):
    """All forces at the end of the step but those of contacts, which are located."""
    place_ends(work, step)
    locate_contacts(scene, work, NOW)
    if scene.surface_reach > 0.0:
        flag_near(scene, work, NOW, 0.0)
    sum_other_forces(scene, work, time + step, NOW)


def evaluate_in_play(scene, work, time, step):
    """The same, of the pairs alone that are in play located; of all where forces from further away
    ask for them."""
    if scene.surface_reach > 0.0:
        evaluate_others(scene, work, time, step)
        return
    place_ends(work, step)
    locate_acting(scene, work, NOW)
    sum_other_forces(scene, work, time + step, NOW)


def evaluate_end(scene, work, time, step):
    """All forces at the end of the step; False where bodies are too deep in each other."""
    evaluate_others(scene, work, time, step)
    if has(scene, CONTACT_FORCE):
        add_mean_forces(scene, work, step)
    return not is_too_deep(scene, work)


def is_too_deep(scene, work):
    """Whether a pair overlaps by more than half of what the contact law takes."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        a, b = candidate.vertex_body, candidate.edge_body
        size = scene.bodies[a].radius + scene.bodies[b].radius
        if -work.geometry[NOW, row].gap > 0.5 * DEEPEST_OVERLAP * size:
            return True
    return False


def momentum_change(scene, work, body, axis, step):
    """Mass times acceleration in the step."""
    before = work.velocity[START, body, axis]
    return inertia(scene, body, axis) * (work.velocity[NOW, body, axis] - before) / step


def unbalanced(scene, work, body, axis, step):
    """Force less mass times acceleration."""
    force = work.force[NOW, body, axis]
    return force - momentum_change(scene, work, body, axis, step)


def write_load(scene, work, step):
    """What the forces do not balance, of a cluster as a whole in the rows of its first body: forces
    and rates apart, so that what is mutual cancels."""
    n = work.poses.shape[0]
    for body in range(n):
        cluster = work.clusters[body]
        cluster.force_x = cluster.force_y = cluster.rate_x = cluster.rate_y = 0.0
    for body in range(n):
        cluster = work.clusters[work.cluster[body]]
        cluster.force_x += work.force[NOW, body, X]
        cluster.force_y += work.force[NOW, body, Y]
        cluster.rate_x += momentum_change(scene, work, body, 0, step)
        cluster.rate_y += momentum_change(scene, work, body, 1, step)
    for body in range(n):
        free = scene.bodies[body].free
        x = unbalanced(scene, work, body, 0, step)
        y = unbalanced(scene, work, body, 1, step)
        if work.cluster[body] == body:
            cluster = work.clusters[body]
            x, y = cluster.force_x - cluster.rate_x, cluster.force_y - cluster.rate_y
        work.loads[REAL, 3 * body] = free * x
        work.loads[REAL, 3 * body + 1] = free * y
        work.loads[REAL, 3 * body + 2] = free * unbalanced(scene, work, body, 2, step)


@apart
def assemble_rest(scene, work, clock, step):
    """Derivatives of all forces at the end of the step but those of contacts."""
    remaining = max(end_of_run(clock) - clock.time, step)
    assemble_without_contacts(scene, work, clock.time + step, remaining)


def refresh(scene, work, clock, step):
    """Factorise anew at the iterate; False where that fails."""
    flag_close(scene, work)
    gather_clusters(scene, work)
    assemble_rest(scene, work, clock, step)
    if has(scene, CONTACT_FORCE):
        add_all_derivatives(scene, work, step)
    return factorise_euler(scene, work, step)


@apart
def solve_change(scene, work, step):
    """Newton's change of velocities into CHANGE; the largest that it makes in place [m]."""
    write_load(scene, work, step)
    solve_real(work)
    work.tally.solves += 1
    largest = 0.0
    for body in range(work.poses.shape[0]):
        memory = step + work.errors[body].velocity_lifetime
        for axis in range(3):
            change = work.loads[REAL, 3 * body + axis].real * scene.bodies[body].free
            work.velocity[CHANGE, body, axis] = change
            if not abs(change) < math.inf:
                return math.inf
            largest = max(largest, lever(scene, body, axis) * memory * abs(change))
    return largest


def go_along(work, way):
    """Add a share of the change to the velocities."""
    for body in range(work.poses.shape[0]):
        for axis in range(3):
            work.velocity[NOW, body, axis] += way * work.velocity[CHANGE, body, axis]


def goal_of(scene, work, clock, step):
    """What a change may be at most where it is the last one [m]."""
    return max(NEWTON_SHARE * clock.tolerance, rounding_error(scene, work, NOW, step))


@apart
def solve_end(scene, work, clock, step):
    """Find the end of the step, of which begin_step has kept the start, from velocities that are
    near it; False where it is not found."""
    for _ in range(MOST_ITERATIONS):
        if not evaluate_end(scene, work, clock.time, step):
            return False
        if not refresh(scene, work, clock, step):
            return False
        change = solve_change(scene, work, step)
        if not change < math.inf:
            return False
        go_along(work, 1.0)
        if change <= goal_of(scene, work, clock, step):
            return evaluate_end(scene, work, clock.time, step)
    return False
