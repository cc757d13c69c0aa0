"""The search for the end of a backward Euler step by the interior-point method.

A search starts warm, from the contacts at the start of the step, where the step would end without
them. One that fails is not repeated: the step is, with a smaller size. Tried and rejected: Newton's
method first (hardly ever are all contacts those of the last step); a predictor-corrector method
(Mehrotra: a fifth fewer systems, but each is solved twice); a second search, from contacts well
inside their domain along frozen gaps (one to three steps in a hundred fewer, a fifth in a bed of
sticking flocs).
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import normal_component
from flocsim.integrators.backward_euler.contact_mean import flag_close, normal_stiffness
from flocsim.integrators.backward_euler.interior import (
    DECIDED_RATIO,
    change_pairs,
    evaluate_law,
    is_decided,
    is_included,
    mean_product,
    set_friction,
    widen_slacks,
    write_forces,
)
from flocsim.integrators.backward_euler.newton import (
    MAX_ITERATIONS,
    apply_change,
    assemble_other_derivatives,
    evaluate_included,
    evaluate_other_forces,
    solve_change,
    solve_end,
)
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.systems import factorise_euler
from flocsim.integrators.rhs.views import effective_mass
from flocsim.state.bodies import X, Y
from flocsim.state.work import NOW, START, TRIAL

SIGMA = 0.01
"""Centring parameter: τ over the mean product."""


def typical_force(scene, work):
    """Return the mean force that acts on a free body [N]."""
    total, count = 0.0, 0
    for body in range(work.poses.shape[0]):
        if scene.bodies[body].free == 1.0:
            fx, fy = work.force[NOW, body, X], work.force[NOW, body, Y]
            total += math.hypot(fx, fy)
            count += 1
    return total / max(count, 1)


def typical_overlap(scene, work, step):
    """Return a typical δ [m]; 0 where no pair is included."""
    count, stopped, stiffness = 0, 0.0, 0.0
    for row in range(work.tally.candidates):
        if is_included(work, row):
            candidate = work.candidates[row]
            a, b = candidate.vertex_body, candidate.edge_body
            # Force that would stop the approach in this step, and stiffness, summed.
            speed = abs(normal_component(work, row, work.velocity, START, NOW))
            stopped += effective_mass(scene, a, b) * speed / step
            stiffness += normal_stiffness(scene, work, row, step, 1e-12)
            count += 1
    if count == 0 or not stiffness > 0.0:
        return 0.0
    return (stopped + count * typical_force(scene, work)) / stiffness


def start_contacts(scene, work, step, overlap_scale):
    """Set δ, s and friction of all contacts as they were at the start of the step."""
    # Start on the central path: with one product δ s = τ, none nears its boundary first.
    # A closed contact of typical overlap is then just decided.
    target = DECIDED_RATIO * overlap_scale * overlap_scale
    for row in range(work.tally.candidates):
        if is_included(work, row):
            geometry = work.geometry[NOW, row]
            contact = work.interior[row]
            before = work.geometry[TRIAL, row].gap
            # Closed at the start, closing in the step, and open.
            if before < 0.0:
                contact.overlap, contact.slack = -before, -target / before
            elif geometry.gap < 0.0:
                contact.overlap, contact.slack = overlap_scale, target / overlap_scale
            else:
                contact.slack = max(geometry.gap, DECIDED_RATIO * overlap_scale)
                contact.overlap = target / contact.slack
            evaluate_law(scene, work, row, step)
            limit, side = contact.friction_limit, work.candidates[row].slide_direction
            if limit > 0.0:
                # Sliding contacts begin near their limit.
                fraction = float(side) if side != 0 else contact.sticking_force / limit
                fraction = min(max(fraction, DECIDED_RATIO - 1.0), 1.0 - DECIDED_RATIO)
                slides = side * (contact.sticking_force - fraction * limit)
                set_friction(work, row, fraction, target)
                if side > 0:
                    contact.slip_forward = max(contact.slip_forward, slides)
                elif side < 0:
                    contact.slip_backward = max(contact.slip_backward, slides)


@apart
def iterate_once(scene, work, clock, step, target):
    """Make one iteration towards products τ = ``target``; return False where that fails.

    Bodies go all the way, and each contact its own fraction.
    """
    assemble_other_derivatives(scene, work, clock, step)
    write_forces(scene, work, step, target)
    if not factorise_euler(scene, work, step) or not solve_change(scene, work, step) < math.inf:
        return False
    # Contacts before bodies: their changes are linear in the gaps before the move.
    change_pairs(work, step, target)
    apply_change(work)
    evaluate_included(scene, work, clock.time, step)
    widen_slacks(work)
    return True


@apart
def follow_path(scene, work, clock, step, overlap_scale):
    """Iterate along the central path, and end by Newton's method; return False where that fails."""
    for _ in range(MAX_ITERATIONS):
        if not iterate_once(scene, work, clock, step, SIGMA * mean_product(work)):
            return False
        # All decided and feasible: Newton's method can finish.
        if is_decided(work, DECIDED_RATIO * overlap_scale):
            return solve_end(scene, work, clock, step)
    return False


@apart
def find_end(scene, work, clock, step):
    """Find the end of the step, whose start begin_step has stored; return False if that fails."""
    # Where the step would end without contacts: which pairs may close there?
    evaluate_other_forces(scene, work, clock.time, step)
    flag_close(scene, work)
    gather_clusters(scene, work)
    overlap_scale = typical_overlap(scene, work, step)
    if overlap_scale == 0.0:
        return solve_end(scene, work, clock, step)
    start_contacts(scene, work, step, overlap_scale)
    return follow_path(scene, work, clock, step, overlap_scale)
