"""What happens within a step that is a series: contacts may swing more than once in it.

Whether a pair has touched, parted, slid or stuck in between is looked for at so many places in the
step that nothing swings by more than a quarter of a turn from one to the next. A step that has to
end is cut to the first place at which something is seen, and found exactly from its ends, as any
other (events/crossings.py).
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import locate_polygons, update_rotation
from flocsim.hooks import SLIP_LIMIT, contact_event, has
from flocsim.integrators.events.crossings import any_touching, is_too_deep, margin, margin_rate
from flocsim.integrators.exponential.collocation import NODES
from flocsim.integrators.exponential.series import shorten, write_at
from flocsim.integrators.rhs.friction import excess_slip_rate, rolled, slip_limit_at
from flocsim.integrators.rhs.views import contact_view, lever, normal_rate
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.contacts import CLOSED, OPEN
from flocsim.state.work import FIRST_STAGE, MOTION, NEW, NOW, TRIAL

A_PART = 1.6
"""Rates times the length of a part: what vibrates swings by a quarter of a turn in it."""

A_WAY = 0.1
"""Bodies come past each other by so much of the smaller one in a part."""

PLAIN = 3.0
"""In a step so long it swings by half a turn, and gaps at both ends tell whether a pair has
switched."""

SOON = 1e-3
"""How the rate changes with which a pair parts is seen in this share of a step."""

BEHIND = 1.5
"""Whether a pair that has parted is back is first looked for so many times as far in a step as it
were if it was slowed down evenly."""

TRIES = 6
"""Places at which the least margin in a part of the step is looked for."""


def parts_of(scene, turns):
    """Into how many parts a step is divided in which the fastest rate comes so far; friction, and a
    law's kinks, may come and go within half a turn."""
    plain = 1.0 if has(scene, SLIP_LIMIT) or scene.events > 0 else PLAIN
    return 1 if turns <= plain else int(turns / A_PART) + 1


def write_ways(scene, work, terms):
    """Write how far a body's points move at most in the step [m], into its Pose."""
    for body in range(work.place.shape[1]):
        way = 0.0
        for axis in range(3):
            size = lever(scene, body, axis)
            for k in range(1, terms):
                way += size * abs(work.series[MOTION, k, body, axis])
        work.poses[body].series_displacement = way


def may_meet(work, row):
    """Whether a pair may come to where it switches in the step, or rub otherwise."""
    candidate = work.candidates[row]
    if candidate.contact_mode == CLOSED:
        return True
    a, b = candidate.vertex_body, candidate.edge_body
    return (
        margin(work, NOW, row)
        <= work.poses[a].series_displacement + work.poses[b].series_displacement
    )


def look(scene, work, terms, step, share):
    """Put the bodies where they are at a share of the step, in TRIAL."""
    write_at(work, NOW, terms, step, share, TRIAL, 0, work.place.shape[1])
    for body in range(work.place.shape[1]):
        update_rotation(work, TRIAL, body)


def has_switched(work, row, depth):
    """Whether a pair has in TRIAL: one that was apart where it is so deep there [m]."""
    least = -depth if work.candidates[row].contact_mode == OPEN else 0.0
    return margin(work, TRIAL, row) < least


def lowest(scene, work, terms, step, low, high, row, depth):
    """Where between two shares of the step a row, the margin of which falls at the first and rises
    at the second, has switched; 2 where it has not."""
    contact = work.contacts[row]
    rate_low, rate_high = contact.sampled_margin_rate, margin_rate(work, TRIAL, row)
    span = step * (high - low)
    if min(contact.sampled_margin + 0.5 * span * rate_low,
           margin(work, TRIAL, row) - 0.5 * span * rate_high) >= 0.0:  # fmt: skip
        return 2.0
    for _ in range(TRIES):
        share = (low * rate_high - high * rate_low) / (rate_high - rate_low)
        look(scene, work, terms, step, share)
        locate_polygons(scene, work, TRIAL, row)
        if has_switched(work, row, depth):
            return share
        rate = margin_rate(work, TRIAL, row)
        if rate < 0.0:
            low, rate_low = share, rate
        else:
            high, rate_high = share, rate
    return 2.0


def rubs_otherwise(scene, work, row, resolution):
    """Whether a closed pair slides that has stuck, sticks that has slid, or has passed a kink of
    its law in TRIAL."""
    if has(scene, SLIP_LIMIT):
        work.slip[TRIAL, row] = work.slip[NOW, row] + rolled(scene, work, TRIAL, row)
        side = work.candidates[row].slide_direction
        if side == 0:
            beyond = abs(work.slip[TRIAL, row]) - slip_limit_at(scene, work, TRIAL, row)
            if beyond > resolution:
                return True
        elif excess_slip_rate(scene, work, TRIAL, row, side) < 0.0:
            return True
    for which in range(scene.events):
        before = contact_event(scene, contact_view(scene, work, NOW, row), which)
        if before * contact_event(scene, contact_view(scene, work, TRIAL, row), which) < 0.0:
            return True
    return False


@apart
def first_seen(scene, work, parts, step, resolution, depth):
    """The first share of a step at which something is seen to have switched; 1 where nothing is
    before its end."""
    terms = work.tally.series_terms
    write_ways(scene, work, terms)
    for row in range(work.tally.candidates):
        contact = work.contacts[row]
        contact.sampled_margin = margin(work, NOW, row)
        contact.sampled_margin_rate = margin_rate(work, NOW, row)
    for part in range(1, parts + 1):
        low, high = (part - 1.0) / parts, part / parts
        look(scene, work, terms, step, high)
        for row in range(work.tally.candidates):
            contact = work.contacts[row]
            if not may_meet(work, row):
                continue
            locate_polygons(scene, work, TRIAL, row)
            value, rate = margin(work, TRIAL, row), margin_rate(work, TRIAL, row)
            if has_switched(work, row, depth):
                return high
            if work.candidates[row].contact_mode == CLOSED and rubs_otherwise(
                scene, work, row, resolution
            ):
                return high
            if contact.sampled_margin_rate < 0.0 < rate:
                share = lowest(scene, work, terms, step, low, high, row, depth)
                if share <= 1.0:
                    return share
                look(scene, work, terms, step, high)
            contact.sampled_margin, contact.sampled_margin_rate = value, rate
    return 1.0


def first_too_deep(scene, work):
    """The first point of the collocation at which a pair that touches is too deep for its law; 1
    where none is before the end."""
    for stage in range(2):
        for row in range(work.tally.candidates):
            any_touching = work.candidates[row].contact_mode == CLOSED
            if any_touching and is_too_deep(scene, work, FIRST_STAGE + stage, row):
                return NODES[stage]
    return 1.0


def parts_of_way(scene, work):
    """Into how many parts a step is divided in which bodies come so far past each other: where
    none touch, they may meet, and be apart again at its end."""
    parts, before = 1, -1
    if any_touching(work):
        return parts
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        pair = candidate.pair
        if pair != before:
            before = pair
            a, b = candidate.vertex_body, candidate.edge_body
            way = abs(way_of(work, a, X) - way_of(work, b, X))
            way += abs(way_of(work, a, Y) - way_of(work, b, Y))
            way += abs(way_of(work, a, ANGLE)) * scene.bodies[a].bounding_radius
            way += abs(way_of(work, b, ANGLE)) * scene.bodies[b].bounding_radius
            size = min(scene.bodies[a].bounding_radius, scene.bodies[b].bounding_radius)
            parts = max(parts, int(way / (A_WAY * size)) + 1)
    return parts


def way_of(work, body, axis):
    """By how much a body's place changes in the step [m or rad]."""
    return work.place[NEW, body, axis] - work.place[NOW, body, axis]


def has_parted(work, step, row):
    """Whether a pair is apart, and goes further than it is in a step."""
    way = step * normal_rate(work, NOW, row)
    return work.candidates[row].contact_mode == OPEN and way > work.geometry[NOW, row].gap


def share_to_return(scene, work, step):
    """The share of a step at which the first pair that has parted would be back if it was slowed
    down evenly; inf where none would."""
    earliest, looked = math.inf, False
    for row in range(work.tally.candidates):
        if has_parted(work, step, row):
            if not looked:
                look(scene, work, work.tally.series_terms, step, SOON)
                looked = True
            locate_polygons(scene, work, TRIAL, row)
            rate = normal_rate(work, NOW, row)
            slower = rate - normal_rate(work, TRIAL, row)
            if slower > 0.0:
                earliest = min(earliest, 2.0 * SOON * rate / slower)
    return earliest


def first_return(scene, work, step, depth):
    """The first share of a step at which a pair that has parted is seen to be back; 1 where none
    is. In a long step it may pass through the other body, and be apart at its end."""
    share = BEHIND * share_to_return(scene, work, step)
    while share < 1.0:
        look(scene, work, work.tally.series_terms, step, share)
        for row in range(work.tally.candidates):
            if has_parted(work, step, row):
                locate_polygons(scene, work, TRIAL, row)
                if has_switched(work, row, depth):
                    return share
        share *= 2.0
    return 1.0


def cut(scene, work, clock, step, resolution, depth):
    """End a step that is a series where something is first seen to have switched; the share of it
    that is left."""
    terms = work.tally.series_terms
    share = min(first_too_deep(scene, work), first_return(scene, work, step, depth))
    parts = max(parts_of(scene, clock.series_norm), parts_of_way(scene, work))
    if share == 1.0 and parts > 1:
        share = first_seen(scene, work, parts, step, resolution, depth)
    if share < 1.0:
        shorten(work, terms, share)
        clock.stages_step *= share
        clock.series_step = clock.stages_step
        write_at(work, NOW, terms, share * step, 1.0, NEW, 0, work.place.shape[1])
    return share
