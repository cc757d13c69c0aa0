"""Islands of a swarm: how one is advanced over a window.

The bodies of an island (grouping.py) are copied into arrays of their own, in their order, run from
the window's beginning to its end by the loop that all runs go through, and copied back: nothing of
the swarm changes before, so that a window can be tried again. Islands know nothing of each other;
in which order they run, and in how many threads, changes no number.
"""

import math

import flocsim.swarms.arrays as sw
from flocsim.geometry.contact.candidates import save_contacts
from flocsim.integrators.loop.driver import FINISHED, NO_ROOM, advance, clear
from flocsim.state.bodies import VX, VY, X, Y
from flocsim.state.clock import CANDIDATES_FULL
from flocsim.state.contacts import OPEN
from flocsim.state.work import NOW, PROPAGATED, begin


def box_at(stretch):
    """The first column of the box of a stretch, of what the observer sees."""
    return sw.BOXES + sw.BOX_COLUMNS * stretch


def widen(observed, body, stretch, x, y):
    """Let the box of a stretch of a body's way hold a place as well."""
    box = box_at(stretch)
    observed[body, box + sw.LEFT] = min(observed[body, box + sw.LEFT], x)
    observed[body, box + sw.RIGHT] = max(observed[body, box + sw.RIGHT], x)
    observed[body, box + sw.LOW] = min(observed[body, box + sw.LOW], y)
    observed[body, box + sw.HIGH] = max(observed[body, box + sw.HIGH], y)


def stretch_at(observed, time):
    """In which stretch of the window a time is."""
    share = (time - observed[0, sw.SINCE]) / observed[0, sw.LENGTH]
    return min(max(int(sw.STRETCHES * share), 0), sw.STRETCHES - 1)


def watch_paths(scene, work, observed, time):
    """Note where bodies have been in every stretch of the window, straight on from step to step,
    and how far they stray from the paths that they were expected to go; 1 where the island is to
    stop."""
    before, since = observed[0, sw.SEEN_AT], time - observed[0, sw.SINCE]
    first, last = stretch_at(observed, before), stretch_at(observed, time)
    for body in range(work.poses.shape[0]):
        if scene.bodies[body].free == 1.0:
            x, y = work.place[NOW, body, X], work.place[NOW, body, Y]
            for stretch in range(first, last):
                border = (
                    observed[0, sw.SINCE] + observed[0, sw.LENGTH] * (stretch + 1) / sw.STRETCHES
                )
                share = min(max((border - before) / (time - before), 0.0), 1.0)
                between_x = observed[body, sw.SEEN_X] + share * (x - observed[body, sw.SEEN_X])
                between_y = observed[body, sw.SEEN_Y] + share * (y - observed[body, sw.SEEN_Y])
                widen(observed, body, stretch, between_x, between_y)
                widen(observed, body, stretch + 1, between_x, between_y)
            widen(observed, body, last, x, y)
            observed[body, sw.SEEN_X], observed[body, sw.SEEN_Y] = x, y
            x -= observed[body, sw.START_X] + since * observed[body, sw.PATH_VX]
            y -= observed[body, sw.START_Y] + since * observed[body, sw.PATH_VY]
            observed[body, sw.FURTHEST] = max(observed[body, sw.FURTHEST], math.hypot(x, y))
    observed[0, sw.SEEN_AT] = time
    return 1 if observed[0, sw.HALT] != 0.0 else 0


def put_scene(swarm, scene, members, first):
    """The bodies of an island, from ``members[first]`` on, into its scene."""
    point = 0
    for body in range(scene.bodies.shape[0]):
        member = members[first + body]
        scene.bodies[body] = swarm.bodies[member]
        scene.first[body] = point
        begin, end = swarm.first[member], swarm.first[member + 1]
        for each in range(begin, end):
            scene.vertices[point + each - begin] = swarm.vertices[each]
        point += end - begin
    scene.first[scene.bodies.shape[0]] = point


def put_state(swarm, work, members, first):
    """The state of its bodies into its work, in which nothing else is left from before."""
    for body in range(work.poses.shape[0]):
        member = members[first + body]
        for axis in range(3):
            work.place[NOW, body, axis] = swarm.motion[member, axis]
            work.place[PROPAGATED, body, axis] = swarm.carried[member, axis]
            work.velocity[NOW, body, axis] = swarm.motion[member, VX + axis]
            work.velocity[PROPAGATED, body, axis] = swarm.carried[member, VX + axis]
        work.errors[body] = swarm.errors[member]
        work.cluster[body] = body


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
    count, size = 0, work.poses.shape[0]
    for body in range(size):
        member = members[first + body]
        for link in range(swarm.first_link[member], swarm.first_link[member + 1]):
            other = local_of(members, first, size, swarm.links[link].earlier)
            if other < 0:
                continue
            if count == work.kept.shape[0]:
                return False
            work.kept[count] = swarm.links[link]
            kept = work.kept[count]
            kept.later, kept.earlier = body, other
            kept.vertex = local_point(swarm, scene, members, first, kept.vertex, body, other)
            kept.edge = local_point(swarm, scene, members, first, kept.edge, body, other)
            count += 1
    work.tally.kept = count + 1
    return True


def touch_plainly(work):
    """Let no contact graze or be held: where steps go on across switches there is none of that."""
    for kept in range(work.tally.kept - 1):
        work.kept[kept].mode = OPEN
        work.kept[kept].gap_offset = 0.0


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


def put_times(swarm, work, observed, clocks, counts, members, first):
    """Clock, counts, and the paths that its bodies are expected to go.

    Steps go on across switches where those of any of its bodies did, from their shortest step.
    """
    clocks[sw.RUNNING], counts[sw.RUNNING] = clocks[sw.FRESH], counts[sw.FRESH]
    clock = clocks[sw.RUNNING]
    clock.time, clock.until = swarm.times[sw.BEGIN], swarm.times[sw.END]
    clock.horizon = swarm.times[sw.HORIZON_AT]
    observed[0, sw.SINCE] = observed[0, sw.SEEN_AT] = swarm.times[sw.BEGIN]
    observed[0, sw.LENGTH] = swarm.times[sw.END] - swarm.times[sw.BEGIN]
    step, across = math.inf, 0.0
    for body in range(work.poses.shape[0]):
        member = members[first + body]
        if swarm.bodies[member].free == 1.0:
            other = swarm.methods[member]
            if other > across:
                step, across = math.inf, other
            step = min(step, swarm.steps[member]) if other == across else step
        x, y = swarm.motion[member, X], swarm.motion[member, Y]
        observed[body, sw.START_X] = observed[body, sw.SEEN_X] = x
        observed[body, sw.START_Y] = observed[body, sw.SEEN_Y] = y
        observed[body, sw.PATH_VX] = swarm.motion[member, VX]
        observed[body, sw.PATH_VY] = swarm.motion[member, VY]
        observed[body, sw.FURTHEST] = 0.0
        for stretch in range(sw.STRETCHES):
            box = box_at(stretch)
            observed[body, box + sw.LEFT] = observed[body, box + sw.LOW] = math.inf
            observed[body, box + sw.RIGHT] = observed[body, box + sw.HIGH] = -math.inf
        widen(observed, body, 0, x, y)
    clock.across = across
    clock.step = step if step < math.inf else clocks[sw.FRESH].step


def take_slips(swarm, scene, work, found, members, first):
    """Write down the displacements of its contacts; False without room."""
    count, begin = save_contacts(work), found.filled[0]
    work.tally.kept = 0
    if begin + count > found.links.shape[0]:
        return False
    for kept in range(count):
        found.links[begin + kept] = work.kept[kept]
        link = found.links[begin + kept]
        later, earlier = link.later, link.earlier
        link.vertex = global_point(swarm, scene, members, first, link.vertex, later, earlier)
        link.edge = global_point(swarm, scene, members, first, link.edge, later, earlier)
        link.later, link.earlier = members[first + later], members[first + earlier]
    found.filled[0] = begin + count
    return True


def take_state(swarm, work, observed, clock, members, first):
    """Write the state of its bodies at the window's end, and how they got there."""
    for body in range(work.poses.shape[0]):
        member = members[first + body]
        swarm.strayed[member] = observed[body, sw.FURTHEST]
        for stretch in range(sw.STRETCHES):
            for column in range(sw.BOX_COLUMNS):
                swarm.ways[member, stretch, column] = observed[body, box_at(stretch) + column]
        if swarm.bodies[member].free == 0.0:
            continue
        for axis in range(3):
            swarm.new_motion[member, axis] = work.place[NOW, body, axis]
            swarm.new_carried[member, axis] = work.place[PROPAGATED, body, axis]
            swarm.new_motion[member, VX + axis] = work.velocity[NOW, body, axis]
            swarm.new_carried[member, VX + axis] = work.velocity[PROPAGATED, body, axis]
        swarm.new_errors[member] = work.errors[body]
        # What errors of steps have led to goes on; the rest is of a run.
        known = swarm.new_errors[member]
        swarm.stated[member] = known.stated
        known.stated = known.velocity_lifetime = known.relaxation_time = 0.0
        known.step_displacement = known.step_velocity = 0.0
        swarm.new_steps[member] = clock.step
        swarm.new_methods[member] = clock.across


def run_islands(swarm, arrays, islands, found, first, last):
    """Run the islands from ``first`` to before ``last``, all of as many bodies as the ``arrays``
    are for: their Status into ``islands.codes``. How far that went: to one that found no room, or
    to the last.

    ``arrays``: IslandArrays; ``islands``: Islands (runner.py).
    """
    scene, work, observed = arrays.scene, arrays.work, arrays.observed
    clocks, counts, members = arrays.clocks, arrays.counts, islands.members
    clock, count = clocks[sw.RUNNING], counts[sw.RUNNING]
    for island in range(first, last):
        at = islands.starts[island]
        put_scene(swarm, scene, members, at)
        clear(arrays.block)
        begin(scene, work, True)
        put_state(swarm, work, members, at)
        if not put_slips(swarm, scene, work, members, at):
            work.tally.full = CANDIDATES_FULL
            return island
        put_times(swarm, work, observed, clocks, counts, members, at)
        if clock.across == 1.0:
            touch_plainly(work)
        code = advance(scene, work, observed, clock, count, arrays.record)
        if code == NO_ROOM:
            return island
        if code == FINISHED and not take_slips(swarm, scene, work, found, members, at):
            return island
        islands.codes[island] = code
        islands.costs[island, sw.STEPS_TAKEN] = count.steps
        islands.costs[island, sw.STEPS_REJECTED] = count.rejected
        islands.costs[island, sw.FORCES_SUMMED] = work.tally.evaluations
        take_state(swarm, work, observed, clock, members, at)
    return last
