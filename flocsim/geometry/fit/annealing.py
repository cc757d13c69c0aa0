"""Simulated annealing of a polygon's vertices (Kirkpatrick et al. 1983).

A search that only goes down ends in the nearest of very many polygons that no single step lowers.
Here single vertices move at random, by a step in any direction, along one of their edges, or into
the middle of another edge; a move that adds pixels is kept with the probability exp(−added/heat).
Heat and steps shrink as it goes on.  The pixels are those of edge_errors, so that a move costs two
or three sums along edges.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np

from flocsim.geometry.fit.coverage import compiled
from flocsim.geometry.fit.edge_errors import (
    BARRED,
    edge_sum,
    leaves_room,
    outward_bisector,
    point,
    set_bisectors,
    set_edge_sums,
)
from flocsim.geometry.fit.simple import edge_is_open

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
            added += edge_sum(
                sums, radius, point(vertices, before), point(out, before), point(vertices, after),
                point(out, after),
            ) - edges[before]  # fmt: skip
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
