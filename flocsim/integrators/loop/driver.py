"""The one loop around every integrator: lists, error control, switches, budgets, recording."""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.body_pairs import watches_all
from flocsim.geometry.contact.candidates import hand_over, list_ahead, outlived, spent, too_wide
from flocsim.geometry.contact.points import locate_contacts
from flocsim.hooks import (
    CENTRE_FORCE,
    CONTACT_FORCE,
    attempt,
    choose_method,
    cut,
    end_within,
    has,
    leave_out_cycles,
    note_step,
    observe,
    step_to_switch,
)
from flocsim.integrators.events.crossings import (
    changes_sides,
    is_too_deep,
    may_switch,
    overtakes,
    passes_within,
    touches,
)
from flocsim.integrators.events.first_event import (
    OTHER_CONTACTS,
    OTHER_FRICTION,
    SAME,
    law_share,
    leave_at_once,
    resolutions_of,
    set_modes,
    settle_grazes,
    switch_share,
)
from flocsim.integrators.loop.kicks import kick_end, meet_kick, renew_kicks
from flocsim.integrators.loop.step_size import (
    choose_step,
    moves,
    plan,
    reject,
    room_for_time,
    shortest_needed,
    step_behind_touch,
)
from flocsim.integrators.rhs.friction import rolled, rolled_besides, slip_in
from flocsim.integrators.rhs.stated_error import add_switch_errors, carry_errors, forget_offsets
from flocsim.integrators.rhs.surface_gap import flag_near, overlooked
from flocsim.state.bodies import RECORD_MOTION, RECORD_TIME
from flocsim.state.clock import NOTHING_FULL
from flocsim.state.contacts import TOUCHES
from flocsim.state.work import NEW, NOW

FINISHED, STOPPED, STEP_BUDGET, STALLED, TOO_DEEP, NO_ROOM, RECORD_FULL, PAUSED, NOT_FINITE = range(
    1, 10
)
"""The values of integrators.base.Status, as plain numbers for the compiled loop."""

MOST_TRIALS = 12
"""Steps tried to end at one switch."""

MOST_STILL = 100
"""Steps in a row that move nothing: more than pairs that switch one behind the other."""


def too_deep(scene, work):
    """Whether any listed pair overlaps past the limit of the contact law."""
    deep = False
    for row in range(work.tally.candidates):
        deep = deep or is_too_deep(scene, work, NOW, row)
    return deep


def take_new_state(work):
    """Make the new state the current one."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[NOW, body, axis] = work.place[NEW, body, axis]
            work.velocity[NOW, body, axis] = work.velocity[NEW, body, axis]
    for row in range(work.tally.candidates):
        work.geometry[NOW, row] = work.geometry[NEW, row]
        if work.candidates[row].closed == 1:
            work.slip[NOW, row] = work.slip[NEW, row]


@apart
def accept(scene, work, clock, counts, step, lists):
    """Go on from the new state, its pairs flagged anew; what switched (see modes)."""
    take_new_state(work)
    clock.time += step
    meet_kick(scene, work, clock)
    counts.steps += 1
    controlled, across = clock.tolerance < math.inf, clock.across == 1.0
    if controlled:
        carry_errors(scene, work, clock, step)
    if across:
        note_step(scene, work, clock, step)
    if not lists:
        return SAME
    if controlled and has(scene, CONTACT_FORCE):
        if not across:
            _, depth = resolutions_of(work, clock)
            add_switch_errors(scene, work, clock, step, depth)
        forget_offsets(work)
    grazes = controlled and not across and settle_grazes(scene, work, clock, step)
    hand_over(scene, work)
    switched = set_modes(scene, work)
    if across:
        return SAME
    return OTHER_FRICTION if grazes and switched == SAME else switched


def plan_flight(work, clock, planned, flew):
    """Begin a flight with the step that was ``planned`` where the one before has ended, as
    contacts have switched behind a series: what comes and goes in one is seen, however long it
    is."""
    if flew:
        clock.flying_step = planned
    if not touches(work):
        clock.step = max(clock.step, clock.flying_step)


def stands_still(clock, counts, step):
    """Count the accepted steps in a row that are as good as none; whether they are too many."""
    counts.still = 0 if moves(clock, step) else counts.still + 1
    return counts.still > MOST_STILL


def record_row(work, clock, counts, record):
    """Write the current state to the record (rows of time, then six numbers for each body)."""
    row = counts.recorded
    record[row, RECORD_TIME] = clock.time
    for body in range(work.place.shape[1]):
        for axis in range(3):
            column = RECORD_MOTION + 6 * body + axis
            record[row, column] = work.place[NOW, body, axis]
            record[row, column + 3] = work.velocity[NOW, body, axis]
    counts.recorded = row + 1


def pause_reason(counts, record):
    """The Status that ends the loop before the next step; 0 to go on."""
    if counts.steps + counts.rejected + counts.located >= counts.max_steps:
        return STEP_BUDGET
    if counts.steps >= counts.pause_at:
        return PAUSED
    if record.shape[0] > 0 and counts.recorded == record.shape[0]:
        return RECORD_FULL
    return 0


@apart
def keep_lists(scene, work, counts, ahead):
    """Make the candidate lists anew, for steps of ``ahead`` [s], where half their budget is spent,
    or they are too wide; False without room."""
    if outlived(scene, work, ahead) or too_wide(scene, work, ahead):
        if not list_ahead(scene, work, ahead):
            return False
        locate_contacts(scene, work, NOW)
        set_modes(scene, work)
        counts.cycle_modes = 0
    return True


def went_too_far(scene, work, clock, step):
    """Locate all pairs at the end of the step; whether what was listed or flagged is not enough, or
    it is not known where surface forces act."""
    if spent(scene, work, NEW) > 1.0:
        return True
    locate_contacts(scene, work, NEW)
    if clock.across == 1.0 and changes_sides(work):
        return True
    if scene.listed_reach <= 0.0 or clock.tolerance == math.inf:
        return False
    if overlooked(scene, work) or passes_within(scene, work, step, clock.tolerance):
        return True
    return overtakes(scene, work, clock, step)


def roll_slips(scene, work, step):
    """Tangential displacements of the closed pairs in NEW, which is located, after a step."""
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == TOUCHES:
            besides = 0.5 * step * rolled_besides(scene, work, NEW, row)
            stuck = work.slip[NOW, row] + rolled(scene, work, NEW, row) + besides
            work.slip[NEW, row] = slip_in(scene, work, NEW, row, stuck)


def ends_early(scene, work, clock, step, ratio, share):
    """End a step at a share of it, where a pair touches or parts; False where it has to be taken
    anew: its motion is not known well enough in between, or a law has a kink in it as well."""
    if law_share(scene, work, clock, step) < 1.0 or not moves(clock, share * step):
        return False
    if not end_within(scene, work, step, ratio, share):
        return False
    locate_contacts(scene, work, NEW)
    roll_slips(scene, work, share * step)
    # A long step may have run through a body: what came first is seen from a nearer end alone.
    resolution, depth = resolutions_of(work, clock)
    return not may_switch(scene, work, share * step, resolution, depth)


def look(scene, work, observed, clock, counts, record, lists):
    """Record and watch the state that has been accepted: a Status, or 0 to go on."""
    if record.shape[0] > 0:
        record_row(work, clock, counts, record)
    if lists and too_deep(scene, work):
        return TOO_DEEP
    counts.code = observe(scene, work, observed, clock.time)
    return STOPPED if counts.code != 0 else 0


def advance(scene, work, observed, clock, counts, record):
    """Run until a Status; call again to go on after PAUSED, RECORD_FULL or NO_ROOM.

    ``record`` (k, 1 + 6n) receives every accepted step; one of length 0 records nothing.
    """
    lists = has(scene, CONTACT_FORCE) or scene.listed_reach > 0.0
    lists = lists or (has(scene, CENTRE_FORCE) and not watches_all(work))
    limit, trials = math.inf, 0
    while clock.time < clock.until:
        status = pause_reason(counts, record)
        if status != 0:
            return status
        if lists and trials == 0 and not keep_lists(scene, work, counts, clock.step):
            return NO_ROOM
        choose_method(scene, work, clock, counts)
        renew_kicks(scene, work, clock)
        step = room_for_time(clock, min(choose_step(scene, work, clock, lists), limit))
        if scene.listed_reach > 0.0:
            flag_near(scene, work, NOW, step)
        ratio = attempt(scene, work, clock, step)
        if work.tally.full != NOTHING_FULL:
            return NO_ROOM
        if ratio < 0.0 and clock.tolerance == math.inf:
            return NOT_FINITE
        too_far = lists and 0.0 <= ratio <= 1.0 and went_too_far(scene, work, clock, step)
        if ratio < 0.0 or ratio > 1.0 or too_far:
            limit, trials = math.inf, 0
            if not reject(clock, counts, step, ratio, too_far):
                return STALLED
            continue
        if lists and trials < MOST_TRIALS and leave_at_once(scene, work, clock, step):
            counts.located += 1
            trials += 1
            clock.staged_step = 0.0
            continue
        if lists and trials < MOST_TRIALS and work.tally.series_terms > 0:
            resolution, depth = resolutions_of(work, clock)
            kept = cut(scene, work, clock, step, resolution, depth)
            if kept < 1.0:
                step *= kept
                trials += 1
                locate_contacts(scene, work, NEW)
                roll_slips(scene, work, step)
        share = switch_share(scene, work, observed, clock, step) if lists else math.inf
        if share < 1.0 and trials < MOST_TRIALS:
            trials += 1
            if not ends_early(scene, work, clock, step, ratio, share):
                limit = step_to_switch(scene, work, step, share)
                counts.located += 1
                continue
            step *= share
        flew = work.tally.series_terms > 0 and not touches(work)
        planned = clock.step
        switched = accept(scene, work, clock, counts, step, lists)
        if switched == OTHER_CONTACTS:
            until = min(clock.until, kick_end(scene, work))
            leave_out_cycles(scene, work, clock, counts, until)
        plan(clock, step, ratio, trials > 0, switched)
        if switched == OTHER_CONTACTS and work.tally.series_terms > 0:
            plan_flight(work, clock, planned, flew)
        if trials > 0 and switched == SAME:
            # Behind a kink of a law its derivatives may still be those before.
            clock.seen_pace = 0.0
        if switched != SAME:
            clock.step = max(clock.step, shortest_needed(scene, work))
            clock.step = min(clock.step, step_behind_touch(scene, work, clock))
        limit, trials = math.inf, 0
        status = look(scene, work, observed, clock, counts, record, lists)
        if status != 0:
            return status
        if stands_still(clock, counts, step):
            return STALLED
    return FINISHED
