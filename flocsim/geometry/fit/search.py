"""From a mask to N vertices: starts, pattern search, and moving vertices to where they are needed.

1. Starts: the corners of the best split of the outline into N segments, for small N from several
   first breaks; the points that tell most; even spacing.
2. Each start is searched by coarse steps, the best few by fine ones.
3. The vertices of the best that count least go to where they lower V. A polygon that no single step
   improves can still have its vertices in the wrong places: taking vertex k out costs so many
   pixels, one more vertex in edge e gains so many. Both are estimated by single moves; the pairs
   that promise most are tried in earnest, with a search around both places.

Every start passes through the same search, so that V never ends above that of even spacing.

A search lowers V + balance·|excess| + outside·(V + excess): V the wrong pixels, excess those
covered less those of the mask, so that V + excess is twice the pixels covered outside of the mask.
"""

import numpy as np

from flocsim.geometry.fit.coverage import compiled, count_wrong, cover, move_vertex, neighbours
from flocsim.geometry.fit.simple import is_simple, stays_simple
from flocsim.geometry.fit.starts import (
    even_points,
    inset,
    ring_inside,
    split_corners,
    telling_points,
    trace_outline,
)

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

MOVE_STEPS = np.array([4.0, 2.0, 1.0, 0.5, 0.25])
"""Steps [px] of a vertex that was moved elsewhere, and of those beside it."""

TRIALS = 8
"""Pairs (vertex, edge) that are tried before vertices stay where they are."""

COMPASS = 8
"""Directions in which a vertex is tried."""

ANGLES = np.pi / 4.0 * np.arange(COMPASS)
DIRECTIONS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
NO_STEPS = np.zeros(0)

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
    balance, outside = weights
    return wrong + balance * abs(excess) + outside * (wrong + excess)


def stepped(vertices, k, directions, direction, step):
    x, y = vertices[k]
    across, down = directions[direction]
    return x + step * across, y + step * down


def leaves_room(shape, new, margin):
    """Whether a place is at least `margin` from the array's rim: pixels off it are not counted."""
    x, y = new
    height, width = shape
    return min(x, y) >= margin and x <= width - 1 - margin and y <= height - 1 - margin


def step_vertex(mask, odd, near, vertices, k, radius, directions, step, excess, weights):
    """Take the step of vertex k that lowers the objective the most, if any does.

    Returns (change of the objective, growth of the cover).
    """
    before, here, after = neighbours(vertices, k)
    best, least, grown = -1, 0, 0
    for direction in range(len(directions)):
        new = stepped(vertices, k, directions, direction, step)
        if not leaves_room(mask.shape, new, radius + 1.0):
            continue
        change, growth = move_vertex(mask, odd, near, before, here, after, new, radius, False)
        change = weighed(change, excess + growth, weights) - weighed(0, excess, weights)
        x, y = new
        if change < least and stays_simple(vertices, k, x, y):
            best, least, grown = direction, change, growth
    if best >= 0:
        new = stepped(vertices, k, directions, best, step)
        move_vertex(mask, odd, near, before, here, after, new, radius, True)
        vertices[k, 0], vertices[k, 1] = new
    return least, grown


def pattern_search(mask, vertices, radius, directions, steps, active, weights):
    """Move vertices along `directions` (k, 2) by shrinking `steps` [px] while that lowers.

    mask: (h, w) bool; vertices: (N, 2), simple, changed in place; active: (N,) bool, the vertices
    to begin with, and those that came in reach at the end.  A vertex whose steps all failed rests
    until one nearby moves.  Returns the objective, V for PLAIN weights.
    """
    odd, near = cover(vertices, radius, mask.shape)
    return search_from(mask, odd, near, vertices, radius, directions, steps, active, weights)


def hole_search(mask, vertices, radius, directions, steps, active, weights):
    """pattern_search of a polygon around a hole: what lies outside of it is covered."""
    odd, near = cover(vertices, radius, mask.shape)
    odd = ~odd
    return search_from(mask, odd, near, vertices, radius, directions, steps, active, weights)


def search_from(mask, odd, near, vertices, radius, directions, steps, active, weights):
    """pattern_search with the counts per pixel of the polygon as it is."""
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


def searched(
    mask: np.ndarray,
    start: np.ndarray,
    radius: float,
    steps: np.ndarray,
    weights: tuple[int, int] = PLAIN,
    active: np.ndarray | None = None,
) -> tuple[np.ndarray, int]:
    """pattern_search of a start, which is left as it is: (vertices, objective)."""
    vertices = np.array(start)
    active = np.ones(len(vertices), bool) if active is None else active
    search = compiled(pattern_search)
    return vertices, int(search(mask, vertices, radius, DIRECTIONS, steps, active, weights))


def count_errors(mask: np.ndarray, vertices: np.ndarray, radius: float) -> int:
    """V of the swept polygon against the mask: a search without steps."""
    return searched(mask, vertices, radius, NO_STEPS)[1]


def insertion_gain(mask, odd, near, vertices, k, radius, steps):
    """Fall of V by a vertex one step away from the middle of edge k, the best of all steps."""
    _, before, after = neighbours(vertices, k)
    (ax, ay), (bx, by) = before, after
    x, y = 0.5 * (ax + bx), 0.5 * (ay + by)
    length = np.hypot(bx - ax, by - ay)
    gain = 0
    for step in steps:
        for direction in range(COMPASS if step < length + 1.0 else 0):
            angle = 2.0 * np.pi * direction / COMPASS
            new = x + step * np.cos(angle), y + step * np.sin(angle)
            change, _ = move_vertex(mask, odd, near, before, (x, y), after, new, radius, False)
            gain = max(gain, -change)
    return gain


def estimates(mask, vertices, radius, steps, found):
    """Growth of V when a vertex is left out, and insertion_gain of the edge after it [px], into
    ``found`` (N, 2)."""
    odd, near = cover(vertices, radius, mask.shape)
    for k in range(len(vertices)):
        before, here, after = neighbours(vertices, k)
        cost, _ = move_vertex(mask, odd, near, before, here, after, before, radius, False)
        found[k, 0] = cost
        found[k, 1] = insertion_gain(mask, odd, near, vertices, k, radius, steps)


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


def relocate(mask, vertices, objective, radius, weights):
    """Take the first promising move of a vertex that lowers the objective, again and again."""
    while len(vertices) > 2 and objective > 0:
        found = np.empty((len(vertices), 2))
        compiled(estimates)(mask, vertices, radius, MOVE_STEPS, found)
        costs, gains = found.T
        for removed, edge in promising_pairs(costs, gains):
            start, nearby = moved(vertices, removed, edge)
            if not is_simple(start):
                continue
            trial, reached = searched(mask, start, radius, MOVE_STEPS, weights, nearby)
            if reached < objective:
                vertices, objective = trial, reached
                break
        else:
            break
    return vertices


def pattern_fit(
    mask: np.ndarray, count: int, radius: float, weights: tuple[int, int] = PLAIN
) -> np.ndarray:
    """The best of several pattern searches, refined: (N, 2) as x, y-down [px].

    mask: with room around it (coverage.padded); weights: what counts beside V.
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
    return telling_points(points, count)


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
