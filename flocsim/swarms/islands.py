"""Islands of a swarm: which bodies form one in a window, and how one is advanced over it.

The bodies of an island are copied into arrays of their own, in their order, run from the window's
beginning to its end by the loop that all runs go through, and copied back: nothing of the swarm
changes before, so that a window can be tried again. Islands know nothing of each other; in which
order they run, and in how many threads, changes no number.

Of one island are those that can reach each other before the window ends. Each body is expected to
go straight on, and allowed to stray from that path by so much (``wander``): discs of its bounding
radius, that way, and half of what acts reaches, which move along their paths (sweep.py). Where two
of them meet, the bodies are of one island. Fixed bodies do not pass on what acts on them: each is a
part of all islands that can reach it.
"""

import math

import flocsim.arrays as at
import flocsim.swarms.arrays as sw
from flocsim.arrays import all_counting
from flocsim.geometry.contact.body_pairs import (
    MOVES,
    PLACE_X,
    PLACE_Y,
    REACH,
    WAY_X,
    WAY_Y,
    near_pairs,
    watches_all,
)
from flocsim.geometry.contact.candidates import keep_slips
from flocsim.geometry.contact.compounds import ONWARD, SWELL
from flocsim.geometry.contact.points import nearest_way
from flocsim.geometry.shapes.cores import edge_count, edge_end, segment_distance2
from flocsim.integrators.loop.driver import FINISHED, NO_ROOM, advance
from flocsim.integrators.radau.contact_frames import unite


def watch_paths(scene, work, observed, time):
    """Note how far bodies stray from the paths on which others count; 1 where the island is to
    stop."""
    for body in range(work.bodies.shape[0]):
        if scene.bodies[body, at.FREE] == 1.0:
            since = time - observed[body, sw.SINCE]
            x = (
                work.motion[at.NOW, body, at.X]
                - observed[body, sw.START_X]
                - since * observed[body, sw.PATH_VX]
            )
            y = (
                work.motion[at.NOW, body, at.Y]
                - observed[body, sw.START_Y]
                - since * observed[body, sw.PATH_VY]
            )
            observed[body, sw.FURTHEST] = max(observed[body, sw.FURTHEST], math.hypot(x, y))
    return 1 if observed[0, sw.HALT] != 0.0 else 0


def put_scene(swarm, scene, members, first):
    """The bodies of an island, from ``members[first]`` on, into its scene."""
    point = 0
    for body in range(scene.bodies.shape[0]):
        member = members[first + body]
        for column in range(scene.bodies.shape[1]):
            scene.bodies[body, column] = swarm.bodies[member, column]
        scene.first[body] = point
        begin, end = swarm.first[member], swarm.first[member + 1]
        for each in range(begin, end):
            for axis in range(swarm.vertices.shape[1]):
                scene.vertices[point + each - begin, axis] = swarm.vertices[each, axis]
        for row in range(2 * (end - begin)):
            for column in range(3):
                scene.tree[2 * point + row, column] = swarm.tree[2 * begin + row, column]
        point += end - begin
    scene.first[scene.bodies.shape[0]] = point


def put_state(swarm, work, members, first):
    """The state of its bodies into its work; nothing else of that is left from before."""
    for body in range(work.bodies.shape[0]):
        member = members[first + body]
        for row in range(at.MOTION_ROWS):
            for axis in range(at.MOTION_COLUMNS):
                work.motion[row, body, axis] = 0.0
        for row in range(at.STATES):
            for axis in range(at.MOTION_COLUMNS):
                work.rates[row, body, axis] = 0.0
        for column in range(work.bodies.shape[1]):
            work.bodies[body, column] = 0.0
        for axis in range(at.MOTION_COLUMNS):
            work.motion[at.NOW, body, axis] = swarm.motion[member, axis]
            work.motion[at.CARRIED, body, axis] = swarm.carried[member, axis]
        for kind in range(sw.ERROR_COLUMNS):
            work.bodies[body, at.ERROR_PLACE + kind] = swarm.errors[member, kind]
        work.order[body] = body
        work.cluster[body] = body
    for place in range(at.TALLY_SIZE):
        work.tally[place] = 0
    for place in range(work.elimination.found.shape[0]):
        work.elimination.found[place] = 0


def local_of(members, first, size, body):
    """The number of a body in its island, −1 where it is not of it; members are sorted."""
    low, high = 0, size
    while low < high - 1:
        middle = (low + high) // 2
        if members[first + middle] <= body:
            low = middle
        else:
            high = middle
    return low if members[first + low] == body else -1


def put_slips(swarm, scene, work, members, first):
    """The displacements of its contacts among those that the first list takes up; False without
    room."""
    count, size = 0, work.bodies.shape[0]
    for body in range(size):
        member = members[first + body]
        for link in range(swarm.first_link[member], swarm.first_link[member + 1]):
            other = local_of(members, first, size, swarm.links[link, sw.EARLIER_BODY])
            if other < 0:
                continue
            if count == work.kept.shape[0]:
                return False
            work.kept[count, at.KEPT_LATER], work.kept[count, at.KEPT_EARLIER] = body, other
            work.kept[count, at.KEPT_VERTEX] = local_point(
                swarm, scene, members, first, swarm.links[link, sw.AT_VERTEX], body, other
            )
            work.kept[count, at.KEPT_EDGE] = local_point(
                swarm, scene, members, first, swarm.links[link, sw.AT_EDGE], body, other
            )
            work.kept[count, at.KEPT_MODE] = swarm.links[link, sw.MODE]
            for kind in range(sw.SLIP_COLUMNS):
                work.slip[at.KEPT_SLIP + kind, count] = swarm.slips[link, kind]
            count += 1
    work.tally[at.KEPT] = count + 1
    return True


def touch_plainly(work):
    """Let no contact graze or be held: where steps go on across switches there is none of that."""
    for kept in range(work.tally[at.KEPT] - 1):
        work.kept[kept, at.KEPT_MODE] = at.OPEN
        work.slip[at.KEPT_GAP, kept] = 0.0


def local_point(swarm, scene, members, first, point, body, other):
    """The number in an island of a core point of one of two bodies."""
    member = members[first + body]
    if not swarm.first[member] <= point < swarm.first[member + 1]:
        body, member = other, members[first + other]
    return scene.first[body] + point - swarm.first[member]


def global_point(swarm, scene, members, first, point, body, other):
    """The other way round."""
    if not scene.first[body] <= point < scene.first[body + 1]:
        body = other
    return swarm.first[members[first + body]] + point - scene.first[body]


def put_times(swarm, work, observed, clock, counts, start_clock, start_counts, members, first):
    """Clock, counts, and the paths that its bodies are expected to go.

    Steps go on across switches where those of any of its bodies did, from their shortest step.
    """
    for place in range(at.CLOCK_SIZE):
        clock[place] = start_clock[place]
    for place in range(at.COUNTS_SIZE):
        counts[place] = start_counts[place]
    clock[at.TIME], clock[at.UNTIL] = swarm.times[sw.BEGIN], swarm.times[sw.END]
    clock[at.HORIZON] = swarm.times[sw.HORIZON_AT]
    step, across = math.inf, 0.0
    for body in range(work.bodies.shape[0]):
        member = members[first + body]
        if swarm.bodies[member, at.FREE] == 1.0:
            other = swarm.methods[member]
            if other > across:
                step, across = math.inf, other
            step = min(step, swarm.steps[member]) if other == across else step
        observed[body, sw.START_X], observed[body, sw.START_Y] = (
            swarm.motion[member, at.X],
            swarm.motion[member, at.Y],
        )
        observed[body, sw.PATH_VX] = swarm.motion[member, at.VX]
        observed[body, sw.PATH_VY] = swarm.motion[member, at.VY]
        observed[body, sw.SINCE], observed[body, sw.FURTHEST] = swarm.times[sw.BEGIN], 0.0
    clock[at.ACROSS] = across
    clock[at.STEP] = step if step < math.inf else start_clock[at.STEP]


def take_slips(swarm, scene, work, found, members, first):
    """Write down the displacements of its contacts; False without room."""
    count, begin = keep_slips(work), found.filled[0]
    work.tally[at.KEPT] = 0
    if begin + count > found.links.shape[0]:
        return False
    for kept in range(count):
        later, earlier = work.kept[kept, at.KEPT_LATER], work.kept[kept, at.KEPT_EARLIER]
        row = begin + kept
        found.links[row, sw.LATER_BODY] = members[first + later]
        found.links[row, sw.EARLIER_BODY] = members[first + earlier]
        found.links[row, sw.AT_VERTEX] = global_point(
            swarm, scene, members, first, work.kept[kept, at.KEPT_VERTEX], later, earlier
        )
        found.links[row, sw.AT_EDGE] = global_point(
            swarm, scene, members, first, work.kept[kept, at.KEPT_EDGE], later, earlier
        )
        found.links[row, sw.MODE] = work.kept[kept, at.KEPT_MODE]
        for kind in range(sw.SLIP_COLUMNS):
            found.slips[row, kind] = work.slip[at.KEPT_SLIP + kind, kept]
    found.filled[0] = begin + count
    return True


def take_state(swarm, work, observed, clock, members, first):
    """Write the state of its bodies at the window's end, and how they got there."""
    for body in range(work.bodies.shape[0]):
        member = members[first + body]
        swarm.strayed[member] = observed[body, sw.FURTHEST]
        if swarm.bodies[member, at.FREE] == 0.0:
            continue
        for axis in range(at.MOTION_COLUMNS):
            swarm.new_motion[member, axis] = work.motion[at.NOW, body, axis]
            swarm.new_carried[member, axis] = work.motion[at.CARRIED, body, axis]
        for kind in range(sw.ERROR_COLUMNS):
            swarm.new_errors[member, kind] = work.bodies[body, at.ERROR_PLACE + kind]
        swarm.new_steps[member] = clock[at.STEP]
        swarm.stated[member] = work.bodies[body, at.STATED]
        swarm.new_methods[member] = clock[at.ACROSS]


def run_islands(
    swarm, scene, work, observed, clock, counts, record, start_clock, start_counts, members, starts,
    codes, costs, found, first, last,
):  # fmt: skip
    """Run the islands from ``first`` to before ``last``, all of as many bodies as ``scene`` has:
    their Status into ``codes``. How far that went: to one that found no room, or to the last."""
    for island in range(first, last):
        begin = starts[island]
        put_scene(swarm, scene, members, begin)
        put_state(swarm, work, members, begin)
        for pair in range(work.budget.shape[0]):
            work.budget[pair] = -1.0
        if watches_all(work):
            work.tally[at.PAIRS] = all_counting(scene.bodies, work.pairs)
        if not put_slips(swarm, scene, work, members, begin):
            work.tally[at.FULL] = at.CANDIDATES_FULL
            return island
        put_times(swarm, work, observed, clock, counts, start_clock, start_counts, members, begin)
        if clock[at.ACROSS] == 1.0:
            touch_plainly(work)
        code = advance(scene, work, observed, clock, counts, record)
        if code == NO_ROOM:
            return island
        if code == FINISHED and not take_slips(swarm, scene, work, found, members, begin):
            return island
        codes[island] = code
        costs[island, sw.STEPS_TAKEN] = counts[at.STEPS]
        costs[island, sw.STEPS_REJECTED] = counts[at.REJECTED]
        costs[island, sw.FORCES_SUMMED] = work.tally[at.EVALUATIONS]
        take_state(swarm, work, observed, clock, members, begin)
    return last


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
