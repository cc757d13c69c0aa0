"""Which bodies can reach each other before a window ends: the islands of the window.

Each body is expected to go straight on, and allowed to stray from that path by so much
(``wander``): discs of its bounding radius, that way, and half of what acts reaches, which move
along their paths (geometry.contact.body_pairs). Where two of them meet, the bodies are of one
island. Fixed bodies do not pass on what acts on them: each is a part of all islands that can reach
it.
"""

import math

import flocsim.arrays as at
from flocsim.geometry.contact.body_pairs import (
    MOVES,
    PLACE_X,
    PLACE_Y,
    REACH,
    WAY_X,
    WAY_Y,
    near_pairs,
)
from flocsim.geometry.contact.compounds import ONWARD, SWELL
from flocsim.geometry.contact.separation import nearest_way
from flocsim.geometry.shapes.cores import edge_count, edge_end, segment_distance2
from flocsim.integrators.radau.contact_frames import unite


def set_discs(swarm, span, reach):
    """The discs of a window of so many seconds."""
    for body in range(swarm.bodies.shape[0]):
        disc = swarm.discs[body]
        disc[PLACE_X], disc[PLACE_Y] = swarm.motion[body, at.X], swarm.motion[body, at.Y]
        disc[WAY_X], disc[WAY_Y] = (
            span * swarm.motion[body, at.VX],
            span * swarm.motion[body, at.VY],
        )
        disc[REACH] = swarm.bodies[body, at.BOUNDING_RADIUS] + swarm.wander[body]
        disc[REACH] += 0.5 * reach
        disc[MOVES] = swarm.bodies[body, at.FREE]
        if disc[MOVES] == 0.0:
            # Found below, by its outline: its circle may be as wide as the box.
            disc[WAY_X] = disc[WAY_Y] = disc[REACH] = 0.0
            disc[PLACE_X] = disc[PLACE_Y] = 0.0


def core_distance2(swarm, wall, x, y):
    """Squared distance of a point from the core of a fixed body [m²]; the point as seen from it."""
    cosine, sine = math.cos(swarm.motion[wall, at.ANGLE]), math.sin(swarm.motion[wall, at.ANGLE])
    x, y = cosine * x + sine * y, cosine * y - sine * x
    first, v, least = swarm.first[wall], swarm.vertices, math.inf
    points = swarm.first[wall + 1] - first
    rings = v.shape[1] > ONWARD
    for start in range(first, first + (points if rings else max(edge_count(points), 1))):
        end = edge_end(first, points, start) if points > 1 else start
        if rings:
            end = start + int(v[start, ONWARD])
        distance2 = segment_distance2(
            x, y, v[start, at.X], v[start, at.Y], v[end, at.X], v[end, at.Y]
        )
        least = min(least, distance2)
    return least


def widest_swell(swarm, wall):
    """By how much the widest disk of a fixed body is wider than its narrowest [m]."""
    widest = 0.0
    if swarm.vertices.shape[1] > SWELL:
        for point in range(swarm.first[wall], swarm.first[wall + 1]):
            widest = max(widest, swarm.vertices[point, SWELL])
    return widest


def reaches_wall(swarm, body, wall, span, reach, width, height):
    """Whether a body can come to act on a fixed one in a window."""
    m = swarm.motion
    x = nearest_way(m[body, at.X] - m[wall, at.X], width)
    y = nearest_way(m[body, at.Y] - m[wall, at.Y], height)
    way = span * math.hypot(m[body, at.VX] - m[wall, at.VX], m[body, at.VY] - m[wall, at.VY])
    way += span * abs(m[wall, at.SPIN]) * swarm.bodies[wall, at.BOUNDING_RADIUS]
    near = swarm.bodies[body, at.BOUNDING_RADIUS] + swarm.bodies[wall, at.RADIUS] + reach
    near += way + swarm.wander[body] + widest_swell(swarm, wall)
    return core_distance2(swarm, wall, x, y) < near * near


def find_islands(swarm, span, reach, width, height, pairs, labels, walls, touches):
    """Name every free body by the first one of its island, fixed ones by −1, and note in
    ``touches`` (n, k) which of the fixed bodies ``walls`` (k,) it can reach.

    Returns the number of near pairs: more than ``pairs`` has room for where that was too few.
    """
    n = swarm.bodies.shape[0]
    set_discs(swarm, span, reach)
    total = near_pairs(swarm.discs, swarm.order, width, height, swarm.starts, pairs)
    if total > pairs.shape[0]:
        return total
    for body in range(n):
        labels[body] = body
    for pair in range(total):
        a, b = pairs[pair, 0], pairs[pair, 1]
        if swarm.bodies[a, at.FREE] * swarm.bodies[b, at.FREE] == 1.0:
            unite(labels, a, b)
    for body in range(n):
        labels[body] = labels[labels[body]]
        free = swarm.bodies[body, at.FREE] == 1.0
        for each in range(walls.shape[0]):
            touches[body, each] = free and reaches_wall(
                swarm, body, walls[each], span, reach, width, height
            )
    for each in range(walls.shape[0]):
        labels[walls[each]] = -1
    return total
