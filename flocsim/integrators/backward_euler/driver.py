"""Steps of backward Euler that go on across switches, for an island of many bodies.

Its steps are as long as the motion allows, however often contacts open and close in them. What they
do not resolve they damp: bodies come to rest at the first touch, as they do by critical damping; an
island in which a body would fly apart again by more than the tolerance is left to the other method.
"""

import math

from flocsim.arrays import (
    CANDIDATES,
    CARRIED,
    CODE,
    DEVIATION,
    EDGE_BODY,
    ERROR,
    ERROR_PLACE,
    ERROR_SPEED,
    ESTIMATE_SHARE,
    FULL,
    GAP,
    MOTION_COLUMNS,
    NEW,
    NORMAL_X,
    NORMAL_Y,
    NOTHING_FULL,
    NOW,
    REJECTED,
    STAGED_STEP,
    START,
    STEP_PLACE,
    STEP_SPEED,
    STEPS,
    SWITCH_PLACE,
    SWITCH_SPEED,
    TIME,
    TOLERANCE,
    TRIAL,
    UNTIL,
    VERTEX_BODY,
    VX,
    VY,
)
from flocsim.compiler.composer import apart
from flocsim.geometry.contact.candidates import spent, time_within
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.geometry.contact.slip_transfer import forget_offsets, hand_over
from flocsim.hooks import observe
from flocsim.integrators.backward_euler.contact_mean import takes_part
from flocsim.integrators.backward_euler.estimate import BEFORE, accelerations, step_ratio
from flocsim.integrators.backward_euler.interior import find_closed
from flocsim.integrators.backward_euler.newton import begin_step, solve_end, take_back
from flocsim.integrators.events.modes import set_modes
from flocsim.integrators.events.resolution import bounces, memory_of, pressed
from flocsim.integrators.loop.driver import (
    FINISHED,
    NO_ROOM,
    STALLED,
    STOPPED,
    TOO_DEEP,
    keep_lists,
    pause_reason,
    too_deep,
)
from flocsim.integrators.loop.step_size import moves
from flocsim.integrators.rhs.stated_error import OF_SWITCHES, carried
from flocsim.integrators.rhs.views import contact_view
from flocsim.laws import CONTACT_FORCE, has

OTHER_METHOD = 0
"""No Status: the other method is to go on from here."""

NEXT_STEP, KNOWN, SWITCHES, TRIALS, BUSY, EULER_SIZE = range(6)
"""Places in ``euler``: the size of the next step [s]; 1 where there was a step before; switches of
contacts, and steps tried, since the method was chosen; 1 where so many contacts switch in a step
that Newton's method alone is slow."""

QUICK, MOST_ITERATIONS = 5, 16
"""Iterations of Newton's method from the start of the step, and from where the interior-point
method has come, before a step is given up and made smaller."""

FEW = 2
"""Behind a step with so few switches at most, Newton's method is tried alone."""

SAFETY, MOST_GROWTH, LEAST_SHARE = 0.9, 5.0, 0.1
"""The next step is that much shorter than would just do; bounds of the change."""

FAILED_SHARE = 0.25
"""A step that has failed is tried again so much shorter."""

ENOUGH_TRIALS, FEW_SWITCHES = 60, 0.25
"""Behind so many trials with fewer switches than that for each, located switches cost no more."""


def next_size(step, ratio):
    """The size of the step after one of that ratio: errors go with h² where motion is smooth, with
    h where contacts switch."""
    if ratio > 1.0:
        return step * max(LEAST_SHARE, SAFETY / ratio)
    return step * min(MOST_GROWTH, SAFETY / math.sqrt(max(ratio, 1e-4)))


def approach_speed(work, row):
    """How fast the bodies of a pair came at each other when the step began [m/s]."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    g, motion = work.geometry, work.motion
    speed = g[NOW, row, NORMAL_X] * (motion[START, b, VX] - motion[START, a, VX])
    return speed + g[NOW, row, NORMAL_Y] * (motion[START, b, VY] - motion[START, a, VY])


@apart
def would_bounce(scene, work, clock):
    """Whether a pair that has closed in the step would fly apart again, by more than is allowed."""
    for row in range(work.tally[CANDIDATES]):
        if work.geometry[TRIAL, row, GAP] >= 0.0 > work.geometry[NOW, row, GAP]:
            speed = approach_speed(work, row)
            if speed * memory_of(work, row) > clock[TOLERANCE]:
                view = contact_view(scene, work, NOW, row)
                stiffness = pressed(scene, view, clock[TOLERANCE], 0.0) / clock[TOLERANCE]
                if stiffness > 0.0:
                    frequency = math.sqrt(stiffness / view.effective_mass)
                    if bounces(scene, view, speed, frequency):
                        return True
    return False


def add_errors(work, clock, step):
    """Carry every body's errors over the step, and add its own."""
    errors, largest = work.bodies, 0.0
    for body in range(work.bodies.shape[0]):
        carried(work, body, ERROR_PLACE, ERROR_SPEED, step)
        carried(work, body, SWITCH_PLACE, SWITCH_SPEED, step)
        # Those of the other method count by a share of what it estimates, these as they are.
        errors[body, ERROR_PLACE] += errors[body, STEP_PLACE] / clock[ESTIMATE_SHARE]
        errors[body, ERROR_SPEED] += errors[body, STEP_SPEED] / clock[ESTIMATE_SHARE]
        stated = clock[ESTIMATE_SHARE] * errors[body, ERROR_PLACE]
        largest = max(largest, stated + OF_SWITCHES * errors[body, SWITCH_PLACE])
        for axis in range(MOTION_COLUMNS):
            work.motion[CARRIED, body, axis] += work.motion[DEVIATION, body, axis]
    clock[ERROR] = largest


def count_switches(work):
    """How many pairs are closed that were not when the step began, or the other way round."""
    count = 0
    for row in range(work.tally[CANDIDATES]):
        before, after = work.geometry[TRIAL, row, GAP], work.geometry[NOW, row, GAP]
        count += 1 if (before < 0.0) != (after < 0.0) else 0
    return count


@apart
def take_end(scene, work, clock, counts, euler, step):
    """Go on from the end of the step."""
    accelerations(work, BEFORE, step, True)
    euler[KNOWN] = 1.0
    switches = count_switches(work)
    euler[SWITCHES] += switches
    if switches <= FEW:
        euler[BUSY] = 0.0
    for row in range(work.tally[CANDIDATES]):
        work.slip[NOW, row] = work.slip[NEW, row] if takes_part(work, row) else 0.0
    clock[TIME] += step
    counts[STEPS] += 1
    add_errors(work, clock, step)
    hand_over(scene, work)
    set_modes(scene, work)
    forget_offsets(work)


def is_loose(work):
    """Whether nothing touches."""
    return not least_listed_gap(work) < 0.0


def choose_size(scene, work, clock, euler):
    """The step, as the lists and the time that is left allow."""
    step = min(euler[NEXT_STEP], time_within(scene, work, 0.5))
    left = clock[UNTIL] - clock[TIME]
    if step < left < 2.0 * step:
        return 0.5 * left
    return min(step, left)


def solve_step(scene, work, clock, euler, step):
    """Find the end of the step; False where it is not found."""
    if euler[BUSY] == 0.0:
        if solve_end(scene, work, clock, step, QUICK):
            return True
        if work.tally[FULL] != NOTHING_FULL:
            return False
        take_back(scene, work)
    euler[BUSY] = 1.0
    if not find_closed(scene, work, clock, step):
        return False
    return solve_end(scene, work, clock, step, MOST_ITERATIONS)


@apart
def list_anew(scene, work):
    """Make the lists anew where they are spent; False without room."""
    return keep_lists(scene, work)


def try_step(scene, work, clock, euler, step):
    """One step: error over tolerance, −1 where it fails."""
    begin_step(work)
    if not solve_step(scene, work, clock, euler, step) or spent(scene, work, NOW) > 1.0:
        return -1.0
    return step_ratio(scene, work, clock, step, euler[KNOWN] == 1.0)


@apart
def advance_across(scene, work, observed, clock, counts, record, euler):
    """Run until a Status, or OTHER_METHOD."""
    clock[STAGED_STEP] = 0.0
    euler[KNOWN] = euler[SWITCHES] = euler[TRIALS] = euler[BUSY] = 0.0
    while clock[TIME] < clock[UNTIL]:
        status = pause_reason(clock, counts, record)
        if status != 0:
            return status
        if not list_anew(scene, work):
            return NO_ROOM
        if not has(scene, CONTACT_FORCE) or is_loose(work):
            return OTHER_METHOD
        if euler[TRIALS] >= ENOUGH_TRIALS:
            if euler[SWITCHES] < FEW_SWITCHES * euler[TRIALS]:
                return OTHER_METHOD
            euler[SWITCHES] = euler[TRIALS] = 0.0
        step = choose_size(scene, work, clock, euler)
        euler[TRIALS] += 1.0
        ratio = try_step(scene, work, clock, euler, step)
        if work.tally[FULL] != NOTHING_FULL:
            return NO_ROOM
        bounces_off = 0.0 <= ratio <= 1.0 and would_bounce(scene, work, clock)
        if ratio < 0.0 or ratio > 1.0 or bounces_off:
            take_back(scene, work)
            set_modes(scene, work)
            if bounces_off:
                return OTHER_METHOD
            counts[REJECTED] += 1
            euler[NEXT_STEP] = FAILED_SHARE * step if ratio < 0.0 else next_size(step, ratio)
            if not moves(clock, euler[NEXT_STEP]):
                return STALLED
            continue
        # A step cut short by the end of the window says nothing against a longer one.
        if step >= euler[NEXT_STEP] or ratio > 0.5:
            euler[NEXT_STEP] = next_size(step, ratio)
        else:
            euler[NEXT_STEP] = max(euler[NEXT_STEP], next_size(step, ratio))
        take_end(scene, work, clock, counts, euler, step)
        if too_deep(scene, work):
            return TOO_DEEP
        counts[CODE] = observe(scene, work, observed, clock[TIME])
        if counts[CODE] != 0:
            return STOPPED
    return FINISHED
