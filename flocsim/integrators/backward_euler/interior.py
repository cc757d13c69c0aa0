"""Which contacts close and slide in a step: an interior-point method, with whose end Newton's
method begins.

With hard springs a step is all but a complementarity problem: of every pair, the overlap δ = Δ₁⁺
that its force has and the gap s = g + δ that is left of it are not below 0, and one of them is 0.
Newton's method (newton.py) finds which, a few pairs an iteration; here all pairs are followed at
once along δ s = τ, τ falling to nothing (primal-dual, Wright 1997; as for contacts in Christensen
et al. 1998): some ten systems for any number of contacts that switch. They are those of Newton's
method, the stiffness of a pair being its part δ/(δ + s) that is at work. OVERLAP holds δ, LEFT s.

    (δ + s) dδ = τ − δ s + δ (s − g − δ) − δ dg

So with friction, whose limit L goes by the δ of the last iteration: what there is of it, f = φ L,
what there would be if the pair stuck, e, and how far it slides ahead and behind, p and q, all over
the normal stiffness [m], follow e − f = p − q, p (L − f) = τ, q (L + f) = τ, so that


    df = w (e − f − τ/(L − f) + τ/(L + f) + de),   1/w = 1 + p/(L − f) + q/(L + f)

The turning of forces is left out, which would be too large before they fit, and would make the
systems indefinite; so that along the way they are those of a convex problem.
"""

import math

from flocsim.arrays import (
    AHEAD,
    BEHIND,
    CANDIDATES,
    CHANGE,
    CLOSED,
    EDGE_BODY,
    FORCE,
    FREE,
    GAP,
    LEFT,
    NOW,
    OVERLAP,
    PART,
    RUBBING,
    START,
    TIME,
    TRIAL,
    VELOCITY,
    VERTEX_BODY,
)
from flocsim.compiler.composer import apart
from flocsim.integrators.backward_euler.contact_mean import (
    add_slopes,
    closed_share,
    flag_close,
    friction_force,
    friction_slope,
    go_by,
    normal_force,
    normal_stiffness,
    view_with,
)
from flocsim.integrators.backward_euler.newton import (
    assemble_rest,
    evaluate_others,
    go_along,
    solve_change,
)
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.systems import factorise_euler
from flocsim.integrators.rhs.jacobian import normal_rows, tangent_rows
from flocsim.integrators.rhs.views import (
    effective_mass,
    pressed_view,
    push_pair,
    tangential_rate,
)
from flocsim.laws import SLIP_LIMIT, contact_derivatives, has, slip_limit

MOST_ITERATIONS = 45

FAR_FROM_WALL = 0.99
"""What is to stay above 0 goes so far towards it at most in an iteration."""

FALLING, STANDING, LEAST_WAY = 0.003, 0.1, 0.7
"""τ is this share of the mean of all products: behind an iteration that went so far at least, or
not."""

FOUND, DOUBTS, MOST_DOUBTS = 0.01, 0.01, 0.1
"""Of a pair that is found to be open or closed, the smaller one of δ and s is below this share of a
usual δ; this share of the pairs may be left to Newton's method, and this one behind all iterations.
"""


def in_play(work, row):
    return work.candidates[row, CLOSED] == 1


def usual_force(scene, work, step):
    """How large forces are that stop, or hold, a body [N], in the mean."""
    total, count = 0.0, 0
    for body in range(work.bodies.shape[0]):
        if scene.bodies[body, FREE] == 1.0:
            fx, fy = work.rates[NOW, body, FORCE], work.rates[NOW, body, FORCE + 1]
            total += math.hypot(fx, fy)
            count += 1
    return total / max(count, 1)


def friction_of(scene, work, row, step):
    """Of a pair's friction, over its normal stiffness: by how much it grows with v_t [s], what it
    would be if the pair stuck, and at most [m]; 0 where nothing limits it."""
    if not has(scene, SLIP_LIMIT):
        return 0.0, 0.0, 0.0
    overlap, rate = work.slip[OVERLAP, row], tangential_rate(work, NOW, row)
    view = pressed_view(view_with(scene, work, row, step, overlap, 0.0, 0.0), overlap, 0.0)
    found = contact_derivatives(scene, view)
    stiffness = found[2] + found[4] / step
    spring = -found[7] / stiffness
    slope = spring * work.slip[PART, row] * step - found[9] / stiffness
    stuck = spring * work.slip[NOW, row] + slope * rate
    limit = slip_limit(scene, view)
    return slope, stuck, spring * limit if limit < math.inf else 0.0


def rate_along(work, row, kind, entries):
    """What velocities, or their change, come to along a direction of both bodies of a pair."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    total = 0.0
    for axis in range(3):
        total += entries[0][axis] * work.motion[kind, a, VELOCITY + axis]
        total += entries[1][axis] * work.motion[kind, b, VELOCITY + axis]
    return total


def begin(scene, work, step):
    """δ and s of all pairs in play to begin with; (a usual δ [m], how many pairs there are)."""
    count, stopped, way, stiffness = 0, 0.0, 0.0, 0.0
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
            speed = abs(rate_along(work, row, START, normal_rows(work, row)))
            stopped += effective_mass(scene, a, b) * speed / step
            way += step * speed
            stiffness += normal_stiffness(scene, work, row, step, 1e-12)
            count += 1
    if count == 0 or not stiffness > 0.0:
        return 0.0, 0
    usual = (stopped + count * usual_force(scene, work, step)) / stiffness
    way = max(way / count, usual)
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            gap = work.geometry[NOW, row, GAP]
            overlap = max(-work.geometry[TRIAL, row, GAP], 0.1 * usual)
            go_by(work, row, overlap, closed_share(work, row))
            work.slip[LEFT, row] = max(gap + overlap, 0.1 * way)
            _, stuck, _ = friction_of(scene, work, row, step)
            work.slip[RUBBING, row] = 0.0
            work.slip[AHEAD, row] = max(stuck, 0.1 * usual)
            work.slip[BEHIND, row] = max(-stuck, 0.1 * usual)
    return usual, count


def mean_product(scene, work, step):
    """The mean of δ s, p (L − f) and q (L + f) over the pairs in play [m²]."""
    total, count = 0.0, 0
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            total += work.slip[OVERLAP, row] * work.slip[LEFT, row]
            count += 1
            _, _, limit = friction_of(scene, work, row, step)
            if limit > 0.0:
                ahead, behind = work.slip[AHEAD, row], work.slip[BEHIND, row]
                total += limit * (ahead + behind + work.slip[RUBBING, row] * (behind - ahead))
                count += 2
    return total / max(count, 1)


def pull(work, row, target):
    """By how much a pair's δ is to change where its gap stays, over δ + s times that [m²]."""
    overlap, left = work.slip[OVERLAP, row], work.slip[LEFT, row]
    off = left - work.geometry[NOW, row, GAP] - overlap
    return target - overlap * left + overlap * off


def drag(work, row, stuck, limit, target):
    """(w, by how much a pair's friction f is to change where v_t stays [m])."""
    force = work.slip[RUBBING, row] * limit
    above, below = limit - force, limit + force
    weight = 1.0 / (1.0 + work.slip[AHEAD, row] / above + work.slip[BEHIND, row] / below)
    return weight, weight * (stuck - force - target / above + target / below)


@apart
def write_forces(scene, work, step, target):
    """Forces and derivatives of the pairs in play, δ and f changed as far as their gaps and v_t are
    not."""
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            overlap, both = work.slip[OVERLAP, row], work.slip[OVERLAP, row] + work.slip[LEFT, row]
            work.slip[PART, row] = closed_share(work, row)
            stiffness = normal_stiffness(scene, work, row, step, overlap)
            normal = normal_force(scene, work, row, step, overlap)
            normal += stiffness * pull(work, row, target) / both
            slope, stuck, limit = friction_of(scene, work, row, step)
            if limit > 0.0:
                weight, change = drag(work, row, stuck, limit, target)
                whole = work.slip[PART, row] * stiffness
                tangential = -whole * (work.slip[RUBBING, row] * limit + change)
                slope *= whole * weight
            else:
                tangential = friction_force(scene, work, row, step)
                slope = friction_slope(scene, work, row, step)
            push_pair(work, NOW, row, normal, tangential)
            add_slopes(scene, work, row, overlap / both * stiffness, slope)


def room(share, size, change):
    """The share of a change that keeps a size above 0, not above the one that is given."""
    return min(share, -FAR_FROM_WALL * size / change) if change < 0.0 else share


def change_friction(scene, work, row, step, target, share):
    """Change a pair's f, p and q by a share, or less where one would come to 0."""
    known = work.slip
    slope, stuck, limit = friction_of(scene, work, row, step)
    if limit > 0.0:
        weight, change = drag(work, row, stuck, limit, target)
        change += weight * slope * rate_along(work, row, CHANGE, tangent_rows(work, row))
        ahead, behind, force = known[AHEAD, row], known[BEHIND, row], known[RUBBING, row] * limit
        above, below = limit - force, limit + force
        more = (target + ahead * change) / above - ahead
        less = (target - behind * change) / below - behind
        share = room(room(share, ahead, more), behind, less)
        share = room(room(share, above, -change), below, change)
        known[RUBBING, row] += share * change / limit
        known[AHEAD, row] += share * more
        known[BEHIND, row] += share * less


def change_pair(scene, work, row, step, target, share, go):
    """The share of the changes of δ and s that keeps them above 0, not above the one that is given;
    if they are to ``go``, they go that far, and friction with them."""
    known = work.slip
    overlap, left = known[OVERLAP, row], known[LEFT, row]
    opening = step * rate_along(work, row, CHANGE, normal_rows(work, row))
    closing = (pull(work, row, target) - overlap * opening) / (overlap + left)
    leaving = opening + closing - (left - work.geometry[NOW, row, GAP] - overlap)
    if go:
        change_friction(scene, work, row, step, target, share)
        known[OVERLAP, row] += share * closing
        known[LEFT, row] += share * leaving
        # The limit of friction goes with δ, and p and q the other way, as their products stay.
        known[AHEAD, row] *= overlap / known[OVERLAP, row]
        known[BEHIND, row] *= overlap / known[OVERLAP, row]
    return room(room(share, overlap, closing), left, leaving)


@apart
def change_pairs(scene, work, step, target, share, go):
    """The same of all pairs in play."""
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            least = change_pair(scene, work, row, step, target, share, go)
            share = share if go else least
    return share


def in_doubt(scene, work, step, usual):
    """How many pairs have neither δ nor s, or neither how far they slide nor what is left until
    they do, far below a usual overlap."""
    count = 0
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            doubt = min(work.slip[OVERLAP, row], work.slip[LEFT, row])
            _, _, limit = friction_of(scene, work, row, step)
            force = work.slip[RUBBING, row] * limit
            doubt = max(doubt, min(work.slip[AHEAD, row], limit - force))
            doubt = max(doubt, min(work.slip[BEHIND, row], limit + force))
            count += 1 if doubt > FOUND * usual else 0
    return count


@apart
def find_closed(scene, work, clock, step):
    """Bring the velocities near those of the step's end; False where that fails."""
    time = clock[TIME]
    evaluate_others(scene, work, time, step)
    flag_close(scene, work)
    usual, count = begin(scene, work, step)
    if count == 0:
        return True
    gather_clusters(scene, work)
    share = 0.0
    for _ in range(MOST_ITERATIONS):
        target = FALLING if share >= LEAST_WAY else STANDING
        target *= mean_product(scene, work, step)
        assemble_rest(scene, work, clock, step)
        write_forces(scene, work, step, target)
        if not factorise_euler(scene, work, step):
            return False
        if not solve_change(scene, work, step) < math.inf:
            return False
        share = change_pairs(scene, work, step, target, 1.0, False)
        change_pairs(scene, work, step, target, share, True)
        go_along(work, share)
        evaluate_others(scene, work, time, step)
        if share > LEAST_WAY and in_doubt(scene, work, step, usual) <= DOUBTS * count:
            return True
    return in_doubt(scene, work, step, usual) <= MOST_DOUBTS * count
