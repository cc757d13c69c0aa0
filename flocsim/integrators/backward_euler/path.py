"""The way of the interior-point method from the start of a step to near its end.

Bodies slide by far more in a step than contacts overlap, and along a corner their gaps then go by
the square of that way, which is more than an overlap as well. So the contacts are followed with
gaps and directions as they are where the step would end without them, and only when it is known
which pairs close and slide, with those where they have come to.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.hooks import SLIP_LIMIT, has
from flocsim.integrators.backward_euler.contact_mean import flag_close, normal_stiffness
from flocsim.integrators.backward_euler.interior import (
    begin_friction,
    change_pairs,
    hold_friction,
    in_play,
    let_open,
    mean_product,
    press,
    rate_along,
    settled,
    write_forces,
)
from flocsim.integrators.backward_euler.newton import (
    assemble_rest,
    evaluate_end,
    evaluate_in_play,
    evaluate_others,
    go_along,
    goal_of,
    place_ends,
    put_back,
    solve_change,
    solve_end,
)
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.systems import factorise_euler
from flocsim.integrators.rhs.forces import sum_other_forces
from flocsim.integrators.rhs.jacobian import normal_rows
from flocsim.integrators.rhs.views import effective_mass
from flocsim.state.bodies import X, Y
from flocsim.state.work import CHANGE, NOW, START, TRIAL

MOST_ITERATIONS, MOST_TURNING, MOST_KNOWN = 70, 45, 24
"""Iterations at most: along gaps that are frozen, along true ones from then on, and along these
where pairs are taken to close and slide as in the step before."""

FALLING, LEAST_WAY = 0.01, 0.7
"""τ is that share of the mean of all products behind an iteration that went so far at least; …"""

STANDING, CAREFUL, CLOSER, APART = 0.03, 0.5, 0.2, 0.05
"""… and behind others one of these: along gaps that are frozen, there where the first one has led
nowhere, along true ones, and where each pair goes its own share."""

THAWS, LEAST_TARGET = 0.1, 1e-10
"""Gaps are true ones from where the mean of all products is below this share of the square of a
usual overlap; τ does not fall below the other one."""

FOUND = 0.01
"""It is known whether a pair is open or closed where the smaller one of δ and s is below this share
of a usual δ."""

NEAR_CHANGE = 10.0
"""Newton's method finds the end, where all of that is known, from a change of so many times what it
may leave itself."""

STILL_CHANGE, WHOLE, CENTRED = 0.1, 0.9, 1e-4
"""The end is there at a change of so many times that, which went so far at least, and a mean of all
products below this share of the square of a usual overlap: what is not known moves nothing."""

AWAY = 0.1
"""What is to fall begins at this share of its usual size at least."""

SMALL_LIMIT = 1e-3
"""A limit of friction counts as this share of a usual overlap at least there."""

AS_BEFORE = 0.03
"""Taken as in the step before, δ s begins at the square of this share of a usual overlap."""

ASTRAY = 30.0
"""Where each pair goes its own share, a change of so many times the first one leads nowhere."""

HALTING, SOON = 0.05, 2
"""Iterations that go less far have come to a halt, after so many in a row."""

NOWHERE, NEAR, THERE = range(3)
"""Where a search leads: Newton's method has to go on from NEAR."""


def usual_force(scene, work):
    """How large forces are that stop, or hold, a body [N], in the mean."""
    total, count = 0.0, 0
    for body in range(work.poses.shape[0]):
        if scene.bodies[body].free == 1.0:
            fx, fy = work.force[NOW, body, X], work.force[NOW, body, Y]
            total += math.hypot(fx, fy)
            count += 1
    return total / max(count, 1)


def usual_sizes(scene, work, step):
    """(a usual δ, a usual s [m]); 0 where no pair is in play."""
    count, stopped, way, deepest, stiffness = 0, 0.0, 0.0, 0.0, 0.0
    for row in range(work.tally.candidates):
        if in_play(work, row):
            candidate = work.candidates[row]
            a, b = candidate.vertex_body, candidate.edge_body
            speed = abs(rate_along(work, row, START, normal_rows(work, row)))
            stopped += effective_mass(scene, a, b) * speed / step
            way += step * speed
            deepest = max(deepest, -work.geometry[NOW, row].gap)
            stiffness += normal_stiffness(scene, work, row, step, 1e-12)
            count += 1
    if count == 0 or not stiffness > 0.0:
        return 0.0, 0.0
    usual = (stopped + count * usual_force(scene, work)) / stiffness
    return usual, max(way / count, usual, AWAY * deepest)


def begin_anywhere(scene, work, step, usual, way):
    """δ, s and friction of all pairs in play to begin with, of which nothing is known, or held."""
    for row in range(work.tally.candidates):
        if in_play(work, row):
            contact = work.interior[row]
            gap = work.geometry[NOW, row].gap
            contact.overlap = max(-work.geometry[TRIAL, row].gap, AWAY * usual)
            contact.slack = max(gap + contact.overlap, AWAY * way, -gap)
            contact.held_overlap = 0.0
            press(scene, work, row, step, False)
            contact.friction = 0.0
            slides = AWAY * usual * AWAY * way / max(contact.friction_limit, SMALL_LIMIT * usual)
            contact.slide_ahead = max(contact.stick_force, slides)
            contact.slide_behind = max(-contact.stick_force, slides)


def begin_as_before(scene, work, step, usual):
    """The same where pairs are closed and slide as at the start of the step."""
    target = (AS_BEFORE * usual) ** 2
    for row in range(work.tally.candidates):
        if in_play(work, row):
            geometry = work.geometry[NOW, row]
            contact = work.interior[row]
            before = work.geometry[TRIAL, row].gap
            if before < 0.0:
                contact.overlap, contact.slack = -before, -target / before
            elif geometry.gap < 0.0:
                contact.overlap, contact.slack = usual, target / usual
            else:
                contact.slack = max(geometry.gap, FOUND * usual)
                contact.overlap = target / contact.slack
            press(scene, work, row, step, True)
            limit, side = contact.friction_limit, work.candidates[row].slide_direction
            if limit > 0.0:
                share = float(side) if side != 0 else contact.stick_force / limit
                share = min(max(share, FOUND - 1.0), 1.0 - FOUND)
                slides = side * (contact.stick_force - share * limit)
                begin_friction(work, row, share, target)
                if side > 0:
                    contact.slide_ahead = max(contact.slide_ahead, slides)
                elif side < 0:
                    contact.slide_behind = max(contact.slide_behind, slides)


def advance_gaps(work, share, step):
    """Gaps after a share of the change of velocities, in the directions that they had."""
    for row in range(work.tally.candidates):
        opening = rate_along(work, row, CHANGE, normal_rows(work, row))
        work.geometry[NOW, row].gap += share * step * opening


@apart
def iterate(scene, work, clock, step, target, turns, own):
    """One iteration towards products τ: (the share of the change that was gone, the pair that
    allowed no more, the change [m]); −1 where it fails. Where each pair goes its ``own`` share,
    that of its last one, and bodies go all the way."""
    assemble_rest(scene, work, clock, step)
    write_forces(scene, work, step, target, turns)
    if not factorise_euler(scene, work, step):
        return -1.0, -1, math.inf
    change = solve_change(scene, work, step)
    if not change < math.inf:
        return -1.0, -1, math.inf
    share, first = change_pairs(work, step, target, own)
    go_along(work, 1.0 if own else share)
    if turns:
        evaluate_in_play(scene, work, clock.time, step)
        if own:
            let_open(work)
    else:
        advance_gaps(work, share, step)
        place_ends(work, step)
        sum_other_forces(scene, work, clock.time + step, NOW)
    return share, first, change


def may_go_apart(scene, work):
    """Whether each pair, all having begun, may go its own share of an iteration. Friction without a
    limit goes by the part of the step for which a pair is closed, and so by δ and s themselves:
    there the bodies' ends would be others than those that pairs know of, and steps are rejected."""
    if has(scene, SLIP_LIMIT):
        return True
    for row in range(work.tally.candidates):
        if in_play(work, row) and work.interior[row].stick_slope > 0.0:
            return False
    return True


def count_halts(work, halted, share, first):
    """(How many iterations in a row have hardly gone any way, whether it makes sense to go on):
    behind SOON of them friction is held, where it has not been; see hold_friction."""
    if share >= HALTING:
        return 0, True
    if halted + 1 < SOON:
        return halted + 1, True
    return -SOON, hold_friction(work, first)


@apart
def arrive(scene, work, clock, step, usual, most, own):
    """Iterate along true gaps, with τ about as small as it is to be; where that leads to. Where
    each pair goes its ``own`` way, it is given up if that leads further and further off."""
    share, halted, first_change = 1.0, 0, math.inf
    for _ in range(most):
        mean = mean_product(work)
        target = (FALLING if share >= LEAST_WAY else APART if own else CLOSER) * mean
        target = max(target, LEAST_TARGET * usual * usual)
        share, first, change = iterate(scene, work, clock, step, target, True, own)
        if share < 0.0 or (own and change > ASTRAY * first_change):
            return NOWHERE
        first_change = change if first_change == math.inf else first_change
        if not own:
            halted, goes_on = count_halts(work, halted, share, first)
            if not goes_on:
                return NOWHERE
        goal = goal_of(scene, work, clock, step)
        near = share > LEAST_WAY and change <= NEAR_CHANGE * goal
        if near and settled(work, FOUND * usual, True):
            return NEAR
        still = share > WHOLE and change <= STILL_CHANGE * goal
        if still and mean <= CENTRED * usual * usual:
            return THERE
    return NOWHERE


@apart
def come_from_afar(scene, work, clock, step, usual, way, careful):
    """Go to the end of the step from where nothing is known of it; where that leads to."""
    put_back(work)
    evaluate_others(scene, work, clock.time, step)
    begin_anywhere(scene, work, step, usual, way)
    share, halted, standing = 0.0, 0, CAREFUL if careful else STANDING
    for _ in range(MOST_ITERATIONS):
        target = (FALLING if share >= LEAST_WAY else standing) * mean_product(work)
        share, first, _ = iterate(scene, work, clock, step, target, False, False)
        if share < 0.0:
            return NOWHERE
        halted, goes_on = count_halts(work, halted, share, first)
        if not goes_on:
            return NOWHERE
        if share > LEAST_WAY and mean_product(work) <= THAWS * usual * usual:
            evaluate_others(scene, work, clock.time, step)
            own = not careful and may_go_apart(scene, work)
            return arrive(scene, work, clock, step, usual, MOST_TURNING, own)
    return NOWHERE


def leaves_out(work):
    """Whether a pair has closed that was not in play."""
    for row in range(work.tally.candidates):
        if work.geometry[NOW, row].gap < 0.0 and not in_play(work, row):
            return True
    return False


def ends(scene, work, clock, step, led):
    """Whether the end of the step is there, or Newton's method finds it from where a search has
    led."""
    if led == THERE:
        if not evaluate_end(scene, work, clock.time, step):
            return False
        if not leaves_out(work):
            return True
    return led != NOWHERE and solve_end(scene, work, clock, step)


@apart
def search_afar(scene, work, clock, step, usual, way):
    """Find the end of the step from where nothing is known of it; once more and more carefully
    where that fails."""
    for careful in (False, True):
        led = come_from_afar(scene, work, clock, step, usual, way, careful)
        if ends(scene, work, clock, step, led):
            return True
    return False


@apart
def find_end(scene, work, clock, step):
    """Find the end of the step, of which begin_step has kept the start; False where it is not
    found."""
    evaluate_others(scene, work, clock.time, step)
    flag_close(scene, work)
    gather_clusters(scene, work)
    usual, way = usual_sizes(scene, work, step)
    if usual == 0.0:
        return solve_end(scene, work, clock, step)
    begin_as_before(scene, work, step, usual)
    if may_go_apart(scene, work):
        led = arrive(scene, work, clock, step, usual, MOST_KNOWN, True)
        if ends(scene, work, clock, step, led):
            return True
    return search_afar(scene, work, clock, step, usual, way)
