"""Implicit, the default method, and Overdamped, the same without inertia.

Implicit has two kinds of step. Where the step resolves the fastest vibration of few bodies, it is a
power series with exponential collocation, of order 6 (flocsim.integrators.exponential). Otherwise
it is Radau IIA with three stages, of order 5 (flocsim.integrators.radau), which damps vibrations
that the step does not resolve. ``Implicit.attempt`` tries the series first and falls back on Radau.

Sources: Hairer & Wanner, Solving Ordinary Differential Equations II (1996), section IV.8; Hochbruck
& Ostermann, Acta Numerica 19 (2010), section 2.3.
"""

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
    estimate_series_error,
    nothing_swings,
    propagate_with_series,
    solve_series,
)
from flocsim.integrators.exponential.samples import cut as cut_series
from flocsim.integrators.exponential.series import evaluate_at
from flocsim.integrators.loop.step_size import (
    SMALLEST_FACTOR,
    adaptive_factor,
    fastest_vibration,
)
from flocsim.integrators.radau.carried_error import (
    add_step_error,
    propagate_error,
    release_uncertainty,
)
from flocsim.integrators.radau.carried_error import overlap_error as step_overlap_error
from flocsim.integrators.radau.collocation import end_on_cubic, interpolate_stages
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.estimate import estimate_error
from flocsim.integrators.radau.grazing import (
    any_grazes,
    clear_grazing_resistances,
    set_grazing_resistances,
)
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

ESTIMATE_ORDER = 4.0
"""The error estimates of both kinds of step scale as this power of the step size."""

TARGET_RATE = 0.4
"""Convergence rate of Newton's method that the next step aims at. The rate scales about as h²:
faster convergence would waste iterations on short steps, slower convergence would risk a failed
step."""


def is_retry(scene, clock):
    """Return True if the previous attempt began at the same time, and is repeated to end at an
    event.

    The forces and derivatives at its start are then still valid. With surface forces they are not,
    because the set of pairs that share in such a force depends on the step size.
    """
    staged = clock.stages_step > 0.0 and clock.stages_time == clock.time
    return staged and scene.listed_reach <= 0.0


TOUCH_ERROR_FACTOR = 0.1
"""Tolerance factor of the first series step after a touch. Its error is taken as (v/ω0) (h ω0)⁵
over this number: the overlap v/ω0 of the impact, times the order-5 effect of the rotation of the
contact normal, which the series does not contain."""


def step_after_touch(work, clock, frequency, speed, later):
    """Return the size [s] of the first step after a touch at a speed [m/s]; see
    flocsim.hooks.first_step."""
    if is_dense(work):
        # Solve (v/ω0) (h ω0)⁵/TOUCH_ERROR_FACTOR = tolerance for h.
        fraction = TOUCH_ERROR_FACTOR * clock.tolerance * frequency / speed
        return fraction**0.2 / frequency
    return resolving_step(clock, frequency, later)


def propagate_over_step(scene, work, clock, step):
    """Propagate the error vector over an accepted step; return its largest norm over the bodies
    [m]."""
    # Radau: a rational approximation of the exponential, with the factors of the step.
    if work.tally.series_terms == 0:
        return propagate_error(scene, work, clock, step)
    # Series: the derivatives of the power series are known exactly. The step may have been cut, so
    # propagate over the fraction of the series that was used.
    bound_propagated(scene, work)
    full = clock.series_step
    propagate_with_series(work, clock, full, step / full)
    # Let the scalar sums grow at the rate of the vector, for example towards an attraction.
    if nothing_swings(clock):
        amplify_sums(scene, work, step)
    add_step_error(work)
    return bound_propagated(scene, work)


def interpolate_step(work, step, fraction, body):
    """Write the motion of a body at a fraction of the step into TRIAL (dense output)."""
    terms = work.tally.series_terms
    if terms > 0:
        evaluate_at(work, START, terms, step, fraction, TRIAL, body, body + 1)
    else:
        interpolate_stages(work, step, fraction, body)


def end_early(scene, work, step, ratio, fraction):
    """Make the motion at a fraction of the step the new state; return False where it is too
    inexact."""
    terms = work.tally.series_terms
    if terms > 0:
        evaluate_at(work, START, terms, step, fraction, NEW, 0, work.place.shape[1])
        # A series is as accurate inside the step as at its end.
        return True
    return end_on_cubic(scene, work, step, ratio, fraction)


MAX_PHASE = 4.0
"""Phase ω h [rad], ω being the fastest vibration, up to which the events inside a series are found
reliably. A Radau step with an event in it is repeated as a series of this length."""


def may_be_series(scene, work):
    """Return True if steps of these bodies can be series: few bodies, and inertia."""
    return is_dense(work) and inertia(scene, 0, 0) != 0.0


def resolve_switch(scene, work, step, fraction):
    """Return the step [s] to be tried after one that passed an event at a fraction of it.

    A Radau step damps vibrations, and the event may be an artefact of that. Then a series is tried
    instead, as long as MAX_PHASE allows, but at most half of the step.
    """
    fastest = fastest_vibration(scene, work)
    if work.tally.series_terms > 0 or not may_be_series(scene, work) or fastest == 0.0:
        return fraction * step
    return max(fraction * step, min(0.5 * step, MAX_PHASE / fastest))


def solve_as_series(scene, work, clock, step, known):
    """Take a step as a series; return its error over the tolerance, or −1 where no series is
    possible.

    ``known``: the previous step was a series, whose remainder can be extrapolated.
    """
    if not may_be_series(scene, work):
        return -1.0
    work.tally.series_terms = solve_series(scene, work, clock, step, known)
    if work.tally.series_terms == 0:
        return -1.0
    estimate_series_error(scene, work, clock, step)
    return error_ratio(scene, work, clock, step)


def forget_series(work, clock, known):
    """Mark the stages of the last step as no longer a series, for the initial guess of Radau.

    ``clock.stages_step`` < 0 says that START holds the state that long ago: a mean acceleration
    follows from it, but no stages.
    """
    if known:
        staged = clock.stages_step > 0.0
        clock.stages_step = clock.stages_time - clock.time if staged else 0.0


@attrs.frozen
class Implicit(Integrator):
    """Adaptive implicit method, stable for contacts of any stiffness: the default.

    For up to six bodies, steps that resolve the fastest vibration are a power series: exact for
    linear forces, of order 6 for the rest. All other steps are Radau IIA of order 5. Steps end
    where a contact opens, closes, sticks or slides, so that the forces are smooth inside them. In
    beds, where contacts switch all the time, a System or Swarm hands over to BackwardEuler
    (flocsim.integrators.backward_euler.method has the rule).

    Parameters
    ----------
    tolerance : float
        Largest error of a step [m], > 0: displacement of any point of an outline, including the
        displacement that the error of the velocity leads to later.
    first_step : float
        Size of the first step [s], > 0.

    Notes
    -----
    Sources: Hairer & Wanner, Solving Ordinary Differential Equations II (1996), section IV.8 (Radau
    IIA); Hochbruck & Ostermann, Acta Numerica 19 (2010), section 2.3 (exponential collocation).
    """

    estimate_share = 0.5

    tolerance: float = quantity("m", above=0.0, default=1e-9)
    first_step: float = quantity("s", above=0.0, default=1e-6)

    @staticmethod
    def attempt(scene, work, clock, step):
        """Take one step; return its error over the tolerance, or −1 where Newton's method
        failed."""
        # The last step's series, if it was one, gives the first guess of this step's remainder.
        known = work.tally.series_terms > 0
        work.tally.series_terms, clock.longest_series = 0, math.inf
        # Beds: backward Euler across events, where the hand-over rule has chosen it.
        if clock.across == 1.0:
            return step_across(scene, work, clock, step)
        time = clock.time
        remaining = max(end_of_run(clock) - time, step)
        # Forces and derivatives at the start. The dashpots of grazing contacts are left out first:
        # the system without them decides how stiff they are, and whether they exist.
        grazes = any_grazes(work)
        if grazes:
            clear_grazing_resistances(work)
        if grazes or not is_retry(scene, clock):
            evaluate_states(scene, work, time, 0.0, NOW, NOW + 1)
            gather_clusters(scene, work)
            assemble_jacobian(scene, work, time, remaining)
        # Try a series. It has no grazing contacts, whose dashpots are too stiff to resolve.
        if not grazes:
            ratio = solve_as_series(scene, work, clock, step, known)
            if work.tally.series_terms > 0:
                return ratio
        forget_series(work, clock, known)
        # Radau with grazing contacts: set their dashpots by the system without them, then assemble
        # anew. A contact that is released leaves the forces, too.
        if grazes:
            if not factorise_systems(scene, work, step):
                return -1.0
            if set_grazing_resistances(scene, work, clock):
                evaluate_states(scene, work, time, 0.0, NOW, NOW + 1)
            assemble_jacobian(scene, work, time, remaining)
        # Radau IIA: simplified Newton iteration with the factors of the start, then the embedded
        # estimate.
        if not factorise_systems(scene, work, step):
            return -1.0
        if not solve_stages(scene, work, clock, step):
            return -1.0
        estimate_error(scene, work, step)
        ratio = error_ratio(scene, work, clock, step)
        if ratio < 0.0:
            return ratio
        # Reject the step, too, where it is uncertain whether a contact still presses. That ratio
        # scales as h², the estimate as h⁴.
        uncertainty = release_uncertainty(scene, work, clock, step)
        return max(ratio, uncertainty * uncertainty)

    @staticmethod
    def next_step(clock, step, ratio):
        """Return the size [s] of the next step, for which estimate and convergence rate stay within
        bounds."""
        if clock.across == 1.0:
            return next_across(clock, step, ratio)
        factor = adaptive_factor(clock, step, ratio, ESTIMATE_ORDER)
        # The convergence rate of Newton's method scales as h².
        if clock.convergence_rate > 0.0:
            factor = min(factor, (TARGET_RATE / clock.convergence_rate) ** 0.5)
        factor = max(factor, SMALLEST_FACTOR)
        # Stay with steps that can be a series. Where Radau would be accurate enough for longer
        # ones, judge_series has raised this limit.
        if ratio <= 1.0:
            return max(min(step * factor, clock.longest_series), min(step, step * factor))
        return step * factor

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """{hook: function}: dense output, early ends, error propagation and hand-over of this
        method."""
        return {
            interpolate: interpolate_step,
            end_within: end_early,
            step_to_switch: resolve_switch,
            cut: cut_series,
            first_step: step_after_touch,
            update_grazing: update_grazing_pairs,
            end_grazing_at_once: end_grazing_early,
            choose_method: hand_over,
            step_across: step_or_give_back,
            note_step: note_rates,
            skip_cycles: leave_out,
            propagate_vector: propagate_over_step,
            overlap_error: step_overlap_error,
        }


def massless(scene, body, axis):
    """Return no inertia: forces balance at every instant."""
    return 0.0


@attrs.frozen
class Overdamped(Implicit):
    """Implicit without inertia: drag balances all other forces at every instant.

    For Stokes numbers far below 1, where drag damps a velocity before the body has moved
    noticeably. The initial velocities do not matter. Every coordinate of every body needs drag, the
    rotation, too.

    Parameters
    ----------
    tolerance : float
        Largest error of a step [m], > 0, as for Implicit.
    first_step : float
        Size of the first step [s], > 0.

    Notes
    -----
    Steps are always Radau IIA of order 5: without inertia nothing vibrates. Source: Hairer &
    Wanner, Solving Ordinary Differential Equations II (1996), section IV.8.
    """

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """{hook: function} of Implicit, and no inertia."""
        return {**super().replaces, inertia: massless}
