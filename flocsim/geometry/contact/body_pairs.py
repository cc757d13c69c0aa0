"""Which bodies may come near each other before they have moved much: the pairs that are watched.

A pair counts where one of its bodies is free: fixed ones do not act on each other, however many
there are, and may overlap. Of few bodies all such pairs are watched; of many, those whose bounding
circles are near. A pair that counts and is not listed lies further apart than what acts on it
reaches, and than two bodies may go until the next listing.

Which of many discs come near each other while each goes straight on is found by a sweep along x:
discs lie in the order of their left ends, and each is compared with those that begin before it
ends; that order is kept from one time to the next, so that sorting it anew costs next to nothing.
Where space repeats itself, the sweep goes on round the seam.
"""

import math

from flocsim.geometry.contact.points import length_of, nearest_way
from flocsim.hooks import hook
from flocsim.state.bodies import X, Y
from flocsim.state.clock import PAIRS_FULL
from flocsim.state.work import ALL_PAIRS, NOW

WANDER = 0.25
"""How far a body may go against the mean of all, in mean bounding radii, until pairs are listed
anew."""


def watches_all(work):
    """Whether all pairs that count are watched."""
    return work.poses.shape[0] <= ALL_PAIRS


def wander_of(scene):
    """How far a body may go until the pairs are listed anew [m]."""
    total, free = 0.0, 0
    for body in range(scene.bodies.shape[0]):
        if scene.bodies[body].free == 1.0:
            total += scene.bodies[body].bounding_radius
            free += 1
    return WANDER * total / max(free, 1)


def drift_of(scene, work, state):
    """The mean way (x, y) of all bodies since the listing; none where one is fixed."""
    x = y = 0.0
    for body in range(scene.bodies.shape[0]):
        pose = work.poses[body]
        if scene.bodies[body].free == 0.0:
            return 0.0, 0.0
        x += work.place[state, body, X]
        x -= pose.listed_x
        y += work.place[state, body, Y]
        y -= pose.listed_y
    return x / scene.bodies.shape[0], y / scene.bodies.shape[0]


def mean_velocity(scene, work):
    """The mean velocity (x, y) of all bodies; none where one is fixed."""
    x = y = 0.0
    for body in range(scene.bodies.shape[0]):
        if scene.bodies[body].free == 0.0:
            return 0.0, 0.0
        x += work.velocity[NOW, body, X]
        y += work.velocity[NOW, body, Y]
    return x / scene.bodies.shape[0], y / scene.bodies.shape[0]


@hook
def wandered(scene, work, state):
    """The largest share of its way that a body has gone since the listing, against the mean."""
    most, furthest = wander_of(scene), 0.0
    drift_x, drift_y = drift_of(scene, work, state)
    for body in range(scene.bodies.shape[0]):
        pose = work.poses[body]
        x = work.place[state, body, X] - pose.listed_x - drift_x
        y = work.place[state, body, Y] - pose.listed_y - drift_y
        furthest = max(furthest, length_of(x, y))
    return furthest / most


@hook
def time_to_wander(scene, work, share):
    """The time [s] in which no body goes further than a share of its way, at constant speed."""
    most, fastest = wander_of(scene), 0.0
    drift_x, drift_y = mean_velocity(scene, work)
    for body in range(scene.bodies.shape[0]):
        x = work.velocity[NOW, body, X] - drift_x
        y = work.velocity[NOW, body, Y] - drift_y
        fastest = max(fastest, length_of(x, y))
    return share * most / fastest if fastest > 0.0 else math.inf


@hook
def list_near(scene, work, cut):
    """List the pairs whose bounding circles are nearer than a gap, sorted; False without room."""
    discs, (width, height) = work.discs, scene.box
    for body in range(work.poses.shape[0]):
        discs[body].x = work.place[NOW, body, X]
        discs[body].y = work.place[NOW, body, Y]
        discs[body].way_x = discs[body].way_y = 0.0
        discs[body].reach = scene.bodies[body].bounding_radius + 0.5 * cut
        discs[body].moves = scene.bodies[body].free
    total = near_pairs(discs, work.order, width, height, work.starts, work.pairs)
    if total > work.pairs.shape[0]:
        work.tally.full, work.tally.pairs = PAIRS_FULL, 0
        return False
    for pair in range(total):
        work.pairs[pair].acting = 0
    work.tally.pairs = total
    return True


def list_pairs(scene, work, cut):
    """List the pairs of bodies that may come nearer than a gap [m]; False without room."""
    if watches_all(work):
        return True
    return list_near(scene, work, cut + 2.0 * wander_of(scene))


def place_ends(discs, width):
    """Fill in where every disc begins and ends along x, all of its way."""
    for disc in range(discs.shape[0]):
        way, reach = discs[disc].way_x, discs[disc].reach
        left = discs[disc].x + min(way, 0.0) - reach
        length = abs(way) + 2.0 * reach
        if width < math.inf:
            left -= width * math.floor(left / width)
        discs[disc].left, discs[disc].right = left, left + length


def sort_discs(discs, order):
    """Sort the discs by their left ends, equal ones by their numbers, by insertion: their order
    has hardly changed."""
    for place in range(1, order.shape[0]):
        disc, free = order[place], place
        left = discs[disc].left
        while free > 0:
            other = order[free - 1]
            if discs[other].left < left or (discs[other].left == left and other < disc):
                break
            order[free] = other
            free -= 1
        order[free] = disc


def come_near(discs, a, b, width, height):
    """Whether two discs touch at any time of their ways."""
    if discs[a].moves + discs[b].moves == 0.0:
        return False
    way_x, way_y = discs[a].way_x - discs[b].way_x, discs[a].way_y - discs[b].way_y
    # By the image that is nearest half way.
    x = nearest_way(discs[a].x - discs[b].x + 0.5 * way_x, width) - 0.5 * way_x
    y = nearest_way(discs[a].y - discs[b].y + 0.5 * way_y, height) - 0.5 * way_y
    length2, share = way_x * way_x + way_y * way_y, 0.0
    if length2 > 0.0:
        share = min(max(-(x * way_x + y * way_y) / length2, 0.0), 1.0)
    x, y = x + share * way_x, y + share * way_y
    reach = discs[a].reach + discs[b].reach
    return x * x + y * y < reach * reach


def sweep(discs, order, width, height, starts, pairs, fill):
    """Count the near ones among the discs before every disc, in ``starts``; or, where ``fill``,
    write (later, earlier) of every near pair to ``pairs``, from the later one's start on."""
    n = order.shape[0]
    for place in range(n):
        a = order[place]
        for step in range(1, n):
            there, shift = place + step, 0.0
            if there >= n:
                if width == math.inf:
                    break
                there, shift = there - n, width
            b = order[there]
            if discs[b].left + shift > discs[a].right:
                break
            # Round the box, two long discs find each other twice: the shorter way counts.
            longer = width < math.inf and (2 * step > n or (2 * step == n and a > b))
            if longer and discs[a].left + width - shift <= discs[b].right:
                continue
            if come_near(discs, a, b, width, height):
                later = max(a, b)
                if fill:
                    pairs[starts[later]].later, pairs[starts[later]].earlier = later, min(a, b)
                starts[later] += 1


def sort_rows(pairs, first, end):
    """Sort one disc's pairs by the other one."""
    for row in range(first + 1, end):
        other, free = pairs[row].earlier, row
        while free > first and pairs[free - 1].earlier > other:
            pairs[free].earlier = pairs[free - 1].earlier
            free -= 1
        pairs[free].earlier = other


def near_pairs(discs, order, width, height, starts, pairs):
    """Write all (later, earlier) that come near each other, sorted; how many there are, more than
    ``pairs`` has room for where they are not all written."""
    n = discs.shape[0]
    place_ends(discs, width)
    sort_discs(discs, order)
    for disc in range(n):
        starts[disc] = 0
    sweep(discs, order, width, height, starts, pairs, False)
    total = 0
    for disc in range(n):
        count = starts[disc]
        starts[disc] = total
        total += count
    if total > pairs.shape[0]:
        return total
    sweep(discs, order, width, height, starts, pairs, True)
    # Every start has come to the next one's by now.
    first = 0
    for disc in range(n):
        sort_rows(pairs, first, starts[disc])
        first = starts[disc]
    return total
