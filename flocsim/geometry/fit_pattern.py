"""The pattern search of a fit: plain Python, compiled by fit_search.

It lowers V + balance·|excess|: V the wrong pixels, excess those covered less those of the mask.
With balance 0 that is the paper's V; with 1 it keeps the floc's area.
"""

import numpy as np

from flocsim.geometry.fit_cover import count_wrong, cover, move_vertex
from flocsim.geometry.fit_simple import stays_simple


def stepped(vertices, k, directions, direction, step):
    """Where vertex k comes to by a step in a direction."""
    return (
        vertices[k, 0] + step * directions[direction, 0],
        vertices[k, 1] + step * directions[direction, 1],
    )


def leaves_room(shape, new, margin):
    """Whether a place is at least `margin` from the array's rim: pixels off it are not counted."""
    return min(new[0], new[1]) >= margin and (
        new[0] <= shape[1] - 1 - margin and new[1] <= shape[0] - 1 - margin
    )


def best_step(mask, odd, near, vertices, k, radius, directions, step, excess, balance):
    """The direction in which a step of vertex k lowers the objective the most.

    Returns (direction or −1, change of the objective, growth of the cover).
    """
    count = len(vertices)
    before = vertices[k - 1, 0], vertices[k - 1, 1]
    here = vertices[k, 0], vertices[k, 1]
    after = vertices[(k + 1) % count, 0], vertices[(k + 1) % count, 1]
    best, least, grown = -1, 0, 0
    for direction in range(len(directions)):
        new = stepped(vertices, k, directions, direction, step)
        if not leaves_room(mask.shape, new, radius + 1.0):
            continue
        change, growth = move_vertex(mask, odd, near, before, here, after, new, radius, False)
        change += balance * (abs(excess + growth) - abs(excess))
        if change < least and stays_simple(vertices, k, new[0], new[1]):
            best, least, grown = direction, change, growth
    return best, least, grown


def step_vertex(mask, odd, near, vertices, k, radius, directions, step, excess, balance):
    """Take the best step of vertex k, if any: (change of the objective, growth of the cover)."""
    direction, change, growth = best_step(
        mask, odd, near, vertices, k, radius, directions, step, excess, balance
    )
    if direction >= 0:
        count = len(vertices)
        new = stepped(vertices, k, directions, direction, step)
        before = vertices[k - 1, 0], vertices[k - 1, 1]
        here = vertices[k, 0], vertices[k, 1]
        after = vertices[(k + 1) % count, 0], vertices[(k + 1) % count, 1]
        move_vertex(mask, odd, near, before, here, after, new, radius, True)
        vertices[k, 0], vertices[k, 1] = new
    return change, growth


def pattern_search(mask, vertices, radius, directions, steps, active, balance):
    """Move vertices along `directions` (k, 2) by shrinking `steps` [px] while that lowers.

    mask: (h, w) bool; vertices: (N, 2), simple, changed in place; active: (N,) bool, the vertices
    to begin with, and those that came in reach at the end.  A vertex whose steps all failed rests
    until one nearby moves.  Returns the objective, V for balance 0.
    """
    odd, near = cover(vertices, radius, mask.shape)
    wrong, excess = count_wrong(mask, odd, near)
    objective = wrong + balance * abs(excess)
    count = len(vertices)
    waiting = np.empty(count, np.bool_)
    for step in steps:
        for k in range(count):
            waiting[k] = active[k]
        k, rested = 0, 0
        while rested < count:
            change = 0
            if waiting[k]:
                change, growth = step_vertex(
                    mask, odd, near, vertices, k, radius, directions, step, excess, balance
                )
                waiting[k] = False
            if change < 0:
                objective += change
                excess += growth
                for near_by in range(k - 2, k + 3):
                    waiting[near_by % count] = active[near_by % count] = True
            rested = 0 if change < 0 else rested + 1
            k = (k + 1) % count
    return objective
