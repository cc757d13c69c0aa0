"""The pattern search of a fit: plain Python, compiled by fit_search."""

import numpy as np

from flocsim.geometry.fit_cover import count_wrong, cover, move_vertex
from flocsim.geometry.fit_simple import stays_simple


def stepped(vertices, k, directions, direction, step):
    """Where vertex k comes to by a step in a direction."""
    return (
        vertices[k, 0] + step * directions[direction, 0],
        vertices[k, 1] + step * directions[direction, 1],
    )


def best_step(mask, odd, near, vertices, k, radius, directions, step):
    """The direction in which a step of vertex k lowers V the most: (direction or −1, change)."""
    count = len(vertices)
    before, after = vertices[(k - 1) % count], vertices[(k + 1) % count]
    margin = radius + 1.0
    best, least = -1, 0
    for direction in range(len(directions)):
        new = stepped(vertices, k, directions, direction, step)
        # Pixels off the array are not counted: the swept outline has to stay on it.
        if min(new[0], new[1]) < margin or (
            new[0] > mask.shape[1] - 1 - margin or new[1] > mask.shape[0] - 1 - margin
        ):
            continue
        change = move_vertex(mask, odd, near, before, vertices[k], after, new, radius, False)
        if change < least and stays_simple(vertices, k, new[0], new[1]):
            best, least = direction, change
    return best, least


def step_vertex(mask, odd, near, vertices, k, radius, directions, step):
    """Take the best step of vertex k, if any lowers V, and give the change of V."""
    direction, change = best_step(mask, odd, near, vertices, k, radius, directions, step)
    if direction >= 0:
        count = len(vertices)
        new = stepped(vertices, k, directions, direction, step)
        before, after = vertices[(k - 1) % count], vertices[(k + 1) % count]
        move_vertex(mask, odd, near, before, vertices[k], after, new, radius, True)
        vertices[k, 0], vertices[k, 1] = new
    return change


def pattern_search(mask, vertices, radius, directions, steps, active):
    """Move vertices along `directions` (k, 2) by shrinking `steps` [px] while V falls.

    mask: (h, w) bool; vertices: (N, 2), simple, changed in place; active: (N,) bool, the vertices
    to begin with, and those that came in reach at the end.  A vertex whose steps all failed rests
    until one nearby moves.  Returns V.
    """
    odd, near = cover(vertices, radius, mask.shape)
    wrong = count_wrong(mask, odd, near)
    count = len(vertices)
    waiting = np.empty(count, np.bool_)
    for step in steps:
        for k in range(count):
            waiting[k] = active[k]
        k, rested = 0, 0
        while rested < count:
            change = 0
            if waiting[k]:
                change = step_vertex(mask, odd, near, vertices, k, radius, directions, step)
                waiting[k] = False
            if change < 0:
                wrong += change
                for near_by in range(k - 2, k + 3):
                    waiting[near_by % count] = active[near_by % count] = True
            rested = 0 if change < 0 else rested + 1
            k = (k + 1) % count
    return wrong
