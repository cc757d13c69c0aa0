"""Where inside a step a listed pair touches or parts, and whether it can be told which pair bears a
force.

The motion in the step is interpolated; the integrator then takes a shorter step that ends there.

Where outlines attract each other, the attraction acts through their deepest contact, for the length
over which it is shared out (rhs/surface_gap.py) is far below an overlap, and presses that deeper
still. Two contacts thus have two places of rest, one with either of them pressed, and bodies go
from one to the other only if they are driven there. A step that is long against the vibrations of a
contact ends at whichever it is led to by damping that is not the bodies', and its estimate, of
what both are apart, may be below the tolerance: the bodies then roll on the wrong way. Such a step
is taken anew, until it is short against the vibrations, or the contacts change by little.
"""

import math

from flocsim.constants import DEEPEST_OVERLAP
from flocsim.geometry.contact.points import locate_polygons, row_radii, turn_body
from flocsim.hooks import hook
from flocsim.integrators.events.resolution import release_resolution, touch_resolution
from flocsim.integrators.rhs.stated_error import pressed_stiffness
from flocsim.integrators.rhs.surface_gap import least_row, run_end
from flocsim.integrators.rhs.views import contact_view, memory_of, normal_rate
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.contacts import GRAZES, OPEN, TOUCHES
from flocsim.state.work import NEW, NOW, TRIAL

NEVER = 2.0
"""The share of the step at which a switch comes that does not come in it."""

MOST_TRIALS = 60
"""Places tried in the search of one switch."""


@hook
def interpolate(work, step, share, body):
    """Write a body's motion at a share of the step into TRIAL: the cubic through both of its
    ends."""
    rest = 1.0 - share
    for axis in range(3):
        change = work.place[NEW, body, axis] - work.place[NOW, body, axis]
        start = step * work.velocity[NOW, body, axis] - change
        end = change - step * work.velocity[NEW, body, axis]
        bend = rest * start + share * end
        work.place[TRIAL, body, axis] = (
            work.place[NOW, body, axis] + share * change + share * rest * bend
        )
        slope = change + (rest - share) * bend + share * rest * (end - start)
        work.velocity[TRIAL, body, axis] = slope / step


def margin(work, state, row):
    """What must not become negative while the flags hold [m]: the gap of a pair that is open now,
    the overlap of a closed one; nothing of one that grazes."""
    gap = work.geometry[state, row].gap
    if work.candidates[row].closed == GRAZES:
        return math.inf
    return -gap if work.geometry[NOW, row].gap < 0.0 else gap


def margin_rate(work, state, row):
    """Rate of change of the margin [m/s]."""
    rate = normal_rate(work, state, row)
    if work.candidates[row].closed == GRAZES:
        return 0.0
    return -rate if work.geometry[NOW, row].gap < 0.0 else rate


def is_too_deep(scene, work, state, row):
    """Whether a listed pair overlaps past the limit of the contact law."""
    radius_a, radius_b = row_radii(scene, work, row)
    return -work.geometry[state, row].gap > DEEPEST_OVERLAP * (radius_a + radius_b)


def look_at(scene, work, step, share, row):
    """Locate a pair at a share of the step; the margin."""
    candidate = work.candidates[row]
    for body in (candidate.vertex_body, candidate.edge_body):
        interpolate(work, step, share, body)
        turn_body(work, TRIAL, body)
    locate_polygons(scene, work, TRIAL, row)
    return margin(work, TRIAL, row)


def may_dip(work, step, row, level):
    """Whether the margin may be below a level [m] inside the step though it is not at its ends."""
    rate_low = step * margin_rate(work, NOW, row)
    rate_high = step * margin_rate(work, NEW, row)
    if not rate_low < 0.0 < rate_high:
        return False
    # Straight lines from both ends bound what a convex margin can fall to.
    at_start, at_end = margin(work, NOW, row) - level, margin(work, NEW, row) - level
    return not (at_start + rate_low * 0.5 > 0.0 and at_end - rate_high * 0.5 > 0.0)


def speed_against(scene, work, state, row):
    """A bound of how fast any points of a pair's two bodies move against each other [m/s]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    speed = abs(work.velocity[state, a, X] - work.velocity[state, b, X])
    speed += abs(work.velocity[state, a, Y] - work.velocity[state, b, Y])
    speed += abs(work.velocity[state, a, ANGLE]) * scene.bodies[a].bounding_radius
    return speed + abs(work.velocity[state, b, ANGLE]) * scene.bodies[b].bounding_radius


def lowest_share(scene, work, step, row, level):
    """Where in the step the margin is least, if that lies inside it and may be below a level [m],
    the pair being located there in TRIAL; else NEVER."""
    if not may_dip(work, step, row, level):
        return NEVER
    low, high = 0.0, 1.0
    rate_low = step * margin_rate(work, NOW, row)
    rate_high = step * margin_rate(work, NEW, row)
    share = 0.5
    for _ in range(8):
        share = (low * rate_high - high * rate_low) / (rate_high - rate_low)
        share = min(max(share, 0.9 * low + 0.1 * high), 0.1 * low + 0.9 * high)
        look_at(scene, work, step, share, row)
        rate = step * margin_rate(work, TRIAL, row)
        if rate < 0.0:
            low, rate_low = share, rate
        else:
            high, rate_high = share, rate
        if abs(rate) * (high - low) < 1e-15:
            break
    return share


def crossing(scene, work, step, row, high, at_high, resolution):
    """The share at which the margin, ``at_high`` at ``high`` and too low there, is just below
    zero."""
    low, target = 0.0, 0.5 * resolution
    at_low = margin(work, NOW, row) + target
    at_high += target
    side = 0
    share = high
    for _ in range(MOST_TRIALS):
        share = (low * at_high - high * at_low) / (at_high - at_low)
        if not low < share < high:
            share = 0.5 * (low + high)
        value = look_at(scene, work, step, share, row) + target
        if abs(value) <= 0.25 * resolution or high - low < 1e-15:
            break
        # The value of an end that stays is halved, so that both ends close in (Illinois).
        if value > 0.0:
            at_high = 0.5 * at_high if side == 1 else at_high
            low, at_low, side = share, value, 1
        else:
            at_low = 0.5 * at_low if side == -1 else at_low
            high, at_high, side = share, value, -1
    return share


def collides(work, step, row, depth):
    """Whether an open pair that overlaps at the end of the step goes on approaching: a graze turns
    around by itself, speed²/(2 slowing) deeper."""
    speed = -normal_rate(work, NEW, row)
    if speed * step > depth:
        return True
    slowing = (-normal_rate(work, NOW, row) - speed) / step
    lasting = speed * memory_of(work, row) > depth
    return lasting and speed * speed > 2.0 * slowing * depth


def unnoticed(scene, work, step, row, resolution, depth):
    """How far behind its switch a pair may be at the end of a step, unnoticed [m]."""
    before, after = work.geometry[NOW, row].gap, work.geometry[NEW, row].gap
    if before < 0.0 <= after:
        return release_resolution(scene, work, NEW, row, resolution)
    if before >= 0.0 > after and collides(work, step, row, depth):
        return touch_resolution(scene, work, NEW, row, resolution)
    return depth


def switch_of(scene, work, step, row, earliest, resolution, depth):
    """The earlier one of the switch of a row and the earliest so far, as shares of the step."""
    high, limit = min(earliest, 1.0), unnoticed(scene, work, step, row, resolution, depth)
    resolution = min(resolution, limit)
    if margin(work, NEW, row) >= -limit:
        lowest = lowest_share(scene, work, step, row, 0.0)
        if lowest > high:
            return earliest
        high = lowest
        if work.tally.series_terms > 0 and work.geometry[NOW, row].gap < 0.0:
            # It has opened, and what pulls it shut again is a law that ends there.
            limit = resolution
    at_high = look_at(scene, work, step, high, row)
    if at_high >= -limit:
        return earliest
    return crossing(scene, work, step, row, high, at_high, resolution)


def may_switch(scene, work, step, resolution, depth):
    """Whether a pair may switch in a step before its end, as seen from both ends of it."""
    for row in range(work.tally.candidates):
        limit = unnoticed(scene, work, step, row, resolution, depth)
        if margin(work, NEW, row) < -limit or may_dip(work, step, row, 0.0):
            return True
    return False


def passes_within(scene, work, step, depth):
    """Whether a pair was within reach of a surface force inside of a step, by more than a depth
    [m], whose ends are both beyond it: the stages may all have missed that."""
    reach, g = scene.surface_reach, work.geometry
    if reach <= 0.0:
        return False
    for row in range(work.tally.candidates):
        if (
            min(g[NOW, row].gap, g[NEW, row].gap) > reach
            and lowest_share(scene, work, step, row, reach) < 1.0
            and g[TRIAL, row].gap < reach - depth
        ):
            return True
    return False


def touches(work):
    """Whether any listed pair does."""
    for row in range(work.tally.candidates):
        if work.candidates[row].closed != OPEN:
            return True
    return False


def changes_sides(work):
    """Whether a vertex has come from one side of an edge to the other in a step across switches,
    which is told of a touch by its end alone."""
    g = work.geometry
    for row in range(work.tally.candidates):
        along = g[NOW, row].normal_x * g[NEW, row].normal_x
        along += g[NOW, row].normal_y * g[NEW, row].normal_y
        if along < 0.0:
            return True
    return False


def first_switch(scene, work, step, resolution, depth):
    """The share of the step at which the first flag must change; NEVER where none has to.

    Expects the geometry of NOW and of NEW. A violation by less than ``depth`` [m] counts as none;
    one that counts is located to ``resolution`` [m].
    """
    earliest, before, way, back = NEVER, -1, 0.0, 0.0
    for row in range(work.tally.candidates):
        pair = work.candidates[row].pair
        if pair != before:
            before = pair
            way = 0.5 * step * speed_against(scene, work, NOW, row)
            back = 0.5 * step * speed_against(scene, work, NEW, row)
        if not (margin(work, NOW, row) > way and margin(work, NEW, row) > back):
            earliest = switch_of(scene, work, step, row, earliest, resolution, depth)
    return earliest


LARGE = 0.25
"""One contact overtakes another one by much where it comes from above it, and goes below it, by
this share of both their overlaps."""

RESOLVED = 1.0
"""A step of so many times 1/ω0 follows a contact's vibration."""


def deepest_of(work, state, row, end):
    """The row of the least gap in a state, of those that touch; −1 without."""
    deepest = -1
    for each in range(row, end):
        gap = work.geometry[state, each].gap
        if work.candidates[each].closed == TOUCHES and (
            deepest < 0 or gap < work.geometry[state, deepest].gap
        ):
            deepest = each
    return deepest


def overtaken(work, row, end, closed):
    """The row of the two bodies that has been the deepest before and is overtaken by much; −1
    without."""
    if closed:
        old, new = deepest_of(work, NOW, row, end), deepest_of(work, NEW, row, end)
    else:
        old, new = least_row(work, NOW, row, end), least_row(work, NEW, row, end)
    if old < 0 or old == new:
        return -1
    g = work.geometry
    deep, deeper = -g[NOW, old].gap, -g[NEW, new].gap
    if not (deep > 0.0 and deeper > 0.0):
        return -1
    way = min(g[NOW, new].gap, 0.0) + deep + min(g[NEW, old].gap, 0.0) + deeper
    return old if way > LARGE * (deep + deeper) else -1


def overtakes(scene, work, clock, step):
    """Whether a contact has overtaken another one of the same bodies from NOW to NEW, and the step
    is too long to tell. Only pairs that are closed count where steps end at switches."""
    row, closed = 0, clock.across == 0.0
    while row < work.tally.candidates:
        end = run_end(work, row)
        old = overtaken(work, row, end, closed)
        if old >= 0:
            view = contact_view(scene, work, NOW, old)
            stiffness = pressed_stiffness(scene, view, clock.tolerance)
            if step * step * stiffness > RESOLVED * RESOLVED * view.effective_mass:
                return True
        row = end
    return False
