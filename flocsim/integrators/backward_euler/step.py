"""A backward Euler step across events, and its error estimate.

The size of a step is limited by the motion, not by the number of contacts that open and close.
Vibrations that it does not resolve are damped: bodies come to rest at their first touch, as they do
under critical damping.

Error: to first order the end is off by ½ h times the change of the rates, whether that is smooth
or, where contacts have switched, sudden. As in Hairer & Wanner (II, 1996, section IV.8), it is
filtered by the step's own matrix, which removes what the step would have damped. For a body that
lands, the motion along the other body remains.

    e_v = (M/h + D + h K)⁻¹ ½ (M (a₀ − a₁) − h K (v₀ − v₁)),   e_x = ½ h (v₀ − v₁) + h e_v

with the accelerations a₁ of the step and a₀ of the last one. The velocity error is filtered once
more, as the next step will do.

Sources: Moreau (1988), Jean (1999), for contacts that are springs.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.constants import TINY
from flocsim.geometry.contact.points import normal_component
from flocsim.hooks import CONTACT_FORCE, has
from flocsim.integrators.backward_euler.contact_mean import takes_part
from flocsim.integrators.backward_euler.newton import begin_step, end_step, solve_end
from flocsim.integrators.backward_euler.path import find_end
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.events.resolution import bounces
from flocsim.integrators.radau.systems import solve_prepared
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.blocks import subtract_product
from flocsim.integrators.rhs.contact_stiffness import secant_stiffness
from flocsim.integrators.rhs.error import (
    LARGEST_FACTOR,
    SAFETY,
    SMALLEST_FACTOR,
    error_ratio,
)
from flocsim.integrators.rhs.views import contact_view, inertia, normal_rate, velocity_lifetime_of
from flocsim.state.work import CHANGE, LAST_RATES, NOW, START, STEP_ERROR, STIFFNESS, TRIAL


def next_across(clock, step, ratio):
    """Return the size [s] of the next step: errors scale as h² in smooth motion, and as h at
    events."""
    # An event may have caused the error, which then scales as h.
    if ratio > 1.0:
        return step * max(SMALLEST_FACTOR, SAFETY / ratio)
    proposed = step * min(LARGEST_FACTOR, SAFETY / math.sqrt(max(ratio, TINY)))
    # A step cut short by the end of the window says nothing against a longer one.
    return max(clock.step, proposed) if step < clock.step and ratio <= 0.5 else proposed


def solve_step(scene, work, clock, step):
    """Find the end of the step; return False if that fails."""
    if has(scene, CONTACT_FORCE):
        return find_end(scene, work, clock, step)
    return solve_end(scene, work, clock, step)


@apart
def fastest_bounce(scene, work, clock, all_contacts):
    """Return ω0 [1/s] of the stiffest contact from which bodies would rebound noticeably; 0 without
    any.

    Noticeably: by more than the tolerance. With ``all_contacts`` of all in the step, otherwise of
    those that closed in it.
    """
    fastest = 0.0
    for row in range(work.tally.candidates):
        closed = work.geometry[TRIAL, row].gap >= 0.0 > work.geometry[NOW, row].gap
        if closed or (all_contacts and takes_part(work, row)):
            speed = -normal_component(work, row, work.velocity, START, NOW)
            if all_contacts:
                speed = max(abs(speed), abs(normal_rate(work, NOW, row)))
            if speed * velocity_lifetime_of(work, row) > clock.tolerance:
                view = contact_view(scene, work, NOW, row)
                # The step stops these bodies. With damping below critical they would rebound
                # instead.
                stiffness = secant_stiffness(scene, view, clock.tolerance)
                if stiffness > 0.0:
                    frequency = math.sqrt(stiffness / view.effective_mass)
                    if bounces(scene, view, speed, frequency):
                        fastest = max(fastest, frequency)
    return fastest


@apart
def euler_step(scene, work, clock, step, all_contacts):
    """Take one step; return (error over tolerance or −1, ω0 of the fastest rebound; see
    fastest_bounce)."""
    begin_step(work, clock)
    converged, bounce = solve_step(scene, work, clock, step), 0.0
    if converged:
        estimate_euler_error(scene, work, clock, step)
        bounce = fastest_bounce(scene, work, clock, all_contacts)
    end_step(work)
    return (error_ratio(scene, work, clock, step) if converged else -1.0), bounce


def note_rates(work, clock, step):
    """Store the rates of an accepted step for the error estimate of the next one; count its
    events."""
    clock.rates_known = 1.0
    write_rates(work, step)
    for row in range(work.tally.candidates):
        gap_start, gap_end = work.geometry[TRIAL, row].gap, work.geometry[NOW, row].gap
        clock.switches_since_check += 1.0 if (gap_start < 0.0) != (gap_end < 0.0) else 0.0


def start_across(clock, step):
    """Let steps go on across events from now on, beginning with the given size [s]."""
    clock.across, clock.step = 1.0, step
    clock.rates_known = clock.stages_step = 0.0
    clock.feasible_step = math.inf


@apart
def end_at_switches(scene, work, clock):
    """Let steps end at events from now on; set the contact modes by the present gaps and
    displacements."""
    clock.across, clock.checked_at = 0.0, math.inf
    clock.step *= SMALLEST_FACTOR
    # Forget everything about earlier steps.
    clock.previous_step = clock.feasible_step = math.inf
    for row in range(work.tally.candidates):
        work.candidates[row].slide_direction = 0
    set_modes(scene, work)


def write_rates(work, step):
    """Write the accelerations of the step, which began in START, to LAST_RATES."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            change = work.velocity[NOW, body, axis] - work.velocity[START, body, axis]
            work.velocity[LAST_RATES, body, axis] = change / step


@apart
def solve_loads(scene, work, weight):
    """Solve the system for the loads minus ``weight`` K CHANGE."""
    subtract_product(work, STIFFNESS, weight)
    solve_prepared(scene, work)


@apart
def estimate_euler_error(scene, work, clock, step):
    """Write the error of the step, whose end is in NOW, to STEP_ERROR."""
    loads = work.loads
    # Without rates of an earlier step a₀ = a₁.
    if clock.rates_known == 0.0:
        write_rates(work, step)
    # ½ M (a₀ − a₁), and v₀ − v₁ for its product with K.
    for body in range(work.place.shape[1]):
        for axis in range(3):
            velocity_drop = work.velocity[START, body, axis] - work.velocity[NOW, body, axis]
            slower = work.velocity[LAST_RATES, body, axis] + velocity_drop / step
            loads[REAL, 3 * body + axis] = 0.5 * inertia(scene, body, axis) * slower
            work.place[CHANGE, body, axis] = velocity_drop
    solve_loads(scene, work, 0.5 * step)
    # Error of the positions; load of the second filter.
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
