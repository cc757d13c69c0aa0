"""Location of touches and partings inside a step, and of contacts that take over from others.

The margin of a pair, its gap while open or its overlap while closed, must not fall below zero while
its mode holds. The motion in the step is interpolated, and the first zero of a margin is located by
regula falsi (Illinois variant; Dowell & Jarratt 1971). The driver then ends the step there.

Two contacts under attraction. Where outlines attract each other, the attraction acts through their
deepest contact, since the length over which it is distributed (rhs/surface_gap.py) is far below an
overlap, and presses that one deeper still. So two contacts have two positions of rest, one with
either of them pressed, and bodies pass from one to the other only if driven. A step much longer
than the contact's vibration ends at whichever it is led to by numerical damping, and its error
estimate may be below the tolerance, so that the bodies roll the wrong way. Such a step is repeated
until it is short compared to the vibration, or the contacts change little.
"""

import math

from flocsim.constants import DEEPEST_OVERLAP
from flocsim.geometry.contact.points import locate_polygons, update_rotation
from flocsim.integrators.events.interpolation import interpolate
from flocsim.integrators.events.resolution import release_resolution, touch_resolution
from flocsim.integrators.rhs.contact_stiffness import RESOLVED_PHASE, secant_stiffness
from flocsim.integrators.rhs.surface_gap import least_row, pair_end
from flocsim.integrators.rhs.views import contact_view, normal_rate, velocity_lifetime_of
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.clock import SERIES
from flocsim.state.contacts import CLOSED, GRAZING, OPEN
from flocsim.state.work import NEW, NOW, TRIAL

DEEPEST_OF_OUTLINES = 0.45
"""Deepest overlap where forces act along outlines, over the smaller spheroradius: at one half, the
attraction of outlines that are moved apart (rhs/outline_sum.py) has a pole."""

MOST_ITERATIONS = 60
"""Evaluations in the search for one switch."""


def margin(work, state, row):
    """Return the gap of a pair that is open now, or the overlap of a closed one [m].

    The pair has switched where this is negative. Pairs that graze have no margin (inf).
    """
    gap = work.geometry[state, row].gap
    if work.candidates[row].contact_mode == GRAZING:
        return math.inf
    return -gap if work.geometry[NOW, row].gap < 0.0 else gap


def margin_rate(work, state, row):
    """Return the rate of change of the margin [m/s]."""
    rate = normal_rate(work, state, row)
    if work.candidates[row].contact_mode == GRAZING:
        return 0.0
    return -rate if work.geometry[NOW, row].gap < 0.0 else rate


def any_too_deep(scene, work, state):
    """Return True if a closed pair overlaps past the limit of the contact law, or of forces along
    outlines, in a state."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        limit = DEEPEST_OVERLAP * (candidate.vertex_radius + candidate.edge_radius)
        if scene.outlines[0] > 0.0:
            smaller = min(candidate.vertex_radius, candidate.edge_radius)
            limit = min(limit, max(DEEPEST_OF_OUTLINES * smaller, scene.outlines[1]))
        if candidate.contact_mode == CLOSED and -work.geometry[state, row].gap > limit:
            return True
    return False


def margin_at(scene, work, step, share, row):
    """Locate a pair at a fraction of the step, in TRIAL; return its margin [m]."""
    candidate = work.candidates[row]
    for body in (candidate.vertex_body, candidate.edge_body):
        interpolate(work, step, share, body)
        update_rotation(work, TRIAL, body)
    locate_polygons(scene, work, TRIAL, row)
    return margin(work, TRIAL, row)


def may_dip(at_start, start_rate, at_end, end_rate):
    """Return True if a margin may be below zero inside an interval though it is not at its ends.

    ``start_rate`` and ``end_rate`` are its changes over the interval at the rates of both ends [m].
    """
    # A minimum inside needs a margin that falls at the start and rises at the end; the tangents at
    # both ends bound a convex margin from below.
    falls_and_rises = start_rate < 0.0 < end_rate
    return falls_and_rises and min(at_start + 0.5 * start_rate, at_end - 0.5 * end_rate) <= 0.0


def may_dip_below(work, step, row, level):
    """Return True if the margin may be below a level [m] inside the step though it is not at its
    ends."""
    return may_dip(
        margin(work, NOW, row) - level, step * margin_rate(work, NOW, row),
        margin(work, NEW, row) - level, step * margin_rate(work, NEW, row),
    )  # fmt: skip


def relative_speed_bound(scene, work, state, row):
    """Return a bound of the relative speed of any two points of a pair's bodies [m/s]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    speed = abs(work.velocity[state, a, X] - work.velocity[state, b, X])
    speed += abs(work.velocity[state, a, Y] - work.velocity[state, b, Y])
    speed += abs(work.velocity[state, a, ANGLE]) * scene.bodies[a].bounding_radius
    return speed + abs(work.velocity[state, b, ANGLE]) * scene.bodies[b].bounding_radius


def share_of_minimum(scene, work, step, row, low, high, rate_low, rate_high):
    """Return the fraction of the step at which the margin is least, and locate the pair there in
    TRIAL.

    Between the fractions ``low``, where the margin falls, and ``high``, where it rises, at these
    rates.
    """
    share = high
    for _ in range(8):
        # Regula falsi on the rate, kept away from the ends of the bracket.
        share = (low * rate_high - high * rate_low) / (rate_high - rate_low)
        share = min(max(share, 0.9 * low + 0.1 * high), 0.1 * low + 0.9 * high)
        margin_at(scene, work, step, share, row)
        rate = margin_rate(work, TRIAL, row)
        if rate < 0.0:
            low, rate_low = share, rate
        else:
            high, rate_high = share, rate
        if step * abs(rate) * (high - low) < 1e-15:
            break
    return share


def share_of_dip(scene, work, step, row, level):
    """Return the fraction of the step at which the margin is least, and locate the pair there in
    TRIAL.

    inf if no minimum lies inside the step, or if it cannot be below ``level`` [m].
    """
    if not may_dip_below(work, step, row, level):
        return math.inf
    falling, rising = margin_rate(work, NOW, row), margin_rate(work, NEW, row)
    return share_of_minimum(scene, work, step, row, 0.0, 1.0, falling, rising)


def locate_crossing(scene, work, step, row, high, at_high, resolution):
    """Return the fraction of the step at which the margin is just below zero.

    The margin is ``at_high`` [m], negative, at the fraction ``high``. Aims half the resolution past
    zero, so that the pair has switched there.
    """
    low, target = 0.0, 0.5 * resolution
    at_low = margin(work, NOW, row) + target
    at_high += target
    side = 0
    share = high
    for _ in range(MOST_ITERATIONS):
        share = (low * at_high - high * at_low) / (at_high - at_low)
        # Rounding: bisect.
        if not low < share < high:
            share = 0.5 * (low + high)
        value = margin_at(scene, work, step, share, row) + target
        if abs(value) <= 0.25 * resolution or high - low < 1e-15:
            break
        # Illinois: halve the value of an end that stays, so that both ends close in.
        if value > 0.0:
            at_high = 0.5 * at_high if side == 1 else at_high
            low, at_low, side = share, value, 1
        else:
            at_low = 0.5 * at_low if side == -1 else at_low
            high, at_high, side = share, value, -1
    return share


def keeps_approaching(work, step, row, depth):
    """Return True if an open pair that overlaps at the end of a step will go deeper by ``depth``
    [m].

    A pair that is only brushed turns around by itself, speed²/(2 deceleration) deeper.
    """
    speed = -normal_rate(work, NEW, row)
    if speed * step > depth:
        return True
    deceleration = (-normal_rate(work, NOW, row) - speed) / step
    # It would within its velocity lifetime, unless the present deceleration stops it before.
    persists = speed * velocity_lifetime_of(work, row) > depth
    return persists and speed * speed > 2.0 * deceleration * depth


def switch_tolerance(scene, work, step, row, resolution, depth):
    """Return how far past its switch a pair may be at the end of a step without ending it [m]."""
    before, after = work.geometry[NOW, row].gap, work.geometry[NEW, row].gap
    # A release, a real collision, or a graze that may be left unnoticed.
    if before < 0.0 <= after:
        return release_resolution(scene, work, step, row, resolution)
    if before >= 0.0 > after and keeps_approaching(work, step, row, depth):
        return touch_resolution(scene, work, NEW, row, resolution)
    return depth


def earlier_switch(scene, work, step, row, earliest, resolution, depth):
    """Return the earlier of the switch of a row and the earliest so far, as fractions of the
    step."""
    high, limit = min(earliest, 1.0), switch_tolerance(scene, work, step, row, resolution, depth)
    resolution = min(resolution, limit)
    # No switch at the end of the step: look for one that comes and goes within it.
    if margin(work, NEW, row) >= -limit:
        lowest = share_of_dip(scene, work, step, row, 0.0)
        if lowest > high:
            return earliest
        high = lowest
        if work.tally.kind == SERIES and work.geometry[NOW, row].gap < 0.0:
            # It opened in between; a law that ends there pulled it shut again.
            limit = resolution
    # The switch lies before ``high``, where the margin must be negative.
    at_high = margin_at(scene, work, step, high, row)
    if at_high >= -limit:
        return earliest
    return locate_crossing(scene, work, step, row, high, at_high, resolution)


def may_switch(scene, work, step, resolution, depth):
    """Return True if a pair may switch before the end of a step, as far as both ends show."""
    for row in range(work.tally.candidates):
        limit = switch_tolerance(scene, work, step, row, resolution, depth)
        if margin(work, NEW, row) < -limit or may_dip_below(work, step, row, 0.0):
            return True
    return False


def passes_through_reach(scene, work, step, depth):
    """Return True if a pair came into reach of a surface force inside a step whose ends are both
    outside.

    Only passages by more than ``depth`` [m] count. All stages of the step may have missed it.
    """
    reach, g = scene.surface_reach, work.geometry
    if reach <= 0.0:
        return False
    for row in range(work.tally.candidates):
        if (
            min(g[NOW, row].gap, g[NEW, row].gap) > reach
            and share_of_dip(scene, work, step, row, reach) < 1.0
            and g[TRIAL, row].gap < reach - depth
        ):
            return True
    return False


def any_touching(work):
    """Return True if any listed pair is in contact."""
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode != OPEN:
            return True
    return False


def changes_sides(work):
    """Return True if a vertex has passed from one side of an edge to the other in a step across
    switches.

    Both ends may be open then; without this check bodies fell through floors thinner than a step.
    """
    g = work.geometry
    for row in range(work.tally.candidates):
        # The normals at both ends point in opposite directions.
        along = g[NOW, row].normal_x * g[NEW, row].normal_x
        along += g[NOW, row].normal_y * g[NEW, row].normal_y
        if along < 0.0:
            return True
    return False


def any_passes_through(work):
    """Return True if a vertex has passed through an edge, from one side of it to the other, in a
    step of fixed size."""
    g = work.geometry
    for row in range(work.tally.candidates):
        inside = g[NOW, row].turning == 0.0 and g[NEW, row].turning == 0.0
        if inside and g[NOW, row].side != g[NEW, row].side:
            return True
    return False


def first_switch(scene, work, step, resolution, depth):
    """Return the fraction of the step at which the first mode must change; inf if none has to.

    Expects the geometry of NOW and of NEW. A violation by less than ``depth`` [m] does not count;
    one that counts is located to ``resolution`` [m].
    """
    earliest, before, shift, end_shift = math.inf, -1, 0.0, 0.0
    for row in range(work.tally.candidates):
        pair = work.candidates[row].pair
        # Bounds of the displacement from either end to the middle of the step, the same for all
        # rows of a pair.
        if pair != before:
            before = pair
            shift = 0.5 * step * relative_speed_bound(scene, work, NOW, row)
            end_shift = 0.5 * step * relative_speed_bound(scene, work, NEW, row)
        # Pairs further from a switch than that need no search.
        if not (margin(work, NOW, row) > shift and margin(work, NEW, row) > end_shift):
            earliest = earlier_switch(scene, work, step, row, earliest, resolution, depth)
    return earliest


OVERTAKE_FRACTION = 0.25
"""A contact has overtaken another if their order changes by this fraction of both their
overlaps."""


def overtakes(work, old, new):
    """Return True if a contact, the deepest of two bodies at the end of the step, has clearly
    overtaken ``old``, the deepest at its start."""
    g = work.geometry
    old_overlap, new_overlap = -g[NOW, old].gap, -g[NEW, new].gap
    # Sum of the leads that the old deepest contact had at the start and the new one has at the end.
    shift = min(g[NOW, new].gap, 0.0) + old_overlap + min(g[NEW, old].gap, 0.0) + new_overlap
    clear = shift > OVERTAKE_FRACTION * (old_overlap + new_overlap)
    return clear and old != new and min(old_overlap, new_overlap) > 0.0


def any_overtakes(scene, work, clock, step):
    """Return True if a contact has overtaken another of the same bodies in a step too long to
    resolve it."""
    row = 0
    while row < work.tally.candidates:
        end = pair_end(work, row)
        old, new = least_row(work, NOW, row, end), least_row(work, NEW, row, end)
        if overtakes(work, old, new):
            view = contact_view(scene, work, NOW, old)
            stiffness = secant_stiffness(scene, view, clock.tolerance)
            # h ω0 > RESOLVED_PHASE.
            if step * step * stiffness > RESOLVED_PHASE * RESOLVED_PHASE * view.effective_mass:
                return True
        row = end
    return False
