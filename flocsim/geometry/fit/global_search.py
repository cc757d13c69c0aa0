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
from typing import NamedTuple

import numpy as np

from flocsim.geometry.fit.coverage import (
    BARRED,
    POSSIBLE,
    compiled,
    copy_points,
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


class Ring(NamedTuple):
    """Places around an outline, the points to choose from at each, and ways round through N of
    them."""

    points: np.ndarray  # (places, choices, 2) [px]
    costs: np.ndarray  # [k, a, i, j] of edges from place k, point i to place k + 1 + a, point j
    least: np.ndarray  # (N + 1, places + 1, choices): cost of the cheapest way so far
    came: np.ndarray  # (N + 1, places + 1, choices): the last edge of that, a · choices + i
    places: np.ndarray  # (N,) of the cheapest way round
    picks: np.ndarray  # (N,): the points picked there


def ring_of(points: np.ndarray, count: int, longest: int) -> Ring:
    """Return a Ring of points (places, choices, 2) for ways of ``count`` edges, each at most
    ``longest`` places long."""
    size, choices, _ = points.shape
    costs = np.empty((size, longest, choices, choices), np.int64)
    least, came = np.empty((2, count + 1, size + 1, choices), np.int64)
    places, picks = np.empty((2, count), np.int64)
    return Ring(points, costs, least, came, places, picks)


def scratch(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return arrays for a search of N vertices to overwrite: other vertices (N, 2), directions
    (N, 2), sums of edges (N,)."""
    return *np.empty((2, count, 2)), np.empty(count, np.int64)


def choice(points, k, i):
    return points[k, i, 0], points[k, i, 1]


def total(edges):
    added = 0
    for k in range(edges.shape[0]):
        added += edges[k]
    return added


def edge_costs(sums, radius, out, ring):
    """edge_sum of every edge of a ring, into its costs; out (places, 2) the directions there."""
    size, longest, choices, _ = ring.costs.shape
    shape, room = (sums.shape[0], sums.shape[1] - 1), radius + 1.0
    for k in range(size):
        for ahead in range(longest):
            to = (k + ahead + 1) % size
            for i in range(choices):
                for j in range(choices):
                    a, b = choice(ring.points, k, i), choice(ring.points, to, j)
                    cost = BARRED
                    if leaves_room(shape, a, room) and leaves_room(shape, b, room):
                        cost = edge_sum(sums, radius, a, point(out, k), b, point(out, to))
                    ring.costs[k, ahead, i, j] = cost


def best_way(ring, start, spread):
    """The cheapest way round a ring with N vertices, one of them at the place ``start``.

    Its places and the points picked there go into ``places`` and ``picks``.  Returns its cost,
    at least POSSIBLE if there is no way round.
    """
    size, longest, choices, _ = ring.costs.shape
    count = ring.places.shape[0]
    least, came = ring.least, ring.came
    best = POSSIBLE
    for first in range(choices):
        for used in range(count + 1):
            for place in range(size + 1):
                for j in range(choices):
                    least[used, place, j] = BARRED
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
                            cost = least[used - 1, behind, i] + ring.costs[k, ahead, i, j]
                            if cost < min(cheapest, POSSIBLE):
                                cheapest, way = cost, ahead * choices + i
                    least[used, place, j], came[used, place, j] = cheapest, way
        if least[count, size, first] < best:
            best = least[count, size, first]
            place, j = size, first
            for used in range(count, 0, -1):
                way = came[used, place, j]
                place, j = place - way // choices - 1, way % choices
                ring.places[used - 1], ring.picks[used - 1] = (start + place) % size, j
    return best


def move_all(sums, vertices, moved, out, edges, ring, radius, directions, steps):
    """Do what descend does; ``directions`` (choices, 2) are those of all choices of a vertex."""
    last = vertices.shape[0] - 1
    lowest = POSSIBLE
    for turn in range(steps.shape[0]):
        while True:
            set_bisectors(vertices, out, 0, last)
            set_edge_sums(sums, radius, vertices, out, edges, 0, last)
            for k in range(last + 1):
                for i in range(directions.shape[0]):
                    for axis in range(2):
                        step = steps[turn] * directions[i, axis]
                        ring.points[k, i, axis] = vertices[k, axis] + step
            edge_costs(sums, radius, out, ring)
            # With the directions of what was found, its own sum can be a little higher.
            lowest = min(lowest, total(edges))
            found = best_way(ring, 0, 0)
            if found >= lowest:
                break
            for k in range(last + 1):
                place = ring.places[k]
                moved[place, 0], moved[place, 1] = choice(ring.points, place, ring.picks[k])
            if not is_open(moved, 2.0 * radius):
                break
            lowest = found
            copy_points(moved, vertices)


def descend(
    sums: np.ndarray, vertices: np.ndarray, radius: float, directions: np.ndarray, steps: np.ndarray
) -> None:
    """Move all vertices at once along ``directions``, or leave them, while that lowers the sum.

    vertices (N, 2): changed in place; steps [px].  The polygon stays simple and open.
    """
    # The first choice of each vertex is where it is.
    count, choices = len(vertices), np.vstack([np.zeros(2), directions])
    ring = ring_of(np.empty((count, *choices.shape)), count, longest=1)
    compiled(move_all)(sums, vertices, *scratch(count), ring, radius, choices, steps)


def chosen(sums, ring, out, radius, spread, start, rounds, vertices):
    """The points (places, 1, 2) of the best way round a ring into ``vertices``; its cost."""
    edge_costs(sums, radius, out, ring)
    count, cost = vertices.shape[0], POSSIBLE
    for _ in range(rounds):
        cost = best_way(ring, start, spread)
        if cost >= POSSIBLE:
            break
        start = ring.places[count // 2]
    if cost < POSSIBLE:
        for k in range(count):
            vertices[k, 0], vertices[k, 1] = choice(ring.points, ring.places[k], 0)
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
    ring = ring_of(np.ascontiguousarray((points - radius * out)[:, None]), count, longest)
    cost = compiled(chosen)(sums, ring, out, radius, SPREAD, start, ROUNDS, vertices)
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


def proposed(vertices, before, k, after, step, draws, move):
    """A place near vertex k: a step in any direction, or along one of its edges."""
    x, y = vertices[k, 0], vertices[k, 1]
    one, other = step * draws[move, 0], step * draws[move, 1]
    share = (draws[move, 4] - JUMPS) / SLIDES
    if share >= 1.0:
        return x + one, y + other
    end = before if share < 0.5 else after
    ux, uy = vertices[end, 0] - x, vertices[end, 1] - y
    length = np.sqrt(ux * ux + uy * uy)
    one, other = STRETCH[0] * one / length, STRETCH[1] * other / length
    return x + one * ux - other * uy, y + one * uy + other * ux


def annealed(sums, vertices, kept, out, edges, best, radius, pixels, draws, heats, steps):
    """Anneal ``vertices``, which are changed; the polygon of the least sum goes into ``best``.
    Returns that sum.

    kept, out, edges: scratch; pixels: the mask's; draws: random_moves of one run; heats, steps: at
    the start and at the end.
    """
    count, moves = vertices.shape[0], draws.shape[0]
    shape = sums.shape[0], sums.shape[1] - 1
    gap, room, last = 2.0 * radius, radius + 1.0, count - 1
    set_bisectors(vertices, out, 0, last)
    set_edge_sums(sums, radius, vertices, out, edges, 0, last)
    least = total(edges)
    copy_points(vertices, best)
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
            x, y = proposed(vertices, before, k, after, step, draws, move)
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
        copy_points(vertices, kept)
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
                copy_points(kept, vertices)
                set_bisectors(vertices, out, first, final)
                set_edge_sums(sums, radius, vertices, out, edges, first - 1, final)
        if not sound:
            copy_points(kept, vertices)
            continue
        now = total(edges)
        if now < least:
            least = now
            copy_points(vertices, best)
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
        best, heats = np.empty_like(start), (heat, COOLED * heat)
        arrays = np.array(start), *scratch(len(start)), best
        least = compiled(annealed)(sums, *arrays, radius, pixels, draws, heats, steps)
        return least, best

    found = [run(start, moves[k], heat) for k, start in enumerate(starts)]
    _, best = min(found, key=lambda each: each[0])
    found.append(run(best, moves[-1], 0.5 * heat))
    return [vertices for _, vertices in found]
