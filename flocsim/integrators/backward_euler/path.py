"""The way of the interior-point method from the start of a step to near its end.

Bodies slide by far more in a step than contacts overlap, and along a corner their gaps then go by
the square of that way, which is more than an overlap as well. So the contacts are followed with
gaps and directions as they are where the step would end without them, and only when it is known
which pairs close and slide, with those where they have come to.
"""

import math

import flocsim.arrays as at
from flocsim.compiler.linker import apart
from flocsim.integrators.backward_euler.contact_mean import flag_close, normal_stiffness
from flocsim.integrators.backward_euler.interior import (
    change_pairs,
    in_play,
    mean_product,
    press,
    rate_along,
    settled,
    write_forces,
)
from flocsim.integrators.backward_euler.newton import (
    assemble_rest,
    evaluate_others,
    go_along,
    goal_of,
    place_ends,
    put_back,
    solve_change,
)
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.systems import factorise_euler
from flocsim.integrators.rhs.forces import sum_other_forces
from flocsim.integrators.rhs.jacobian import normal_rows
from flocsim.integrators.rhs.views import effective_mass

MOST_ITERATIONS, MOST_TURNING, MOST_KNOWN = 70, 45, 40
"""Iterations at most: along gaps that are frozen, along true ones from then on, and along these
where pairs are taken to close and slide as in the step before."""

FALLING, LEAST_WAY, STANDING, CAREFUL = 0.003, 0.7, 0.03, 0.3
"""τ is the first share of the mean of all products behind an iteration that went so far at least;
behind others it is one of the other two, the larger where the smaller one has led nowhere."""

THAWS, LEAST_TARGET = 0.1, 1e-10
"""Gaps are true ones from where the mean of all products is below this share of the square of a
usual overlap; τ does not fall below the other one."""

FOUND = 0.01
"""It is known whether a pair is open or closed where the smaller one of δ and s is below this share
of a usual δ."""

NEAR = 10.0
"""The method is done at a change of so many times what Newton's method may leave."""

AWAY = 0.1
"""What is to fall begins at this share of its usual size at least."""

AS_BEFORE, CUT_OFF = 0.1, 0.1
"""Taken as in the step before, δ s begins at the square of this share of a usual overlap; an
iteration that goes less far than the other one says that it is not so."""


def usual_force(scene, work):
    """How large forces are that stop, or hold, a body [N], in the mean."""
    total, count = 0.0, 0
    for body in range(work.bodies.shape[0]):
        if scene.bodies[body, at.FREE] == 1.0:
            fx, fy = work.rates[at.NOW, body, at.FORCE], work.rates[at.NOW, body, at.FORCE + 1]
            total += math.hypot(fx, fy)
            count += 1
    return total / max(count, 1)


def usual_sizes(scene, work, step):
    """(a usual δ, a usual s [m]); 0 where no pair is in play."""
    count, stopped, way, deepest, stiffness = 0, 0.0, 0.0, 0.0, 0.0
    for row in range(work.tally[at.CANDIDATES]):
        if in_play(work, row):
            a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
            speed = abs(rate_along(work, row, at.START, normal_rows(work, row)))
            stopped += effective_mass(scene, a, b) * speed / step
            way += step * speed
            deepest = max(deepest, -work.geometry[at.NOW, row, at.GAP])
            stiffness += normal_stiffness(scene, work, row, step, 1e-12)
            count += 1
    if count == 0 or not stiffness > 0.0:
        return 0.0, 0.0
    usual = (stopped + count * usual_force(scene, work)) / stiffness
    return usual, max(way / count, usual, AWAY * deepest)


def begin_anywhere(scene, work, step, usual, way):
    """δ, s and friction of all pairs in play to begin with, of which nothing is known."""
    for row in range(work.tally[at.CANDIDATES]):
        if in_play(work, row):
            known = work.slip
            known[at.OVERLAP, row] = max(-work.geometry[at.TRIAL, row, at.GAP], AWAY * usual)
            known[at.LEFT, row] = max(
                work.geometry[at.NOW, row, at.GAP] + known[at.OVERLAP, row], AWAY * way
            )
            press(scene, work, row, step)
            known[at.RUBBING, row] = 0.0
            known[at.AHEAD, row] = max(known[at.STUCK, row], AWAY * usual)
            known[at.BEHIND, row] = max(-known[at.STUCK, row], AWAY * usual)


def begin_as_before(scene, work, step, usual):
    """The same where pairs are closed and slide as at the start of the step."""
    target = (AS_BEFORE * usual) ** 2
    for row in range(work.tally[at.CANDIDATES]):
        if in_play(work, row):
            known, before = work.slip, work.geometry[at.TRIAL, row, at.GAP]
            if before < 0.0:
                known[at.OVERLAP, row], known[at.LEFT, row] = -before, -target / before
            else:
                known[at.LEFT, row] = max(work.geometry[at.NOW, row, at.GAP], FOUND * usual)
                known[at.OVERLAP, row] = target / known[at.LEFT, row]
            press(scene, work, row, step)
            limit, side = known[at.LIMIT, row], work.candidates[row, at.SLIDING]
            if limit > 0.0:
                share = float(side) if side != 0 else known[at.STUCK, row] / limit
                share = min(max(share, FOUND - 1.0), 1.0 - FOUND)
                slides = side * (known[at.STUCK, row] - share * limit)
                known[at.RUBBING, row] = share
                known[at.AHEAD, row] = target / (limit * (1.0 - share))
                known[at.BEHIND, row] = target / (limit * (1.0 + share))
                moves = at.AHEAD if side > 0 else at.BEHIND
                if side != 0:
                    known[moves, row] = max(known[moves, row], slides)


def advance_gaps(work, share, step):
    """Gaps after a share of the change of velocities, in the directions that they had."""
    for row in range(work.tally[at.CANDIDATES]):
        opening = rate_along(work, row, at.CHANGE, normal_rows(work, row))
        work.geometry[at.NOW, row, at.GAP] += share * step * opening


@apart
def iterate(scene, work, clock, step, target, turns):
    """One iteration towards products τ: (the share of the change that was gone, the change [m]),
    −1 where it fails."""
    assemble_rest(scene, work, clock, step)
    write_forces(scene, work, step, target, turns)
    if not factorise_euler(scene, work, step):
        return -1.0, math.inf
    change = solve_change(scene, work, step)
    if not change < math.inf:
        return -1.0, math.inf
    share = change_pairs(work, step, target)
    go_along(work, share)
    if turns:
        evaluate_others(scene, work, clock[at.TIME], step)
    else:
        advance_gaps(work, share, step)
        place_ends(work, step)
        sum_other_forces(scene, work, clock[at.TIME] + step, at.NOW)
    return share, change


@apart
def arrive(scene, work, clock, step, usual, most, least):
    """Iterate along true gaps, with τ about as small as it is to be; whether that leads to the end.
    It is given up where an iteration does not go far enough."""
    share = 1.0
    for _ in range(most):
        target = (FALLING if share >= LEAST_WAY else CAREFUL) * mean_product(work)
        target = max(target, LEAST_TARGET * usual * usual)
        share, change = iterate(scene, work, clock, step, target, True)
        if share < least:
            return False
        near = share > LEAST_WAY and change <= NEAR * goal_of(scene, work, clock, step)
        if near and settled(work, FOUND * usual, True):
            return True
    return False


@apart
def come_from_afar(scene, work, clock, step, usual, way, standing):
    """Go to the end of the step from where nothing is known of it; whether that leads there."""
    begin_anywhere(scene, work, step, usual, way)
    share = 0.0
    for _ in range(MOST_ITERATIONS):
        target = (FALLING if share >= LEAST_WAY else standing) * mean_product(work)
        share, _ = iterate(scene, work, clock, step, target, False)
        if share < 0.0:
            return False
        if share > LEAST_WAY and mean_product(work) <= THAWS * usual * usual:
            evaluate_others(scene, work, clock[at.TIME], step)
            return arrive(scene, work, clock, step, usual, MOST_TURNING, 0.0)
    return False


def start_anew(scene, work, clock, step):
    """Go back to the velocities at the start of the step."""
    put_back(work)
    evaluate_others(scene, work, clock[at.TIME], step)


@apart
def find_closed(scene, work, clock, step):
    """Bring the velocities near those of the step's end; False where that fails."""
    evaluate_others(scene, work, clock[at.TIME], step)
    flag_close(scene, work)
    gather_clusters(scene, work)
    usual, way = usual_sizes(scene, work, step)
    if usual == 0.0:
        return True
    if clock[at.BUSY] == 0.0:
        begin_as_before(scene, work, step, usual)
        if arrive(scene, work, clock, step, usual, MOST_KNOWN, CUT_OFF):
            return True
        start_anew(scene, work, clock, step)
    clock[at.BUSY] = 1.0
    if come_from_afar(scene, work, clock, step, usual, way, STANDING):
        return True
    start_anew(scene, work, clock, step)
    return come_from_afar(scene, work, clock, step, usual, way, CAREFUL)
