"""Tangential displacements while contacts roll from pair to pair and lists are made anew."""

import math

from flocsim.arrays import (
    CANDIDATES,
    EDGE_ARM_N,
    EDGE_ARM_T,
    EDGE_BODY,
    EDGE_START,
    GAP,
    KEPT,
    KEPT_EDGE,
    KEPT_SLIP,
    KEPT_VERTEX,
    NORMAL_X,
    NORMAL_Y,
    NOW,
    VERTEX,
    VERTEX_ARM_N,
    VERTEX_ARM_T,
    VERTEX_BODY,
)


def keep_slips(work):
    """Set aside the tangential displacements of the listed pairs; how many there are.

    Those that an earlier attempt has set aside, whose list found no room, are still the ones.
    """
    if work.tally[KEPT] > 0:
        return work.tally[KEPT] - 1
    count = 0
    for row in range(work.tally[CANDIDATES]):
        if work.slip[NOW, row] != 0.0:
            work.kept[count, KEPT_VERTEX] = work.candidates[row, VERTEX]
            work.kept[count, KEPT_EDGE] = work.candidates[row, EDGE_START]
            work.slip[KEPT_SLIP, count] = work.slip[NOW, row]
            count += 1
    work.tally[KEPT] = count + 1
    return count


def restore_slips(work, count):
    """Give the kept displacements back to the same pairs of the new list."""
    for row in range(work.tally[CANDIDATES]):
        work.slip[NOW, row] = 0.0
        for k in range(count):
            same = work.kept[k, KEPT_VERTEX] == work.candidates[row, VERTEX]
            if same and work.kept[k, KEPT_EDGE] == work.candidates[row, EDGE_START]:
                work.slip[NOW, row] = work.slip[KEPT_SLIP, k]
    work.tally[KEPT] = 0


def nearest_active(work, row):
    """The closed pair of the same two bodies nearest to an opening one, −1 where none is left."""
    found = -1
    least = math.inf
    low = min(work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY])
    high = max(work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY])
    x, y = contact_point(work, row, low)
    for other in range(work.tally[CANDIDATES]):
        a, b = work.candidates[other, VERTEX_BODY], work.candidates[other, EDGE_BODY]
        if work.geometry[NOW, other, GAP] < 0.0 and min(a, b) == low and max(a, b) == high:
            ox, oy = contact_point(work, other, low)
            distance = (ox - x) ** 2 + (oy - y) ** 2
            if distance < least:
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


def hand_over(work):
    """Pass the displacement of every pair that has opened on to the nearest that carries on.

    The tangential force of a contact that rolls from pair to pair then does not jump; with the
    last pair it vanishes. Expects the geometry of the current position.
    """
    for row in range(work.tally[CANDIDATES]):
        if work.slip[NOW, row] != 0.0 and work.geometry[NOW, row, GAP] >= 0.0:
            heir = nearest_active(work, row)
            if heir >= 0:
                work.slip[NOW, heir] += work.slip[NOW, row] * tangent_agreement(work, row, heir)
            work.slip[NOW, row] = 0.0


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
