"""Events inside a step that is a series: a contact may oscillate more than once in it.

Contacts are sampled at times between which nothing oscillates by more than a quarter of a period. A
step with an event is cut at the first sample that shows it. The event is then located between the
ends of the shorter step, like any other (events/crossings.py).
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import locate_polygons, update_rotation
from flocsim.hooks import SLIP_LIMIT, contact_event, has
from flocsim.integrators.events.crossings import (
    any_too_deep,
    margin,
    margin_rate,
    may_dip,
    relative_speed_bound,
    share_of_minimum,
)
from flocsim.integrators.events.interpolation import end_within, interpolate
from flocsim.integrators.exponential.collocation import NODES
from flocsim.integrators.rhs.contact_stiffness import RESOLVED_PHASE
from flocsim.integrators.rhs.friction import excess_slip_rate, slip_limit_at, slip_of_motion
from flocsim.integrators.rhs.views import contact_view
from flocsim.state.contacts import CLOSED, OPEN
from flocsim.state.work import FIRST_STAGE, NEW, NOW, TRIAL

HALF_PERIOD = math.pi
"""Phase [rad] of the fastest vibration up to which the gaps at both ends of a step show whether a
contact has opened or closed. A part of a longer step is a quarter of a period at most."""

PART_DISPLACEMENT = 0.1
"""Largest displacement of two bodies in a part, over the radius of the smaller one."""


def parts_by_phase(scene, phase):
    """Return the number of parts that the phase of the fastest vibration requires."""
    # Sliding, and kinks of a law, may come and go within half a period.
    kinks = has(scene, SLIP_LIMIT) or scene.events > 0
    threshold_phase = RESOLVED_PHASE if kinks else HALF_PERIOD
    return 1 if phase <= threshold_phase else int(2.0 * phase / HALF_PERIOD) + 1


def place_bodies(work, step, share):
    """Place the bodies where they are at a fraction of the step, in TRIAL."""
    for body in range(work.place.shape[1]):
        interpolate(work, step, share, body)
        update_rotation(work, TRIAL, body)


def has_switched_in_trial(work, row, depth):
    """Return True if a pair has switched in TRIAL; an open one only if it overlaps by ``depth``
    [m]."""
    threshold = -depth if work.candidates[row].contact_mode == OPEN else 0.0
    return margin(work, TRIAL, row) < threshold


def has_changed_friction(scene, work, row, resolution):
    """Return True if a closed pair has begun or ceased to slide, or passed a kink of its law, in
    TRIAL."""
    if has(scene, SLIP_LIMIT):
        work.slip[TRIAL, row] = work.slip[NOW, row] + slip_of_motion(scene, work, TRIAL, row)
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
    # Margins at the start.
    for row in range(work.tally.candidates):
        contact = work.contacts[row]
        contact.sampled_margin = margin(work, NOW, row)
        contact.sampled_margin_rate = margin_rate(work, NOW, row)
    for part in range(1, parts + 1):
        low, high = (part - 1.0) / parts, part / parts
        # Test each pair at the end of the part, and at a minimum of its margin within the part.
        place_bodies(work, step, high)
        for row in range(work.tally.candidates):
            contact = work.contacts[row]
            locate_polygons(scene, work, TRIAL, row)
            value, rate = margin(work, TRIAL, row), margin_rate(work, TRIAL, row)
            if has_switched_in_trial(work, row, depth):
                return high
            if work.candidates[row].contact_mode == CLOSED and has_changed_friction(
                scene, work, row, resolution
            ):
                return high
            before, rate_before = contact.sampled_margin, contact.sampled_margin_rate
            span = step * (high - low)
            if may_dip(before, span * rate_before, value, span * rate):
                share = share_of_minimum(scene, work, step, row, low, high, rate_before, rate)
                if has_switched_in_trial(work, row, depth):
                    return share
                place_bodies(work, step, high)
            contact.sampled_margin, contact.sampled_margin_rate = value, rate
    return 1.0


def parts_by_displacement(scene, work, step):
    """Return the number of parts that displacements require: bodies may meet and part within a
    step."""
    parts, before = 1, -1
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.pair != before:
            before = candidate.pair
            a, b = candidate.vertex_body, candidate.edge_body
            speed = 0.5 * relative_speed_bound(scene, work, NOW, row)
            speed += 0.5 * relative_speed_bound(scene, work, NEW, row)
            size = min(scene.bodies[a].bounding_radius, scene.bodies[b].bounding_radius)
            parts = max(parts, int(step * speed / (PART_DISPLACEMENT * size)) + 1)
    return parts


def cut_series(scene, work, clock, step, resolution, depth):
    """Cut a series step at the first sample that shows an event; return the fraction that
    remains."""
    fraction = 1.0
    # Overlaps may be too deep for the contact law at the collocation points.
    for stage in range(2):
        if fraction == 1.0 and any_too_deep(scene, work, FIRST_STAGE + stage):
            fraction = NODES[stage]
    # Sampling only in steps that are long enough.
    parts = max(parts_by_phase(scene, clock.series_norm), parts_by_displacement(scene, work, step))
    if fraction == 1.0 and parts > 1:
        fraction = first_sampled_switch(scene, work, parts, step, resolution, depth)
    if fraction < 1.0:
        end_within(scene, work, step, 0.0, fraction)
    return fraction
