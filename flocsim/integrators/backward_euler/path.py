"""The search for the end of a backward Euler step by the interior-point method.

In a step bodies slide by far more than contacts overlap (1e-8 m against 1e-12 m), and along a
corner the gaps change with the square of that, which is more than an overlap, too. So the contacts
are first solved along frozen gaps and directions, those where the step would end without contacts.
Only when it is known which contacts close and slide does the search follow the true gaps.

A search starts warm, from the contacts at the start of the step, and where that fails cold. Tried
and rejected: Newton's method first (hardly ever are all contacts those of the last step), and a
predictor-corrector method (Mehrotra: a fifth fewer systems, but each is solved twice).
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import normal_component
from flocsim.hooks import SLIP_LIMIT, has
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
    apply_change,
    assemble_other_derivatives,
    evaluate_included,
    evaluate_other_forces,
    final_tolerance,
    solve_change,
    solve_end,
    update_positions,
)
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.systems import factorise_euler
from flocsim.integrators.rhs.forces import copy_motion, sum_other_forces
from flocsim.integrators.rhs.views import effective_mass
from flocsim.state.bodies import X, Y
from flocsim.state.work import CHANGE, NOW, START, TRIAL

MAX_ITERATIONS = 50
"""Most iterations along frozen gaps, and along true gaps."""

SIGMA, SIGMA_FAST, FULL_STEP = 0.05, 0.01, 0.7
"""Centring parameter: τ over the mean product; SIGMA_FAST after an iteration that made at least
FULL_STEP of its change."""

UNFREEZE, MIN_PRODUCT = 0.1, 1e-10
"""Mean product, over the square of a typical overlap, below which gaps are no longer frozen; and
the smallest τ, in the same unit."""

NEWTON_RADIUS = 10.0
"""Largest last change, over Newton's own tolerance, from which Newton's method finds the end once
all contacts are decided."""

START_SIZE = 0.1
"""Least initial value of δ, s and slips in a cold start, over their typical size."""

WARM_FRACTION = 0.03
"""Square root of the initial products of a warm start, over a typical overlap."""

STALLED_STEP, MAX_STALLED = 0.05, 2
"""Iterations that make less than this fraction of their change are stalled; after this many in a
row the search is given up."""


def typical_force(scene, work):
    """Return the mean force that acts on a free body [N]."""
    total, count = 0.0, 0
    for body in range(work.poses.shape[0]):
        if scene.bodies[body].free == 1.0:
            fx, fy = work.force[NOW, body, X], work.force[NOW, body, Y]
            total += math.hypot(fx, fy)
            count += 1
    return total / max(count, 1)


def typical_sizes(scene, work, step):
    """Return a typical δ and a typical s [m]; (0, 0) where no pair is included."""
    count, stopped, slack_scale, deepest, stiffness = 0, 0.0, 0.0, 0.0, 0.0
    for row in range(work.tally.candidates):
        if is_included(work, row):
            candidate = work.candidates[row]
            a, b = candidate.vertex_body, candidate.edge_body
            # Force that would stop the approach in this step, path in the step, and stiffness,
            # summed.
            speed = abs(normal_component(work, row, work.velocity, START, NOW))
            stopped += effective_mass(scene, a, b) * speed / step
            slack_scale += step * speed
            deepest = max(deepest, -work.geometry[NOW, row].gap)
            stiffness += normal_stiffness(scene, work, row, step, 1e-12)
            count += 1
    if count == 0 or not stiffness > 0.0:
        return 0.0, 0.0
    overlap_scale = (stopped + count * typical_force(scene, work)) / stiffness
    return overlap_scale, max(slack_scale / count, overlap_scale, START_SIZE * deepest)


def start_cold(scene, work, step, overlap_scale, slack_scale):
    """Set δ, s and friction of all contacts for a cold start."""
    for row in range(work.tally.candidates):
        if is_included(work, row):
            contact = work.interior[row]
            gap = work.geometry[NOW, row].gap
            # Well inside the domain, and consistent with the gaps.
            contact.overlap = max(-work.geometry[TRIAL, row].gap, START_SIZE * overlap_scale)
            contact.slack = max(gap + contact.overlap, START_SIZE * slack_scale, -gap)
            evaluate_law(scene, work, row, step, False)
            contact.friction_ratio = 0.0
            slides = (
                START_SIZE
                * overlap_scale
                * START_SIZE
                * slack_scale
                / max(contact.friction_limit, START_SIZE * overlap_scale)
            )
            contact.slip_forward = max(contact.sticking_force, slides)
            contact.slip_backward = max(-contact.sticking_force, slides)


def start_warm(scene, work, step, overlap_scale):
    """Set δ, s and friction of all contacts as they were at the start of the step."""
    target = (WARM_FRACTION * overlap_scale) ** 2
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
            evaluate_law(scene, work, row, step, True)
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


def advance_gaps(work, fraction, step):
    """Change the gaps by a fraction of the velocity change, along frozen directions."""
    for row in range(work.tally.candidates):
        opening = normal_component(work, row, work.velocity, CHANGE, NOW)
        work.geometry[NOW, row].gap += fraction * step * opening


@apart
def iterate_once(scene, work, clock, step, target, turns, own):
    """Make one iteration towards products τ = ``target``; return (fraction made, change [m]).

    The fraction is −1 where the iteration fails. With ``own`` steps each contact goes its own
    fraction, bodies go all the way, and the smallest fraction is returned.
    """
    # System and velocity change.
    assemble_other_derivatives(scene, work, clock, step)
    write_forces(scene, work, step, target, turns)
    if not factorise_euler(scene, work, step):
        return -1.0, math.inf
    change = solve_change(scene, work, step)
    if not change < math.inf:
        return -1.0, math.inf
    fraction = change_pairs(work, step, target, own)
    apply_change(work, 1.0 if own else fraction)
    # Follow true gaps by locating the contacts, or frozen ones by their linear change.
    if turns:
        evaluate_included(scene, work, clock.time, step)
        if own:
            widen_slacks(work)
    else:
        advance_gaps(work, fraction, step)
        update_positions(work, step)
        sum_other_forces(scene, work, clock.time + step, NOW)
    return fraction, change


def allows_own_steps(scene, work):
    """Return True if each contact may make a step of its own.

    Not where friction has no limit: it depends on the closed fraction, and so on δ and s
    themselves. The bodies would end elsewhere than the contacts assume, and the step would be
    rejected.
    """
    if has(scene, SLIP_LIMIT):
        return True
    for row in range(work.tally.candidates):
        if is_included(work, row) and work.interior[row].sticking_slope > 0.0:
            return False
    return True


@apart
def follow_true_gaps(scene, work, clock, step, overlap_scale, own):
    """Iterate along true gaps, with τ near its final size, and end by Newton's method; return False
    where that fails."""
    fraction, stalled = 1.0, 0
    for _ in range(MAX_ITERATIONS):
        # Choose τ by the success of the last iteration.
        target = (SIGMA_FAST if fraction >= FULL_STEP else SIGMA) * mean_product(work)
        target = max(target, MIN_PRODUCT * overlap_scale * overlap_scale)
        fraction, change = iterate_once(scene, work, clock, step, target, True, own)
        if fraction < 0.0:
            return False
        stalled = stalled + 1 if fraction < STALLED_STEP and not own else 0
        if stalled == MAX_STALLED:
            return False
        # All decided and feasible: Newton's method can finish.
        near = change <= NEWTON_RADIUS * final_tolerance(scene, work, clock, step)
        if near and fraction > FULL_STEP and is_decided(work, DECIDED_RATIO * overlap_scale):
            return solve_end(scene, work, clock, step)
    return False


@apart
def search_cold(scene, work, clock, step, overlap_scale, slack_scale):
    """Search for the end of the step without knowledge of its contacts; return False where that
    fails."""
    # Freeze gaps and directions where the step would end without contacts.
    copy_motion(work, START, NOW)
    evaluate_other_forces(scene, work, clock.time, step)
    start_cold(scene, work, step, overlap_scale, slack_scale)
    fraction, stalled = 0.0, 0
    for _ in range(MAX_ITERATIONS):
        target = (SIGMA_FAST if fraction >= FULL_STEP else SIGMA) * mean_product(work)
        fraction, _ = iterate_once(scene, work, clock, step, target, False, False)
        if fraction < 0.0:
            return False
        stalled = stalled + 1 if fraction < STALLED_STEP else 0
        if stalled == MAX_STALLED:
            return False
        # Products are small: locate the contacts, and follow true gaps.
        if fraction > FULL_STEP and mean_product(work) <= UNFREEZE * overlap_scale * overlap_scale:
            evaluate_other_forces(scene, work, clock.time, step)
            own = allows_own_steps(scene, work)
            return follow_true_gaps(scene, work, clock, step, overlap_scale, own)
    return False


@apart
def find_end(scene, work, clock, step):
    """Find the end of the step, whose start begin_step has stored; return False if that fails."""
    # Where the step would end without contacts: which pairs may close there?
    evaluate_other_forces(scene, work, clock.time, step)
    flag_close(scene, work)
    gather_clusters(scene, work)
    overlap_scale, slack_scale = typical_sizes(scene, work, step)
    if overlap_scale == 0.0:
        return solve_end(scene, work, clock, step)
    # Warm start first: in a bed at rest most contacts stay as they are.
    start_warm(scene, work, step, overlap_scale)
    own = allows_own_steps(scene, work)
    if own and follow_true_gaps(scene, work, clock, step, overlap_scale, True):
        return True
    return search_cold(scene, work, clock, step, overlap_scale, slack_scale)
