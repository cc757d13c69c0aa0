"""Newton's method on the contact forces of an implicit step, the set of closed contacts included.

A contact acts if its overlap at the *end* of the step, −(gap + h J·v′), is positive, so that one
that closes inside the step is seen before it is missed. For a linear law two iterations do.
"""

from flocsim.integrators.assembly import (
    add_direction,
    hold_fixed,
    normal_rows,
    tangent_rows,
)
from flocsim.integrators.linear import solve_in_place
from flocsim.integrators.views import both_fixed, contact_view, normal_rate, tangential_rate
from flocsim.layout import BASE, BOUNDING_RADIUS, CANDIDATES, NEWTON, SOLVES
from flocsim.slots import contact_force, has_contact
from flocsim.state import ContactView

MAX_ITERATIONS = 20
"""Newton steps before the step is given up and halved."""

FREE_CHANGES = 4
"""After so many iterations contacts may still close but no longer open, which ends cycling."""


def end_overlap(work, row, end, step):
    """The pair's overlap at the end of the step [m], to first order."""
    return -(work.geometry[row, 2] + step * normal_rate(work, end, row))


def closed_share(work, row, overlap):
    """The share of the step during which a pair that closes in it is closed."""
    gap = work.geometry[row, 2]
    if gap <= 0.0:
        return 1.0
    return max(overlap, 0.0) / (max(overlap, 0.0) + gap)


def end_view(scene, work, row, start, end, step):
    """The pair's ContactView at the end of the step."""
    overlap = end_overlap(work, row, end, step)
    slip_rate = tangential_rate(work, end, row)
    slip = work.slip[start, row] + closed_share(work, row, overlap) * step * slip_rate
    rate = -normal_rate(work, end, row)
    return contact_view(scene, work, row, overlap, rate, slip, slip_rate)


def changed_view(view, overlap, overlap_rate, slip, slip_rate):
    """A ContactView with small changes added."""
    return ContactView(
        view.overlap + overlap, view.overlap_rate + overlap_rate, view.slip + slip,
        view.slip_rate + slip_rate, view.effective_mass, view.radius_i, view.radius_j,
    )  # fmt: skip


def stiffness_and_damping(view, parameters, normal, tangential):
    """(k_n, c_n, k_t, c_t) of the contact law at a view, by differences, none negative."""
    by_overlap = 1e-3 * abs(view.overlap) + 1e-13
    by_slip = 1e-3 * abs(view.slip) + 1e-13
    by_rate = 1e-3 * abs(view.overlap_rate) + 1e-9
    by_slip_rate = 1e-3 * abs(view.slip_rate) + 1e-9
    deeper, _ = contact_force(changed_view(view, by_overlap, 0.0, 0.0, 0.0), parameters)
    faster, _ = contact_force(changed_view(view, 0.0, by_rate, 0.0, 0.0), parameters)
    _, further = contact_force(changed_view(view, 0.0, 0.0, by_slip, 0.0), parameters)
    _, sliding = contact_force(changed_view(view, 0.0, 0.0, 0.0, by_slip_rate), parameters)
    return (
        max((deeper - normal) / by_overlap, 0.0),
        max((faster - normal) / by_rate, 0.0),
        max((tangential - further) / by_slip, 0.0),
        max((tangential - sliding) / by_slip_rate, 0.0),
    )


def add_contact(scene, work, row, start, end, step):
    """One contact's force and derivatives in the Newton system."""
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    view = end_view(scene, work, row, start, end, step)
    normal, tangential = contact_force(view, scene.parameters)
    k_n, c_n, k_t, c_t = stiffness_and_damping(view, scene.parameters, normal, tangential)
    share = closed_share(work, row, view.overlap)
    on_a, on_b = normal_rows(work, row)
    weight = step * (step * k_n + c_n)
    add_direction(work, NEWTON, a, b, on_a, on_b, weight, step * normal)
    on_a, on_b = tangent_rows(work, row)
    weight = step * (share * step * k_t + c_t)
    add_direction(work, NEWTON, a, b, on_a, on_b, weight, step * tangential)


def add_contacts(scene, work, start, end, step, iteration):
    """All active contacts in the Newton system; whether the active set has changed."""
    changed = False
    for row in range(work.tally[CANDIDATES]):
        if both_fixed(scene, work.candidates[row, 0], work.candidates[row, 2]):
            continue
        was_closed = work.candidates[row, 5] == 1
        closed = end_overlap(work, row, end, step) > 0.0
        if iteration >= FREE_CHANGES:
            closed = closed or was_closed
        changed = changed or closed != was_closed
        work.candidates[row, 5] = 1 if closed else 0
        if closed:
            add_contact(scene, work, row, start, end, step)
    return changed


def residual_system(work, end):
    """NEWTON matrix = BASE matrix, its load = BASE load − BASE matrix · v′."""
    system = work.system
    size = system.shape[1]
    for i in range(size):
        total = system[BASE, i, size]
        for j in range(size):
            system[NEWTON, i, j] = system[BASE, i, j]
            total -= system[BASE, i, j] * work.motion[end, j // 3, 3 + j % 3]
        system[NEWTON, i, size] = total


def apply_correction(scene, work, end, step):
    """Add the solution to the velocities; the largest change of place that it means [m]."""
    largest = 0.0
    size = work.system.shape[1]
    for body in range(scene.bodies.shape[0]):
        for axis in range(3):
            change = work.system[NEWTON, 3 * body + axis, size]
            work.motion[end, body, 3 + axis] += change
            lever = scene.bodies[body, BOUNDING_RADIUS] if axis == 2 else 1.0
            largest = max(largest, abs(change) * lever * step)
    return largest


def solve_velocities(scene, work, start, end, step, tolerance):
    """The end velocities, from those in state ``end`` as first guess; False without convergence."""
    contacts = has_contact() and work.tally[CANDIDATES] > 0
    for row in range(work.tally[CANDIDATES]):
        work.candidates[row, 5] = 0
    for iteration in range(MAX_ITERATIONS):
        residual_system(work, end)
        changed = contacts and add_contacts(scene, work, start, end, step, iteration)
        hold_fixed(scene, work, NEWTON)
        work.tally[SOLVES] += 1
        if not solve_in_place(work.system, NEWTON):
            return False
        moved = apply_correction(scene, work, end, step)
        if not contacts or (iteration > 0 and not changed and moved < 1e-3 * tolerance):
            return True
    return False
