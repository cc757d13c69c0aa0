"""A step of backward Euler that goes on across switches, as the loop of all methods takes it.

Its steps are as long as the motion allows, however often contacts open and close in them. What they
do not resolve they damp: bodies come to rest at the first touch, as they do by critical damping.

What it is likely to be wrong by: to first order its end is off by ½ h times how much the rates have
changed in it, whether smoothly or, where contacts have closed or opened somewhere in it, at once.
As Hairer & Wanner (II, 1996, IV.8) have it, that is sent through the step's own matrix, which
leaves of it what the step would not have damped: of a body that lands, what it goes on along the
other body.

    e_v = (M/h + D + h K)⁻¹ ½ (M (a₀ − a₁) − h K (v₀ − v₁)),   e_x = ½ h (v₀ − v₁) + h e_v

a₁ being the acceleration of the step and a₀ that of the last one: what the forces were before. The
error of velocity is sent through once more, for what the next step leaves of it.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.hooks import CONTACT_FORCE, has
from flocsim.integrators.backward_euler.contact_mean import add_held_friction, takes_part
from flocsim.integrators.backward_euler.newton import begin_step, end_step, solve_end
from flocsim.integrators.backward_euler.path import find_end
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.events.resolution import bounces
from flocsim.integrators.radau.systems import solve_for_free
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.blocks import subtract_product
from flocsim.integrators.rhs.error import error_ratio
from flocsim.integrators.rhs.stated_error import secant_stiffness
from flocsim.integrators.rhs.views import contact_view, inertia, velocity_lifetime_of
from flocsim.state.bodies import X, Y
from flocsim.state.work import CHANGE, LAST_RATES, NOW, START, STEP_ERROR, STIFFNESS, TRIAL

SAFETY, MOST_GROWTH, LEAST_SHARE = 0.9, 3.0, 0.1
"""The next step is that much shorter than would just do; bounds of the change."""

SHORT = 0.5
"""A step of less than this share of what it might have been has been cut short."""

FIRST_SHARE = 0.1
"""The first step with located switches behind one across them, over that."""


def next_across(clock, step, ratio):
    """The size of the step after one of that ratio: errors go with h² where motion is smooth, with
    h where contacts switch."""
    if ratio > 1.0:
        return step * max(LEAST_SHARE, SAFETY / ratio)
    longer = step * min(MOST_GROWTH, SAFETY / math.sqrt(max(ratio, 1e-4)))
    # A step cut short by the end of the window says nothing against a longer one.
    return max(clock.step, longer) if step < clock.step and ratio <= 0.5 else longer


def solve_step(scene, work, clock, step):
    """Find the end of the step; False where it is not found."""
    if has(scene, CONTACT_FORCE):
        return find_end(scene, work, clock, step)
    return solve_end(scene, work, clock, step)


def speed_along(work, row, state):
    """How fast the bodies of a pair came at each other in a state [m/s]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g = work.geometry
    speed = g[NOW, row].normal_x * (work.velocity[state, b, X] - work.velocity[state, a, X])
    return speed + g[NOW, row].normal_y * (work.velocity[state, b, Y] - work.velocity[state, a, Y])


@apart
def fastest_bounce(scene, work, clock, lasting):
    """ω0 [1/s] of the stiffest contact of the step from which bodies would fly apart again, by
    more than is allowed; of those alone that have closed in it unless ``lasting``."""
    fastest = 0.0
    for row in range(work.tally.candidates):
        closed = work.geometry[TRIAL, row].gap >= 0.0 > work.geometry[NOW, row].gap
        if closed or (lasting and takes_part(work, row)):
            speed = speed_along(work, row, START)
            if lasting:
                speed = max(abs(speed), abs(speed_along(work, row, NOW)))
            if speed * velocity_lifetime_of(work, row) > clock.tolerance:
                view = contact_view(scene, work, NOW, row)
                stiffness = secant_stiffness(scene, view, clock.tolerance)
                if stiffness > 0.0:
                    frequency = math.sqrt(stiffness / view.effective_mass)
                    if bounces(scene, view, speed, frequency):
                        fastest = max(fastest, frequency)
    return fastest


@apart
def euler_step(scene, work, clock, step, lasting):
    """One step: (error over tolerance, −1 where it fails; see fastest_bounce)."""
    begin_step(work, clock)
    found, bounce = solve_step(scene, work, clock, step), 0.0
    if found:
        estimate_step(scene, work, clock, step)
        bounce = fastest_bounce(scene, work, clock, lasting)
    end_step(work)
    return (error_ratio(scene, work, clock, step) if found else -1.0), bounce


def note_rates(scene, work, clock, step):
    """Write down what a step that has been accepted says of the next one."""
    # A short one, in which a pair has landed, says nothing of how rates go on.
    clock.rates_known = 1.0 if step > SHORT * clock.step else 0.0
    if clock.rates_known == 1.0:
        write_rates(work, step)
    for row in range(work.tally.candidates):
        before, after = work.geometry[TRIAL, row].gap, work.geometry[NOW, row].gap
        clock.switches_since_check += 1.0 if (before < 0.0) != (after < 0.0) else 0.0


def go_across(clock, step):
    """From now on, steps go on across switches; the size of the first one."""
    clock.across, clock.step = 1.0, step
    clock.rates_known = clock.stages_step = 0.0
    clock.feasible_step = math.inf


@apart
def end_at_switches(scene, work, clock):
    """From now on, steps end at switches, as pairs are flagged by gaps and displacements now."""
    clock.across, clock.step, clock.checked_at = (
        0.0,
        FIRST_SHARE * clock.step,
        math.inf,
    )
    clock.previous_step = clock.feasible_step = clock.step_after_switch = math.inf
    clock.switch_streak = 0.0
    for row in range(work.tally.candidates):
        work.candidates[row].slide_direction = 0
    set_modes(scene, work)


def write_rates(work, step):
    """Write the accelerations of the step, which has begun in START, into LAST_RATES."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            change = work.velocity[NOW, body, axis] - work.velocity[START, body, axis]
            work.velocity[LAST_RATES, body, axis] = change / step


@apart
def solve_loads(scene, work, weight):
    """The solution of the system for the loads less ``weight`` K CHANGE."""
    subtract_product(work, STIFFNESS, weight)
    solve_for_free(scene, work)


@apart
def estimate_step(scene, work, clock, step):
    """The error of the step, whose end stands in NOW, into STEP_ERROR."""
    loads = work.loads
    if clock.rates_known == 0.0:
        write_rates(work, step)
    for body in range(work.place.shape[1]):
        for axis in range(3):
            less = work.velocity[START, body, axis] - work.velocity[NOW, body, axis]
            slower = work.velocity[LAST_RATES, body, axis] + less / step
            loads[REAL, 3 * body + axis] = 0.5 * inertia(scene, body, axis) * slower
            work.place[CHANGE, body, axis] = less
    if has(scene, CONTACT_FORCE):
        add_held_friction(scene, work, step)
    solve_loads(scene, work, 0.5 * step)
    for body in range(work.place.shape[1]):
        free = scene.bodies[body].free
        for axis in range(3):
            speed = loads[REAL, 3 * body + axis].real
            error = free * step * (0.5 * work.place[CHANGE, body, axis] + speed)
            work.place[STEP_ERROR, body, axis] = work.place[CHANGE, body, axis] = error
            loads[REAL, 3 * body + axis] = inertia(scene, body, axis) / step * speed
    solve_loads(scene, work, 1.0)
    for body in range(work.place.shape[1]):
        free = scene.bodies[body].free
        for axis in range(3):
            work.velocity[STEP_ERROR, body, axis] = free * loads[REAL, 3 * body + axis].real
