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

from flocsim.integrators.backward_euler.method import step_or_give_back
from flocsim.integrators.backward_euler.step import next_across
from flocsim.integrators.base import Adaptive
from flocsim.integrators.exponential.collocation import (
    estimate_series_error,
    may_be_series,
    solve_series,
)
from flocsim.integrators.loop.step_size import adaptive_factor
from flocsim.integrators.radau.carried_error import release_uncertainty
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.estimate import estimate_error
from flocsim.integrators.radau.grazing import (
    any_grazes,
    clear_grazing_resistances,
    set_grazing_resistances,
)
from flocsim.integrators.radau.stages import TARGET_RATE, evaluate_states, solve_stages
from flocsim.integrators.radau.systems import factorise_systems
from flocsim.integrators.rhs.error import SMALLEST_FACTOR, end_of_run, error_ratio
from flocsim.integrators.rhs.jacobian import assemble_jacobian
from flocsim.integrators.rhs.views import inertia
from flocsim.state.clock import PLAIN, RADAU, SERIES
from flocsim.state.work import NOW

ESTIMATE_ORDER = 4.0
"""The error estimates of both kinds of step scale as this power of the step size."""


def is_retry(scene, clock):
    """Return True if the previous attempt began at the same time, and is repeated to end at an
    event.

    The forces and derivatives at its start are then still valid. With surface forces they are not,
    because the set of pairs that share in such a force depends on the step size.
    """
    staged = clock.stages_step > 0.0 and clock.stages_time == clock.time
    return staged and scene.listed_reach <= 0.0


@attrs.frozen
class Implicit(Adaptive):
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
    hands_over = True

    @staticmethod
    def attempt(scene, work, clock, step):
        """Take one step; return its error over the tolerance, or −1 where Newton's method
        failed."""
        # The last step's series, if it was one, gives the first guess of this step's remainder.
        known = work.tally.kind == SERIES
        work.tally.kind, clock.longest_series = PLAIN, math.inf
        # Beds: backward Euler across events, where the hand-over rule has chosen it.
        if clock.across == 1.0:
            return step_or_give_back(scene, work, clock, step)
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
        if not grazes and may_be_series(scene, work):
            work.tally.series_terms = solve_series(scene, work, clock, step, known)
            if work.tally.series_terms > 0:
                work.tally.kind = SERIES
                estimate_series_error(work, clock, step)
                return error_ratio(scene, work, clock, step)
        work.tally.kind = RADAU
        if known:
            # The points of a series are no stages from which Radau's could be extrapolated.
            clock.stages_step = 0.0
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
        # ones, exponential.series.expand has raised this limit.
        if ratio <= 1.0:
            return max(min(step * factor, clock.longest_series), min(step, step * factor))
        return step * factor


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
        """{hook: function}: no inertia."""
        return {inertia: massless}
