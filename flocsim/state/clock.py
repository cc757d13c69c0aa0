"""The time, the step sizes and the counters of a run."""

import math

from flocsim.state.records import Record


class Tally(Record):
    """Sizes of a run's lists, counters of its work, and one result passed between functions."""

    candidates: int  # listed vertex–edge pairs: rows in use of ``Work.candidates``
    pairs: int  # listed pairs of bodies: rows in use of ``Work.pairs``
    evaluations: int  # force sums so far
    rebuilds: int  # candidate lists made so far
    solves: int  # linear systems solved so far
    kept: int  # 1 + displacements set aside while a list had no room; 0: none are set aside
    full: int  # which array has no room left, see NOTHING_FULL
    kind: int  # of the last step tried: PLAIN, SERIES or RADAU
    series_terms: int  # terms of its series in ``Work.series``, if it was one
    series_step: float  # size of the step of that series, which may have ended earlier [s]
    smooth_gap: float  # last smooth gap evaluated (rhs.surface_gap) [m]


# Kinds of step (Tally.kind): what is known of the motion inside of it.
(
    PLAIN,  # both ends
    SERIES,  # its power series (integrators.exponential)
    RADAU,  # its stages (integrators.radau)
) = range(3)


# Values of Tally.full.
(
    NOTHING_FULL,
    CANDIDATES_FULL,
    PAIRS_FULL,
    BLOCKS_FULL,
    NOT_COMPILED,  # no array: code that the engine compiles only when a run reaches it
) = range(5)


class Clock(Record):
    """Time, step sizes, tolerance and errors of a run."""

    time: float  # [s]
    until: float  # end of the run, or of a window within it [s]
    horizon: float  # end of the run if ``until`` ends a window only; else 0 [s]
    step: float  # planned size of the next step [s]
    tolerance: float  # allowed error of a step [m]; inf: steps have a fixed size
    error: float  # stated error of the motion so far [m]
    largest_step: float  # upper bound of the step, from the integrator [s]
    feasible_step: float  # upper bound after a failed step; grows again with every step [s]
    step_error: float  # error estimate of the step just taken [m]
    estimate_share: float  # fraction of the step estimates that the stated error counts
    # The last steps, from which the step controller (loop.step_size) plans the next.
    previous_step: float  # size of the last step [s]; inf: no trend is known, 0: a trial has failed
    previous_ratio: float  # its error over the tolerance
    rejected_step: float  # size of the trial just rejected [s]; 0: the last one was accepted
    flight_step: float  # step planned when the last flight ended [s]
    # Newton's method and the stages of Radau IIA.
    convergence_rate: float  # factor by which a Newton iteration shrinks the last increment
    second_iteration_rate: float  # that of the last second iteration; 0: unknown
    second_iteration_step: float  # size of the step in which it was measured [s]
    stages_step: float  # size of the step whose stages are stored [s]; 0: none are
    stages_time: float  # time at which that step began [s]
    # Motion as a power series.
    longest_series: float  # longest step for which the series converges; inf: not known [s]
    series_norm: float  # bound of ω h in that step, ω being its highest frequency
    # Backward Euler, whose steps pass over switches.
    across: float  # 1 if steps pass over switches, 0 if they end at them
    rates_known: float  # 1 if the accelerations of the last such step (LAST_RATES) are stored
    switches_since_check: float  # switches since progress was last checked
    checked_at: float  # time of that check [s]; inf: no check yet


SMALLEST_STEP = 1e-14
"""A step below this fraction of the elapsed time, or of 1 ms, moves nothing: rounding of the time
is 2e-16. A run of such steps has stalled."""


def moves(clock: Clock, step: float) -> bool:
    """Return True if anything can have moved in a step that ended at the present time."""
    if clock.tolerance == math.inf:
        return clock.time - step < clock.time
    return step >= SMALLEST_STEP * max(clock.time, 1e-3)


NEVER = 2**63 - 1
"""A number of steps that no run reaches."""


class Counts(Record):
    """Counters of a run, and its budgets."""

    steps: int  # steps accepted
    rejected: int  # steps rejected
    max_steps: int  # budget for accepted and rejected steps and located events together
    recorded: int  # rows written to the record
    pause_at: int  # number of steps after which to pause
    code: int  # last return value of the observer
    located: int  # trials spent on locating events
    stationary_steps: int  # steps in a row that were too short to count as motion
    next_check: int  # number of steps after which to check the progress of the method, or NEVER
    trials_at_check: int  # steps and trials made by the last check
