"""What happens within a step that is a series: contacts may swing more than once in it.

Whether a pair has touched, parted, slid or stuck in between is looked for at so many places in the
step that nothing swings by more than a quarter of a turn from one to the next. A step that has to
end is cut to the first place at which something is seen, and found exactly from its ends, as any
other (events/crossings.py).
"""

import flocsim.arrays as at
from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import locate_polygons, turn_body
from flocsim.hooks import SLIP_LIMIT, contact_event, has
from flocsim.integrators.events.crossings import is_too_deep, margin, margin_rate
from flocsim.integrators.exponential.collocation import NODES
from flocsim.integrators.exponential.series import shorten, write_at
from flocsim.integrators.rhs.friction import limit_in, outgrowth, rolled
from flocsim.integrators.rhs.views import contact_view, lever

A_PART = 1.6
"""Rates times the length of a part: what vibrates swings by a quarter of a turn in it."""

PLAIN = 3.0
"""In a step so long it swings by half a turn, and gaps at both ends tell whether a pair has
switched."""

TRIES = 6
"""Places at which the least margin in a part of the step is looked for."""


def parts_of(scene, turns):
    """Into how many parts a step is divided in which the fastest rate comes so far; friction, and a
    law's kinks, may come and go within half a turn."""
    plain = 1.0 if has(scene, SLIP_LIMIT) or scene.events > 0 else PLAIN
    return 1 if turns <= plain else int(turns / A_PART) + 1


def write_ways(scene, work, terms):
    """Write how far a body's points move at most in the step [m], into WAY."""
    for body in range(work.motion.shape[1]):
        way = 0.0
        for axis in range(3):
            size = lever(scene, body, axis)
            for k in range(1, terms):
                way += size * abs(work.series[at.MOTION, k, body, axis])
        work.bodies[body, at.WAY] = way


def may_meet(work, row):
    """Whether a pair may come to where it switches in the step, or rub otherwise."""
    if work.candidates[row, at.CLOSED] == at.TOUCHES:
        return True
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    return margin(work, at.NOW, row) <= work.bodies[a, at.WAY] + work.bodies[b, at.WAY]


def look(scene, work, terms, step, share):
    """Put the bodies where they are at a share of the step, in TRIAL."""
    write_at(work, at.NOW, terms, step, share, at.TRIAL, 0, work.motion.shape[1])
    for body in range(work.motion.shape[1]):
        turn_body(work, at.TRIAL, body)


def lowest(scene, work, terms, step, low, high, row):
    """Where between two shares of the step the margin of a row, which falls at the first and rises
    at the second, is below 0; 2 where it is not."""
    rate_low, rate_high = work.slip[at.SAMPLED_RATE, row], margin_rate(work, at.TRIAL, row)
    span = step * (high - low)
    if min(work.slip[at.SAMPLED, row] + 0.5 * span * rate_low,
           margin(work, at.TRIAL, row) - 0.5 * span * rate_high) >= 0.0:  # fmt: skip
        return 2.0
    for _ in range(TRIES):
        share = (low * rate_high - high * rate_low) / (rate_high - rate_low)
        look(scene, work, terms, step, share)
        locate_polygons(scene, work, at.TRIAL, row)
        if margin(work, at.TRIAL, row) < 0.0:
            return share
        rate = margin_rate(work, at.TRIAL, row)
        if rate < 0.0:
            low, rate_low = share, rate
        else:
            high, rate_high = share, rate
    return 2.0


def rubs_otherwise(scene, work, row, resolution):
    """Whether a closed pair slides that has stuck, sticks that has slid, or has passed a kink of
    its law in TRIAL."""
    if has(scene, SLIP_LIMIT):
        work.slip[at.TRIAL, row] = work.slip[at.NOW, row] + rolled(scene, work, at.TRIAL, row)
        side = work.candidates[row, at.SLIDING]
        if side == 0:
            beyond = abs(work.slip[at.TRIAL, row]) - limit_in(scene, work, at.TRIAL, row)
            if beyond > resolution:
                return True
        elif outgrowth(scene, work, at.TRIAL, row, side) < 0.0:
            return True
    for which in range(scene.events):
        before = contact_event(scene, contact_view(scene, work, at.NOW, row), which)
        if before * contact_event(scene, contact_view(scene, work, at.TRIAL, row), which) < 0.0:
            return True
    return False


@apart
def first_seen(scene, work, parts, step, resolution):
    """The first share of a step at which something is seen to have switched; 1 where nothing is
    before its end."""
    terms = work.tally[at.SERIES_TERMS]
    write_ways(scene, work, terms)
    for row in range(work.tally[at.CANDIDATES]):
        work.slip[at.SAMPLED, row] = margin(work, at.NOW, row)
        work.slip[at.SAMPLED_RATE, row] = margin_rate(work, at.NOW, row)
    for part in range(1, parts + 1):
        low, high = (part - 1.0) / parts, part / parts
        look(scene, work, terms, step, high)
        for row in range(work.tally[at.CANDIDATES]):
            if not may_meet(work, row):
                continue
            locate_polygons(scene, work, at.TRIAL, row)
            value, rate = margin(work, at.TRIAL, row), margin_rate(work, at.TRIAL, row)
            if value < 0.0:
                return high
            if work.candidates[row, at.CLOSED] == at.TOUCHES and rubs_otherwise(
                scene, work, row, resolution
            ):
                return high
            if work.slip[at.SAMPLED_RATE, row] < 0.0 < rate:
                share = lowest(scene, work, terms, step, low, high, row)
                if share <= 1.0:
                    return share
                look(scene, work, terms, step, high)
            work.slip[at.SAMPLED, row], work.slip[at.SAMPLED_RATE, row] = value, rate
    return 1.0


def first_too_deep(scene, work):
    """The first point of the collocation at which a pair that touches is too deep for its law; 1
    where none is before the end."""
    for stage in range(2):
        for row in range(work.tally[at.CANDIDATES]):
            touches = work.candidates[row, at.CLOSED] == at.TOUCHES
            if touches and is_too_deep(scene, work, at.FIRST_STAGE + stage, row):
                return NODES[stage]
    return 1.0


def cut(scene, work, clock, step, resolution):
    """End a step that is a series where something is first seen to have switched; the share of it
    that is left."""
    terms = work.tally[at.SERIES_TERMS]
    share = first_too_deep(scene, work)
    parts = parts_of(scene, clock[at.SERIES_TURNS])
    if share == 1.0 and parts > 1:
        share = first_seen(scene, work, parts, step, resolution)
    if share < 1.0:
        shorten(work, terms, share)
        clock[at.STAGED_STEP] *= share
        clock[at.SERIES_STEP] = clock[at.STAGED_STEP]
        write_at(work, at.NOW, terms, share * step, 1.0, at.NEW, 0, work.motion.shape[1])
    return share
