"""Tangential displacements while contacts roll from pair to pair and lists are made anew."""

import math

from flocsim.arrays import (
    CANDIDATES,
    CARRIED,
    CLOSED,
    EDGE_ARM_N,
    EDGE_ARM_T,
    EDGE_BODY,
    EDGE_END,
    EDGE_START,
    FLIGHT,
    FLIGHTS,
    FRESH,
    GAP,
    GAP_OFFSET,
    GRAZES,
    GRAZING_FORCE,
    KEPT,
    KEPT_EARLIER,
    KEPT_EDGE,
    KEPT_FLIGHTS,
    KEPT_FORCE,
    KEPT_GAP,
    KEPT_LATER,
    KEPT_MODE,
    KEPT_OFFSET,
    KEPT_SLIP,
    KEPT_VERTEX,
    NORMAL_X,
    NORMAL_Y,
    NOW,
    PAIR,
    RADIUS,
    SLIP_OFFSET,
    VERTEX,
    VERTEX_ARM_N,
    VERTEX_ARM_T,
    VERTEX_BODY,
    X,
)
from flocsim.hooks import hook


def is_kept(work, row, mode):
    """Whether there is anything to be known of a pair besides where its bodies are."""
    known = work.slip[NOW, row] != 0.0 or work.slip[GAP_OFFSET, row] != 0.0
    return known or work.slip[FLIGHTS, row] != 0.0 or mode == GRAZES


def keep_slips(work):
    """Set aside the tangential displacements, and the grazing, of the listed pairs; how many there
    are.

    Those that an earlier attempt has set aside, whose list found no room, are still the ones.
    """
    if work.tally[KEPT] > 0:
        return work.tally[KEPT] - 1
    count = 0
    for row in range(work.tally[CANDIDATES]):
        mode = work.candidates[row, CLOSED]
        if is_kept(work, row, mode):
            a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
            work.kept[count, KEPT_LATER], work.kept[count, KEPT_EARLIER] = max(a, b), min(a, b)
            work.kept[count, KEPT_VERTEX] = work.candidates[row, VERTEX]
            work.kept[count, KEPT_EDGE] = work.candidates[row, EDGE_START]
            work.kept[count, KEPT_MODE] = mode
            work.slip[KEPT_SLIP, count] = work.slip[NOW, row]
            work.slip[KEPT_FORCE, count] = work.slip[GRAZING_FORCE, row]
            work.slip[KEPT_GAP, count] = work.slip[GAP_OFFSET, row]
            work.slip[KEPT_OFFSET, count] = work.slip[SLIP_OFFSET, row]
            work.slip[KEPT_FLIGHTS, count] = work.slip[FLIGHTS, row]
            count += 1
    work.tally[KEPT] = count + 1
    return count


def comes_before(work, kept, later, earlier):
    """Whether the bodies of a kept displacement come before two others in the list."""
    if work.kept[kept, KEPT_LATER] != later:
        return work.kept[kept, KEPT_LATER] < later
    return work.kept[kept, KEPT_EARLIER] < earlier


def restore_slips(work, count):
    """Give the kept displacements back to the same pairs of the new list; both are in the order of
    their bodies."""
    first = 0
    for row in range(work.tally[CANDIDATES]):
        work.slip[NOW, row] = work.slip[SLIP_OFFSET, row] = work.slip[GAP_OFFSET, row] = 0.0
        work.slip[FLIGHT, row] = work.slip[FLIGHTS, row] = 0.0
        a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
        later, earlier = max(a, b), min(a, b)
        while first < count and comes_before(work, first, later, earlier):
            first += 1
        for k in range(first, count):
            if work.kept[k, KEPT_LATER] != later or work.kept[k, KEPT_EARLIER] != earlier:
                break
            same = work.kept[k, KEPT_VERTEX] == work.candidates[row, VERTEX]
            if same and work.kept[k, KEPT_EDGE] == work.candidates[row, EDGE_START]:
                work.slip[NOW, row] = work.slip[KEPT_SLIP, k]
                work.slip[SLIP_OFFSET, row] = work.slip[KEPT_OFFSET, k]
                work.slip[GAP_OFFSET, row] = work.slip[KEPT_GAP, k]
                work.slip[FLIGHTS, row] = work.slip[KEPT_FLIGHTS, k]
                if work.kept[k, KEPT_MODE] == GRAZES:
                    work.candidates[row, CLOSED] = GRAZES
                    work.slip[GRAZING_FORCE, row] = work.slip[KEPT_FORCE, k]
                    work.slip[FRESH, row] = 0.0
    work.tally[KEPT] = 0


def first_of_pair(work, row):
    """The first row of the two bodies of a row: their rows follow one another."""
    while row > 0 and work.candidates[row - 1, PAIR] == work.candidates[row, PAIR]:
        row -= 1
    return row


@hook
def same_corner(scene, body, point, other):
    """Whether two core points of a body are the same one or follow each other."""
    count = scene.first[body + 1] - scene.first[body]
    apart = abs(point - other)
    return apart <= 1 or apart == count - 1


def same_end(start, end, other_start, other_end):
    """Whether two edges of a body are the same one or meet."""
    return start in (other_start, other_end) or end in (other_start, other_end)


def rolls_on_to(scene, work, row, other):
    """Whether a pair of features of the same two bodies neighbours another, either way round."""
    pairs = work.candidates
    point, start, end = pairs[row, VERTEX], pairs[row, EDGE_START], pairs[row, EDGE_END]
    on, first, last = pairs[other, VERTEX], pairs[other, EDGE_START], pairs[other, EDGE_END]
    if pairs[row, VERTEX_BODY] == pairs[other, VERTEX_BODY]:
        near = same_corner(scene, pairs[row, VERTEX_BODY], point, on)
        return near and same_end(start, end, first, last)
    return on in (start, end) and point in (first, last)


def heir_of(scene, work, row):
    """The closed pair that a contact rolls on to when this one opens, −1 where it does not.

    The nearest contact point of the same two bodies, if it is of a neighbouring pair of features
    or within r_i + r_j of the spheroradii.
    """
    found = -1
    least = math.inf
    low = min(work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY])
    high = max(work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY])
    near = scene.bodies[low, RADIUS] + scene.bodies[high, RADIUS]
    x, y = contact_point(work, row, low)
    for other in range(first_of_pair(work, row), work.tally[CANDIDATES]):
        if work.candidates[other, PAIR] != work.candidates[row, PAIR]:
            break
        if work.geometry[NOW, other, GAP] < 0.0:
            ox, oy = contact_point(work, other, low)
            distance = math.hypot(ox - x, oy - y)
            if distance < least and (distance <= near or rolls_on_to(scene, work, row, other)):
                least = distance
                found = other
    return found


def contact_point(work, row, body):
    """The middle of a pair's overlap, relative to the centroid of one of its bodies."""
    geometry = work.geometry[NOW]
    nx, ny = geometry[row, NORMAL_X], geometry[row, NORMAL_Y]
    if work.candidates[row, VERTEX_BODY] == body:
        across, along = geometry[row, VERTEX_ARM_N], geometry[row, VERTEX_ARM_T]
    else:
        across, along = geometry[row, EDGE_ARM_N], geometry[row, EDGE_ARM_T]
    return along * nx + across * ny, along * ny - across * nx


def hand_over(scene, work):
    """Pass the displacement of every pair that has opened on to the pair that it rolls on to.

    The tangential force of a contact that rolls on then does not jump, as far as energy allows:
    Σ ½ k_t ξ² of the two bodies never grows, since what it grew by would drive them without end.
    Without an heir ξ vanishes. Expects the geometry of the current position.
    """
    for row in range(work.tally[CANDIDATES]):
        grazes = work.candidates[row, CLOSED] == GRAZES
        if work.slip[NOW, row] != 0.0 and work.geometry[NOW, row, GAP] >= 0.0 and not grazes:
            heir = heir_of(scene, work, row)
            if heir >= 0:
                own, given = work.slip[NOW, heir], work.slip[NOW, row]
                most = math.hypot(own, given)
                agreement = tangent_agreement(work, row, heir)
                total = own + given * agreement
                work.slip[NOW, heir] = min(max(total, -most), most)
                wrong = slip_error(work, row, X) + work.slip[SLIP_OFFSET, row]
                work.slip[SLIP_OFFSET, heir] += wrong * agreement
            work.slip[NOW, row] = 0.0


def slip_error(work, row, first):
    """How wrong a pair's two contact points lie along the tangent, as carried on with the motion
    [m], for ``first`` X; how wrong they move there [m/s], for VELOCITY."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    e, g = work.motion, work.geometry
    along = g[NOW, row, NORMAL_X] * (e[CARRIED, a, first + 1] - e[CARRIED, b, first + 1])
    along -= g[NOW, row, NORMAL_Y] * (e[CARRIED, a, first] - e[CARRIED, b, first])
    along += g[NOW, row, VERTEX_ARM_T] * e[CARRIED, a, first + 2]
    return along - g[NOW, row, EDGE_ARM_T] * e[CARRIED, b, first + 2]


def tangent_agreement(work, row, other):
    """How much of one pair's tangential force another pair can carry: a cosine.

    A pair listed the other way round has the opposite tangent, and its slip the same sign.
    """
    geometry = work.geometry[NOW]
    cosine = (
        geometry[row, NORMAL_X] * geometry[other, NORMAL_X]
        + geometry[row, NORMAL_Y] * geometry[other, NORMAL_Y]
    )
    if work.candidates[row, VERTEX_BODY] == work.candidates[other, VERTEX_BODY]:
        return cosine
    return -cosine
