"""Lists of pairs of bodies that may approach each other before the next listing (broad phase).

A pair can interact if at least one of its bodies is free; fixed bodies do not act on each other,
and may overlap. Among few bodies all such pairs are listed, among many those whose bounding circles
are near. A pair that can interact and is not listed lies further apart than the reach of its forces
plus the distance that two bodies may travel until the next listing.

The near pairs of many discs, each moving along a straight line, are found by sweep and prune along
x: discs are sorted by their left ends, and each is compared with those that begin before it ends.
The order is kept from one listing to the next, so sorting costs next to nothing. In a periodic
domain the sweep continues across the seam.
"""

import math

from flocsim.geometry.contact.points import length_of, nearest_displacement
from flocsim.hooks import hook
from flocsim.state.bodies import X, Y
from flocsim.state.clock import PAIRS_FULL
from flocsim.state.work import ALL_PAIRS, NOW

TRAVEL = 0.25
"""Displacement relative to the mean of all bodies, over their mean bounding radius, that triggers a
new listing."""


def lists_all_pairs(work):
    """Return True if all pairs that can interact are listed."""
    return work.poses.shape[0] <= ALL_PAIRS


def travel_limit(scene):
    """Return how far a body may travel until pairs are listed again [m]."""
    total, free = 0.0, 0
    for body in range(scene.bodies.shape[0]):
        if scene.bodies[body].free == 1.0:
            total += scene.bodies[body].bounding_radius
            free += 1
    return TRAVEL * total / max(free, 1)


def motion_of_body(work, state, body, is_speed):
    """Return the displacement (x, y) [m] of a body since the listing, in a state; or its present
    velocity [m/s]."""
    if is_speed:
        return work.velocity[NOW, body, X], work.velocity[NOW, body, Y]
    pose = work.poses[body]
    return work.place[state, body, X] - pose.listed_x, work.place[state, body, Y] - pose.listed_y


def largest_motion(scene, work, state, is_speed):
    """Return the largest of these relative to the mean of all bodies, or to rest if one is
    fixed."""
    count, all_free = scene.bodies.shape[0], 1.0
    mean_x, mean_y, largest = 0.0, 0.0, 0.0
    for body in range(count):
        x, y = motion_of_body(work, state, body, is_speed)
        mean_x, mean_y = mean_x + x / count, mean_y + y / count
        all_free = min(all_free, scene.bodies[body].free)
    for body in range(count):
        x, y = motion_of_body(work, state, body, is_speed)
        largest = max(largest, length_of(x - all_free * mean_x, y - all_free * mean_y))
    return largest


@hook
def travelled_share(scene, work, state):
    """Return the largest displacement relative to the mean since the listing, over its limit."""
    return largest_motion(scene, work, state, False) / travel_limit(scene)


@hook
def time_to_travel(scene, work, share):
    """Return the time [s] in which no body uses more than a share of its limit, at constant
    speed."""
    fastest = largest_motion(scene, work, NOW, True)
    return share * travel_limit(scene) / fastest if fastest > 0.0 else math.inf


@hook
def list_near(scene, work, cut):
    """List the pairs whose bounding circles are closer than ``cut`` [m], sorted; False without
    room."""
    discs, (width, height) = work.discs, scene.box
    for body in range(work.poses.shape[0]):
        discs[body].x = work.place[NOW, body, X]
        discs[body].y = work.place[NOW, body, Y]
        discs[body].way_x = discs[body].way_y = 0.0
        # Half of the cut-off is added to each circle.
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
    """List the pairs of bodies that may come closer than a gap [m]; return False without room."""
    if lists_all_pairs(work):
        return True
    # Both bodies may travel by the limit before the next listing.
    return list_near(scene, work, cut + 2.0 * travel_limit(scene))


def update_extents(discs, width):
    """Store the left and right ends of every disc's swept extent along x."""
    for disc in range(discs.shape[0]):
        way, reach = discs[disc].way_x, discs[disc].reach
        left = discs[disc].x + min(way, 0.0) - reach
        length = abs(way) + 2.0 * reach
        if width < math.inf:
            left -= width * math.floor(left / width)
        discs[disc].left, discs[disc].right = left, left + length


def sort_discs(discs, order):
    """Sort the discs by left end, ties by number.

    Insertion sort: the order has hardly changed since the last listing.
    """
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


def paths_meet(discs, a, b, width, height):
    """Return True if two discs touch at any time along their paths."""
    if discs[a].moves + discs[b].moves == 0.0:
        return False
    way_x, way_y = discs[a].way_x - discs[b].way_x, discs[a].way_y - discs[b].way_y
    # The periodic image that is nearest halfway along the relative path.
    x = nearest_displacement(discs[a].x - discs[b].x + 0.5 * way_x, width) - 0.5 * way_x
    y = nearest_displacement(discs[a].y - discs[b].y + 0.5 * way_y, height) - 0.5 * way_y
    # Closest approach: minimise |x + share · way| over shares in [0, 1].
    length2, share = way_x * way_x + way_y * way_y, 0.0
    if length2 > 0.0:
        share = min(max(-(x * way_x + y * way_y) / length2, 0.0), 1.0)
    x, y = x + share * way_x, y + share * way_y
    reach = discs[a].reach + discs[b].reach
    return x * x + y * y < reach * reach


def sweep(discs, order, width, height, starts, pairs, fill):
    """Count or store the pairs of discs that come near.

    If ``fill`` is False, add to ``starts[later]`` the number of near pairs of each later disc; else
    write (later, earlier) to ``pairs``, from ``starts[later]`` on.
    """
    n = order.shape[0]
    for place in range(n):
        a = order[place]
        for step in range(1, n):
            there, shift = place + step, 0.0
            # Beyond the last disc the sweep goes on with the first ones, shifted by one period.
            if there >= n:
                if width == math.inf:
                    break
                there, shift = there - n, width
            b = order[there]
            if discs[b].left + shift > discs[a].right:
                break
            # Across the seam two long discs can meet twice: keep the shorter way round.
            longer = width < math.inf and (2 * step > n or (2 * step == n and a > b))
            if longer and discs[a].left + width - shift <= discs[b].right:
                continue
            if paths_meet(discs, a, b, width, height):
                later = max(a, b)
                if fill:
                    pairs[starts[later]].later, pairs[starts[later]].earlier = later, min(a, b)
                starts[later] += 1


def sort_rows(pairs, first, end):
    """Sort the pairs of one disc by the number of the other."""
    for row in range(first + 1, end):
        other, free = pairs[row].earlier, row
        while free > first and pairs[free - 1].earlier > other:
            pairs[free].earlier = pairs[free - 1].earlier
            free -= 1
        pairs[free].earlier = other


def near_pairs(discs, order, width, height, starts, pairs):
    """Write all pairs (later, earlier) that come near, sorted; return their number.

    If there are more than ``pairs`` has room for, not all are written.
    """
    n = discs.shape[0]
    update_extents(discs, width)
    sort_discs(discs, order)
    for disc in range(n):
        starts[disc] = 0
    sweep(discs, order, width, height, starts, pairs, False)
    # Counting sort by the later disc: counts become start indices.
    total = 0
    for disc in range(n):
        count = starts[disc]
        starts[disc] = total
        total += count
    if total > pairs.shape[0]:
        return total
    sweep(discs, order, width, height, starts, pairs, True)
    # The fill has advanced every start index to the next disc's start.
    first = 0
    for disc in range(n):
        sort_rows(pairs, first, starts[disc])
        first = starts[disc]
    return total
