"""Which contacts close in a step: an interior-point method, whose end Newton's method begins with.

With hard springs a step is all but a complementarity problem: of every pair, the overlap δ = Δ₁⁺
that its force has and the gap s = g + δ that is left of it are not below 0, and one of them is 0.
Newton's method (newton.py) finds which, a few pairs an iteration; here all pairs are followed at
once along δ s = τ, τ falling to nothing (primal-dual, Wright 1997; as for contacts in Christensen
et al. 1998): some ten systems for any number of contacts that switch. They are those of Newton's
method, the stiffness of a pair being its part δ/(δ + s) that is at work. OVERLAP holds δ, LEFT s.

    (δ + s) dδ = τ − δ s + δ (s − g − δ) − δ dg

The turning of forces is left out, which would be too large before they fit, and would make the
systems indefinite; so that along the way they are those of a convex problem.
"""

import math

from flocsim.arrays import (
    CANDIDATES,
    CHANGE,
    CLOSED,
    EDGE_BODY,
    FORCE,
    FREE,
    GAP,
    LEFT,
    LEFT_CHANGE,
    NOW,
    OVERLAP,
    OVERLAP_CHANGE,
    START,
    TIME,
    TRIAL,
    VELOCITY,
    VERTEX_BODY,
)
from flocsim.compiler.composer import apart
from flocsim.integrators.backward_euler.contact_mean import (
    add_mean_derivatives,
    add_mean_force,
    flag_close,
    normal_stiffness,
)
from flocsim.integrators.backward_euler.newton import (
    assemble_rest,
    evaluate_others,
    go_along,
    solve_change,
)
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.systems import factorise_euler
from flocsim.integrators.rhs.views import along_normal, effective_mass, push_pair

MOST_ITERATIONS = 30

FAR_FROM_WALL = 0.99
"""δ and s go so far towards 0 at most in an iteration."""

FALLING, STANDING, LEAST_WAY = 0.003, 0.1, 0.7
"""τ is this share of the mean of δ s: behind an iteration that went so far at least, or not."""

FOUND, DOUBTS = 0.01, 0.01
"""Of a pair that is found to be open or closed, the smaller one of δ and s is below this share of a
usual δ; this share of the pairs may be left to Newton's method."""


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


def begin(scene, work, step):
    """δ and s of all pairs in play to begin with; (a usual δ [m], how many pairs there are)."""
    count, stopped, way, stiffness = 0, 0.0, 0.0, 0.0
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
            speed = abs(along_normal(work, row, START, VELOCITY))
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
            work.slip[OVERLAP, row] = overlap
            work.slip[LEFT, row] = max(gap + overlap, 0.1 * way)
    return usual, count


def mean_product(work, count):
    """The mean of δ s over the pairs in play [m²]."""
    total = 0.0
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            total += work.slip[OVERLAP, row] * work.slip[LEFT, row]
    return total / count


def pull(work, row, target):
    """By how much a pair's δ is to change where its gap stays, over δ + s times that [m²]."""
    overlap, left = work.slip[OVERLAP, row], work.slip[LEFT, row]
    off = left - work.geometry[NOW, row, GAP] - overlap
    return target - overlap * left + overlap * off


@apart
def write_forces(scene, work, step, target):
    """Forces and derivatives of the pairs in play, δ changed as far as their gaps do not."""
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            overlap, both = work.slip[OVERLAP, row], work.slip[OVERLAP, row] + work.slip[LEFT, row]
            add_mean_force(scene, work, row, step, overlap)
            stiffness = normal_stiffness(scene, work, row, step, overlap)
            push_pair(work, NOW, row, stiffness * pull(work, row, target) / both, 0.0)
            add_mean_derivatives(scene, work, row, step, overlap, overlap / both, False)


@apart
def write_pair_changes(work, step, target):
    """Changes of δ and s from those of velocities; the largest share of them that keeps all above
    0."""
    share = 1.0
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            overlap, left = work.slip[OVERLAP, row], work.slip[LEFT, row]
            opening = step * along_normal(work, row, CHANGE, VELOCITY)
            change = (pull(work, row, target) - overlap * opening) / (overlap + left)
            off = left - work.geometry[NOW, row, GAP] - overlap
            work.slip[OVERLAP_CHANGE, row] = change
            work.slip[LEFT_CHANGE, row] = opening + change - off
            if change < 0.0:
                share = min(share, -FAR_FROM_WALL * overlap / change)
            if opening + change - off < 0.0:
                share = min(share, -FAR_FROM_WALL * left / (opening + change - off))
    return share


def go(work, share):
    """Go a share of the changes."""
    go_along(work, share)
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            work.slip[OVERLAP, row] += share * work.slip[OVERLAP_CHANGE, row]
            work.slip[LEFT, row] += share * work.slip[LEFT_CHANGE, row]


def in_doubt(work, usual):
    """How many pairs have neither δ nor s far below a usual overlap."""
    count = 0
    for row in range(work.tally[CANDIDATES]):
        if in_play(work, row):
            smaller = min(work.slip[OVERLAP, row], work.slip[LEFT, row])
            count += 1 if smaller > FOUND * usual else 0
    return count


@apart
def find_closed(scene, work, clock, step):
    """Bring the velocities near those of the step's end; False where no system can be solved."""
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
        target *= mean_product(work, count)
        assemble_rest(scene, work, clock, step)
        write_forces(scene, work, step, target)
        if not factorise_euler(scene, work, step):
            return False
        if not solve_change(scene, work, step) < math.inf:
            return False
        share = write_pair_changes(work, step, target)
        go(work, share)
        evaluate_others(scene, work, time, step)
        if share > LEAST_WAY and in_doubt(work, usual) <= DOUBTS * count:
            return True
    return True
