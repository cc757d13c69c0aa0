"""The pattern search of a fit: plain Python, compiled by fit_search.

It lowers V + balance·|excess| + outside·(V + excess): V the wrong pixels, excess those covered less
those of the mask, so that V + excess is twice the pixels covered outside of the mask.
"""

import numpy as np

from flocsim.geometry.fit.coverage import count_wrong, cover, move_vertex
from flocsim.geometry.fit.simple import stays_simple

PLAIN = (0, 0)
"""(balance, outside) for the paper's V."""

AREA = (1, 0)
"""Keeps the floc's area."""

INSCRIBED = (0, 25)
"""A pixel outside of the mask weighs as fifty that are missed: more, and the search gives up large
parts of the floc for the first few pixels."""

INSIDE = (0, 10**6)
"""No number of missed pixels makes up for one outside: the end of an inscribed fit."""


def weighed(wrong, excess, weights):
    """The objective of a fit."""
    return wrong + weights[0] * abs(excess) + weights[1] * (wrong + excess)


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


def best_step(mask, odd, near, vertices, k, radius, directions, step, excess, weights):
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
        change = weighed(change, excess + growth, weights) - weighed(0, excess, weights)
        if change < least and stays_simple(vertices, k, new[0], new[1]):
            best, least, grown = direction, change, growth
    return best, least, grown


def step_vertex(mask, odd, near, vertices, k, radius, directions, step, excess, weights):
    """Take the best step of vertex k, if any: (change of the objective, growth of the cover)."""
    direction, change, growth = best_step(
        mask, odd, near, vertices, k, radius, directions, step, excess, weights
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


def pattern_search(mask, vertices, radius, directions, steps, active, weights):
    """Move vertices along `directions` (k, 2) by shrinking `steps` [px] while that lowers.

    mask: (h, w) bool; vertices: (N, 2), simple, changed in place; active: (N,) bool, the vertices
    to begin with, and those that came in reach at the end.  A vertex whose steps all failed rests
    until one nearby moves.  Returns the objective, V for PLAIN weights.
    """
    odd, near = cover(vertices, radius, mask.shape)
    wrong, excess = count_wrong(mask, odd, near)
    objective = weighed(wrong, excess, weights)
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
                    mask, odd, near, vertices, k, radius, directions, step, excess, weights
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
