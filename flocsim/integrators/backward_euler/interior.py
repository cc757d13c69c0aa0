"""A primal-dual interior-point method for the contacts of a backward Euler step.

With stiff springs a step is nearly a complementarity problem. For each contact, the overlap δ = Δ₁⁺
that carries its force and the slack s = g + δ of its gap g are both ≥ 0, and one of them is 0.
Newton's method (newton.py) finds out which, a few contacts an iteration. Here all contacts follow
the central path δ s = τ, τ → 0, together (Wright, Primal-Dual Interior-Point Methods, 1997; for
contacts Christensen et al. 1998). The systems are those of Newton's method, but a contact has only
the fraction δ/(δ+s) of its stiffness. Linearised, with the change dg of the gap:

    (δ + s) dδ = τ − δ s + δ (s − g − δ) − δ dg

Friction f has a limit L(δ). With e, the friction of a sticking contact, and the forward and
backward slips p, q ≥ 0, all divided by the normal stiffness [m]:

    e − f = p − q,   p (L − f) = τ,   q (L + f) = τ,

    df = w (e − f − τ/(L − f) + τ/(L + f) + de) + w (p/(L − f) − q/(L + f)) dL,
    1/w = 1 + p/(L − f) + q/(L + f)

InteriorPoint stores δ, s, f/L, p, q, L and e of each contact. L follows δ within an iteration, and
p and q follow L. Where L was changed between iterations only, half of the searches in a pile of 450
polygons failed.

With L(δ) the systems are not symmetric, and may lead to no solution (a contact wedged between
sliding ones): the search is given up, and the step repeated with a smaller size.

The length of an iteration would be limited by the contact that first leaves its domain, and among
hundreds there is always one. So each contact makes a step of its own, and the bodies make a full
one (`change_pairs`). Contacts then do not fit their gaps, as in an infeasible start (Wright,
chapter 6), and the next iteration mends this. It takes a third of the systems.

Before the end, a contact with a friction limit that was closed at the start counts as closed for
the whole step. Its s would follow the gap, which is far from its final value, and friction would
vanish nearly everywhere.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import normal_component, tangential_component
from flocsim.hooks import SLIP_LIMIT, contact_derivatives, contact_force, has, slip_limit
from flocsim.integrators.backward_euler.contact_mean import (
    add_contact_slopes,
    friction_force,
    friction_slopes,
    step_view,
    sticking_slopes,
)
from flocsim.integrators.rhs.jacobian import add_geometric_stiffness
from flocsim.integrators.rhs.views import add_pair_force, tangential_rate, view_without_slip
from flocsim.state.contacts import CLOSED
from flocsim.state.work import CHANGE, NOW, TRIAL

DECIDED_RATIO = 0.01
"""Ratio of a small quantity to a large one, below which a contact counts as decided or feasible.
What must stay positive keeps at least this share of itself in an iteration (the usual
fraction-to-the-boundary rule), and a friction limit this share of that of the spring alone."""


def is_included(work, row):
    # Pairs marked by flag_close take part in the iteration.
    return work.candidates[row].contact_mode == CLOSED


def closed_part_slopes(work, row, limited):
    """Return the fraction s of the step in which a pair is closed, ds/dδ, and minus ds/d(slack)
    [1/m].

    At the solution, it is that of contact_mean.
    """
    contact = work.interior[row]
    overlap, slack, gap_start = (
        contact.overlap,
        contact.slack,
        work.geometry[TRIAL, row].gap,
    )
    # It closes in the step.
    if gap_start >= 0.0:
        return overlap / (overlap + gap_start), gap_start / (overlap + gap_start) ** 2, 0.0
    if limited:
        return 1.0, 0.0, 0.0
    # It may open in the step.
    faded = overlap + contact.fade_length
    return faded / (faded + slack), slack / (faded + slack) ** 2, faded / (faded + slack) ** 2


def evaluate_law(scene, work, row, step):
    """Return N of a pair for the overlap δ [N], and dN/dδ [N/m]; write its friction law.

    The friction law goes to ``work.interior``; its limit is 0 where there is none.
    """
    contact = work.interior[row]
    overlap, rate = contact.overlap, tangential_rate(work, NOW, row)
    view = step_view(scene, work, row, step, overlap, 0.0, 0.0)
    values, limit = contact_derivatives(scene, view), 0.0
    stiffness = hardness = values[2] + values[4] / step
    spring, dashpot = -values[7], -values[9]
    if has(scene, SLIP_LIMIT):
        if not hardness > 0.0:
            # A law without tension clips a pull: take the stiffness of the same overlap at rest.
            pressed = contact_derivatives(scene, view_without_slip(view, overlap, 0.0))
            hardness = pressed[2] + pressed[4] / step
        # Stiffness while sticking, and the limit L over the normal stiffness.
        friction_view = step_view(scene, work, row, step, overlap, 0.0, 0.0)
        slip_cut = slip_limit(scene, friction_view)
        if 0.0 < slip_cut < math.inf:
            spring, dashpot = sticking_slopes(scene, friction_view, slip_cut, step)
            limit_view = step_view(scene, work, row, step, overlap, slip_cut, abs(rate))
            # L must stay positive where the dashpot pulls.
            limit = max(-contact_force(scene, limit_view)[1], DECIDED_RATIO * spring * slip_cut)
            limit /= hardness
    # e = k_t (ξ₀ + s h v_t) + damping, over the normal stiffness.
    contact.closed_fraction, _, _ = closed_part_slopes(work, row, limit > 0.0)
    part = contact.closed_fraction
    contact.normal_stiffness, contact.friction_limit = hardness, limit
    contact.sticking_slope = (spring * part * step + dashpot) / hardness
    contact.sticking_force = spring / hardness * work.slip[NOW, row] + contact.sticking_slope * rate
    return values[0], stiffness


def mean_product(work):
    """Return the mean of δ s, p (L − f) and q (L + f) over all contacts [m²]: the duality
    measure."""
    total, count = 0.0, 0
    for row in range(work.tally.candidates):
        if is_included(work, row):
            contact = work.interior[row]
            total += contact.overlap * contact.slack
            count += 1
            if contact.friction_limit > 0.0:
                forward, backward = contact.slip_forward, contact.slip_backward
                total_size = forward + backward + contact.friction_ratio * (backward - forward)
                total += contact.friction_limit * total_size
                count += 2
    return total / max(count, 1)


def overlap_correction(work, row, target):
    """Return dδ at a constant gap [m], see the module."""
    contact = work.interior[row]
    overlap, slack = contact.overlap, contact.slack
    # By how much the contact does not fit its gap.
    misfit = slack - work.geometry[NOW, row].gap - overlap
    return (target - overlap * slack + overlap * misfit) / (overlap + slack)


def friction_correction(work, row, target):
    """Return w, df at constant v_t and L [m], and df/dL, see the module."""
    contact = work.interior[row]
    limit = contact.friction_limit
    force = contact.friction_ratio * limit
    above, below = limit - force, limit + force
    forward, backward = contact.slip_forward / above, contact.slip_backward / below
    weight = 1.0 / (1.0 + forward + backward)
    change = weight * (contact.sticking_force - force - target / above + target / below)
    return weight, change, weight * (forward - backward)


def limited_friction(work, row, target):
    """Return s T, minus its derivative by v_t, and that by the gap, of a contact with a friction
    limit."""
    contact = work.interior[row]
    total_size = contact.overlap + contact.slack
    weight, change, by_limit = friction_correction(work, row, target)
    scale = contact.closed_fraction * contact.normal_stiffness
    by_limit *= contact.friction_limit / contact.overlap
    # The linearised friction after this iteration, at the present gap and v_t.
    force = contact.friction_ratio * contact.friction_limit + change
    force += by_limit * overlap_correction(work, row, target)
    falls = by_limit * contact.overlap / total_size
    return -scale * force, scale * weight * contact.sticking_slope, -scale * falls


def unlimited_friction(scene, work, row, step, target):
    """Return s T, minus its derivative by v_t, and that by the gap, of a contact without a
    limit."""
    contact = work.interior[row]
    total_size = contact.overlap + contact.slack
    force = friction_force(scene, work, row, step)
    slope, _, by_part = friction_slopes(scene, work, row, step)
    # Without a limit, friction depends on δ and s through the closed fraction.
    _, grows, falls = closed_part_slopes(work, row, False)
    d_overlap = overlap_correction(work, row, target)
    d_slack = d_overlap - (contact.slack - work.geometry[NOW, row].gap - contact.overlap)
    force += by_part * (grows * d_overlap - falls * d_slack)
    return (
        force,
        slope,
        by_part * (grows * contact.overlap + falls * contact.slack) / total_size,
    )


@apart
def write_forces(scene, work, step, target):
    """Add the linearised forces, and their derivatives, of all contacts to forces and system."""
    for row in range(work.tally.candidates):
        if is_included(work, row):
            contact = work.interior[row]
            overlap, slack = contact.overlap, contact.slack
            normal, stiffness = evaluate_law(scene, work, row, step)
            # Eliminate dδ and df: what remains depends on gap and v_t, that is, on the velocities.
            normal += stiffness * overlap_correction(work, row, target)
            tangential, slope, coupled = 0.0, 0.0, 0.0
            if contact.friction_limit > 0.0:
                tangential, slope, coupled = limited_friction(work, row, target)
            elif contact.sticking_slope > 0.0:
                tangential, slope, coupled = unlimited_friction(scene, work, row, step, target)
            add_pair_force(work, NOW, row, normal, tangential)
            # Only the fraction δ/(δ + s) of the stiffness resists a change of the gap.
            stiffness *= overlap / (overlap + slack)
            add_contact_slopes(scene, work, row, stiffness, slope, coupled)
            add_geometric_stiffness(scene, work, row, normal, tangential)


def keep_positive(fraction, size, change):
    """Return the fraction of a change, at most the given one, that keeps a quantity positive."""
    return min(fraction, (DECIDED_RATIO - 1.0) * size / change) if change < 0.0 else fraction


def change_friction(work, row, target, d_limit, fraction, apply):
    """Return the fraction of the changes of p, q and f that keeps them in their domain.

    At most the given one. With ``apply`` they are changed by the given fraction. L changes by
    ``d_limit`` [m].
    """
    contact = work.interior[row]
    limit = contact.friction_limit
    weight, change, by_limit = friction_correction(work, row, target)
    # Add the part of df by the new v_t, and by the change of the limit.
    rate = tangential_component(work, row, work.velocity, CHANGE, NOW)
    sticking_change = contact.sticking_slope * rate
    change += weight * sticking_change + by_limit * d_limit
    forward, backward, force = (
        contact.slip_forward,
        contact.slip_backward,
        contact.friction_ratio * limit,
    )
    above, below = limit - force, limit + force
    slides = contact.sticking_force + sticking_change - force - change
    # Linearise p (L − f) = τ or q (L + f) = τ on the side away from the limit, and take the other
    # slip from e − f = p − q: dividing by the small distance would lose digits.
    if above > below:
        d_forward = (target - forward * (d_limit - change)) / above - forward
        d_backward = forward + d_forward - slides - backward
    else:
        d_backward = (target - backward * (d_limit + change)) / below - backward
        d_forward = backward + d_backward + slides - forward
    if apply:
        contact.sticking_force += fraction * sticking_change
        contact.friction_limit = limit + fraction * d_limit
        contact.friction_ratio = (force + fraction * change) / contact.friction_limit
        contact.slip_forward += fraction * d_forward
        contact.slip_backward += fraction * d_backward
        return fraction
    # p, q, L − f and L + f stay positive.
    fraction = keep_positive(keep_positive(fraction, forward, d_forward), backward, d_backward)
    return keep_positive(keep_positive(fraction, above, d_limit - change), below, d_limit + change)


def change_pair(work, row, step, target, fraction, apply):
    """Return the fraction of the changes of δ, s and friction that keeps them in their domain.

    At most the given one. With ``apply`` they are changed by the given fraction.
    """
    contact = work.interior[row]
    overlap, slack = contact.overlap, contact.slack
    d_gap = step * normal_component(work, row, work.velocity, CHANGE, NOW)
    # dδ follows the change of the gap, and ds keeps s = g + δ.
    d_overlap = overlap_correction(work, row, target) - overlap / (overlap + slack) * d_gap
    d_slack = d_gap + d_overlap - (slack - work.geometry[NOW, row].gap - overlap)
    if contact.friction_limit > 0.0:
        d_limit = d_overlap * contact.friction_limit / overlap
        fraction = change_friction(work, row, target, d_limit, fraction, apply)
    if apply:
        contact.overlap += fraction * d_overlap
        contact.slack += fraction * d_slack
        return fraction
    return keep_positive(keep_positive(fraction, overlap, d_overlap), slack, d_slack)


@apart
def change_pairs(work, step, target):
    """Change all contacts along with the velocities in CHANGE, each by the largest fraction that
    keeps it in its domain."""
    for row in range(work.tally.candidates):
        if is_included(work, row):
            fraction = change_pair(work, row, step, target, 1.0, False)
            change_pair(work, row, step, target, fraction, True)


@apart
def widen_slacks(work):
    """Widen slacks to gaps that have opened further: near δ = 0 they would only double per
    iteration."""
    for row in range(work.tally.candidates):
        if is_included(work, row):
            contact = work.interior[row]
            wide = work.geometry[NOW, row].gap + contact.overlap
            contact.slack = max(contact.slack, wide)


def set_friction(work, row, fraction, target):
    """Set the friction of a pair to a fraction of its limit, with products τ."""
    contact = work.interior[row]
    limit = contact.friction_limit
    contact.friction_ratio = fraction
    contact.slip_forward = target / (limit * (1.0 - fraction))
    contact.slip_backward = target / (limit * (1.0 + fraction))


def is_undecided(work, row, least):
    """Return True if it is not known yet whether a contact is closed, or, if closed, whether it
    slides.

    ``least`` [m] is a size below which nothing matters.
    """
    contact = work.interior[row]
    limit = contact.friction_limit
    total_size = contact.overlap + contact.slack
    # Neither δ nor s is small.
    if min(contact.overlap, contact.slack) > DECIDED_RATIO * max(total_size, least):
        return True
    if contact.overlap < contact.slack:
        return False
    # Closed: on each side, neither the slip nor the distance from the limit is small.
    force, least = contact.friction_ratio * limit, min(least, DECIDED_RATIO * max(limit, least))
    sides = max(min(contact.slip_forward, limit - force), min(contact.slip_backward, limit + force))
    return limit > 0.0 and sides > least


def is_infeasible(work, row, least):
    """Return True if a contact does not fit its gap (s − δ ≠ g) or its slip (e − f ≠ p − q)."""
    contact = work.interior[row]
    total_size = contact.overlap + contact.slack
    misfit = contact.slack - work.geometry[NOW, row].gap - contact.overlap
    if abs(misfit) > DECIDED_RATIO * max(total_size, DECIDED_RATIO * least):
        return True
    limit, forward, backward = contact.friction_limit, contact.slip_forward, contact.slip_backward
    misfit = contact.sticking_force - contact.friction_ratio * limit - forward + backward
    return limit > 0.0 and abs(misfit) > DECIDED_RATIO * max(limit + forward + backward, least)


@apart
def is_decided(work, least):
    """Return True if all contacts are decided and feasible."""
    for row in range(work.tally.candidates):
        undecided = is_undecided(work, row, least) or is_infeasible(work, row, least)
        if undecided and is_included(work, row):
            return False
    return True
