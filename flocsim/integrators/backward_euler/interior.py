"""The pairs of a step as an interior-point method sees them: what closes and slides, all at once.

With hard springs a step is all but a complementarity problem: of every pair, the overlap δ = Δ₁⁺
that its force has and the gap s = g + δ that is left of it are not below 0, and one of them is 0.
Newton's method (newton.py) finds which, a few pairs an iteration; here all pairs are followed at
once along δ s = τ, τ falling to nothing (primal-dual, Wright 1997; as for contacts in Christensen
et al. 1998). The systems are those of Newton's method, the stiffness of a pair being its part
δ/(δ + s) that is at work. InteriorPoint holds δ as ``overlap``, s as ``slack``.

    (δ + s) dδ = τ − δ s + δ (s − g − δ) − δ dg

So with friction, whose limit L goes by δ: what there is of it, f, what there would be if the pair
stuck, e, and how far it slides ahead and behind, p and q, all over the normal stiffness [m], follow
e − f = p − q, p (L − f) = τ, q (L + f) = τ, so that

    df = w (e − f − τ/(L − f) + τ/(L + f) + de) + w (p/(L − f) − q/(L + f)) dL,
    1/w = 1 + p/(L − f) + q/(L + f)

Its ``friction`` is f/L. L follows δ within an iteration as well as from one to the next: p and q
that do not follow it are soon far from where they belong, and half of all searches end nowhere.
With L a system has no symmetry, and there may be no way to a solution (a pair wedged between others
that slide), or none at all: iterations then go less and less far. There what friction goes by is
held, ``held_overlap`` and ``step_share``: all of this is convex then, and a step has one end.

How far an iteration goes is bounded by the pair that would first leave where it belongs. Among
hundreds one always does: begun near the last step's end, with most of them right, nothing moves
then. There each pair goes as far as it itself may, and bodies go all the way (`change_pairs`): what
is left of a pair no longer fits its gap, as in a search that begins where it does not (Wright, ch.
6), and is mended by the next one. That takes a third of the systems, or leads astray, which shows
within four; so it is how a search begins, and how it ends.

Along the way a pair of such a limit counts as closed for the whole step if it was at its start:
where it opens L is 0. By the gap, which is far from its end until δ and s are, it would be without
friction nearly everywhere.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.hooks import SLIP_LIMIT, contact_derivatives, contact_force, has, slip_limit
from flocsim.integrators.backward_euler.contact_mean import (
    add_slopes,
    bearing_of,
    friction_force,
    friction_slopes,
    sticking_slopes,
    view_with,
)
from flocsim.integrators.rhs.jacobian import add_geometric_stiffness, normal_rows, tangent_rows
from flocsim.integrators.rhs.views import add_pair_force, tangential_rate, view_without_slip
from flocsim.state.work import CHANGE, NOW, TRIAL

FAR_FROM_WALL = 0.99
"""What is to stay above 0 goes so far towards it at most in an iteration."""

WITHIN = 0.9
"""A pair that has brought iterations to a halt begins again at this share of its limit at most."""

NOTHING = 1e-14
"""A pair of which less of its stiffness is at work stiffens nothing."""

LEAST_LIMIT = 1e-3
"""Friction holds this share of what the spring alone would let it, at least: L stays above 0."""

SMALL = 0.01
"""What is off by this share of its parts is nearly right."""


def in_play(work, row):
    return work.candidates[row].contact_mode == 1


def rate_along(work, row, kind, entries):
    """What velocities, or their change, come to along a direction of both bodies of a pair."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    total = 0.0
    for axis in range(3):
        total += entries[0][axis] * work.velocity[kind, a, axis]
        total += entries[1][axis] * work.velocity[kind, b, axis]
    return total


def part_of_step(work, row, limited):
    """The part of the step for which a pair is closed, by how much that grows with δ, and by how
    much it falls with s [1/m]: at their ends contact_mean's."""
    contact = work.interior[row]
    over, left, before = (
        contact.overlap,
        contact.slack,
        work.geometry[TRIAL, row].gap,
    )
    if before >= 0.0:
        return over / (over + before), before / (over + before) ** 2, 0.0
    if limited:
        return 1.0, 0.0, 0.0
    held = over + contact.fading_gap
    return held / (held + left), left / (held + left) ** 2, held / (held + left) ** 2


def press(scene, work, row, step, turns):
    """(N of a pair of the overlap δ [N], how it grows with that [N/m]).

    Writes the law of its friction into ``work.interior``, see InteriorPoint; the limit is 0 where
    nothing limits it, or there is none. Along gaps that do not ``turns`` it is limited by springs
    alone, which is smooth: together with dashpots they are clipped."""
    contact = work.interior[row]
    overlap, rate = contact.overlap, tangential_rate(work, NOW, row)
    view = view_with(scene, work, row, step, overlap, 0.0, 0.0)
    found, limit = contact_derivatives(scene, view), 0.0
    stiffness = hardness = found[2] + found[4] / step
    spring, drag = -found[7], -found[9]
    if has(scene, SLIP_LIMIT):
        bearing = bearing_of(work, row)
        if not hardness > 0.0:
            # The law has clipped what pulls.
            pressed = contact_derivatives(scene, view_without_slip(view, overlap, 0.0))
            hardness = pressed[2] + pressed[4] / step
        borne = view_with(scene, work, row, step, bearing, 0.0, 0.0)
        held = slip_limit(scene, borne)
        if 0.0 < held < math.inf:
            spring, drag = sticking_slopes(scene, borne, held, step)
            limit = spring * held
            if turns:
                most = view_with(scene, work, row, step, bearing, held, abs(rate))
                limit = max(-contact_force(scene, most)[1], LEAST_LIMIT * limit)
            limit /= hardness
    if contact.held_overlap == 0.0:
        contact.step_share, _, _ = part_of_step(work, row, limit > 0.0)
    part = contact.step_share
    contact.normal_stiffness, contact.friction_limit = hardness, limit
    contact.stick_slope = (spring * part * step + drag) / hardness
    contact.stick_force = spring / hardness * work.slip[NOW, row] + contact.stick_slope * rate
    return found[0], stiffness


def mean_product(work):
    """The mean of δ s, p (L − f) and q (L + f) over the pairs in play [m²]."""
    total, count = 0.0, 0
    for row in range(work.tally.candidates):
        if in_play(work, row):
            contact = work.interior[row]
            total += contact.overlap * contact.slack
            count += 1
            if contact.friction_limit > 0.0:
                ahead, behind = contact.slide_ahead, contact.slide_behind
                both = ahead + behind + contact.friction * (behind - ahead)
                total += contact.friction_limit * both
                count += 2
    return total / max(count, 1)


def pull(work, row, target):
    """By how much a pair's δ is to change where its gap stays [m]."""
    contact = work.interior[row]
    overlap, left = contact.overlap, contact.slack
    off = left - work.geometry[NOW, row].gap - overlap
    return (target - overlap * left + overlap * off) / (overlap + left)


def drag(work, row, target):
    """(w, by how much a pair's friction f is to change where v_t and L stay [m], by how much it
    grows with L)."""
    contact = work.interior[row]
    limit = contact.friction_limit
    force = contact.friction * limit
    above, below = limit - force, limit + force
    ahead, behind = contact.slide_ahead / above, contact.slide_behind / below
    weight = 1.0 / (1.0 + ahead + behind)
    change = weight * (contact.stick_force - force - target / above + target / below)
    return weight, change, weight * (ahead - behind)


def limit_by_overlap(work, row):
    """By how much the limit of a pair's friction grows with δ; not at all where it is held."""
    contact = work.interior[row]
    if contact.held_overlap > 0.0:
        return 0.0
    return contact.friction_limit / contact.overlap


def limited_friction(work, row, target):
    """(s T, how it falls with v_t, how it grows with the gap) of a pair with a limit."""
    contact = work.interior[row]
    both = contact.overlap + contact.slack
    weight, change, by_limit = drag(work, row, target)
    whole = contact.step_share * contact.normal_stiffness
    by_limit *= limit_by_overlap(work, row)
    force = contact.friction * contact.friction_limit + change
    force += by_limit * pull(work, row, target)
    falls = by_limit * contact.overlap / both
    return -whole * force, whole * weight * contact.stick_slope, -whole * falls


def other_friction(scene, work, row, step, target):
    """The same of one without."""
    contact = work.interior[row]
    both = contact.overlap + contact.slack
    force = friction_force(scene, work, row, step)
    slope, _, by_part = friction_slopes(scene, work, row, step)
    if contact.held_overlap > 0.0:
        return force, slope, 0.0
    _, grows, falls = part_of_step(work, row, False)
    closing = pull(work, row, target)
    leaving = closing - (contact.slack - work.geometry[NOW, row].gap - contact.overlap)
    force += by_part * (grows * closing - falls * leaving)
    return (
        force,
        slope,
        by_part * (grows * contact.overlap + falls * contact.slack) / both,
    )


@apart
def write_forces(scene, work, step, target, turns):
    """Forces and derivatives of the pairs in play, δ and f changed as far as their gaps and v_t are
    not; if they turn, with what that does, which is too large before they fit, and can make systems
    indefinite."""
    for row in range(work.tally.candidates):
        if in_play(work, row):
            contact = work.interior[row]
            overlap, left = contact.overlap, contact.slack
            normal, stiffness = press(scene, work, row, step, turns)
            normal += stiffness * pull(work, row, target)
            tangential, slope, coupled = 0.0, 0.0, 0.0
            if contact.friction_limit > 0.0:
                tangential, slope, coupled = limited_friction(work, row, target)
            elif contact.stick_slope > 0.0:
                tangential, slope, coupled = other_friction(scene, work, row, step, target)
            add_pair_force(work, NOW, row, normal, tangential)
            works = overlap / (overlap + left)
            if works > NOTHING:
                add_slopes(scene, work, row, works * stiffness, slope, coupled)
                if turns:
                    add_geometric_stiffness(scene, work, row, normal, tangential)


def room(share, size, change):
    """The share of a change that keeps a size above 0, not above the one that is given."""
    return min(share, -FAR_FROM_WALL * size / change) if change < 0.0 else share


def change_friction(work, row, target, grown, share, go):
    """The share of the changes of p, q and f that keeps them where they belong, not above the one
    that is given; if they are to ``go``, they go that far. L is ``grown`` by so much [m]."""
    contact = work.interior[row]
    limit = contact.friction_limit
    weight, change, by_limit = drag(work, row, target)
    rate = rate_along(work, row, CHANGE, tangent_rows(work, row))
    stuck = contact.stick_slope * rate
    change += weight * stuck + by_limit * grown
    ahead, behind, force = (
        contact.slide_ahead,
        contact.slide_behind,
        contact.friction * limit,
    )
    above, below = limit - force, limit + force
    slides = contact.stick_force + stuck - force - change
    # The nearer side of the limit is not divided by: next to nothing is left there.
    if above > below:
        more = (target - ahead * (grown - change)) / above - ahead
        less = ahead + more - slides - behind
    else:
        less = (target - behind * (grown + change)) / below - behind
        more = behind + less + slides - ahead
    if go:
        contact.stick_force += share * stuck
        contact.friction_limit = limit + share * grown
        contact.friction = (force + share * change) / contact.friction_limit
        contact.slide_ahead += share * more
        contact.slide_behind += share * less
        return share
    share = room(room(share, ahead, more), behind, less)
    return room(room(share, above, grown - change), below, grown + change)


def change_pair(work, row, step, target, share, go):
    """The same of δ and s, and of friction."""
    contact = work.interior[row]
    overlap, left = contact.overlap, contact.slack
    opening = step * rate_along(work, row, CHANGE, normal_rows(work, row))
    closing = pull(work, row, target) - overlap / (overlap + left) * opening
    leaving = opening + closing - (left - work.geometry[NOW, row].gap - overlap)
    if contact.friction_limit > 0.0:
        grown = closing * limit_by_overlap(work, row)
        share = change_friction(work, row, target, grown, share, go)
    if go:
        contact.overlap += share * closing
        contact.slack += share * leaving
        return share
    return room(room(share, overlap, closing), left, leaving)


@apart
def change_pairs(work, step, target, own):
    """Change all pairs in play as the velocities in CHANGE do, each as far as all of them may, or
    as its ``own`` parts may: (the least share, the pair that has allowed no more, −1 for none)."""
    share, first = 1.0, -1
    for row in range(work.tally.candidates):
        if in_play(work, row):
            goes = change_pair(work, row, step, target, 1.0, False)
            if own:
                change_pair(work, row, step, target, goes, True)
            if goes < share:
                share, first = goes, row
    if not own:
        for row in range(work.tally.candidates):
            if in_play(work, row):
                change_pair(work, row, step, target, share, True)
    return share, first


@apart
def let_open(work):
    """Let the s of pairs follow their gaps where these have opened by more: next to δ = 0 it would
    but double in an iteration."""
    for row in range(work.tally.candidates):
        if in_play(work, row):
            contact = work.interior[row]
            wide = work.geometry[NOW, row].gap + contact.overlap
            contact.slack = max(contact.slack, wide)


def begin_friction(work, row, share, target):
    """Let the friction of a pair begin at a share of its limit, with products τ."""
    contact = work.interior[row]
    limit = contact.friction_limit
    contact.friction = share
    contact.slide_ahead = target / (limit * (1.0 - share))
    contact.slide_behind = target / (limit * (1.0 + share))


@apart
def hold_friction(work, first):
    """Hold what friction goes by from now on, and let the pair begin again that is in the way of
    the others; False where there is none left to be held."""
    newly = False
    for row in range(work.tally.candidates):
        contact = work.interior[row]
        rubs = contact.stick_slope > 0.0 and contact.held_overlap == 0.0
        if in_play(work, row) and rubs:
            contact.held_overlap, newly = contact.overlap, True
    if newly and work.interior[first].friction_limit > 0.0:
        share = min(max(work.interior[first].friction, -WITHIN), WITHIN)
        begin_friction(work, first, share, mean_product(work))
    return newly


def in_doubt(work, row, least):
    """Whether a pair has neither δ nor s below a small share of both, or of a size [m]; or, closed,
    neither how far it slides nor what is left until it does below that or a small share of L."""
    contact = work.interior[row]
    limit = contact.friction_limit
    both = contact.overlap + contact.slack
    if min(contact.overlap, contact.slack) > SMALL * max(both, least):
        return True
    if contact.overlap < contact.slack:
        return False
    force, least = contact.friction * limit, min(least, SMALL * max(limit, least))
    sides = max(min(contact.slide_ahead, limit - force), min(contact.slide_behind, limit + force))
    return limit > 0.0 and sides > least


def is_off(work, row, least):
    """Whether the gap of a pair is not s − δ, or how far it slides not e − f, by far more than
    their parts, or than a size [m]."""
    contact = work.interior[row]
    both = contact.overlap + contact.slack
    off = contact.slack - work.geometry[NOW, row].gap - contact.overlap
    if abs(off) > SMALL * max(both, SMALL * least):
        return True
    limit, ahead, behind = contact.friction_limit, contact.slide_ahead, contact.slide_behind
    off = contact.stick_force - contact.friction * limit - ahead + behind
    return limit > 0.0 and abs(off) > SMALL * max(limit + ahead + behind, least)


@apart
def settled(work, least, fitting):
    """Whether of all pairs it is known if they close and slide, by a size [m]; and, for
    ``fitting``, if that fits their gaps and rates."""
    for row in range(work.tally.candidates):
        open_question = in_doubt(work, row, least) or (fitting and is_off(work, row, least))
        if open_question and in_play(work, row):
            return False
    return True
