"""Implicit: exponential collocation of order 6 where steps resolve what vibrates, Radau IIA of
order 5 where they leave it out."""

import math
from collections.abc import Callable

import attrs

from flocsim.fields import quantity
from flocsim.hooks import (
    choose_method,
    cut,
    end_within,
    first_step,
    note_step,
    resolving_step,
    skip_cycles,
    step_across,
    step_to_switch,
)
from flocsim.integrators.backward_euler.method import hand_over, step_or_give_back
from flocsim.integrators.backward_euler.step import next_across, note_rates
from flocsim.integrators.base import Integrator
from flocsim.integrators.events.crossings import interpolate
from flocsim.integrators.events.cycles import skip_equal_cycles as leave_out
from flocsim.integrators.events.first_event import end_grazing_at_once, update_grazing
from flocsim.integrators.events.grazes import end_grazing_early, update_grazing_pairs
from flocsim.integrators.exponential.collocation import (
    carry_known,
    judge_series,
    nothing_swings,
    solve_series,
)
from flocsim.integrators.exponential.samples import cut as cut_series
from flocsim.integrators.exponential.series import write_at
from flocsim.integrators.loop.step_size import (
    SMALLEST_FACTOR,
    adaptive_factor,
    fastest_vibration,
)
from flocsim.integrators.radau.carried_error import add_step, carry_error, doubt_of_release
from flocsim.integrators.radau.carried_error import overlap_error as step_overlap_error
from flocsim.integrators.radau.collocation import collocate, end_on_the_cubic
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.estimate import estimate_error
from flocsim.integrators.radau.grazing import any_grazes, hold_gaps, release_gaps
from flocsim.integrators.radau.stages import evaluate_states, solve_stages
from flocsim.integrators.radau.systems import factorise_systems, is_dense
from flocsim.integrators.rhs.error import end_of_run, error_ratio
from flocsim.integrators.rhs.jacobian import assemble_jacobian
from flocsim.integrators.rhs.stated_error import (
    amplify_sums,
    bound_propagated,
    overlap_error,
    propagate_vector,
)
from flocsim.integrators.rhs.views import inertia
from flocsim.state.work import NEW, NOW, START, TRIAL

ORDER_OF_ESTIMATE = 4.0
"""The estimate goes with this power of the step."""

COMFORTABLE_PACE = 0.4
"""Newton's pace goes about with the square of the step; the next step aims at this."""


def is_tried_again(scene, clock):
    """Whether the step before began here as well, and is taken anew so that it ends at a switch:
    what was found out about its start is known still. Not so with surface forces, as which pairs
    have a share in them hangs on the size of the step."""
    staged = clock.stages_step > 0.0 and clock.stages_time == clock.time
    return staged and scene.listed_reach <= 0.0


SHARE_OF_TOUCH = 0.1
"""The error of the first step behind a touch, where it is a series, is taken to be how deep it
gets, speed/ω0, times (h ω0)⁵ over this share: what turns meanwhile is not in the series."""


def step_behind_touch(work, clock, frequency, speed, later):
    """The first step behind a touch."""
    if is_dense(work):
        share = SHARE_OF_TOUCH * clock.tolerance * frequency / speed
        return share**0.2 / frequency
    return resolving_step(clock, frequency, later)


def carry_over_step(scene, work, clock, step):
    """Carry the error over an accepted step; the largest one of a body's outline [m]."""
    if work.tally.series_terms == 0:
        return carry_error(scene, work, clock, step)
    bound_propagated(scene, work)
    whole = clock.series_step
    carry_known(work, clock, whole, step / whole)
    if nothing_swings(clock):
        amplify_sums(scene, work, step)
    add_step(work)
    return bound_propagated(scene, work)


def within(work, step, share, body):
    """Write a body's motion at a share of the step into TRIAL."""
    terms = work.tally.series_terms
    if terms > 0:
        write_at(work, START, terms, step, share, TRIAL, body, body + 1)
    else:
        collocate(work, step, share, body)


def end_early(scene, work, step, ratio, share):
    """Make the motion at a share of the step the new state, where it is known well enough."""
    terms = work.tally.series_terms
    if terms > 0:
        write_at(work, START, terms, step, share, NEW, 0, work.place.shape[1])
        return True
    return end_on_the_cubic(scene, work, step, ratio, share)


RADIANS = 4.0
"""What switches in a series is found even where contacts swing so far in it, by the fastest rate
there is."""


def may_be_series(scene, work):
    """Whether steps of these bodies can be series."""
    return is_dense(work) and inertia(scene, 0, 0) != 0.0


def resolve_switch(scene, work, step, share):
    """The step to be tried behind one that was seen to pass a switch at a share of it: where that
    was Radau IIA, which leaves vibrations out, a series that shows them."""
    fastest = fastest_vibration(scene, work)
    if work.tally.series_terms > 0 or not may_be_series(scene, work) or fastest == 0.0:
        return share * step
    return max(share * step, min(0.5 * step, RADIANS / fastest))


def solve_as_series(scene, work, clock, step, known):
    """Take a step as a series, if that can be: its error over the tolerance, or −1. ``known``:
    whether the last one was."""
    if not may_be_series(scene, work):
        return -1.0
    work.tally.series_terms = solve_series(scene, work, clock, step, known)
    if work.tally.series_terms == 0:
        return -1.0
    judge_series(scene, work, clock, step)
    return error_ratio(scene, work, clock, step)


def forget_series(work, clock, known):
    """No series is there any more; how long ago the stages of Radau IIA, if they are there, or the
    state before, began."""
    if known:
        staged = clock.stages_step > 0.0
        clock.stages_step = clock.stages_time - clock.time if staged else 0.0


@attrs.frozen
class Implicit(Integrator):
    """Adaptive and stable for any stiffness: the default.

    Of up to six bodies steps that are not long against the fastest vibration are a power series,
    exact where forces are linear and of order 6 in what is left (flocsim.integrators.exponential);
    all others Radau IIA of order 5. They end where a pair of features touches or parts, so that the
    forces are smooth inside them; in a bed, where contacts switch all the time, they are those of
    BackwardEuler, by the rule of flocsim.integrators.backward_euler.method.
    Parameters: ``tolerance`` [m], the error of a step in the place of any outline point, what its
    velocity error leads to included; ``first_step`` [s].

    Source: Hairer & Wanner, Solving Ordinary Differential Equations II (1996), section IV.8;
    Hochbruck & Ostermann, Acta Numerica 19 (2010), section 2.3.
    """

    estimate_share = 0.5

    tolerance: float = quantity("m", above=0.0, default=1e-9)
    first_step: float = quantity("s", above=0.0, default=1e-6)

    @staticmethod
    def attempt(scene, work, clock, step):
        """One step: error over tolerance, or −1 where Newton's method fails."""
        known = work.tally.series_terms > 0
        work.tally.series_terms, clock.longest_series = 0, math.inf
        if clock.across == 1.0:
            return step_across(scene, work, clock, step)
        time = clock.time
        remaining = max(end_of_run(clock) - time, step)
        grazes = any_grazes(work)
        if grazes:
            release_gaps(work)
        if grazes or not is_tried_again(scene, clock):
            evaluate_states(scene, work, time, 0.0, NOW, NOW + 1)
            gather_clusters(scene, work)
            assemble_jacobian(scene, work, time, remaining)
        if not grazes:
            ratio = solve_as_series(scene, work, clock, step, known)
            if work.tally.series_terms > 0:
                return ratio
        forget_series(work, clock, known)
        if grazes:
            if not factorise_systems(scene, work, step):
                return -1.0
            if hold_gaps(scene, work, clock):
                evaluate_states(scene, work, time, 0.0, NOW, NOW + 1)
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
        if clock.across == 1.0:
            return next_across(clock, step, ratio)
        factor = adaptive_factor(clock, step, ratio, ORDER_OF_ESTIMATE)
        if clock.convergence_rate > 0.0:
            factor = min(factor, (COMFORTABLE_PACE / clock.convergence_rate) ** 0.5)
        factor = max(factor, SMALLEST_FACTOR)
        if ratio <= 1.0:
            return max(min(step * factor, clock.longest_series), min(step, step * factor))
        return step * factor

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """Dense output, and ends of steps, by the series or the stages' cubic; the error as a
        vector."""
        return {
            interpolate: within,
            end_within: end_early,
            step_to_switch: resolve_switch,
            cut: cut_series,
            first_step: step_behind_touch,
            update_grazing: update_grazing_pairs,
            end_grazing_at_once: end_grazing_early,
            choose_method: hand_over,
            step_across: step_or_give_back,
            note_step: note_rates,
            skip_cycles: leave_out,
            propagate_vector: carry_over_step,
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
