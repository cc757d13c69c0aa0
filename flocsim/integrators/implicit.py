"""Implicit: Radau IIA of order 5 on smooth stretches, for any stiffness."""

from collections.abc import Callable

import attrs

import flocsim.arrays as at
from flocsim.fields import quantity
from flocsim.hooks import (
    choose_method,
    end_within,
    leave_out_cycles,
    note_step,
    step_across,
)
from flocsim.integrators.backward_euler.method import hand_over, step_or_give_back
from flocsim.integrators.backward_euler.step import next_across, note_rates
from flocsim.integrators.base import Integrator
from flocsim.integrators.events.crossings import interpolate
from flocsim.integrators.events.cycles import leave_out_cycles as leave_out
from flocsim.integrators.events.first_event import leave_at_once, settle_grazes
from flocsim.integrators.events.grazes import leave_early, settle
from flocsim.integrators.loop.step_size import SMALLEST_FACTOR, adaptive_factor
from flocsim.integrators.radau.carried_error import carry_error, doubt_of_release
from flocsim.integrators.radau.carried_error import overlap_error as step_overlap_error
from flocsim.integrators.radau.collocation import collocate, end_on_the_cubic
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.grazing import any_grazes, hold_gaps, release_gaps
from flocsim.integrators.radau.stages import evaluate_states, solve_stages
from flocsim.integrators.radau.systems import factorise_systems, solve_for_free
from flocsim.integrators.radau.tableau import EIGENVALUES, ESTIMATE, REAL
from flocsim.integrators.rhs.blocks import subtract_product
from flocsim.integrators.rhs.error import end_of_run, error_ratio
from flocsim.integrators.rhs.jacobian import assemble_jacobian
from flocsim.integrators.rhs.stated_error import carry_vector, overlap_error
from flocsim.integrators.rhs.views import inertia

ORDER_OF_ESTIMATE = 4.0
"""The estimate goes with this power of the step."""

COMFORTABLE_PACE = 0.4
"""Newton's pace goes about with the square of the step; the next step aims at this."""


def estimated_rate(work, row, first, step):
    """Weighted mean of the stages' increments over h, of a place or, ``first`` being VELOCITY, of a
    velocity."""
    body, axis = row // 3, first + row % 3
    now = work.motion[at.NOW, body, axis]
    total = 0.0
    for stage in range(3):
        total += ESTIMATE[stage] * (work.motion[at.FIRST_STAGE + stage, body, axis] - now)
    return total / step


def write_error_load(scene, work, step):
    """The load of the estimate; the mean rates of places stay in CHANGE."""
    for body in range(work.motion.shape[1]):
        for axis in range(3):
            row = 3 * body + axis
            load = work.rates[at.NOW, body, at.FORCE + axis]
            load += inertia(scene, body, axis) * estimated_rate(work, row, at.VELOCITY, step)
            work.loads[REAL, row] = load
            drift = work.motion[at.NOW, body, at.VELOCITY + axis]
            work.motion[at.CHANGE, body, axis] = drift + estimated_rate(work, row, at.X, step)
    subtract_product(work, at.STIFFNESS, step / EIGENVALUES[REAL].real)


def estimate_error(scene, work, step):
    write_error_load(scene, work, step)
    solve_for_free(scene, work)
    damped = step / EIGENVALUES[REAL].real
    for body in range(work.motion.shape[1]):
        free = scene.bodies[body, at.FREE]
        for axis in range(3):
            speed = work.loads[REAL, 3 * body + axis].real
            drift = work.motion[at.CHANGE, body, axis]
            work.motion[at.DEVIATION, body, axis] = free * damped * (speed + drift)
            work.motion[at.DEVIATION, body, at.VELOCITY + axis] = free * speed


def is_tried_again(scene, clock):
    """Whether the step before began here as well, and is taken anew so that it ends at a switch:
    what was found out about its start is known still. Not so with surface forces, as which pairs
    have a share in them hangs on the size of the step."""
    staged = clock[at.STAGED_STEP] > 0.0 and clock[at.STAGED_AT] == clock[at.TIME]
    return staged and scene.listed_reach <= 0.0


@attrs.frozen
class Implicit(Integrator):
    """Radau IIA of order 5, adaptive and stable for any stiffness: the default.

    Steps end where a pair of features touches or parts, so that the forces are smooth inside them;
    in a bed, where contacts switch all the time, they are those of BackwardEuler, by the rule of
    flocsim.integrators.backward_euler.method.
    Parameters: ``tolerance`` [m], the error of a step in the place of any outline point, what its
    velocity error leads to included; ``first_step`` [s].

    Source: Hairer & Wanner, Solving Ordinary Differential Equations II (1996), section IV.8.
    """

    estimate_share = 0.5

    tolerance: float = quantity("m", above=0.0, default=1e-9)
    first_step: float = quantity("s", above=0.0, default=1e-6)

    @staticmethod
    def attempt(scene, work, clock, step):
        """One step: error over tolerance, or −1 where Newton's method fails."""
        if clock[at.ACROSS] == 1.0:
            return step_across(scene, work, clock, step)
        time = clock[at.TIME]
        remaining = max(end_of_run(clock) - time, step)
        grazes = any_grazes(work)
        if grazes:
            release_gaps(work)
        if grazes or not is_tried_again(scene, clock):
            evaluate_states(scene, work, time, 0.0, at.NOW, at.NOW + 1)
            gather_clusters(scene, work)
            assemble_jacobian(scene, work, time, remaining)
        if grazes:
            if not factorise_systems(scene, work, step):
                return -1.0
            if hold_gaps(scene, work, clock):
                evaluate_states(scene, work, time, 0.0, at.NOW, at.NOW + 1)
            assemble_jacobian(scene, work, time, remaining)
        if not factorise_systems(scene, work, step):
            return -1.0
        if not solve_stages(scene, work, clock, step):
            return -1.0
        estimate_error(scene, work, step)
        ratio = error_ratio(scene, work, clock, step)
        if ratio < 0.0:
            return ratio
        doubt = doubt_of_release(scene, work, clock, step)
        return max(ratio, doubt * doubt)

    @staticmethod
    def next_step(clock, step, ratio):
        """The step for which the estimate and Newton's pace stay in bounds."""
        if clock[at.ACROSS] == 1.0:
            return next_across(clock, step, ratio)
        factor = adaptive_factor(clock, step, ratio, ORDER_OF_ESTIMATE)
        if clock[at.PACE] > 0.0:
            factor = min(factor, (COMFORTABLE_PACE / clock[at.PACE]) ** 0.5)
        return step * max(factor, SMALLEST_FACTOR)

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """Dense output, and ends of steps, by the stages' cubic; the error as a vector."""
        return {
            interpolate: collocate,
            end_within: end_on_the_cubic,
            settle_grazes: settle,
            leave_at_once: leave_early,
            choose_method: hand_over,
            step_across: step_or_give_back,
            note_step: note_rates,
            leave_out_cycles: leave_out,
            carry_vector: carry_error,
            overlap_error: step_overlap_error,
        }


def massless(scene, body, axis):
    """No inertia: forces balance at every instant."""
    return 0.0


@attrs.frozen
class Overdamped(Implicit):
    """The method of Implicit without inertia: drag balances all other forces at every instant.

    For Stokes numbers far below 1, where a body has forgotten its velocity before it has moved.
    The velocities given at the start do not matter. Every body needs a drag on each of its
    coordinates: rotational drag, too. Parameters as for Implicit.
    """

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """No inertia besides what Implicit replaces."""
        return {**super().replaces, inertia: massless}
