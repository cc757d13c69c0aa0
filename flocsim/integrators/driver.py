"""The one loop around every integrator: lists, error control, events, budgets, recording."""

import math

from flocsim.constants import DEEPEST_OVERLAP
from flocsim.geometry.candidates import list_candidates, spent
from flocsim.geometry.contacts import least_listed_gap, locate_contacts
from flocsim.geometry.handover import hand_over
from flocsim.integrators.events import NO_BRACKET, between, is_located, narrowed
from flocsim.layout import (
    BOUNDING_RADIUS,
    CANDIDATES,
    CODE,
    ERROR,
    LARGEST_STEP,
    LOCATED,
    MAX_STEPS,
    NEW,
    NOW,
    PAUSE_AT,
    RADIUS,
    RECORDED,
    REJECTED,
    STEP,
    STEPS,
    TIME,
    TOLERANCE,
    UNTIL,
)
from flocsim.slots import attempt, event_value, has_contact, next_step, observe, surface_reach

FINISHED, STOPPED, STEP_BUDGET, STALLED, TOO_DEEP, NO_ROOM, RECORD_FULL, PAUSED, NOT_FINITE = range(
    1, 10
)
"""The values of integrators.status.Status, as plain numbers for the compiled loop."""

SMALLEST_STEP = 1e-14
"""A step below this share of the elapsed time, or of 1 ms, moves nothing: the run has stalled."""

EVENT_GRAIN = 0.02
"""While an event is awaited, a step moves the bodies by no more than 0.9 of the gap, or this share
of r_i + r_j: what a straight step can then cut off a corner is below 1e-4 of r_i + r_j."""


def too_deep(scene, work):
    """Whether any listed pair overlaps past the limit of the contact law."""
    for row in range(work.tally[CANDIDATES]):
        a, b = work.candidates[row, 0], work.candidates[row, 2]
        if -work.geometry[row, 2] > DEEPEST_OVERLAP * (
            scene.bodies[a, RADIUS] + scene.bodies[b, RADIUS]
        ):
            return True
    return False


def closing_speed(scene, work, a, b):
    """Upper bound of the speed at which two outlines move against each other [m/s]."""
    v = work.motion
    turning = abs(v[NOW, a, 5]) * scene.bodies[a, BOUNDING_RADIUS]
    turning += abs(v[NOW, b, 5]) * scene.bodies[b, BOUNDING_RADIUS]
    return math.hypot(v[NOW, a, 3] - v[NOW, b, 3], v[NOW, a, 4] - v[NOW, b, 4]) + turning


def motion_step(scene, work, awaiting):
    """The longest step whose motion keeps the list valid and skips no awaited event."""
    longest = math.inf
    least_gap = least_listed_gap(work)
    pair = 0
    for a in range(scene.bodies.shape[0]):
        for b in range(a):
            room = 0.5 * work.budget[pair]
            if awaiting:
                grain = EVENT_GRAIN * (scene.bodies[a, RADIUS] + scene.bodies[b, RADIUS])
                room = min(room, max(0.9 * least_gap, grain))
            speed = closing_speed(scene, work, a, b)
            if speed * longest > room:
                longest = room / speed
            pair += 1
    return longest


def choose_step(scene, work, clock, lists, awaiting):
    """The size of the next step [s]."""
    step = min(clock[STEP], clock[LARGEST_STEP])
    if lists:
        step = min(step, motion_step(scene, work, awaiting))
    left = clock[UNTIL] - clock[TIME]
    # Two even steps at the end instead of a long one and a sliver.
    if step < left < 2.0 * step and clock[TOLERANCE] < math.inf:
        return 0.5 * left
    return min(step, left)


def accept(scene, work, clock, counts, step, ratio, lists):
    """Make the new state the current one."""
    for body in range(work.motion.shape[1]):
        for axis in range(6):
            work.motion[NOW, body, axis] = work.motion[NEW, body, axis]
    for row in range(work.tally[CANDIDATES]):
        work.slip[NOW, row] = work.slip[NEW, row]
    clock[TIME] += step
    counts[STEPS] += 1
    if clock[TOLERANCE] < math.inf:
        clock[ERROR] += ratio * clock[TOLERANCE]
    if lists:
        locate_contacts(scene, work, NOW)
        hand_over(work)


def reject(clock, counts, step, ratio, too_far):
    """Choose a smaller step; STALLED where there is none."""
    counts[REJECTED] += 1
    clock[STEP] = 0.25 * step if ratio < 0.0 or too_far else next_step(clock, step, ratio)
    if step < SMALLEST_STEP * max(clock[TIME], 1e-3):
        return STALLED
    return 0


def record_row(work, clock, counts, record):
    """Write the current state to the record (rows of time, then six numbers for each body)."""
    row = counts[RECORDED]
    record[row, 0] = clock[TIME]
    for body in range(work.motion.shape[1]):
        for axis in range(6):
            record[row, 1 + 6 * body + axis] = work.motion[NOW, body, axis]
    counts[RECORDED] = row + 1


def pause_reason(clock, counts, record):
    """The Status that ends the loop before the next step; 0 to go on."""
    if counts[STEPS] + counts[REJECTED] >= counts[MAX_STEPS]:
        return STEP_BUDGET
    if counts[STEPS] >= counts[PAUSE_AT]:
        return PAUSED
    if record.shape[0] > 0 and counts[RECORDED] == record.shape[0]:
        return RECORD_FULL
    return 0


def keep_lists(scene, work):
    """Make the candidate lists anew where half their budget is spent; False without room."""
    if spent(scene, work, NOW) > 0.5:
        if not list_candidates(scene, work):
            return False
        locate_contacts(scene, work, NOW)
    return True


def look(scene, work, memo, clock, counts, record, lists, at_event):
    """Record and watch the state that has been accepted: a Status, or 0 to go on."""
    if record.shape[0] > 0:
        record_row(work, clock, counts, record)
    if lists and too_deep(scene, work):
        return TOO_DEEP
    counts[CODE] = observe(scene, work, memo, clock[TIME], at_event)
    return STOPPED if counts[CODE] != 0 else 0


def advance(scene, work, memo, clock, counts, record):
    """Run until a Status; call again to go on after PAUSED, RECORD_FULL or NO_ROOM.

    ``record`` (k, 1 + 6n) receives every accepted step; one of length 0 records nothing.
    """
    lists = has_contact() or surface_reach(scene.parameters) > 0.0
    bracket = NO_BRACKET
    while clock[TIME] < clock[UNTIL]:
        status = pause_reason(clock, counts, record)
        if status != 0:
            return status
        if lists and not keep_lists(scene, work):
            return NO_ROOM
        locating = bracket[5] > 0.0
        before = event_value(scene, work, memo, NOW)
        if locating:
            step = between(bracket)
        else:
            step = choose_step(scene, work, clock, lists, before < math.inf)
        ratio = attempt(scene, work, clock, step)
        if ratio < 0.0 and clock[TOLERANCE] == math.inf:
            return NOT_FINITE
        too_far = lists and ratio >= 0.0 and spent(scene, work, NEW) > 1.0
        if ratio < 0.0 or ratio > 1.0 or too_far:
            bracket = NO_BRACKET
            status = reject(clock, counts, step, ratio, too_far)
            if status != 0:
                return status
            continue
        after = event_value(scene, work, memo, NEW) if before > 0.0 else math.inf
        at_event = locating or (before > 0.0 and after <= 0.0)
        if at_event and not is_located(bracket, after, clock):
            start = bracket if locating else (0.0, 0.0, before, 0.0, 0.0, 0.0)
            bracket = narrowed(start, step, after)
            continue
        bracket = NO_BRACKET
        if at_event:
            counts[LOCATED] += 1
        else:
            clock[STEP] = next_step(clock, step, ratio)
        accept(scene, work, clock, counts, step, ratio, lists)
        status = look(scene, work, memo, clock, counts, record, lists, at_event)
        if status != 0:
            return status
    return FINISHED
