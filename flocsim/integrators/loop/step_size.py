"""The size of the next step: from the last one's error, the lists, and what is about to switch."""

import math

from flocsim.geometry.contact.candidates import share_ahead, time_within
from flocsim.hooks import first_step, next_step
from flocsim.integrators.events.first_event import OTHER_CONTACTS, OTHER_FRICTION, resolutions_of
from flocsim.integrators.events.resolution import touch_resolution
from flocsim.integrators.loop.kicks import kick_end
from flocsim.integrators.rhs.stated_error import pressed_stiffness
from flocsim.integrators.rhs.views import contact_view, inertia, memory_of, normal_rate
from flocsim.state.contacts import TOUCHES
from flocsim.state.work import NOW, STIFFNESS

SAFETY = 0.9
"""Aim that far below the step at which the error would meet the tolerance."""

SMALLEST_FACTOR, LARGEST_FACTOR = 0.1, 8.0
"""Bounds of the change from one step to the next."""

LOWEST_ORDER = 0.5
"""Least power of the step that an error is taken to go with."""


def seen_order(clock, step, ratio, order):
    """The power of the step that the errors of two rejected trials in a row go with.

    Behind a switch stiff forces settle, and the error falls far more slowly than the order says
    (Gustafsson 1994).
    """
    if clock.rejected_step <= step:
        return order
    decay = math.log(clock.rejected_ratio / ratio) / math.log(clock.rejected_step / step)
    return min(max(decay, LOWEST_ORDER), order)


def adaptive_factor(clock, step, ratio, order):
    """By how much to change the step after one whose error was ``ratio`` times the tolerance.

    The trend of the last two steps that were taken is carried on, also past rejected ones: towards
    an attraction that diverges every step has to be shorter than the one before. A step behind a
    rejected one does not grow (Gustafsson 1994, as in Hairer & Wanner, Solving Ordinary
    Differential Equations II, IV.8).
    """
    ratio = max(ratio, 1e-12)
    if ratio > 1.0:
        order = seen_order(clock, step, ratio, order)
    factor = SAFETY * ratio ** (-1.0 / order)
    before = clock.previous_step
    if ratio <= 1.0 and (before == 0.0 or clock.rejected_step > 0.0):
        factor = min(factor, 1.0)
    if ratio <= 1.0 and 0.0 < before < math.inf:
        trend = max(clock.previous_ratio, 1e-2) / (ratio * ratio)
        factor = min(factor, SAFETY * step / before * trend ** (1.0 / order))
    return min(max(factor, SMALLEST_FACTOR), LARGEST_FACTOR)


SMALLEST_STEP = 1e-14
"""A step below this share of the elapsed time, or of 1 ms, moves nothing: the run has stalled."""

LEAST_ADVANCE = 2.3e-16
"""A step of this share of the time takes it to another number at least: what switches within that
switches together."""

RESOLVED = 0.02
"""A step of this share of 1/ω0 resolves a vibration."""

TINY = 1e-300
"""Stands for no inertia."""

IMMINENT = 0.05
"""A switch within this share of the step is run up to by a step of its own."""

SHARE_OF_FAILED, RECOVERY = 0.6, 2.0
"""Behind a step that failed, steps grow to this share of it, and that by so much a step."""

SETTLED_GROWTH = 3.0
"""The first step behind a switch is at most so many times the one behind the switch before."""

MOST_SWITCHING = 4.0
"""Steps in a row that may each end at a switch before they grow all the same."""


def imminent_switch(scene, work, clock, step):
    """The step, or the much shorter one behind which a pair is just about to switch."""
    resolution, _ = resolutions_of(work, clock)
    for row in range(work.tally.candidates):
        gap = work.geometry[NOW, row].gap
        if 0.0 <= gap < clock.tolerance:
            rate = normal_rate(work, NOW, row)
            if gap * rate < 0.0:
                behind = 0.5 * touch_resolution(scene, work, NOW, row, resolution)
                ahead = (abs(gap) + behind) / abs(rate)
                if ahead < IMMINENT * step:
                    step = ahead
    return step


SHORT_OF_IT, LANDING = 0.05, 0.5
"""A step across switches ends so many tolerances before a pair lands in it; the landing itself
lasts as long as this share of one takes."""


def step_to_landing(work, clock, step):
    """The step, or that which ends just before the first pair lands in it, or in which it does: by
    its end alone a step does not tell when in it that was, and would be wrong by half the way.
    Pairs that come nearer by less than the tolerance may land anywhere in it."""
    tolerance = clock.tolerance
    for row in range(work.tally.candidates):
        gap, speed = work.geometry[NOW, row].gap, -normal_rate(work, NOW, row)
        if gap > 0.0 and speed * step > max(gap, tolerance):
            way = gap - SHORT_OF_IT * tolerance
            lands = way <= 0.5 * SHORT_OF_IT * tolerance
            step = (LANDING * tolerance if lands else way) / speed
    return step


def choose_step(scene, work, clock, lists):
    step = min(clock.step, clock.largest_step)
    if lists:
        step = min(step, time_within(scene, work, share_ahead(scene, work)))
        if clock.tolerance < math.inf:
            if clock.across == 0.0:
                step = imminent_switch(scene, work, clock, step)
            else:
                step = step_to_landing(work, clock, step)
    left = min(clock.until, kick_end(scene, work)) - clock.time
    # Two even steps at the end instead of a long one and a sliver.
    if step < left < 2.0 * step and clock.tolerance < math.inf:
        return 0.5 * left
    return min(step, left)


def room_for_time(clock, step):
    """The step, or the least one behind which the time is another number."""
    if clock.tolerance == math.inf:
        return step
    return max(step, min(LEAST_ADVANCE * clock.time, clock.until - clock.time))


def moves(clock, step):
    """Whether anything can have moved in a step, which ended at the time now."""
    if clock.tolerance == math.inf:
        return clock.time - step < clock.time
    return step >= SMALLEST_STEP * max(clock.time, 1e-3)


def reject(clock, counts, step, ratio, too_far):
    """Choose a smaller step; False where there is none."""
    counts.rejected += 1
    clock.staged_step = 0.0
    failed = ratio < 0.0 or too_far
    if failed:
        clock.previous_step = 0.0
    clock.step = 0.25 * step if failed else next_step(clock, step, ratio)
    clock.rejected_step = 0.0 if failed else step
    clock.rejected_ratio = ratio
    # What switches late in a step across switches makes its error a jump: it comes again.
    if ratio < 0.0 or (clock.across == 1.0 and not too_far):
        clock.bearable_step = SHARE_OF_FAILED * step
    return moves(clock, step)


def fastest_vibration(scene, work):
    """ω of the fastest vibration that there is [1/s]; 0 without any."""
    stiffest = 0.0
    for body in range(work.poses.shape[0]):
        if scene.bodies[body].free == 1.0:
            for axis in range(3):
                mass = max(inertia(scene, body, axis), TINY)
                stiffest = max(stiffest, work.jacobian[STIFFNESS, body, axis, axis] / mass)
    return math.sqrt(stiffest)


def shortest_needed(scene, work):
    """The step behind a switch that resolves it; 0 without any [s]."""
    fastest = fastest_vibration(scene, work)
    return RESOLVED / fastest if fastest > 0.0 else 0.0


def step_behind_touch(scene, work, clock):
    """The step that resolves how contacts take up the speed at which they have just touched, as far
    as that displaces bodies by the tolerance [s]."""
    pace, speed_of, later = 0.0, 0.0, 0.0
    for row in range(work.tally.candidates):
        speed = -normal_rate(work, NOW, row)
        if work.candidates[row].closed == TOUCHES and speed > 0.0:
            view = contact_view(scene, work, NOW, row)
            stiffness = pressed_stiffness(scene, view, clock.tolerance)
            pace += stiffness / view.effective_mass
            speed_of = max(speed_of, speed)
            later = max(later, speed * memory_of(work, row))
    if not (pace > 0.0 and later > 0.0):
        return math.inf
    return first_step(work, clock, math.sqrt(pace), speed_of, later)


def plan(clock, step, ratio, was_cut, switched):
    """The size of the step after an accepted one; ``was_cut``, whether to end at a switch."""
    if switched == OTHER_CONTACTS:
        # The forces are new, and settle about as fast as behind the last switch.
        clock.previous_step = math.inf
        clock.staged_step = 0.0
        clock.settling += 1.0
        if clock.settling > MOST_SWITCHING and not was_cut:
            # A pair on the verge of touching switches step after step: they have to grow, too.
            clock.step = min(next_step(clock, step, ratio), clock.bearable_step)
            clock.settled_step = max(clock.settled_step, step)
        clock.step = min(clock.step, SETTLED_GROWTH * clock.settled_step)
    elif switched == OTHER_FRICTION:
        clock.previous_step = math.inf
        clock.staged_step = 0.0
    elif was_cut:
        # The switch did not come: the step was too long to tell.
        clock.previous_step = math.inf
        clock.bearable_step = SHARE_OF_FAILED * clock.step
        clock.step = min(clock.bearable_step, LARGEST_FACTOR * step)
    else:
        if clock.settling > 0.0:
            clock.settled_step = step
            clock.settling = 0.0
        cut = step < 0.5 * clock.step
        clock.step = min(next_step(clock, step, ratio), clock.bearable_step)
        clock.bearable_step *= RECOVERY
        clock.previous_step = math.inf if cut else step
        clock.previous_ratio = ratio
    clock.rejected_step = 0.0
