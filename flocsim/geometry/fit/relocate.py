"""Moving vertices from where they count least to where they gain most.

A polygon that no single step improves can still have its vertices in the wrong places.  Taking
vertex k out costs removal[k] pixels; one more vertex in edge e gains insertion[e].  Both are
estimated by single moves (plain Python, compiled); the pairs that promise most are tried in
earnest, with a search around both places.
"""

import numpy as np

from flocsim.geometry.fit.coverage import cover, move_vertex
from flocsim.geometry.fit.kernels import compiled, is_simple, searched

STEPS = np.array([4.0, 2.0, 1.0, 0.5, 0.25])
"""Steps [px] of a vertex that was moved elsewhere, and of those beside it."""

TRIALS = 8
"""Pairs (vertex, edge) that are tried before vertices stay where they are."""

DIRECTIONS = 8


def removal_cost(mask, odd, near, vertices, k, radius):
    """Growth of V when vertex k is left out."""
    count = len(vertices)
    before = vertices[k - 1, 0], vertices[k - 1, 1]
    here = vertices[k, 0], vertices[k, 1]
    after = vertices[(k + 1) % count, 0], vertices[(k + 1) % count, 1]
    return move_vertex(mask, odd, near, before, here, after, before, radius, False)[0]


def insertion_gain(mask, odd, near, vertices, k, radius, steps):
    """Fall of V by a vertex one step away from the middle of edge k, the best of all steps."""
    count = len(vertices)
    before = vertices[k, 0], vertices[k, 1]
    after = vertices[(k + 1) % count, 0], vertices[(k + 1) % count, 1]
    middle = 0.5 * (before[0] + after[0]), 0.5 * (before[1] + after[1])
    length = np.hypot(after[0] - before[0], after[1] - before[1])
    gain = 0
    for step in steps:
        for direction in range(DIRECTIONS if step < length + 1.0 else 0):
            angle = 2.0 * np.pi * direction / DIRECTIONS
            new = middle[0] + step * np.cos(angle), middle[1] + step * np.sin(angle)
            change = move_vertex(mask, odd, near, before, middle, after, new, radius, False)[0]
            gain = max(gain, -change)
    return gain


def estimates(mask, vertices, radius, steps):
    """(N, 2): removal_cost of every vertex, insertion_gain of the edge after it [px]."""
    odd, near = cover(vertices, radius, mask.shape)
    found = np.empty((len(vertices), 2))
    for k in range(len(vertices)):
        found[k, 0] = removal_cost(mask, odd, near, vertices, k, radius)
        found[k, 1] = insertion_gain(mask, odd, near, vertices, k, radius, steps)
    return found


def promising_pairs(costs, gains):
    """The TRIALS pairs (vertex, edge) of least cost − gain, the best first."""
    count = len(costs)
    cheap = np.argsort(costs, kind="stable")[:TRIALS].tolist()
    rich = np.argsort(-gains, kind="stable")[:TRIALS].tolist()
    pairs = [(k, e) for k in cheap for e in rich if e not in (k, (k - 1) % count)]
    return sorted(pairs, key=lambda pair: costs[pair[0]] - gains[pair[1]])[:TRIALS]


def moved(vertices, removed, edge):
    """The polygon without a vertex, with one in the middle of an edge; (N,) bool: those nearby."""
    middle = 0.5 * (vertices[edge] + vertices[(edge + 1) % len(vertices)])
    trial = np.delete(np.insert(vertices, edge + 1, middle, axis=0), removed + (removed > edge), 0)
    nearby = np.zeros(len(trial), bool)
    for place in (edge + 1 - (removed <= edge), removed + (removed > edge)):
        nearby[np.arange(place - 2, place + 3) % len(trial)] = True
    return trial, nearby


def improvement(mask, vertices, objective, radius, weights):
    """The first promising move that lowers the objective: (vertices, objective), or None."""
    costs, gains = compiled(estimates)(mask, vertices, radius, STEPS).T
    for removed, edge in promising_pairs(costs, gains):
        start, nearby = moved(vertices, removed, edge)
        if is_simple(start):
            trial, found = searched(mask, start, radius, STEPS, weights, nearby)
            if found < objective:
                return trial, found
    return None


def relocate(mask, vertices, objective, radius, weights):
    """Move vertices to where that lowers the objective of the search, as long as it does."""
    while len(vertices) > 2 and objective > 0:
        better = improvement(mask, vertices, objective, radius, weights)
        if better is None:
            break
        vertices, objective = better
    return vertices
