"""The loop that advances every method: lists, error control, switches, budgets and the record.

One pass of `advance` tries one step:

 1. Renew the candidate lists if half of their motion budget is spent.
 2. Choose the step; let the method attempt it. A ratio (error over tolerance) above 1, or a
    failure (below 0), rejects it.
 3. Compute the geometry of all pairs at its end. If a contact opens, closes, sticks or slides
    inside the step, the step is ended there (event location), since forces are smooth only while
    modes are fixed.
 4. Accept: NEW becomes NOW, errors are propagated, contact modes are set.
 5. Plan the next step, record the state, ask the observer.

Source of the step control: Hairer & Wanner, Solving Ordinary Differential Equations II (1996),
section IV.8; of event location: Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I
(1993), section II.6.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.body_pairs import lists_all_pairs
from flocsim.geometry.contact.candidates import (
    is_too_wide,
    needs_rebuild,
    rebuild_list_ahead,
    spent_budget,
    transfer_slips,
)
from flocsim.geometry.contact.points import locate_contacts
from flocsim.hooks import CENTRE_FORCE, CONTACT_FORCE, attempt, has, observe
from flocsim.integrators.backward_euler.method import hand_over
from flocsim.integrators.backward_euler.step import note_rates
from flocsim.integrators.events.crossings import (
    any_overtakes,
    any_passes_through,
    any_too_deep,
    any_touching,
    changes_sides,
    may_switch,
    passes_through_reach,
)
from flocsim.integrators.events.first_event import (
    first_law_share,
    set_modes,
    switch_resolutions,
    switch_share,
)
from flocsim.integrators.events.grazes import end_grazing_early, update_grazing_pairs
from flocsim.integrators.events.interpolation import end_within
from flocsim.integrators.events.samples import cut_series
from flocsim.integrators.loop.kicks import renew_kicks, snap_to_kick_end
from flocsim.integrators.loop.stated_error import (
    add_friction_uncertainty,
    add_switch_errors,
    propagate_errors,
    reset_slip_offsets,
)
from flocsim.integrators.loop.step_size import (
    choose_step,
    plan,
    reject,
    representable_step,
    step_to_switch,
)
from flocsim.integrators.rhs.forces import copy_motion
from flocsim.integrators.rhs.friction import limited_slip, slip_of_motion, slip_rate_of_gap_change
from flocsim.integrators.rhs.surface_gap import flag_near, missed_sharing
from flocsim.state.bodies import RECORD_MOTION, RECORD_TIME
from flocsim.state.clock import NOTHING_FULL, PLAIN, SERIES, moves
from flocsim.state.contacts import CLOSED
from flocsim.state.work import NEW, NOW

FINISHED, STOPPED, STEP_BUDGET, STALLED, TOO_DEEP, NO_ROOM, RECORD_FULL, PAUSED, NOT_FINITE = range(
    1, 10
)
"""The values of integrators.base.Status as plain numbers, for the compiled loop."""

MOST_TRIALS = 12
"""Trials to end a step at one switch; then the step is accepted as it is."""

MOST_STATIONARY = 100
"""Steps in a row without motion before a run has stalled. Pairs that switch one directly after
another need fewer."""


def adopt_new_state(work):
    """Make the new state the current one."""
    copy_motion(work, NEW, NOW)
    for row in range(work.tally.candidates):
        work.contacts[row].start_gap = work.geometry[NOW, row].gap
        work.geometry[NOW, row] = work.geometry[NEW, row]
        # Open pairs have no displacement; grazing ones keep that with which they parted.
        if work.candidates[row].contact_mode == CLOSED:
            work.slip[NOW, row] = work.slip[NEW, row]


@apart
def accept(scene, work, clock, counts, step, needs_lists):
    """Accept the step: adopt the new state, propagate errors and set the modes of all pairs. Return
    True if a contact has switched."""
    adopt_new_state(work)
    clock.time += step
    snap_to_kick_end(scene, work, clock)
    counts.steps += 1
    controlled, across = clock.tolerance < math.inf, clock.across == 1.0
    # Errors are propagated with the derivatives and modes of this step, hence before modes change.
    if controlled:
        propagate_errors(scene, work, clock, step)
    if across:
        note_rates(work, clock, step)
    if not needs_lists:
        return False
    if controlled and has(scene, CONTACT_FORCE):
        # Steps across switches locate none, so they have no such errors.
        if across:
            add_friction_uncertainty(scene, work, clock, step)
        else:
            _, depth = switch_resolutions(work, clock)
            add_switch_errors(scene, work, clock, step, depth)
        reset_slip_offsets(work)
    # Grazing first: set_modes leaves grazing pairs as they are.
    grazes = work.tally.kind != PLAIN and update_grazing_pairs(scene, work, clock, step)
    # A contact that rolls from one edge to the next hands its tangential displacement on.
    transfer_slips(scene, work)
    switched = set_modes(scene, work)
    return not across and (grazes or switched)


def plan_flight(work, clock, planned, was_flying):
    """Restore the step of the last flight after contacts have switched behind a series.

    A series detects every touch inside it, however long it is, so a bounce need not shorten the
    steps of the flight that follows. ``planned`` [s] is the step planned before the switch,
    ``was_flying`` is True if the bodies were apart then.
    """
    if was_flying:
        clock.flight_step = planned
    if not any_touching(work):
        clock.step = max(clock.step, clock.flight_step)


def stands_still(clock, counts, step):
    """Count accepted steps in a row that are too short to move anything; return True if they are
    too many."""
    counts.stationary_steps = 0 if moves(clock, step) else counts.stationary_steps + 1
    return counts.stationary_steps > MOST_STATIONARY


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
    """Return the Status that ends the loop before the next step; 0 to continue."""
    if counts.steps + counts.rejected + counts.located >= counts.max_steps:
        return STEP_BUDGET
    if counts.steps >= counts.pause_at:
        return PAUSED
    if record.shape[0] > 0 and counts.recorded == record.shape[0]:
        return RECORD_FULL
    return 0


@apart
def keep_lists(scene, work, ahead):
    """Renew the candidate lists for steps of ``ahead`` [s] if half of their motion budget is spent
    or if they are too wide; return False if an array is full."""
    if needs_rebuild(scene, work, ahead) or is_too_wide(scene, work, ahead):
        if not rebuild_list_ahead(scene, work, ahead):
            return False
        # New rows have no geometry and no mode yet.
        locate_contacts(scene, work, NOW)
        set_modes(scene, work)
    return True


def went_too_far(scene, work, clock, step):
    """Locate all pairs at the end of the step. Return True if the step must be rejected.

    It must if the bodies left the range of the candidate list, if a vertex crossed an edge, if the
    stages may have missed a pair through which a surface force acts, or if the deepest of several
    contacts changed within a step too long to follow that.
    """
    if spent_budget(scene, work, NEW) > 1.0:
        return True
    locate_contacts(scene, work, NEW)
    # Steps across switches see contacts only at their end: a vertex may have tunnelled.
    if clock.across == 1.0 and changes_sides(work):
        return True
    # Only surface forces depend on pairs that are open.
    if scene.listed_reach <= 0.0 or clock.tolerance == math.inf:
        return False
    if missed_sharing(scene, work) or passes_through_reach(scene, work, step, clock.tolerance):
        return True
    return any_overtakes(scene, work, clock, step)


def update_slips(scene, work, step):
    """Update the tangential displacements of the closed pairs in NEW, which is located, after a
    step."""
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == CLOSED:
            # ξ follows from positions; only the part by the change of the gap is integrated
            # (trapezoid).
            gap_change_slip = 0.5 * step * slip_rate_of_gap_change(scene, work, NEW, row)
            sticking_slip = (
                work.slip[NOW, row] + slip_of_motion(scene, work, NEW, row) + gap_change_slip
            )
            work.slip[NEW, row] = limited_slip(scene, work, NEW, row, sticking_slip)


def ends_early(scene, work, clock, step, ratio, share):
    """End a step at a fraction of it where a pair touches or parts. Return False if the step must
    be repeated instead, since its interpolation is not accurate enough or a law has a kink in it as
    well."""
    # A kink of a law, or the onset of sliding, is located by repeating the step.
    if first_law_share(scene, work, clock, step) < 1.0 or not moves(clock, share * step):
        return False
    if not end_within(scene, work, step, ratio, share):
        return False
    locate_contacts(scene, work, NEW)
    update_slips(scene, work, share * step)
    # A long step may have run through a body: what came first shows only from the nearer end.
    resolution, depth = switch_resolutions(work, clock)
    return not may_switch(scene, work, share * step, resolution, depth)


def record_and_observe(scene, work, observed, clock, counts, record, needs_lists):
    """Record the accepted state and show it to the observer. Return a Status, or 0 to continue."""
    if record.shape[0] > 0:
        record_row(work, clock, counts, record)
    if needs_lists and any_too_deep(scene, work, NOW):
        return TOO_DEEP
    counts.code = observe(scene, work, observed, clock.time)
    return STOPPED if counts.code != 0 else 0


@apart
def advance(scene, work, observed, clock, counts, record):
    """Advance a run until a Status ends or pauses it.

    Call again to continue after PAUSED, RECORD_FULL or NO_ROOM. All state is in the arguments, so a
    pause changes nothing. ``record`` (k, 1 + 6n) receives every accepted step; one of length 0
    records nothing. ``observed`` is the observer's own array.
    """
    # Forces at the outline need lists; so do centre forces if not all pairs are watched.
    needs_lists = has(scene, CONTACT_FORCE) or scene.listed_reach > 0.0
    needs_lists = needs_lists or (has(scene, CENTRE_FORCE) and not lists_all_pairs(work))
    # The bound of the next trial [s], and the trials spent on the current switch.
    limit, trials = math.inf, 0
    while clock.time < clock.until:
        status = pause_reason(counts, record)
        if status != 0:
            return status
        # 1. Lists. A repeated trial starts from the same state: its lists are valid.
        if needs_lists and trials == 0 and not keep_lists(scene, work, clock.step):
            return NO_ROOM
        # 2. Attempt a step.
        hand_over(scene, work, clock, counts)
        renew_kicks(scene, work, clock)
        step = representable_step(clock, min(choose_step(scene, work, clock, needs_lists), limit))
        # Pairs that may share a surface force are fixed for the step, so that it stays smooth.
        if scene.listed_reach > 0.0:
            flag_near(scene, work, NOW, step)
        ratio = attempt(scene, work, clock, step)
        if work.tally.full != NOTHING_FULL:
            return NO_ROOM
        if ratio < 0.0 and clock.tolerance == math.inf:
            return NOT_FINITE
        # Reject: the error is too large, Newton failed, or the bodies moved out of the lists.
        too_far = needs_lists and 0.0 <= ratio <= 1.0 and went_too_far(scene, work, clock, step)
        if ratio < 0.0 or ratio > 1.0 or too_far:
            limit, trials = math.inf, 0
            if not reject(clock, counts, step, ratio, too_far):
                return STALLED
            continue
        # 3. Events. Grazing that ends right at the start: begin again in the other mode.
        if needs_lists and trials < MOST_TRIALS and end_grazing_early(scene, work, clock, step):
            counts.located += 1
            trials += 1
            clock.stages_step = 0.0
            continue
        # A series may span several swings of a contact: cut it at the first switch seen.
        if needs_lists and trials < MOST_TRIALS and work.tally.kind == SERIES:
            resolution, depth = switch_resolutions(work, clock)
            remaining = cut_series(scene, work, clock, step, resolution, depth)
            if remaining < 1.0:
                step *= remaining
                trials += 1
                locate_contacts(scene, work, NEW)
                update_slips(scene, work, step)
        # Locate the first switch. End the step there by interpolation, else by a shorter step.
        share = switch_share(scene, work, observed, clock, step) if needs_lists else math.inf
        if share < 1.0 and trials < MOST_TRIALS:
            trials += 1
            if not ends_early(scene, work, clock, step, ratio, share):
                limit = step_to_switch(scene, work, step, share, trials)
                counts.located += 1
                continue
            step *= share
        # Steps of fixed size are not repeated, however far they lead.
        if needs_lists and clock.tolerance == math.inf and any_passes_through(work):
            return TOO_DEEP
        # 4. Accept.
        was_flying = work.tally.kind == SERIES and not any_touching(work)
        planned = clock.step
        switched = accept(scene, work, clock, counts, step, needs_lists)
        # 5. Plan the next step.
        plan(scene, work, clock, step, ratio, trials > 0, switched)
        if switched and work.tally.kind == SERIES:
            plan_flight(work, clock, planned, was_flying)
        limit, trials = math.inf, 0
        status = record_and_observe(scene, work, observed, clock, counts, record, needs_lists)
        if status != 0:
            return status
        if stands_still(clock, counts, step):
            return STALLED
    return FINISHED


@apart
def clear(block):
    """Set an array of whole numbers, the memory of work arrays, to zero."""
    # Apart, as other code knows this memory by other names, and must not read it before.
    for word in range(block.shape[0]):
        block[word] = 0


def drive(scene, work, observed, clock, counts, record):
    """The same as an engine of its own, which shares its machine code with those that run many."""
    return advance(scene, work, observed, clock, counts, record)
