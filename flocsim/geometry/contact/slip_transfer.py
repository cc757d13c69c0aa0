"""Tangential displacements while contacts roll from pair to pair and lists are made anew."""

import math

import flocsim.arrays as at
from flocsim.hooks import hook


def keep_slips(work):
    """Set aside the tangential displacements, and the grazing, of the listed pairs; how many there
    are.

    Those that an earlier attempt has set aside, whose list found no room, are still the ones.
    """
    if work.tally[at.KEPT] > 0:
        return work.tally[at.KEPT] - 1
    count = 0
    for row in range(work.tally[at.CANDIDATES]):
        mode = work.candidates[row, at.CLOSED]
        # Whether there is anything to be known of a pair besides where its bodies are.
        known = work.slip[at.NOW, row] != 0.0 or work.slip[at.GAP_OFFSET, row] != 0.0
        if known or work.slip[at.FLIGHTS, row] != 0.0 or mode == at.GRAZES:
            a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
            work.kept[count, at.KEPT_LATER] = max(a, b)
            work.kept[count, at.KEPT_EARLIER] = min(a, b)
            work.kept[count, at.KEPT_VERTEX] = work.candidates[row, at.VERTEX]
            work.kept[count, at.KEPT_EDGE] = work.candidates[row, at.EDGE_START]
            work.kept[count, at.KEPT_MODE] = mode
            work.slip[at.KEPT_SLIP, count] = work.slip[at.NOW, row]
            work.slip[at.KEPT_FORCE, count] = work.slip[at.GRAZING_FORCE, row]
            work.slip[at.KEPT_GAP, count] = work.slip[at.GAP_OFFSET, row]
            work.slip[at.KEPT_OFFSET, count] = work.slip[at.SLIP_OFFSET, row]
            work.slip[at.KEPT_FLIGHTS, count] = work.slip[at.FLIGHTS, row]
            count += 1
    work.tally[at.KEPT] = count + 1
    return count


def comes_before(work, kept, later, earlier):
    """Whether the bodies of a kept displacement come before two others in the list."""
    if work.kept[kept, at.KEPT_LATER] != later:
        return work.kept[kept, at.KEPT_LATER] < later
    return work.kept[kept, at.KEPT_EARLIER] < earlier


def restore_slips(work, count):
    """Give the kept displacements back to the same pairs of the new list; both are in the order of
    their bodies."""
    first = 0
    for row in range(work.tally[at.CANDIDATES]):
        work.slip[at.NOW, row] = work.slip[at.SLIP_OFFSET, row] = 0.0
        work.slip[at.GAP_OFFSET, row] = 0.0
        work.slip[at.FLIGHT, row] = work.slip[at.FLIGHTS, row] = 0.0
        a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
        later, earlier = max(a, b), min(a, b)
        while first < count and comes_before(work, first, later, earlier):
            first += 1
        for k in range(first, count):
            if work.kept[k, at.KEPT_LATER] != later or work.kept[k, at.KEPT_EARLIER] != earlier:
                break
            same = work.kept[k, at.KEPT_VERTEX] == work.candidates[row, at.VERTEX]
            if same and work.kept[k, at.KEPT_EDGE] == work.candidates[row, at.EDGE_START]:
                work.slip[at.NOW, row] = work.slip[at.KEPT_SLIP, k]
                work.slip[at.SLIP_OFFSET, row] = work.slip[at.KEPT_OFFSET, k]
                work.slip[at.GAP_OFFSET, row] = work.slip[at.KEPT_GAP, k]
                work.slip[at.FLIGHTS, row] = work.slip[at.KEPT_FLIGHTS, k]
                if work.kept[k, at.KEPT_MODE] == at.GRAZES:
                    work.candidates[row, at.CLOSED] = at.GRAZES
                    work.slip[at.GRAZING_FORCE, row] = work.slip[at.KEPT_FORCE, k]
                    work.slip[at.FRESH, row] = 0.0
    work.tally[at.KEPT] = 0


@hook
def same_corner(scene, body, point, other):
    """Whether two core points of a body are the same one or follow each other."""
    count = scene.first[body + 1] - scene.first[body]
    apart = abs(point - other)
    return apart <= 1 or apart == count - 1


def rolls_on_to(scene, work, row, other):
    """Whether a pair of features of the same two bodies neighbours another, either way round."""
    pairs = work.candidates
    point, start, end = pairs[row, at.VERTEX], pairs[row, at.EDGE_START], pairs[row, at.EDGE_END]
    on = pairs[other, at.VERTEX]
    first, last = pairs[other, at.EDGE_START], pairs[other, at.EDGE_END]
    if pairs[row, at.VERTEX_BODY] == pairs[other, at.VERTEX_BODY]:
        near = same_corner(scene, pairs[row, at.VERTEX_BODY], point, on)
        return near and (start in (first, last) or end in (first, last))
    return on in (start, end) and point in (first, last)


def heir_of(scene, work, row):
    """The closed pair that a contact rolls on to when this one opens, −1 where it does not.

    The nearest contact point of the same two bodies, if it is of a neighbouring pair of features
    or within r_i + r_j of the spheroradii.
    """
    found = -1
    least = math.inf
    low = min(work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY])
    high = max(work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY])
    near = scene.bodies[low, at.RADIUS] + scene.bodies[high, at.RADIUS]
    x, y = contact_point(work, row, low)
    pair, first = work.candidates[row, at.PAIR], row
    while first > 0 and work.candidates[first - 1, at.PAIR] == pair:
        first -= 1  # the rows of two bodies follow one another
    for other in range(first, work.tally[at.CANDIDATES]):
        if work.candidates[other, at.PAIR] != pair:
            break
        if work.geometry[at.NOW, other, at.GAP] < 0.0:
            ox, oy = contact_point(work, other, low)
            distance = math.hypot(ox - x, oy - y)
            if distance < least and (distance <= near or rolls_on_to(scene, work, row, other)):
                least = distance
                found = other
    return found


def contact_point(work, row, body):
    """The middle of a pair's overlap, relative to the centroid of one of its bodies."""
    geometry = work.geometry[at.NOW]
    nx, ny = geometry[row, at.NORMAL_X], geometry[row, at.NORMAL_Y]
    if work.candidates[row, at.VERTEX_BODY] == body:
        across, along = geometry[row, at.VERTEX_ARM_N], geometry[row, at.VERTEX_ARM_T]
    else:
        across, along = geometry[row, at.EDGE_ARM_N], geometry[row, at.EDGE_ARM_T]
    return along * nx + across * ny, along * ny - across * nx


def hand_over(scene, work):
    """Pass the displacement of every pair that has opened on to the pair that it rolls on to.

    The tangential force of a contact that rolls on then does not jump, as far as energy allows:
    Σ ½ k_t ξ² of the two bodies never grows, since what it grew by would drive them without end.
    Without an heir ξ vanishes. Expects the geometry of the current position.
    """
    for row in range(work.tally[at.CANDIDATES]):
        opened = work.geometry[at.NOW, row, at.GAP] >= 0.0
        grazes = work.candidates[row, at.CLOSED] == at.GRAZES
        if work.slip[at.NOW, row] != 0.0 and opened and not grazes:
            heir = heir_of(scene, work, row)
            if heir >= 0:
                own, given = work.slip[at.NOW, heir], work.slip[at.NOW, row]
                most = math.hypot(own, given)
                agreement = tangent_agreement(work, row, heir)
                total = own + given * agreement
                work.slip[at.NOW, heir] = min(max(total, -most), most)
                wrong = slip_error(work, row, at.X) + work.slip[at.SLIP_OFFSET, row]
                work.slip[at.SLIP_OFFSET, heir] += wrong * agreement
            work.slip[at.NOW, row] = 0.0


def slip_error(work, row, first):
    """How wrong a pair's two contact points lie along the tangent, as carried on with the motion
    [m], for ``first`` X; how wrong they move there [m/s], for VELOCITY."""
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    e, g = work.motion, work.geometry
    along = g[at.NOW, row, at.NORMAL_X] * (
        e[at.CARRIED, a, first + 1] - e[at.CARRIED, b, first + 1]
    )
    along -= g[at.NOW, row, at.NORMAL_Y] * (e[at.CARRIED, a, first] - e[at.CARRIED, b, first])
    along += g[at.NOW, row, at.VERTEX_ARM_T] * e[at.CARRIED, a, first + 2]
    return along - g[at.NOW, row, at.EDGE_ARM_T] * e[at.CARRIED, b, first + 2]


def tangent_agreement(work, row, other):
    """How much of one pair's tangential force another pair can carry: a cosine.

    A pair listed the other way round has the opposite tangent, and its slip the same sign.
    """
    geometry = work.geometry[at.NOW]
    cosine = (
        geometry[row, at.NORMAL_X] * geometry[other, at.NORMAL_X]
        + geometry[row, at.NORMAL_Y] * geometry[other, at.NORMAL_Y]
    )
    if work.candidates[row, at.VERTEX_BODY] == work.candidates[other, at.VERTEX_BODY]:
        return cosine
    return -cosine
