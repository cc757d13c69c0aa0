"""Where inside a step a listed pair touches, parts, or becomes the closest of its bodies.

The motion in the step is interpolated; the integrator then takes a shorter step that ends there.
"""

from flocsim.arrays import (
    CANDIDATES,
    CLOSEST,
    EDGE_BODY,
    GAP,
    NEW,
    NOW,
    TRIAL,
    VELOCITY,
    VERTEX_BODY,
)
from flocsim.geometry.contact.points import locate_polygons, turn_bodies
from flocsim.hooks import hook
from flocsim.integrators.events.resolution import memory_of, release_resolution, touch_resolution
from flocsim.integrators.rhs.views import normal_rate

NEVER = 2.0
"""The share of the step at which a switch comes that does not come in it."""

MOST_TRIALS = 60
"""Places tried in the search of one switch."""


@hook
def interpolate(work, step, share):
    """Write the motion at a share of the step into TRIAL: the cubic through both of its ends."""
    motion = work.motion
    rest = 1.0 - share
    for body in range(motion.shape[1]):
        for axis in range(3):
            change = motion[NEW, body, axis] - motion[NOW, body, axis]
            start = step * motion[NOW, body, VELOCITY + axis] - change
            end = change - step * motion[NEW, body, VELOCITY + axis]
            bend = rest * start + share * end
            motion[TRIAL, body, axis] = (
                motion[NOW, body, axis] + share * change + share * rest * bend
            )
            slope = change + (rest - share) * bend + share * rest * (end - start)
            motion[TRIAL, body, VELOCITY + axis] = slope / step


def same_bodies(work, row, other):
    """Whether two rows belong to the same two bodies, either way round."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    c, d = work.candidates[other, VERTEX_BODY], work.candidates[other, EDGE_BODY]
    return (a == c and b == d) or (a == d and b == c)


def rival_of(work, row):
    """The row of the same two bodies that is flagged as their closest, −1 where none is."""
    for other in range(work.tally[CANDIDATES]):
        if work.candidates[other, CLOSEST] == 1 and same_bodies(work, row, other):
            return other
    return -1


def margin(work, state, row, rival):
    """What must not become negative while the flags hold [m].

    Without a rival: the gap of a pair that is open now, the overlap of a closed one; otherwise how
    much further the pair is apart than its closest rival.
    """
    gap = work.geometry[state, row, GAP]
    if rival >= 0:
        return gap - work.geometry[state, rival, GAP]
    return -gap if work.geometry[NOW, row, GAP] < 0.0 else gap


def margin_rate(work, state, row, rival):
    """Rate of change of the margin [m/s]."""
    rate = normal_rate(work, state, row)
    if rival >= 0:
        return rate - normal_rate(work, state, rival)
    return -rate if work.geometry[NOW, row, GAP] < 0.0 else rate


def look_at(scene, work, step, share, row, rival):
    """Locate a pair and its rival at a share of the step; the margin."""
    interpolate(work, step, share)
    turn_bodies(work, TRIAL)
    locate_polygons(scene, work, TRIAL, row)
    if rival >= 0:
        locate_polygons(scene, work, TRIAL, rival)
    return margin(work, TRIAL, row, rival)


def lowest_share(scene, work, step, row, rival):
    """Where in the step the margin is least, if that lies inside it and is low; else NEVER."""
    low, high = 0.0, 1.0
    rate_low = step * margin_rate(work, NOW, row, rival)
    rate_high = step * margin_rate(work, NEW, row, rival)
    if not rate_low < 0.0 < rate_high:
        return NEVER
    at_start, at_end = margin(work, NOW, row, rival), margin(work, NEW, row, rival)
    # Straight lines from both ends bound what a convex margin can fall to.
    if at_start + rate_low * 0.5 > 0.0 and at_end - rate_high * 0.5 > 0.0:
        return NEVER
    share = 0.5
    for _ in range(8):
        share = (low * rate_high - high * rate_low) / (rate_high - rate_low)
        share = min(max(share, 0.9 * low + 0.1 * high), 0.1 * low + 0.9 * high)
        look_at(scene, work, step, share, row, rival)
        rate = step * margin_rate(work, TRIAL, row, rival)
        if rate < 0.0:
            low, rate_low = share, rate
        else:
            high, rate_high = share, rate
        if abs(rate) * (high - low) < 1e-15:
            break
    return share


def crossing(scene, work, step, row, rival, high, resolution):
    """The share at which the margin, which is too low at ``high``, is just below zero."""
    low, target = 0.0, 0.5 * resolution
    at_low = margin(work, NOW, row, rival) + target
    at_high = look_at(scene, work, step, high, row, rival) + target
    side = 0
    share = high
    for _ in range(MOST_TRIALS):
        share = (low * at_high - high * at_low) / (at_high - at_low)
        if not low < share < high:
            share = 0.5 * (low + high)
        value = look_at(scene, work, step, share, row, rival) + target
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
    before, after = work.geometry[NOW, row, GAP], work.geometry[NEW, row, GAP]
    if before < 0.0 <= after:
        return release_resolution(scene, work, NEW, row, resolution)
    if before >= 0.0 > after and collides(work, step, row, depth):
        return touch_resolution(scene, work, NEW, row, resolution)
    return depth


def switch_of(scene, work, step, row, rival, earliest, resolution, depth):
    """The earlier one of the switch of a row and the earliest so far, as shares of the step."""
    high, limit = min(earliest, 1.0), depth
    if rival < 0:
        limit = unnoticed(scene, work, step, row, resolution, depth)
        resolution = min(resolution, limit)
    if margin(work, NEW, row, rival) >= -limit:
        if rival < 0 and work.geometry[NOW, row, GAP] < 0.0:
            return earliest
        lowest = lowest_share(scene, work, step, row, rival)
        if lowest > high:
            return earliest
        high = lowest
    if look_at(scene, work, step, high, row, rival) >= -limit:
        return earliest
    return crossing(scene, work, step, row, rival, high, resolution)


def first_switch(scene, work, step, resolution, depth):
    """The share of the step at which the first flag must change; NEVER where none has to.

    Expects the geometry of NOW and of NEW. A violation by less than ``depth`` [m] counts as none;
    one that counts is located to ``resolution`` [m].
    """
    earliest, rival = NEVER, -1
    for row in range(work.tally[CANDIDATES]):
        earliest = switch_of(scene, work, step, row, -1, earliest, resolution, depth)
        if scene.surface_reach > 0.0:
            if rival < 0 or not same_bodies(work, row, rival):
                rival = rival_of(work, row)
            if rival != row:
                earliest = switch_of(scene, work, step, row, rival, earliest, resolution, depth)
    return earliest
