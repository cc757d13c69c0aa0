"""Which bodies of a swarm form an island in a window: those that can reach each other in it.

Before it is run, each body is expected to go straight on, and allowed to stray from that path by so
much (``wander``): discs of its bounding radius, that way, and half of what acts reaches, which move
along their paths (geometry/contact/body_pairs.py). Where two of them meet, the bodies are of one
island. One whose path leads into another body may stop there: it may stray by all that is left of
its path, so that whoever follows it is of its island from the first.

Afterwards it is known where bodies have been, stretch by stretch of the window. Islands of which
two bodies have been in each other's reach become one, which is run again.

Fixed bodies do not pass on what acts on them: each is a part of all islands that can reach it.
"""

import math

import flocsim.swarms.arrays as sw
from flocsim.geometry.contact.body_pairs import near_pairs
from flocsim.geometry.contact.points import nearest_displacement
from flocsim.geometry.shapes.cores import segment_distance2
from flocsim.integrators.radau.contact_frames import merge
from flocsim.state.bodies import ANGLE, SPIN, VX, VY, X, Y


def set_disc(swarm, body, x, y, way_x, way_y, wide):
    """The disc of a body that begins at a place, goes a way, and reaches so far [m]."""
    disc, free = swarm.discs[body], swarm.bodies[body].free
    if free == 0.0:
        # Found by its outline: its circle may be as wide as the box.
        x = y = way_x = way_y = wide = 0.0
    disc.x, disc.y = x, y
    disc.way_x, disc.way_y = way_x, way_y
    disc.reach, disc.moves = wide, free


def disc_reach(swarm, body, reach, stray):
    """How far a disc reaches in which a body may stray by so much [m]."""
    return swarm.bodies[body].bounding_radius + stray + 0.5 * reach


def both_free(swarm, a, b):
    return swarm.bodies[a].free * swarm.bodies[b].free == 1.0


def set_discs(swarm, span, reach):
    """The discs of a window of so many seconds."""
    m = swarm.motion
    for body in range(swarm.bodies.shape[0]):
        wide = disc_reach(swarm, body, reach, swarm.wander[body])
        way_x, way_y = span * m[body, VX], span * m[body, VY]
        set_disc(swarm, body, m[body, X], m[body, Y], way_x, way_y, wide)


def core_distance2(swarm, wall, x, y):
    """Squared distance of a point from the core of a fixed body [m²]; the point as seen from it."""
    cosine, sine = math.cos(swarm.motion[wall, ANGLE]), math.sin(swarm.motion[wall, ANGLE])
    x, y = cosine * x + sine * y, cosine * y - sine * x
    first, v, least = swarm.first[wall], swarm.vertices, math.inf
    for start in range(first, swarm.first[wall + 1]):
        end = start + v[start].edge_offset
        distance2 = segment_distance2(x, y, v[start].x, v[start].y, v[end].x, v[end].y)
        least = min(least, distance2)
    return least


def widest_swell(swarm, wall):
    """By how much the widest disk of a fixed body is wider than its narrowest [m]."""
    widest = 0.0
    for point in range(swarm.first[wall], swarm.first[wall + 1]):
        widest = max(widest, swarm.vertices[point].excess_radius)
    return widest


def reaches_wall(swarm, body, wall, span, reach, width, height):
    """Whether a body can come to act on a fixed one in a window."""
    m = swarm.motion
    x = nearest_displacement(m[body, X] - m[wall, X], width)
    y = nearest_displacement(m[body, Y] - m[wall, Y], height)
    way = span * math.hypot(m[body, VX] - m[wall, VX], m[body, VY] - m[wall, VY])
    way += span * abs(m[wall, SPIN]) * swarm.bodies[wall].bounding_radius
    near = swarm.bodies[body].bounding_radius + swarm.bodies[wall].radius + reach
    near += way + swarm.wander[body] + widest_swell(swarm, wall)
    return core_distance2(swarm, wall, x, y) < near * near


def name_islands(labels):
    """Name all bodies of islands that have been united by the first one, in place of a chain."""
    for body in range(labels.shape[0]):
        if labels[body] >= 0:
            labels[body] = labels[labels[body]]


def note_walls(swarm, span, reach, width, height, labels, walls, touches):
    """Note which of the fixed bodies ``walls`` each body can reach; these are of no island."""
    for body in range(labels.shape[0]):
        free = swarm.bodies[body].free == 1.0
        for each in range(walls.shape[0]):
            touches[body, each] = free and reaches_wall(
                swarm, body, walls[each], span, reach, width, height
            )
    for each in range(walls.shape[0]):
        labels[walls[each]] = -1


def share_to_touch(swarm, a, b, span, width, height):
    """The share of a window after which the circles of two bodies touch, on their straight paths; 1
    where they do not in it."""
    m, bodies = swarm.motion, swarm.bodies
    x = nearest_displacement(m[a, X] - m[b, X], width)
    y = nearest_displacement(m[a, Y] - m[b, Y], height)
    way_x, way_y = span * (m[a, VX] - m[b, VX]), span * (m[a, VY] - m[b, VY])
    near = bodies[a].bounding_radius + bodies[b].bounding_radius
    apart, closing = max(x * x + y * y - near * near, 0.0), -(x * way_x + y * way_y)
    left = closing * closing - apart * (way_x * way_x + way_y * way_y)
    if closing <= 0.0 or left <= 0.0:
        return 1.0
    return min(apart / (closing + math.sqrt(left)), 1.0)


def widen_landing(swarm, span, width, height, pairs, total, reach):
    """Widen the path of the faster one of two bodies that will touch by what is left of it; whether
    there are any."""
    m, found = swarm.motion, False
    for pair in range(total):
        a, b = pairs[pair].later, pairs[pair].earlier
        share = share_to_touch(swarm, a, b, span, width, height) if both_free(swarm, a, b) else 1.0
        if share < 1.0:
            b_goes = math.hypot(m[b, VX], m[b, VY])
            faster = b if b_goes > math.hypot(m[a, VX], m[a, VY]) else a
            way = span * math.hypot(m[a, VX] - m[b, VX], m[a, VY] - m[b, VY])
            wide = disc_reach(swarm, faster, reach, (1.0 - share) * way)
            if wide > swarm.discs[faster].reach:
                swarm.discs[faster].reach, found = wide, True
    return found


def find_islands(swarm, span, reach, width, height, pairs, labels, walls, touches):
    """Name every free body by the first one of its island, fixed ones by −1, and note in
    ``touches`` (n, k) which of the fixed bodies ``walls`` (k,) it can reach.

    Returns the number of near pairs: more than ``pairs`` has room for where that was too few.
    """
    n = swarm.bodies.shape[0]
    set_discs(swarm, span, reach)
    total = near_pairs(swarm.discs, swarm.order, width, height, swarm.starts, pairs)
    known = total <= pairs.shape[0]
    if known and widen_landing(swarm, span, width, height, pairs, total, reach):
        total = near_pairs(swarm.discs, swarm.order, width, height, swarm.starts, pairs)
    if total > pairs.shape[0]:
        return total
    for body in range(n):
        labels[body] = body
    for pair in range(total):
        if both_free(swarm, pairs[pair].later, pairs[pair].earlier):
            merge(labels, pairs[pair].later, pairs[pair].earlier)
    name_islands(labels)
    note_walls(swarm, span, reach, width, height, labels, walls, touches)
    return total


def set_boxes(swarm, reach):
    """The discs round all of where bodies have been in the window."""
    ways = swarm.ways
    for body in range(swarm.bodies.shape[0]):
        left, right, low, high = math.inf, -math.inf, math.inf, -math.inf
        for stretch in range(sw.STRETCHES):
            left = min(left, ways[body, stretch, sw.LEFT])
            right = max(right, ways[body, stretch, sw.RIGHT])
            low = min(low, ways[body, stretch, sw.LOW])
            high = max(high, ways[body, stretch, sw.HIGH])
        wide = disc_reach(swarm, body, reach, 0.5 * math.hypot(right - left, high - low))
        set_disc(swarm, body, 0.5 * (left + right), 0.5 * (low + high), 0.0, 0.0, wide)


def gap_along(ways, a, b, stretch, low_end, high_end, period):
    """How far two bodies' stretches of an axis are apart [m], by their nearest images; the ends of
    each are these columns of ``ways``."""
    low, high = ways[a, stretch, low_end], ways[a, stretch, high_end]
    other_low, other_high = ways[b, stretch, low_end], ways[b, stretch, high_end]
    between = abs(nearest_displacement(0.5 * (low + high - other_low - other_high), period))
    return max(between - 0.5 * (high - low + other_high - other_low), 0.0)


def have_met(swarm, a, b, reach, width, height):
    """Whether two bodies have been in each other's reach in any stretch of the window."""
    ways = swarm.ways
    near = swarm.bodies[a].bounding_radius + swarm.bodies[b].bounding_radius + reach
    for stretch in range(sw.STRETCHES):
        x = gap_along(ways, a, b, stretch, sw.LEFT, sw.RIGHT, width)
        y = gap_along(ways, a, b, stretch, sw.LOW, sw.HIGH, height)
        if x * x + y * y < near * near:
            return True
    return False


def join_islands(swarm, span, reach, width, height, pairs, labels, walls, touches):
    """Make one of islands of which two bodies have been in each other's reach; the number of near
    pairs, as find_islands."""
    set_boxes(swarm, reach)
    total = near_pairs(swarm.discs, swarm.order, width, height, swarm.starts, pairs)
    if total > pairs.shape[0]:
        return total
    for pair in range(total):
        a, b = pairs[pair].later, pairs[pair].earlier
        others = both_free(swarm, a, b) and labels[a] != labels[b]
        if others and have_met(swarm, a, b, reach, width, height):
            merge(labels, a, b)
    name_islands(labels)
    note_walls(swarm, span, reach, width, height, labels, walls, touches)
    return total
