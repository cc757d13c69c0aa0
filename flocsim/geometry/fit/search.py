"""From a mask to N vertices: starts, steps of all vertices at once, annealing, pattern search.

1. Starts: the best N of points along the outline; the points that tell most; even spacing.
2. The best two are lowered by steps of all their vertices at once, and annealed. Both are in
   global_search.py, as are the best N points.
3. The best of all these, by the pixels counted, is searched vertex by vertex.

The starts are among those, so that V never ends above that of even spacing of as many vertices as
are searched. Where N vertices would be crowded these are fewer, and the longest edges of their
outline are halved.

A search lowers V + balance·|excess| + outside·(V + excess): V the wrong pixels, excess those
covered less those of the mask, so that V + excess is twice the pixels covered outside of the mask.
Sums over edges have no balance, which is left to the last search.

The paper's own optimiser (section 2.3; Dobrohotoff et al. 2012): vertices as damped particles that
obey ẍ = −H ∇V − c ẋ, ∇V by central differences of the pixel error over ±h.  The printed equation
has the signs that would raise V.  The paper gives H and c but neither h, the time step, the start
nor the end; those are set here: a pixel, a step in which nothing moves by much more than a fraction
of a pixel, even spacing, and no lower V for a while.
"""

import numpy as np

from flocsim.geometry.fit.coverage import (
    compiled,
    copy_points,
    count_edges,
    count_wrong,
    leaves_room,
    move_vertex,
    neighbours,
    no_cover,
    running_sums,
)
from flocsim.geometry.fit.global_search import annealed_runs, descend, split_outline
from flocsim.geometry.fit.simple import is_simple, simple_inset, stays_simple

HEADINGS = ((0, 1), (1, 0), (0, -1), (-1, 0))
"""Walks along pixel edges as (rows, columns): right, down, left, up, each a right turn on."""

COARSE = np.array([8.0, 4.0, 2.0, 1.0])
"""First steps of the search [px]: from past the usual detail of a floc to a pixel."""

FINE = np.array([1.0, 0.5, 0.25])
"""Last steps [px], below a pixel."""

CROWDED = 1.75
"""Vertices nearer than this [px] along the edges of the core's pixels bar each other's way; the
wider the disk, the fewer pixels tell them apart, by its root. At half of it fits of 4 to 9 px are
worse with more vertices; at twice of it they stop at RE .14 % where .06 % can be had."""

FEWEST = 8
"""So many vertices are searched on any outline."""

FINALISTS = 3
"""So many of all trials are searched vertex by vertex."""

LOWERED = 2
"""So many starts are lowered by steps of all their vertices at once, and annealed."""

DESCENT = np.array([2.0, 1.0, 0.5])
"""Steps [px] of all vertices at once."""

ANGLES = np.pi / 4.0 * np.arange(8)
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


def trace_outline(mask: np.ndarray) -> np.ndarray:
    """The outer outline of a mask's first region, (M, 2) as x = column, y = row.

    The points are the middles of the pixel edges between the region and its outside, in order
    around the region, which is taken 8-connected.  Their polygon is simple.  `mask` has a margin
    of at least one empty pixel.
    """
    start = row, column = tuple(int(place[0]) for place in np.nonzero(mask))
    inside = mask.tolist()
    heading, middles = 0, []
    while True:
        down, right = HEADINGS[heading]
        middles.append((column - 0.5 + 0.5 * right, row - 0.5 + 0.5 * down))
        row, column = row + down, column + right
        # The pixels ahead of the upper left corner of this one, on the left and on the right.
        on_left, on_right = (
            inside[row + (down + hand * right - 1) // 2][column + (right - hand * down - 1) // 2]
            for hand in (-1, 1)
        )
        heading = (heading + (-1 if on_left else 0 if on_right else 1)) % 4
        if (row, column) == start and heading == 0:
            return np.array(middles)


def even_points(outline: np.ndarray, count: int) -> np.ndarray:
    """`count` points evenly spaced along the closed outline."""
    closed = np.vstack([outline, outline[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    places = np.arange(count) / count * along[-1]
    return np.column_stack([np.interp(places, along, axis) for axis in closed.T])


def inset(points: np.ndarray, mask: np.ndarray, depth: float) -> np.ndarray:
    """A simple polygon through the points, drawn in by `depth` [px] or less where it must.

    Points whose polygon is not simple are reordered, or a ring inside the mask takes their place.
    """
    from scipy.ndimage import distance_transform_edt

    drawn, count = np.array(points), len(points)
    if simple_inset(drawn, depth):
        return drawn
    # A regular polygon around the deepest pixel of the mask is always simple.
    within = distance_transform_edt(mask)
    row, column = np.unravel_index(np.argmax(within), within.shape)
    radius = max(0.5 * within[row, column], 1.0, 0.01 * count)
    angles = 2.0 * np.pi * np.arange(count) / count
    drawn = np.column_stack([column + radius * np.cos(angles), row + radius * np.sin(angles)])
    simple_inset(drawn, depth)
    return drawn


def even_start(mask: np.ndarray, count: int, radius: float) -> np.ndarray:
    return inset(even_points(trace_outline(mask), count), mask, radius)


def triangle(points, before, k, after):
    """Twice the area of the triangle of three of the points."""
    ux, uy = points[before, 0] - points[k, 0], points[before, 1] - points[k, 1]
    wx, wy = points[after, 0] - points[k, 0], points[after, 1] - points[k, 1]
    return abs(ux * wy - uy * wx)


def telling_points(outline: np.ndarray, count: int) -> np.ndarray:
    """The `count` points that tell most of a closed outline (Visvalingam and Whyatt 1993): of its
    own, or of twice as many even ones where it has fewer.

    The point that spans the smallest triangle with its neighbours is left out, again and again.
    """
    points = outline if len(outline) >= 2 * count else even_points(outline, 2 * count)
    areas, places = np.empty(len(points)), np.arange(len(points))
    compiled(leave_out)(points, count, areas, np.roll(places, 1), np.roll(places, -1))
    return points[np.isfinite(areas)]


def leave_out(points, count, areas, before, after):
    """Twice the areas of the triangles of all but `count` points, inf where one is left out.

    before, after: the places of each point's neighbours, which change.
    """
    size = points.shape[0]
    for k in range(size):
        areas[k] = triangle(points, before[k], k, after[k])
    for _ in range(size - count):
        k = 0
        for other in range(1, size):
            if areas[other] < areas[k]:
                k = other
        areas[k] = np.inf
        left, right = before[k], after[k]
        after[left], before[right] = right, left
        areas[left] = triangle(points, before[left], left, right)
        areas[right] = triangle(points, left, right, after[right])


def weighed(wrong, excess, weights):
    balance, outside = weights
    return wrong + balance * abs(excess) + outside * (wrong + excess)


def step_vertex(mask, odd, near, vertices, k, radius, directions, step, excess, weights):
    """Take the step of vertex k that lowers the objective the most, if any does.

    Returns (change of the objective, growth of the cover).
    """
    before, here, after = neighbours(vertices, k)
    best, least, grown = here, 0, 0
    for direction in range(directions.shape[0]):
        x, y = here[0] + step * directions[direction, 0], here[1] + step * directions[direction, 1]
        if not leaves_room(mask.shape, (x, y), radius + 1.0):
            continue
        change, growth = move_vertex(mask, odd, near, before, here, after, (x, y), radius, False)
        change = weighed(change, excess + growth, weights) - weighed(0, excess, weights)
        if change < least and stays_simple(vertices, k, x, y):
            best, least, grown = (x, y), change, growth
    if least < 0:
        move_vertex(mask, odd, near, before, here, after, best, radius, True)
        vertices[k, 0], vertices[k, 1] = best
    return least, grown


def pattern_search(mask, vertices, odd, near, waiting, radius, directions, steps, weights):
    """Move vertices along `directions` (k, 2) by shrinking `steps` [px] while that lowers.

    mask: (h, w) bool; vertices: (N, 2), simple, changed in place; odd, near: no_cover, where
    vertices go around a hole with all inside; waiting: (N,) bool.  A vertex whose steps all failed
    rests until one nearby moves.  Returns the objective, V for PLAIN weights.
    """
    count_edges(vertices, radius, odd, near)
    wrong, excess = count_wrong(mask, odd, near)
    objective = weighed(wrong, excess, weights)
    count = vertices.shape[0]
    for turn in range(steps.shape[0]):
        step = steps[turn]
        for k in range(count):
            waiting[k] = True
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
                    waiting[near_by % count] = True
            rested = 0 if change < 0 else rested + 1
            k = (k + 1) % count
    return objective


def searched(
    mask: np.ndarray,
    start: np.ndarray,
    radius: float,
    steps: np.ndarray,
    weights: tuple[int, int] = PLAIN,
    hole: bool = False,
) -> tuple[np.ndarray, int]:
    """pattern_search of a start, which is left as it is: (vertices, objective).

    hole: whether the vertices go around a hole, what lies outside of it being covered.
    """
    vertices, search = np.array(start), compiled(pattern_search)
    arrays = vertices, *no_cover(mask.shape, inside=hole), np.empty(len(start), bool)
    return vertices, int(search(mask, *arrays, radius, DIRECTIONS, steps, weights))


def pattern_fit(
    mask: np.ndarray, count: int, radius: float, weights: tuple[int, int] = PLAIN
) -> np.ndarray:
    """The best of several searches: (N, 2) as x, y-down [px].

    mask: with room around it (coverage.padded); weights: what counts beside V.
    """
    outline = trace_outline(mask)
    # Crowded vertices bar each other's way: fewer find the better outline, so that more vertices
    # are not worse. The core of a disc of radius R has 8 (R − radius) edges of pixels.
    around_core = len(outline) - 8.0 * radius
    enough = max(FEWEST, int(around_core / (CROWDED * max(1.0, radius) ** 0.5)))
    if count > enough:
        return split_longest_edges(pattern_fit(mask, enough, radius, weights), count)
    sums = running_sums(mask, weights[1])

    def counted(vertices: np.ndarray) -> tuple[np.ndarray, int]:
        return searched(mask, vertices, radius, NO_STEPS, weights)

    trials = [counted(start) for start in _starts(mask, sums, outline, count, radius)]
    if count > 2:
        for start, _ in _lowest(trials, LOWERED):
            vertices = np.array(start)
            descend(sums, vertices, radius, DIRECTIONS, DESCENT)
            trials.append(counted(vertices))
        begin = [vertices for vertices, _ in _lowest(trials, LOWERED)]
        trials += map(counted, annealed_runs(sums, begin, radius, int(mask.sum())))
    else:
        trials += [searched(mask, start, radius, COARSE, weights) for start, _ in trials]
    fine = [searched(mask, trial, radius, FINE, weights) for trial, _ in _lowest(trials, FINALISTS)]
    [(vertices, _)] = _lowest(fine, 1)
    if weights == INSCRIBED:
        vertices = searched(mask, vertices, radius, np.append(COARSE, FINE[1:]), INSIDE)[0]
    return vertices


def _lowest(trials, many):
    """So many of (vertices, objective), those of the lowest objective first."""
    return sorted(trials, key=lambda trial: trial[1])[:many]


def _starts(mask, sums, outline, count, radius):
    split = split_outline(sums, outline, count, radius) if count > 2 else None
    starts = [] if split is None else [inset(split, mask, 0.0)]
    starts += [
        inset(p, mask, radius)
        for p in (telling_points(outline, count), even_points(outline, count))
    ]
    return [start for start in starts if is_simple(start)]


def split_longest_edges(vertices: np.ndarray, count: int) -> np.ndarray:
    """Return ``count`` vertices of the same outline: its longest edges halved one after another."""
    while len(vertices) < count:
        edges = np.roll(vertices, -1, axis=0) - vertices
        longest = int(np.argmax(np.hypot(*edges.T)))
        middle = vertices[longest] + 0.5 * edges[longest]
        vertices = np.insert(vertices, longest + 1, middle, axis=0)
    return vertices


FORCE = 0.5
"""H, the paper's force factor."""

DAMPING = 2.0
"""c, the paper's damping factor."""

SPACING = 1.0
"""h [px]: V is a whole number and flat below the size of a pixel."""

TIME_STEP = 0.1
"""Short against the relaxation time 1/c."""

PATIENCE = 200
"""Steps without a lower V after which it counts as the minimum: forty relaxation times."""


def gradient(mask, odd, near, vertices, k, radius, spacing):
    """∇V [pixels/px] of vertex k by central differences."""
    before, here, after = neighbours(vertices, k)
    x, y = here
    right, _ = move_vertex(mask, odd, near, before, here, after, (x + spacing, y), radius, False)
    left, _ = move_vertex(mask, odd, near, before, here, after, (x - spacing, y), radius, False)
    down, _ = move_vertex(mask, odd, near, before, here, after, (x, y + spacing), radius, False)
    up, _ = move_vertex(mask, odd, near, before, here, after, (x, y - spacing), radius, False)
    return 0.5 * (right - left) / spacing, 0.5 * (down - up) / spacing


def advance(mask, odd, near, vertices, velocities, k, radius, step):
    """Move vertex k by its velocity, or stop it where the polygon would not stay simple.

    Returns the change of V.
    """
    before, here, after = neighbours(vertices, k)
    x = vertices[k, 0] + step * velocities[k, 0]
    y = vertices[k, 1] + step * velocities[k, 1]
    room = leaves_room(mask.shape, (x, y), radius + SPACING + 1.0)
    if not (room and stays_simple(vertices, k, x, y)):
        velocities[k, 0] = velocities[k, 1] = 0.0
        return 0
    vertices[k, 0], vertices[k, 1] = x, y
    change, _ = move_vertex(mask, odd, near, before, here, after, (x, y), radius, True)
    return change


def damped_descent(
    mask, odd, near, vertices, velocities, best, radius, force, damping, spacing, step, patience
):
    """The vertices (N, 2) of the least V on the way of the damped motion into ``best``; the steps
    taken.

    odd, near: no_cover; velocities: zeros (N, 2).
    """
    count_edges(vertices, radius, odd, near)
    wrong = least = count_wrong(mask, odd, near)[0]
    copy_points(vertices, best)
    steps = waited = 0
    while waited < patience and least > 0:
        for k in range(vertices.shape[0]):
            across, down = gradient(mask, odd, near, vertices, k, radius, spacing)
            velocities[k, 0] -= step * (force * across + damping * velocities[k, 0])
            velocities[k, 1] -= step * (force * down + damping * velocities[k, 1])
        for k in range(vertices.shape[0]):
            wrong += advance(mask, odd, near, vertices, velocities, k, radius, step)
        steps, waited = steps + 1, waited + 1
        if wrong < least:
            copy_points(vertices, best)
            least, waited = wrong, 0
    return steps


def paper_fit(mask: np.ndarray, start: np.ndarray, radius: float) -> tuple[np.ndarray, int]:
    """The vertices (N, 2) that the paper's motion leads to from a start, which it leaves alone, and
    the steps taken."""
    vertices, velocities, best = np.array(start), np.zeros_like(start), np.empty_like(start)
    arrays = *no_cover(mask.shape), vertices, velocities, best
    settings = FORCE, DAMPING, SPACING, TIME_STEP, PATIENCE
    return best, compiled(damped_descent)(mask, *arrays, radius, *settings)
