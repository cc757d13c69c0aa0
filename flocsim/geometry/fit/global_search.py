"""Searches that look beyond the next step of one vertex: the best of very many polygons at once, by
dynamic programming, and simulated annealing.  Both take V as the sum over edges of coverage.py.

Places stand in order around the outline, each with a few points that a vertex there can be at. The
best polygon that goes round once through N of them is the cheapest path of N edges (Perez and
Vidal 1994), its cost the sum over edges.  Two rings are used: points along the outline, of which N
are chosen, gives a polygon to begin with; and the vertices of a polygon, each with the steps that
it can take, of which all are chosen, moves all vertices at once.

A search that only goes down ends in the nearest of very many polygons that no single step lowers.
So single vertices are annealed (Kirkpatrick et al. 1983): they move at random, by a step in any
direction, along one of their edges, or into the middle of another edge; a move that adds pixels is
kept with the probability exp(−added/heat).  Heat and steps shrink as it goes on, and a move costs
two or three sums along edges.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np

from flocsim.geometry.fit.coverage import (
    BARRED,
    POSSIBLE,
    compiled,
    edge_sum,
    leaves_room,
    outward_bisector,
    point,
    set_bisectors,
    set_edge_sums,
)
from flocsim.geometry.fit.simple import edge_is_open, is_open

FEWEST_PLACES = 64
"""Places along an outline, or four times N."""

LONGEST = 4
"""An edge passes over at most so many times the places of an even split."""

SPREAD = 8
"""The vertices chosen up to any place differ by at most this from an even split's."""

ROUNDS = 2
"""Paths that are looked for, each from the place half-way round the one before."""

MOVES = 16_000
"""Moves of a run, of all vertices together: half as many again lower RE by about a hundredth of
it."""

MOST_RUNS = 3
"""One from each start, and one more from the best of these, with half the heat."""

HEAT = 0.007
"""Heat at the start [pixels], for each of the mask's pixels a vertex has."""

COOLED = 0.3
"""Heat at the end, of that at the start."""

STEPS = (0.1, 0.02)
"""Steps at the start and at the end, of r_eq."""

JUMPS = 0.3
"""Share of the moves that put a vertex into another edge."""

SLIDES = 0.2
"""Share of the moves along an edge."""

STRETCH = 3.0, 0.1
"""Steps along the edge and across it in such a move, of others."""

PIXEL = 0.4
"""The least step [px] at the end: below it hardly a pixel changes."""


def edge_costs(sums, radius, points, out, costs):
    """edge_sum of every edge from place k, point i to the place 1 + a further on, point j, into
    costs[k, a, i, j]; points (places, choices, 2), out (places, 2) the directions there."""
    size, choices = points.shape[:2]
    shape = sums.shape[0], sums.shape[1] - 1
    inside = np.empty((size, choices), np.bool_)
    for k in range(size):
        for i in range(choices):
            inside[k, i] = leaves_room(shape, point(points[k], i), radius + 1.0)
    for k in range(size):
        for ahead in range(costs.shape[1]):
            to = (k + ahead + 1) % size
            for i in range(choices):
                for j in range(choices):
                    cost = BARRED
                    if inside[k, i] and inside[to, j]:
                        a, b = point(points[k], i), point(points[to], j)
                        cost = edge_sum(sums, radius, a, point(out, k), b, point(out, to))
                    costs[k, ahead, i, j] = cost


def best_ring(costs, start, spread, places, picks):
    """The cheapest way round with len(places) vertices, one of them at the place ``start``.

    Its places and the points picked there go into ``places`` and ``picks``.  Returns its cost,
    at least POSSIBLE if there is no way round.
    """
    size, longest, choices = costs.shape[:3]
    count = len(places)
    least = np.empty((count + 1, size + 1, choices), np.int64)
    came = np.empty((count + 1, size + 1, choices), np.int64)
    best = POSSIBLE
    for first in range(choices):
        least[:] = BARRED
        least[0, 0, first] = 0
        for place in range(1, size + 1):
            even = place * count // size
            fewest, most = max(1, even - spread), min(place, count, even + spread)
            if place == size:
                fewest = count
            for used in range(fewest, most + 1):
                for j in range(choices):
                    if place == size and j != first:
                        continue
                    cheapest, way = BARRED, 0
                    for ahead in range(min(longest, place)):
                        behind = place - ahead - 1
                        k = (start + behind) % size
                        for i in range(choices):
                            cost = least[used - 1, behind, i] + costs[k, ahead, i, j]
                            if cost < min(cheapest, POSSIBLE):
                                cheapest, way = cost, ahead * choices + i
                    least[used, place, j], came[used, place, j] = cheapest, way
        if least[count, size, first] < best:
            best = least[count, size, first]
            place, j = size, first
            for used in range(count, 0, -1):
                way = came[used, place, j]
                place, j = place - way // choices - 1, way % choices
                places[used - 1], picks[used - 1] = (start + place) % size, j
    return best


def descend(sums, vertices, radius, directions, steps):
    """Move all vertices at once along ``directions``, or leave them, while that lowers the sum.

    vertices (N, 2): changed in place; steps [px].  The polygon stays simple and open.
    """
    count, choices = len(vertices), len(directions) + 1
    points, out = np.empty((count, choices, 2)), np.empty((count, 2))
    costs = np.empty((count, 1, choices, choices), np.int64)
    places, picks = np.empty(count, np.int64), np.empty(count, np.int64)
    moved, edges = np.empty((count, 2)), np.empty(count, np.int64)
    lowest = POSSIBLE
    for step in steps:
        while True:
            set_bisectors(vertices, out, 0, count - 1)
            set_edge_sums(sums, radius, vertices, out, edges, 0, count - 1)
            points[:, 0] = vertices
            for i in range(1, choices):
                points[:, i] = vertices + step * directions[i - 1]
            edge_costs(sums, radius, points, out, costs)
            # With the directions of what was found, its own sum can be a little higher.
            lowest = min(lowest, edges.sum())
            found = best_ring(costs, 0, 0, places, picks)
            if found >= lowest:
                break
            for k in range(count):
                moved[places[k]] = points[places[k], picks[k]]
            if not is_open(moved, 2.0 * radius):
                break
            lowest = found
            vertices[:] = moved


def chosen(sums, points, out, radius, longest, spread, start, rounds, vertices):
    """The best ring of points (places, 1, 2) into ``vertices``; its cost."""
    count = len(vertices)
    costs = np.empty((len(points), longest, 1, 1), np.int64)
    edge_costs(sums, radius, points, out, costs)
    places, picks = np.empty(count, np.int64), np.empty(count, np.int64)
    cost = POSSIBLE
    for _ in range(rounds):
        cost = best_ring(costs, start, spread, places, picks)
        if cost >= POSSIBLE:
            break
        start = places[count // 2]
    if cost < POSSIBLE:
        vertices[:] = points[places, 0]
    return cost


def split_outline(
    sums: np.ndarray, outline: np.ndarray, count: int, radius: float
) -> np.ndarray | None:
    """The best `count` of points spread along an outline and drawn in by the radius, (N, 2) [px].

    None where there is no way round with so many.
    """
    size = min(max(FEWEST_PLACES, 4 * count), len(outline))
    if size <= count:
        return None
    step = len(outline) / size
    points = outline[(step * np.arange(size)).astype(int)]
    # The normal of what is about one edge of an even split.
    half = max(1, size // count // 2)
    along = np.roll(points, -half, axis=0) - np.roll(points, half, axis=0)
    lengths = np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    out = np.column_stack([along[:, 1], -along[:, 0]]) / lengths
    longest = min(size // 2, max(2, LONGEST * size // count))
    start = int(np.argmax(np.hypot(*(points - points.mean(axis=0)).T)))
    vertices = np.empty((count, 2))
    drawn = np.ascontiguousarray((points - radius * out)[:, None])
    cost = compiled(chosen)(sums, drawn, out, radius, longest, SPREAD, start, ROUNDS, vertices)
    return vertices if cost < POSSIBLE else None


@cache
def random_moves() -> np.ndarray:
    """(MOST_RUNS, MOVES, 6): two normal numbers, one from 0 to 1, an exponential one, two from 0 to
    1; the same for every fit."""
    # The legacy generator's numbers stay what they are in every version of numpy.
    generator = np.random.RandomState(0)
    shape = MOST_RUNS, MOVES
    normal = generator.standard_normal((*shape, 2))
    even = generator.random_sample((*shape, 4))
    even[..., 1] = -np.log(1.0 - even[..., 1])
    return np.concatenate([normal, even], axis=2)


def put_into_edge(vertices, k, edge, x, y):
    """Take vertex k out and put it at (x, y) between the ends of another edge; its new place."""
    if edge < k:
        for i in range(k, edge + 1, -1):
            vertices[i, 0], vertices[i, 1] = vertices[i - 1, 0], vertices[i - 1, 1]
        k = edge + 1
    else:
        for i in range(k, edge):
            vertices[i, 0], vertices[i, 1] = vertices[i + 1, 0], vertices[i + 1, 1]
        k = edge
    vertices[k, 0], vertices[k, 1] = x, y
    return k


def proposed(vertices, before, k, after, step, draws):
    """A place near vertex k: a step in any direction, or along one of its edges."""
    x, y = vertices[k, 0], vertices[k, 1]
    one, other = step * draws[0], step * draws[1]
    share = (draws[4] - JUMPS) / SLIDES
    if share >= 1.0:
        return x + one, y + other
    end = before if share < 0.5 else after
    ux, uy = vertices[end, 0] - x, vertices[end, 1] - y
    length = np.sqrt(ux * ux + uy * uy)
    one, other = STRETCH[0] * one / length, STRETCH[1] * other / length
    return x + one * ux - other * uy, y + one * uy + other * ux


def annealed(sums, vertices, best, radius, pixels, draws, heats, steps):
    """Anneal ``vertices``, which are changed; the polygon of the least sum goes into ``best``.
    Returns that sum.

    pixels: the mask's; draws: random_moves of one run; heats, steps: at the start and at the end.
    """
    count, moves = len(vertices), len(draws)
    shape = sums.shape[0], sums.shape[1] - 1
    gap, room, last = 2.0 * radius, radius + 1.0, count - 1
    out, kept = np.empty((count, 2)), np.empty((count, 2))
    edges = np.empty(count, np.int64)
    set_bisectors(vertices, out, 0, last)
    set_edge_sums(sums, radius, vertices, out, edges, 0, last)
    least = edges.sum()
    best[:] = vertices
    heat = heats[0]
    cooling, shrinking = (heats[1] / heat) ** (1.0 / moves), (steps[1] / steps[0]) ** (1.0 / moves)
    step = steps[0]
    for move in range(moves):
        heat, step = heat * cooling, step * shrinking
        k = int(draws[move, 2] * count)
        before, after = k - 1 if k > 0 else last, k + 1 if k < last else 0
        jump = draws[move, 4] < JUMPS
        if jump:
            edge = int(draws[move, 5] * count)
            if edge in (k, before) or count < 4:
                continue
            start, stop = edge, edge + 1 if edge < last else 0
            x = 0.5 * (vertices[start, 0] + vertices[stop, 0]) + 2.0 * step * draws[move, 0]
            y = 0.5 * (vertices[start, 1] + vertices[stop, 1]) + 2.0 * step * draws[move, 1]
        else:
            edge, start, stop = before, before, after
            x, y = proposed(vertices, before, k, after, step, draws[move])
        if not leaves_room(shape, (x, y), room):
            continue
        new, one, two = (x, y), point(vertices, start), point(vertices, stop)
        outward = outward_bisector(one, new, two)
        added = edge_sum(sums, radius, one, point(out, start), new, outward)
        if added >= BARRED:
            continue
        added += edge_sum(sums, radius, new, outward, two, point(out, stop)) - edges[edge]
        if jump:
            a, b = point(vertices, before), point(vertices, after)
            added += edge_sum(sums, radius, a, point(out, before), b, point(out, after))
            added -= edges[before]
        added -= edges[k]
        # Kept with the probability exp(−added/heat).
        if added > heat * draws[move, 3]:
            continue
        kept[:] = vertices
        if jump:
            place = put_into_edge(vertices, k, edge, x, y)
            # What was the vertex before k begins the edge that closes the gap.
            closing = (k if edge < k else k - 1) % count
            first, final = 0, last
        else:
            vertices[k, 0], vertices[k, 1] = x, y
            place, closing = k, k
            first, final = k - 1, k + 1
        sound = (
            edge_is_open(vertices, (place - 1) % count, gap)
            and edge_is_open(vertices, place, gap)
            and (not jump or edge_is_open(vertices, closing, gap))
        )
        if sound:
            set_bisectors(vertices, out, first, final)
            sound = set_edge_sums(sums, radius, vertices, out, edges, first - 1, final) < BARRED
            if not sound:
                vertices[:] = kept
                set_bisectors(vertices, out, first, final)
                set_edge_sums(sums, radius, vertices, out, edges, first - 1, final)
        if not sound:
            vertices[:] = kept
            continue
        now = edges.sum()
        if now < least:
            least = now
            best[:] = vertices
            if least <= -pixels:
                break
    return least


def annealed_runs(
    sums: np.ndarray, starts: Sequence[np.ndarray], radius: float, pixels: int
) -> list[np.ndarray]:
    """The polygons (N, 2) that runs from each of the ``starts``, two at most, and a last one from
    the best of these come to.

    sums: running_sums of the mask, of so many pixels.  Starts are left as they are.
    """
    heat = HEAT * pixels / len(starts[0])
    size = np.sqrt(pixels / np.pi)
    steps = max(STEPS[0] * size, PIXEL), max(STEPS[1] * size, PIXEL)
    moves = random_moves()

    def run(start: np.ndarray, draws: np.ndarray, heat: float) -> tuple[int, np.ndarray]:
        vertices, best = np.array(start), np.empty_like(start)
        heats = heat, COOLED * heat
        least = compiled(annealed)(sums, vertices, best, radius, pixels, draws, heats, steps)
        return least, best

    found = [run(start, moves[k], heat) for k, start in enumerate(starts)]
    _, best = min(found, key=lambda each: each[0])
    found.append(run(best, moves[-1], 0.5 * heat))
    return [vertices for _, vertices in found]
