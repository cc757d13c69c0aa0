"""An outline as N straight segments: the best split, and its corners as a fit's start.

Each segment is the line of total least squares through a run of outline points; where runs meet,
neighbouring lines cross and give a vertex.  The split is the one that minimises the area between
lines and outline, estimated as Σ √(n S), n the points of a run and S their summed squared
distances from its line; dynamic programming finds it (Perez and Vidal 1994) for a given first
break.
"""

import numpy as np

from flocsim.geometry.fit.kernels import compiled

SPACINGS = 8
"""A run holds at most this many times the points of an even split."""

FLATTEST = 0.17
"""Sine of the angle, about 10°, below which neighbouring lines do not tell where they cross."""


def moment_sums(points):
    """Running sums (2 M + 1, 5) of x, y, x², xy, y² over the outline, walked twice."""
    x, y = np.concatenate([points, points]).T
    terms = np.column_stack([x, y, x * x, x * y, y * y])
    return np.concatenate([np.zeros((1, 5)), np.cumsum(terms, axis=0)])


def scatter(sums, first, last):
    """Centre and scatter (x, y, xx, xy, yy) of the points first … last, both included."""
    n = last - first + 1.0
    x, y, xx, xy, yy = np.moveaxis(sums[last + 1] - sums[first], -1, 0)
    return x / n, y / n, xx - x * x / n, xy - x * y / n, yy - y * y / n


def run_costs(points, longest):
    """√(n S) of all runs, (M, longest + 1), by first point and number of steps to the last."""
    first = np.arange(len(points))[:, None]
    steps = np.arange(longest + 1)[None]
    _, _, xx, xy, yy = scatter(moment_sums(points), first, first + steps)
    least = 0.5 * (xx + yy - np.hypot(xx - yy, 2.0 * xy))
    return np.sqrt((steps + 1.0) * np.maximum(least, 0.0))


def best_breaks(costs, count, start):
    """The `count` breaks, the first at `start`, of the split of least total cost.

    Plain Python, compiled.
    """
    size, longest = costs.shape[0], costs.shape[1] - 1
    least = np.empty((count + 1, size + 1))
    chosen = np.zeros((count + 1, size + 1), np.int64)
    for k in range(count + 1):
        for place in range(size + 1):
            least[k, place] = np.inf
    least[0, 0] = 0.0
    for k in range(1, count + 1):
        for place in range(k, size - count + k + 1):
            for steps in range(1, min(longest, place) + 1):
                total = least[k - 1, place - steps] + costs[(start + place - steps) % size, steps]
                if total < least[k, place]:
                    least[k, place] = total
                    chosen[k, place] = steps
    breaks = np.empty(count, np.int64)
    place = size
    for k in range(count, 0, -1):
        place -= chosen[k, place]
        breaks[k - 1] = (start + place) % size
    return breaks


def lines_through(points, breaks):
    """Centres (N, 2) and unit directions (N, 2) of the lines through the runs from each break."""
    after = np.roll(breaks, -1)
    last = np.where(after > breaks, after, after + len(points))
    x, y, xx, xy, yy = scatter(moment_sums(points), breaks, last)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    return np.column_stack([x, y]), np.column_stack([np.cos(angle), np.sin(angle)])


def corners(points, breaks):
    """The vertices (N, 2) where the lines of neighbouring runs cross.

    Where they cross too flatly, or far from the break, midway between its feet on both lines.
    """
    centres, along = lines_through(points, breaks)
    before, ahead = np.roll(centres, 1, axis=0), np.roll(along, 1, axis=0)
    places = points[breaks]
    sine = ahead[:, 0] * along[:, 1] - ahead[:, 1] * along[:, 0]
    offset = centres - before
    flat = np.abs(sine) < FLATTEST
    share = offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0]
    crossing = before + (share / np.where(flat, 1.0, sine))[:, None] * ahead
    feet = 0.5 * (foot(places, before, ahead) + foot(places, centres, along))
    lengths = np.hypot(*(np.roll(places, -1, axis=0) - places).T)
    reach = 1.0 + 0.5 * np.minimum(lengths, np.roll(lengths, 1))
    near = ~flat & (np.hypot(*(crossing - places).T) < reach)
    return np.where(near[:, None], crossing, feet)


def foot(points, origins, directions):
    """The nearest places (N, 2) to the points on the lines."""
    share = np.einsum("ij,ij->i", points - origins, directions)
    return origins + share[:, None] * directions


def split_corners(points, count, start, rounds):
    """The `count` corners of the best split of the outline `points` (M, 2), M ≥ 2 `count`.

    The split has a break at `start`; every round takes the break across as the start of a
    better one.
    """
    size = len(points)
    longest = size // 2 if count < SPACINGS else SPACINGS * size // count
    costs = run_costs(points, min(longest, size - 1))
    breaks = compiled(best_breaks)(costs, count, start)
    for _ in range(rounds):
        breaks = compiled(best_breaks)(costs, count, int(breaks[count // 2]))
    return corners(points, breaks)
