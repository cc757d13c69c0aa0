"""Choices of N points that a fit can start from, made from the outline of a mask.

Even spacing; a ring inside; the points that tell most of the outline; and the corners of its best
split into N straight segments. Each segment is the line of total least squares through a run of
outline points; where runs meet, neighbouring lines cross and give a vertex. The split is the one
that minimises the area between lines and outline, estimated as Σ √(n S), n the points of a run and
S their summed squared distances from its line; dynamic programming finds it (Perez and Vidal 1994)
for a given first break.
"""

import numpy as np

from flocsim.geometry.fit.coverage import compiled
from flocsim.geometry.fit.simple import simple_inset
from flocsim.geometry.shapes.cores import cross

HEADINGS = ((0, 1), (1, 0), (0, -1), (-1, 0))
"""Walks along pixel edges as (rows, columns): right, down, left, up, each a right turn on."""

SPACINGS = 8
"""A run holds at most this many times the points of an even split."""

FLATTEST = 0.17
"""Sine of the angle, about 10°, below which neighbouring lines do not tell where they cross."""


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
        heading = _turn(inside, row, column, heading)
        if (row, column) == start and heading == 0:
            return np.array(middles)


def _turn(inside, row, column, heading):
    """The heading after the upper left corner of pixel (row, column), the region on the right."""
    down, right = HEADINGS[heading]

    def ahead(hand):
        """Whether the pixel ahead, to the left (−1) or the right (1), is the region's."""
        return inside[row + (down + hand * right - 1) // 2][column + (right - hand * down - 1) // 2]

    if ahead(-1):
        return (heading - 1) % 4
    return heading if ahead(1) else (heading + 1) % 4


def even_points(outline: np.ndarray, count: int, shift: float = 0.0) -> np.ndarray:
    """`count` points evenly spaced along the closed outline; `shift` in spacings moves them on."""
    closed = np.vstack([outline, outline[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    places = (np.arange(count) + shift) / count * along[-1]
    return np.column_stack([np.interp(places, along, axis) for axis in closed.T])


def ring_inside(mask: np.ndarray, count: int) -> np.ndarray:
    """A regular polygon around the deepest pixel of the mask: a start that is always simple."""
    from scipy.ndimage import distance_transform_edt

    depth = distance_transform_edt(mask)
    row, column = np.unravel_index(np.argmax(depth), depth.shape)
    radius = max(0.5 * depth[row, column], 1.0, 0.01 * count)
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([column + radius * np.cos(angles), row + radius * np.sin(angles)])


def inset(points: np.ndarray, mask: np.ndarray, depth: float) -> np.ndarray:
    """A simple polygon through the points, drawn in by `depth` [px] or less where it must.

    Points whose polygon is not simple are reordered, or a ring inside the mask takes their place.
    """
    drawn = np.array(points)
    if compiled(simple_inset)(drawn, float(depth)):
        return drawn
    drawn = ring_inside(mask, len(points))
    compiled(simple_inset)(drawn, float(depth))
    return drawn


def even_start(mask: np.ndarray, count: int, radius: float) -> np.ndarray:
    return inset(even_points(trace_outline(mask), count), mask, radius)


def triangle(points, before, k, after):
    """Twice the area of the triangle of three of the points."""
    ux, uy = points[before, 0] - points[k, 0], points[before, 1] - points[k, 1]
    wx, wy = points[after, 0] - points[k, 0], points[after, 1] - points[k, 1]
    return abs(ux * wy - uy * wx)


def telling_points(points: np.ndarray, count: int) -> np.ndarray:
    """The `count` points that tell most of a closed outline (Visvalingam and Whyatt 1993).

    The point that spans the smallest triangle with its neighbours is left out, again and again.
    """
    areas = np.empty(len(points))
    compiled(leave_out)(points, count, areas)
    return points[np.isfinite(areas)]


def leave_out(points, count, areas):
    """Twice the areas of the triangles of all but `count` points, inf where one is left out."""
    size = len(points)
    before, after = np.arange(size) - 1, np.arange(size) + 1
    before[0], after[size - 1] = size - 1, 0
    for k in range(size):
        areas[k] = triangle(points, before[k], k, after[k])
    for _ in range(size - count):
        k = np.argmin(areas)
        areas[k] = np.inf
        left, right = before[k], after[k]
        after[left], before[right] = right, left
        areas[left] = triangle(points, before[left], left, right)
        areas[right] = triangle(points, left, right, after[right])


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


def best_breaks(costs: np.ndarray, count: int, start: int) -> np.ndarray:
    """The `count` breaks, the first at `start`, of the split of least total cost."""
    breaks = np.empty(count, np.int64)
    compiled(split_costs)(costs, start, breaks)
    return breaks


def split_costs(costs, start, breaks):
    """The same into an array."""
    count = len(breaks)
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
    place = size
    for k in range(count, 0, -1):
        place -= chosen[k, place]
        breaks[k - 1] = (start + place) % size


def corners(points, breaks):
    """The vertices (N, 2) where the lines of neighbouring runs cross.

    Where they cross too flatly, or far from the break, midway between its feet on both lines.
    """
    # The line of least squares through each run.
    stops = np.roll(breaks, -1)
    last = np.where(stops > breaks, stops, stops + len(points))
    x, y, xx, xy, yy = scatter(moment_sums(points), breaks, last)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    centres = np.column_stack([x, y])
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    before, ahead = np.roll(centres, 1, axis=0), np.roll(along, 1, axis=0)
    places = points[breaks]
    sine = cross(ahead, along)
    offset = centres - before
    flat = np.abs(sine) < FLATTEST
    share = cross(offset, along)
    crossing = before + (share / np.where(flat, 1.0, sine))[:, None] * ahead
    feet = 0.5 * (foot(places, before, ahead) + foot(places, centres, along))
    lengths = np.hypot(*(np.roll(places, -1, axis=0) - places).T)
    reach = 1.0 + 0.5 * np.minimum(lengths, np.roll(lengths, 1))
    near = ~flat & (np.hypot(*(crossing - places).T) < reach)
    return np.where(near[:, None], crossing, feet)


def foot(points, origins, directions):
    share = np.einsum("ij,ij->i", points - origins, directions)
    return origins + share[:, None] * directions


def split_corners(points: np.ndarray, count: int, start: int, rounds: int) -> np.ndarray:
    """The `count` corners of the best split of the outline `points` (M, 2), M ≥ 2 `count`.

    The split has a break at `start`; every round takes the break across as the start of a
    better one.
    """
    size = len(points)
    longest = size // 2 if count < SPACINGS else SPACINGS * size // count
    costs = run_costs(points, min(longest, size - 1))
    breaks = best_breaks(costs, count, start)
    for _ in range(rounds):
        breaks = best_breaks(costs, count, int(breaks[count // 2]))
    return corners(points, breaks)
