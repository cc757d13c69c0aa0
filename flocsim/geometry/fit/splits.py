"""The best N vertices of a ring of places, found at once by dynamic programming.

Places stand in order around the outline, each with a few points that a vertex there can be at. The
best polygon that goes round once through N of them is the cheapest path of N edges (Perez and
Vidal 1994), its cost the sum of edge_errors.  Two rings are used: points along the outline, of
which N are chosen, gives a polygon to begin with; and the vertices of a polygon, each with the
steps that it can take, of which all are chosen, moves all vertices at once.
"""

import numpy as np

from flocsim.geometry.fit.coverage import compiled
from flocsim.geometry.fit.edge_errors import (
    BARRED,
    POSSIBLE,
    edge_sum,
    leaves_room,
    point,
    set_bisectors,
    set_edge_sums,
)
from flocsim.geometry.fit.simple import is_open

FEWEST_PLACES = 64
"""Places along an outline, or four times N."""

LONGEST = 4
"""An edge passes over at most so many times the places of an even split."""

SPREAD = 8
"""The vertices chosen up to any place differ by at most this from an even split's."""

ROUNDS = 2
"""Paths that are looked for, each from the place half-way round the one before."""


def edge_costs(sums, radius, points, out, costs):
    """edge_sum of every edge from place k, point i to the place 1 + a further on, point j, into
    costs[k, a, i, j]; points (places, choices, 2), out (places, 2) the directions there."""
    size, choices = points.shape[:2]
    shape = sums.shape[0], sums.shape[1] - 1
    inside = np.empty((size, choices), np.bool_)
    for k in range(size):
        for i in range(choices):
            inside[k, i] = leaves_room(shape, (points[k, i, 0], points[k, i, 1]), radius + 1.0)
    for k in range(size):
        for ahead in range(costs.shape[1]):
            to = (k + ahead + 1) % size
            for i in range(choices):
                for j in range(choices):
                    cost = BARRED
                    if inside[k, i] and inside[to, j]:
                        cost = edge_sum(
                            sums, radius, (points[k, i, 0], points[k, i, 1]), point(out, k),
                            (points[to, j, 0], points[to, j, 1]), point(out, to),
                        )  # fmt: skip
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
            for k in range(count):
                for axis in range(2):
                    points[k, 0, axis] = vertices[k, axis]
                    for i in range(1, choices):
                        points[k, i, axis] = vertices[k, axis] + step * directions[i - 1, axis]
            edge_costs(sums, radius, points, out, costs)
            # With the directions of what was found, its own sum can be a little higher.
            lowest = min(lowest, edges.sum())
            found = best_ring(costs, 0, 0, places, picks)
            if found >= lowest:
                break
            for k in range(count):
                for axis in range(2):
                    moved[places[k], axis] = points[places[k], picks[k], axis]
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
        for k in range(count):
            for axis in range(2):
                vertices[k, axis] = points[places[k], 0, axis]
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
