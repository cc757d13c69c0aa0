"""From a mask to N vertices: starts, pattern search, and moving vertices to where they are needed.

The kernels are composed (flocsim.composer): compiled on first use and kept on disk.
"""

from functools import cache
from itertools import islice

import numpy as np

from flocsim.composer import compose
from flocsim.geometry import fit_cover, fit_pattern, fit_simple
from flocsim.geometry.fit_outline import (
    even_points,
    inward_directions,
    ring_inside,
    telling_points,
    trace_outline,
)

ANGLES = np.pi / 4.0 * np.arange(8)
DIRECTIONS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])

STEPS = np.array([8.0, 4.0, 2.0, 1.0, 0.5, 0.25])
"""Steps of the pattern search [px]: from past the usual detail of a floc to below a pixel."""

SHIFTS = (0.0, 0.25, 0.5, 0.75)
"""Shifts, in spacings, of the evenly spaced starts."""

FEWEST = 8
"""Coarser searches go down to below this many vertices."""

CANDIDATES = 3
"""So many of the vertices that count least are tried elsewhere; more gains nearly nothing."""

EDGES = 100
"""Of more edges than this only the longest are given a vertex: the short ones need none."""


@cache
def compiled(kernel):
    """The kernel of fit_cover, fit_simple or fit_pattern, compiled."""
    return compose(kernel, {}, allocates=True)


def count_errors(mask, vertices, radius):
    """V of the swept polygon against the mask."""
    return int(compiled(fit_cover.count_errors)(mask, np.ascontiguousarray(vertices), radius))


def is_simple(vertices):
    """Whether no edges cross or nearly touch."""
    return bool(compiled(fit_simple.is_simple)(np.ascontiguousarray(vertices)))


def even_fit(mask, count, radius):
    """Points evenly spaced on the outline, drawn in by the radius: (N, 2) as x, y-down [px]; V."""
    padded, margin = _padded(mask, count, radius)
    points = even_points(trace_outline(padded), count)
    vertices = inset(_simple(points, padded), radius)
    return vertices - margin, count_errors(padded, vertices, radius)


def pattern_fit(mask, count, radius):
    """The best of several pattern searches, refined: vertices as in even_fit, and V."""
    padded, margin = _padded(mask, count, radius)
    searched = [_searched(padded, start, radius, STEPS) for start in _starts(padded, count, radius)]
    vertices, wrong = min(searched, key=lambda found: found[1])
    vertices, wrong = _relocated(padded, vertices, wrong, radius)
    return vertices - margin, wrong


def _padded(mask, count, radius):
    """The mask with room around it for the swept polygon, and the width of that margin [px]."""
    margin = int(np.ceil(radius)) + 6 + count // 100
    return np.pad(mask, margin), margin


def _starts(mask, count, radius):
    outline = trace_outline(mask)
    choices = [telling_points(outline, count)]
    choices += [even_points(outline, count, shift) for shift in SHIFTS]
    starts = [inset(_simple(points, mask), radius) for points in choices]
    split = _split_coarser(mask, outline, count, radius)
    return [*starts, split] if is_simple(split) else starts


def _split_coarser(mask, outline, count, radius):
    """A search with half as many vertices, its longest edges halved until there are `count`.

    Where vertices are many for the floc's size, starts on the outline are cramped; this is not.
    """
    half = max(2, (count + 1) // 2)
    if half < FEWEST:
        start = inset(_simple(telling_points(outline, half), mask), radius)
    else:
        start = _simple(_split_coarser(mask, outline, half, radius), mask)
    vertices = _searched(mask, start, radius, STEPS)[0]
    while len(vertices) < count:
        edges = np.roll(vertices, -1, axis=0) - vertices
        longest = int(np.argmax(np.hypot(*edges.T)))
        middle = vertices[longest] + 0.5 * edges[longest]
        vertices = np.insert(vertices, longest + 1, middle, axis=0)
    return vertices


def _simple(points, mask):
    """The points as a simple polygon: as they are, reordered, or a ring in their place."""
    if is_simple(points):
        return points
    reordered = np.array(points)
    compiled(fit_simple.untangle)(reordered)
    return reordered if is_simple(reordered) else ring_inside(mask, len(points))


def inset(vertices, depth):
    """The simple polygon with every vertex drawn inwards by `depth` [px], or less where it must."""
    drawn = np.array(vertices)
    compiled(fit_simple.draw_in)(drawn, inward_directions(drawn), float(depth))
    return drawn


def _searched(mask, start, radius, steps, active=None):
    vertices = np.array(start)
    active = np.ones(len(vertices), bool) if active is None else active
    search = compiled(fit_pattern.pattern_search)
    return vertices, int(search(mask, vertices, radius, DIRECTIONS, steps, active))


def _relocated(mask, vertices, wrong, radius):
    """Take vertices out where they count least and put them in anew, as long as V falls."""
    lowered = len(vertices) > 2
    while lowered and wrong > 0:
        lowered = False
        for trial in _relocations(mask, vertices, radius):
            if trial[1] < wrong:
                vertices, wrong = trial
                lowered = True
                break
    return vertices, wrong


def _relocations(mask, vertices, radius):
    """Every search after moving one of the least useful vertices to the middle of another edge."""
    for removed in _least_useful(mask, vertices, radius):
        rest = np.delete(vertices, removed, axis=0)
        for edge in _longest_edges(rest):
            middle = 0.5 * (rest[edge] + rest[(edge + 1) % len(rest)])
            start = np.insert(rest, edge + 1, middle, axis=0)
            if is_simple(start):
                active = _around(len(start), edge + 1, removed + (removed > edge))
                yield _searched(mask, start, radius, STEPS[1:], active)


def _least_useful(mask, vertices, radius):
    """Indices of the few vertices without which V grows the least and the polygon stays simple."""
    without = [np.delete(vertices, k, axis=0) for k in range(len(vertices))]
    order = np.argsort([count_errors(mask, rest, radius) for rest in without], kind="stable")
    return list(islice((int(k) for k in order if is_simple(without[k])), CANDIDATES))


def _longest_edges(vertices):
    """Indices, rising, of the edges where a vertex is tried: all, or the longest of very many."""
    lengths = np.hypot(*(np.roll(vertices, -1, axis=0) - vertices).T)
    return sorted(np.argsort(-lengths, kind="stable")[:EDGES].tolist())


def _around(count, *places):
    """(count,) bool: the vertices up to two from any of the `places`."""
    active = np.zeros(count, bool)
    for place in places:
        active[np.arange(place - 2, place + 3) % count] = True
    return active
