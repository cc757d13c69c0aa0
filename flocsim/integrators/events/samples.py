"""Events inside a step that is a series: a contact may oscillate more than once in it.

Contacts are sampled at times between which nothing oscillates by more than a quarter of a period. A
step with an event is cut at the first sample that shows it. The event is then located between the
ends of the shorter step, like any other (events/crossings.py).
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import locate_polygons, update_rotation
from flocsim.hooks import SLIP_LIMIT, contact_event, has
from flocsim.integrators.events.crossings import any_touching, is_too_deep, margin, margin_rate
from flocsim.integrators.exponential.collocation import NODES
from flocsim.integrators.exponential.series import evaluate_at, rescale
from flocsim.integrators.rhs.friction import excess_slip_rate, rolled, slip_limit_at
from flocsim.integrators.rhs.views import contact_view, lever, normal_rate
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.contacts import CLOSED, OPEN
from flocsim.state.work import FIRST_STAGE, MOTION, NEW, NOW, TRIAL

PART_PHASE = 1.6
"""Phase [rad] of the fastest vibration in a part of the step: about a quarter of a period."""

PART_DISPLACEMENT = 0.1
"""Largest displacement of two bodies in a part, over the radius of the smaller one."""

UNSAMPLED_PHASE = 3.0
"""Phase [rad] of the fastest vibration, half a period, up to which the gaps at both ends show
whether a contact has opened or closed."""

PROBE_FRACTION = 1e-3
"""Fraction of the step over which the deceleration of an opening pair is measured."""

RETURN_MARGIN = 1.5
"""A pair that has opened is first looked for at this multiple of its estimated return time."""

MAX_TRIALS = 6
"""Trials by which the minimum of a gap within a part of the step is searched."""


def parts_by_phase(scene, phase):
    """Return the number of parts that the phase of the fastest vibration requires."""
    # Sliding, and kinks of a law, may come and go within half a period.
    threshold_phase = 1.0 if has(scene, SLIP_LIMIT) or scene.events > 0 else UNSAMPLED_PHASE
    return 1 if phase <= threshold_phase else int(phase / PART_PHASE) + 1


def write_path_bounds(scene, work, terms):
    """Write an upper bound of the path of each body's points in the step [m]."""
    for body in range(work.place.shape[1]):
        displacement = 0.0
        for axis in range(3):
            size = lever(scene, body, axis)
            for k in range(1, terms):
                displacement += size * abs(work.series[MOTION, k, body, axis])
        work.poses[body].series_displacement = displacement


def may_switch_in_step(work, row):
    """Return True if a pair is closed, or comes near enough to switch in the step."""
    candidate = work.candidates[row]
    if candidate.contact_mode == CLOSED:
        return True
    a, b = candidate.vertex_body, candidate.edge_body
    return (
        margin(work, NOW, row)
        <= work.poses[a].series_displacement + work.poses[b].series_displacement
    )


def place_bodies(scene, work, terms, step, fraction):
    """Place the bodies where they are at a fraction of the step, in TRIAL."""
    evaluate_at(work, NOW, terms, step, fraction, TRIAL, 0, work.place.shape[1])
    for body in range(work.place.shape[1]):
        update_rotation(work, TRIAL, body)


def has_switched_in_trial(work, row, depth):
    """Return True if a pair has switched in TRIAL; an open one only if it overlaps by ``depth``
    [m]."""
    threshold = -depth if work.candidates[row].contact_mode == OPEN else 0.0
    return margin(work, TRIAL, row) < threshold


def switch_near_minimum(scene, work, terms, step, low, high, row, depth):
    """Return the fraction, between two samples, at which a margin is below zero near its minimum;
    or 2.

    The margin falls at the first sample and rises at the second (rates of opposite sign).
    """
    contact = work.contacts[row]
    rate_low, rate_high = contact.sampled_margin_rate, margin_rate(work, TRIAL, row)
    # Along the tangents at both ends the margin stays positive up to the middle: no search is
    # needed.
    span = step * (high - low)
    if min(contact.sampled_margin + 0.5 * span * rate_low,
           margin(work, TRIAL, row) - 0.5 * span * rate_high) >= 0.0:  # fmt: skip
        return 2.0
    for _ in range(MAX_TRIALS):
        # Secant step on the rate.
        fraction = (low * rate_high - high * rate_low) / (rate_high - rate_low)
        place_bodies(scene, work, terms, step, fraction)
        locate_polygons(scene, work, TRIAL, row)
        if has_switched_in_trial(work, row, depth):
            return fraction
        rate = margin_rate(work, TRIAL, row)
        if rate < 0.0:
            low, rate_low = fraction, rate
        else:
            high, rate_high = fraction, rate
    return 2.0


def has_changed_friction(scene, work, row, resolution):
    """Return True if a closed pair has begun or ceased to slide, or passed a kink of its law, in
    TRIAL."""
    if has(scene, SLIP_LIMIT):
        work.slip[TRIAL, row] = work.slip[NOW, row] + rolled(scene, work, TRIAL, row)
        # A sticking pair slides beyond its limit; a sliding one sticks where it would fall below.
        side = work.candidates[row].slide_direction
        if side == 0:
            beyond = abs(work.slip[TRIAL, row]) - slip_limit_at(scene, work, TRIAL, row)
            if beyond > resolution:
                return True
        elif excess_slip_rate(scene, work, TRIAL, row, side) < 0.0:
            return True
    # The events of a law change sign at its kinks.
    for which in range(scene.events):
        before = contact_event(scene, contact_view(scene, work, NOW, row), which)
        if before * contact_event(scene, contact_view(scene, work, TRIAL, row), which) < 0.0:
            return True
    return False


@apart
def first_sampled_switch(scene, work, parts, step, resolution, depth):
    """Return the first fraction of the step at which a sample shows an event; 1 if none before its
    end."""
    terms = work.tally.series_terms
    write_path_bounds(scene, work, terms)
    # Margins at the start.
    for row in range(work.tally.candidates):
        contact = work.contacts[row]
        contact.sampled_margin = margin(work, NOW, row)
        contact.sampled_margin_rate = margin_rate(work, NOW, row)
    for part in range(1, parts + 1):
        low, high = (part - 1.0) / parts, part / parts
        # Test each pair at the end of the part, and at a minimum of its margin within the part.
        place_bodies(scene, work, terms, step, high)
        for row in range(work.tally.candidates):
            contact = work.contacts[row]
            if not may_switch_in_step(work, row):
                continue
            locate_polygons(scene, work, TRIAL, row)
            value, rate = margin(work, TRIAL, row), margin_rate(work, TRIAL, row)
            if has_switched_in_trial(work, row, depth):
                return high
            if work.candidates[row].contact_mode == CLOSED and has_changed_friction(
                scene, work, row, resolution
            ):
                return high
            if contact.sampled_margin_rate < 0.0 < rate:
                fraction = switch_near_minimum(scene, work, terms, step, low, high, row, depth)
                if fraction <= 1.0:
                    return fraction
                place_bodies(scene, work, terms, step, high)
            contact.sampled_margin, contact.sampled_margin_rate = value, rate
    return 1.0


def first_too_deep(scene, work):
    """Return the first collocation point with an overlap too deep for the contact law; 1 if
    none."""
    for stage in range(2):
        for row in range(work.tally.candidates):
            closed = work.candidates[row].contact_mode == CLOSED
            if closed and is_too_deep(scene, work, FIRST_STAGE + stage, row):
                return NODES[stage]
    return 1.0


def parts_by_displacement(scene, work):
    """Return the number of parts that displacements require: bodies may meet and part within a
    step."""
    parts, before = 1, -1
    if any_touching(work):
        return parts
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        pair = candidate.pair
        if pair != before:
            before = pair
            a, b = candidate.vertex_body, candidate.edge_body
            displacement = abs(displacement_of(work, a, X) - displacement_of(work, b, X))
            displacement += abs(displacement_of(work, a, Y) - displacement_of(work, b, Y))
            displacement += abs(displacement_of(work, a, ANGLE)) * scene.bodies[a].bounding_radius
            displacement += abs(displacement_of(work, b, ANGLE)) * scene.bodies[b].bounding_radius
            size = min(scene.bodies[a].bounding_radius, scene.bodies[b].bounding_radius)
            parts = max(parts, int(displacement / (PART_DISPLACEMENT * size)) + 1)
    return parts


def displacement_of(work, body, axis):
    """Return the change of a coordinate in the step [m or rad]."""
    return work.place[NEW, body, axis] - work.place[NOW, body, axis]


def passes_its_gap(work, step, row):
    """Return True if an open pair moves apart by more than its gap in the step."""
    displacement = step * normal_rate(work, NOW, row)
    return work.candidates[row].contact_mode == OPEN and displacement > work.geometry[NOW, row].gap


def estimated_return(scene, work, step):
    """Return the fraction at which the first pair that opens widely would be back, or inf if none
    would.

    At constant deceleration.
    """
    earliest, placed = math.inf, False
    for row in range(work.tally.candidates):
        if passes_its_gap(work, step, row):
            # Place the bodies once, for all pairs.
            if not placed:
                place_bodies(scene, work, work.tally.series_terms, step, PROBE_FRACTION)
                placed = True
            locate_polygons(scene, work, TRIAL, row)
            # The gap returns after 2 v/a.
            rate = normal_rate(work, NOW, row)
            rate_drop = rate - normal_rate(work, TRIAL, row)
            if rate_drop > 0.0:
                earliest = min(earliest, 2.0 * PROBE_FRACTION * rate / rate_drop)
    return earliest


def first_return(scene, work, step, depth):
    """Return the first fraction at which a pair that had opened is seen closed again; 1 if none.

    In a long step it may pass through the other body, and be apart again at its end.
    """
    fraction = RETURN_MARGIN * estimated_return(scene, work, step)
    # Look at ever longer times, doubling them.
    while fraction < 1.0:
        place_bodies(scene, work, work.tally.series_terms, step, fraction)
        for row in range(work.tally.candidates):
            if passes_its_gap(work, step, row):
                locate_polygons(scene, work, TRIAL, row)
                if has_switched_in_trial(work, row, depth):
                    return fraction
        fraction *= 2.0
    return 1.0


def cut(scene, work, clock, step, resolution, depth):
    """Cut a series step at the first sample that shows an event; return the fraction that
    remains."""
    terms = work.tally.series_terms
    # Cheap tests first; sampling only in steps that are long enough.
    fraction = min(first_too_deep(scene, work), first_return(scene, work, step, depth))
    parts = max(parts_by_phase(scene, clock.series_norm), parts_by_displacement(scene, work))
    if fraction == 1.0 and parts > 1:
        fraction = first_sampled_switch(scene, work, parts, step, resolution, depth)
    if fraction < 1.0:
        # The series, and everything that follows from it, is that of the shorter step from now on.
        rescale(work, terms, fraction)
        clock.stages_step *= fraction
        clock.series_step = clock.stages_step
        evaluate_at(work, NOW, terms, fraction * step, 1.0, NEW, 0, work.place.shape[1])
    return fraction
