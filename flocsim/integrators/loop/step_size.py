"""The size of the next step: from the last error, the candidate lists, and contacts that close.

The controller is Gustafsson's predictive one (Hairer & Wanner, Solving Ordinary Differential
Equations II (1996), section IV.8), with p the power of h that the error estimate follows:

    h_new = 0.9 h min( ratio^(−1/p),  h/h_old (ratio_old/ratio²)^(1/p) ),

ratio being error over tolerance. Steps that follow a switch are planned from the contact that has
closed instead, since the forces are new.
"""

import math

from flocsim.constants import TINY
from flocsim.geometry.contact.candidates import spendable_share, time_to_spend
from flocsim.hooks import next_step
from flocsim.integrators.exponential.collocation import may_be_series
from flocsim.integrators.loop.kicks import kick_end
from flocsim.integrators.rhs.contact_stiffness import secant_stiffness
from flocsim.integrators.rhs.error import LARGEST_FACTOR, ROUNDING, SAFETY, SMALLEST_FACTOR
from flocsim.integrators.rhs.views import contact_view, inertia, normal_rate, velocity_lifetime_of
from flocsim.state.clock import PLAIN, RADAU, moves
from flocsim.state.contacts import CLOSED
from flocsim.state.work import MOST_IN_SERIES, NOW, STIFFNESS


def adaptive_factor(clock, step, ratio, order):
    """Return the factor from this step to the next, given the ratio of its error to the tolerance.

    The trend of the last two accepted steps is extrapolated, also past rejected ones: towards an
    attraction that diverges, every step has to be shorter than the one before. A step behind a
    rejected one does not grow (Gustafsson 1994, as in Hairer & Wanner, Solving Ordinary
    Differential Equations II, IV.8).
    """
    ratio = max(ratio, 1e-12)
    # Elementary controller: error ∝ h^p.
    factor = SAFETY * ratio ** (-1.0 / order)
    before = clock.previous_step
    # No growth right after a rejection or a failure (previous_step = 0).
    if ratio <= 1.0 and (before == 0.0 or clock.rejected_step > 0.0):
        factor = min(factor, 1.0)
    # Predictive controller; the last ratio counts as 0.01 at least.
    if ratio <= 1.0 and 0.0 < before < math.inf:
        trend = max(clock.previous_ratio, 1e-2) / (ratio * ratio)
        factor = min(factor, SAFETY * step / before * trend ** (1.0 / order))
    return min(max(factor, SMALLEST_FACTOR), LARGEST_FACTOR)


FRACTION_OF_FAILED, RECOVERY = 0.6, 2.0
"""After a failed step, the next ones are at most this fraction of it; the bound then grows by
RECOVERY per step."""

TOUCH_ERROR_FRACTION = 0.1
"""The error of the first step after a touch is taken as (h ω0)⁴ over this times the displacement
that the impact leads to; that of a series as (h ω0)⁵ over this times the overlap v/ω0 of the
impact, for the rotation of the contact normal, which the series does not contain."""

MAX_PHASE = 4.0
"""Phase ω h [rad], ω being the fastest vibration, up to which the switches inside a series are
found reliably. A Radau step with a switch in it is repeated as a series of this length. With half a
period, π, doublets that rattle need a third more steps."""

RECURS = 3
"""Trials to end a Radau step at one switch, after which its location is not trusted and the step is
halved."""

LANDING_MARGIN = 0.05
"""A step across switches ends this many tolerances before a pair lands in it; the step that
contains the landing lasts as long as the pair takes to move by one tolerance."""


def step_to_landing(work, clock, step):
    """Return the step, or a shorter one that ends just before the first pair lands, or contains
    only that.

    Backward Euler knows contacts only at the end of a step, so a landing somewhere inside it is
    wrong by half the path that the body would have gone on. In a pile of hundreds of bodies these
    errors made steps of microseconds. Pairs that come nearer by less than the tolerance may land
    anywhere.
    """
    tolerance = clock.tolerance
    for row in range(work.tally.candidates):
        gap, speed = work.geometry[NOW, row].gap, -normal_rate(work, NOW, row)
        if gap > 0.0 and speed * step > max(gap, tolerance):
            approach = gap - LANDING_MARGIN * tolerance
            lands = approach <= 0.5 * LANDING_MARGIN * tolerance
            step = (tolerance if lands else approach) / speed
    return step


def choose_step(scene, work, clock, needs_lists):
    step = min(clock.step, clock.largest_step)
    # Lists: no pair may use up its motion budget.
    if needs_lists:
        step = min(step, time_to_spend(scene, work, spendable_share(scene, work)))
        # Steps across switches end just before a landing.
        if clock.across == 1.0:
            step = step_to_landing(work, clock, step)
    # Stops and thermal kicks end a step exactly.
    remaining = min(clock.until, kick_end(scene, work)) - clock.time
    # Two even steps at the end instead of a long one and a sliver.
    if step < remaining < 2.0 * step and clock.tolerance < math.inf:
        return 0.5 * remaining
    return min(step, remaining)


def representable_step(clock, step):
    """Return the step, or one that changes the time in double precision: switches closer together
    than that count as simultaneous."""
    if clock.tolerance == math.inf:
        return step
    return max(step, min(ROUNDING * clock.time, clock.until - clock.time))


def reject(clock, counts, step, ratio, too_far):
    """Plan a smaller step after a rejected one; return False if it would move nothing."""
    counts.rejected += 1
    clock.stages_step = 0.0
    failed = ratio < 0.0 or too_far
    if failed:
        clock.previous_step = 0.0
    # A failure carries no information about the error: quarter the step.
    clock.step = 0.25 * step if failed else next_step(clock, step, ratio)
    clock.rejected_step = 0.0 if failed else step
    # Failed steps bound the next ones. So do rejected steps across switches: a contact that
    # switches late in the step makes the error jump, and would do so again.
    if ratio < 0.0 or (clock.across == 1.0 and not too_far):
        clock.feasible_step = FRACTION_OF_FAILED * step
    return moves(clock, step)


def step_behind_touch(scene, work, clock):
    """Return the step that resolves how new contacts take up the impact [s]; inf if none has
    closed.

    It need resolve that only as far as the impact displaces bodies by the tolerance. Without this
    rule the step was guessed from those before, at the price of two or three rejections per touch.
    """
    frequency_squared, top_speed, displacement = 0.0, 0.0, 0.0
    # Contacts that close now act in parallel: their k/m add up to ω².
    for row in range(work.tally.candidates):
        speed = -normal_rate(work, NOW, row)
        if work.candidates[row].contact_mode == CLOSED and speed > 0.0:
            view = contact_view(scene, work, NOW, row)
            stiffness = secant_stiffness(scene, view, clock.tolerance)
            frequency_squared += stiffness / view.effective_mass
            top_speed = max(top_speed, speed)
            displacement = max(displacement, speed * velocity_lifetime_of(work, row))
    if not (0.0 < frequency_squared < math.inf and displacement > 0.0):
        return math.inf
    frequency, allowed = math.sqrt(frequency_squared), TOUCH_ERROR_FRACTION * clock.tolerance
    # Solve the error of the step = tolerance for h; see TOUCH_ERROR_FRACTION.
    if work.tally.kind == PLAIN or work.poses.shape[0] > MOST_IN_SERIES:
        return (allowed / displacement) ** 0.25 / frequency
    return (allowed * frequency / top_speed) ** 0.2 / frequency


def fastest_vibration(scene, work):
    """Return the angular frequency of the fastest vibration [1/s], 0 if nothing vibrates."""
    stiffest = 0.0
    for body in range(work.poses.shape[0]):
        if scene.bodies[body].free == 1.0:
            # Diagonal of M⁻¹K: ω² of each coordinate alone.
            for axis in range(3):
                mass = max(inertia(scene, body, axis), TINY)
                stiffest = max(stiffest, work.jacobian[STIFFNESS, body, axis, axis] / mass)
    return math.sqrt(stiffest)


def step_to_switch(scene, work, step, share, trials):
    """Return the step [s] to try after one that passed a switch at a fraction of it.

    A Radau step damps vibrations, and the switch may be an artefact of that. Then a series is tried
    instead, as long as MAX_PHASE allows, but at most half of the step. ``trials`` counts the steps
    that were meant to end at this switch.
    """
    # The gap of a contact with almost no load has errors at the end of a long step, where each
    # trial shows the switch again, though it came much earlier.
    if work.tally.kind == RADAU and trials >= RECURS:
        return min(share, 0.5) * step
    fastest = fastest_vibration(scene, work)
    if work.tally.kind != RADAU or not may_be_series(scene, work) or fastest == 0.0:
        return share * step
    return max(share * step, min(0.5 * step, MAX_PHASE / fastest))


def plan(scene, work, clock, step, ratio, aimed_at_switch, switched):
    """Plan the size of the step after an accepted one. ``aimed_at_switch`` is True if the step was
    meant to end at a switch, ``switched`` if a contact has switched at its end."""
    if switched:
        # The forces are new.
        clock.previous_step = math.inf
        clock.stages_step = 0.0
        clock.step = min(clock.step, step_behind_touch(scene, work, clock))
    elif aimed_at_switch:
        # The switch did not come: the step was too long to predict it. Or it was a kink: then the
        # convergence rate may be that from before it.
        clock.previous_step = math.inf
        clock.feasible_step = FRACTION_OF_FAILED * clock.step
        clock.step = min(clock.feasible_step, LARGEST_FACTOR * step)
        clock.second_iteration_rate = 0.0
    else:
        # A step shortened by lists or stops says nothing about the trend of the error.
        shortened = step < 0.5 * clock.step
        clock.step = min(next_step(clock, step, ratio), clock.feasible_step)
        clock.feasible_step *= RECOVERY
        clock.previous_step = math.inf if shortened else step
        clock.previous_ratio = ratio
    clock.rejected_step = 0.0
