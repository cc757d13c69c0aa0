"""From a mask to N vertices: starts, pattern search, and moving vertices to where they are needed.

1. Starts: the corners of the best split of the outline into N segments (fit_segments), for small
   N from several first breaks; the points that tell most; even spacing.
2. Each start is searched by coarse steps, the best few by fine ones (fit_pattern).
3. The vertices of the best that count least go to where they lower V (fit_relocate).

Every start passes through the same search, so that V never ends above that of even spacing.
"""

import numpy as np

from flocsim.geometry.fit.kernels import compiled, inset, is_simple, searched
from flocsim.geometry.fit.outline import even_points, ring_inside, trace_outline
from flocsim.geometry.fit.pattern import INSCRIBED, INSIDE, PLAIN
from flocsim.geometry.fit.relocate import relocate
from flocsim.geometry.fit.segments import split_corners
from flocsim.geometry.fit.telling import telling_points

COARSE = np.array([8.0, 4.0, 2.0, 1.0])
"""First steps of the search [px]: from past the usual detail of a floc to a pixel."""

FINE = np.array([1.0, 0.5, 0.25])
"""Last steps [px], below a pixel."""

FINALISTS = 3
"""So many starts are searched by fine steps."""

FEW = 12
"""Up to so many vertices a search ends in many different places: more starts are tried."""

FIRST_BREAKS = 8
"""Splits into few segments that are tried, from first breaks spread over one segment."""

CRAMPED = 3.0
"""Vertices are many for a floc if they are nearer than so many radii along the outline."""

OUTLINE_POINTS = 96
"""An outline of more points than this and 4 N is thinned out before it is split."""


def even_start(mask, count, radius):
    """Points evenly spaced on the outline, drawn in by the radius."""
    return inset(even_points(trace_outline(mask), count), mask, radius)


def pattern_fit(mask, count, radius, weights=PLAIN):
    """The best of several pattern searches, refined: (N, 2) as x, y-down [px].

    mask: with room around it (fit_kernels.padded); weights: what counts beside V (fit_pattern).
    """
    starts = _starts(mask, count, radius)
    if weights == INSCRIBED:
        starts.append(ring_inside(mask, count))
    coarse = [searched(mask, start, radius, COARSE, weights) for start in starts]
    coarse.sort(key=lambda found: found[1])
    fine = [searched(mask, s, radius, FINE, weights) for s, _ in coarse[:FINALISTS]]
    best, objective = min(fine, key=lambda found: found[1])
    vertices = relocate(mask, best, objective, radius, weights)
    if weights == INSCRIBED:
        vertices = searched(mask, vertices, radius, np.append(COARSE, FINE[1:]), INSIDE)[0]
    return vertices


def _starts(mask, count, radius):
    outline = trace_outline(mask)
    choices = [*_splits(outline, count), _telling(outline, count), even_points(outline, count)]
    starts = [inset(points, mask, radius) for points in choices]
    if CRAMPED * count * radius > len(outline):
        cramped = _split_coarser(mask, outline, count, radius)
        starts += [start for start in (cramped, ring_inside(mask, count)) if is_simple(start)]
    return starts


def _splits(outline, count):
    """Corners of the best split, the first break free; of more, with other first breaks, if few."""
    size = max(min(len(outline), OUTLINE_POINTS), 4 * count)
    points = even_points(outline, size)
    farthest = int(np.argmax(np.hypot(*(points - points.mean(axis=0)).T)))
    yield split_corners(points, count, farthest, 2)
    for k in range(1, FIRST_BREAKS if count <= FEW else 1):
        shift = k * size // (count * FIRST_BREAKS)
        yield split_corners(points, count, (farthest + shift) % size, 0)


def _telling(outline, count):
    points = outline if len(outline) >= 2 * count else even_points(outline, 2 * count)
    return compiled(telling_points)(points, count)


def _split_coarser(mask, outline, count, radius):
    """A search with half as many vertices, its longest edges halved until there are `count`.

    Where vertices are many for the floc's size, starts on the outline are cramped; this is not.
    """
    half = max(2, (count + 1) // 2)
    if half < FEW:
        start = inset(_telling(outline, half), mask, radius)
    else:
        start = inset(_split_coarser(mask, outline, half, radius), mask, 0.0)
    vertices = searched(mask, start, radius, np.append(COARSE, FINE[1:]))[0]
    while len(vertices) < count:
        edges = np.roll(vertices, -1, axis=0) - vertices
        longest = int(np.argmax(np.hypot(*edges.T)))
        middle = vertices[longest] + 0.5 * edges[longest]
        vertices = np.insert(vertices, longest + 1, middle, axis=0)
    return vertices
