"""Motion inside a step, as far as the kind of the step tells it (flocsim.state.clock: PLAIN)."""

from flocsim.integrators.exponential.series import evaluate_all, evaluate_body
from flocsim.integrators.radau.collocation import end_on_cubic, interpolate_stages
from flocsim.state.clock import RADAU, SERIES
from flocsim.state.work import MOTION, NEW, NOW, START, TRIAL


def interpolate(work, step, share, body):
    """Write a body's motion at a fraction of the step to TRIAL (dense output)."""
    if work.tally.kind == SERIES:
        whole, terms = work.tally.series_step, work.tally.series_terms
        evaluate_body(work, MOTION, START, terms, whole, share * step / whole, TRIAL, body)
    elif work.tally.kind == RADAU:
        interpolate_stages(work, share, body)
    else:
        interpolate_ends(work, step, share, body)


def interpolate_ends(work, step, share, body):
    """Write a body's motion on the cubic through both ends of a step to TRIAL (Hermite)."""
    rest = 1.0 - share
    for axis in range(3):
        change = work.place[NEW, body, axis] - work.place[NOW, body, axis]
        # p(s) = p0 + s Δ + s (1 − s) ((1 − s) (h v0 − Δ) + s (Δ − h v1)).
        start = step * work.velocity[NOW, body, axis] - change
        end = change - step * work.velocity[NEW, body, axis]
        bend = rest * start + share * end
        work.place[TRIAL, body, axis] = (
            work.place[NOW, body, axis] + share * change + share * rest * bend
        )
        slope = change + (rest - share) * bend + share * rest * (end - start)
        work.velocity[TRIAL, body, axis] = slope / step


def end_within(scene, work, step, ratio, share):
    """Make the motion at a fraction of a step the new state, if it is as accurate as a shorter
    step's.

    ``ratio`` is the step's error over its tolerance. Return False if it is not; nothing changes
    then.
    """
    if work.tally.kind == SERIES:
        # A series is as accurate inside the step as at its end.
        whole, terms = work.tally.series_step, work.tally.series_terms
        evaluate_all(work, MOTION, START, terms, whole, share * step / whole, NEW)
        return True
    return work.tally.kind == RADAU and end_on_cubic(scene, work, step, ratio, share)
