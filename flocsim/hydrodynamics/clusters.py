"""How rigid clusters of bodies move through slow flow: the sum of Kirkwood and Riseman.

Of a force on a cluster every body bears a share, and moves the others by the tensor of Rotne,
Prager and Yamakawa, the sphere of its drag in its place; the shares are those with which all move
alike in the mean of two directions, which makes the least of the sum. Touching spheres push each
other by less than that tensor says when they move as one, as neither yields to what the other does
around it: by as much as is exact for two alike, which fades by the cube of the distance.

`mobilities` is what others call; the kernels are plain functions on scalars and arrays.

Sources: J. G. Kirkwood and J. Riseman (1948), J. Chem. Phys. 16, 565; of unequal and overlapping
spheres P. J. Zuk et al. (2014), J. Fluid Mech. 741, R5; of two that touch D. J. Jeffrey and
Y. Onishi (1984), J. Fluid Mech. 139, 261.
"""

import math

import numpy as np

from flocsim.compiler.composer import compiled

FEW = 100
"""Bodies of a cluster of which all pairs count by themselves."""

LESS_ALONG, LESS_ACROSS = 0.120, 0.1315
"""By which shares of the tensor two alike push each other less where they touch, along the line of
centres and across."""

CENTRED = 1e-6
"""Centres nearer to each other than this share of both radii count as so far apart."""

SHARE_ERROR, MOST_CHANGES = 0.03, 30
"""Shares are good where bodies move alike to so much; after so many changes at most. The sum is
then right to 1 %."""


def push(x, y, a, b):
    """(xx, xy, yy) [1/m]: what a force on a sphere of radius b does to one of radius a, which is
    (x, y) from it, in the plane, where both are of one rigid cluster."""
    sum_, less = a + b, abs(a - b)
    r = max(math.hypot(x, y), less, CENTRED * sum_)
    if r >= sum_:
        scale = 1.0 / (8.0 * math.pi * r)
        across = scale * (1.0 + (a * a + b * b) / (3.0 * r * r))
        more = scale * (1.0 - (a * a + b * b) / (r * r))
    else:
        scale = 1.0 / (6.0 * math.pi * a * b * 32.0 * r * r * r)
        across = scale * (16.0 * r * r * r * sum_ - (less * less + 3.0 * r * r) ** 2)
        more = scale * 3.0 * (less * less - r * r) ** 2
    near = min(1.0, sum_ / r) ** 3
    along = (across + more) * (1.0 - LESS_ALONG * near)
    across *= 1.0 - LESS_ACROSS * near
    more = (along - across) / (r * r)
    return across + more * x * x, more * x * y, across + more * y * y


def add_push(moved, one, other, found, of_one, of_other):
    """Add what two shares of a force do to each other's bodies, or cells, pushed by ``found``."""
    for k in range(3):
        moved[k, one] += found[k] * of_other
        moved[k, other] += found[k] * of_one


def pushed_by(c, cells, starts, grid, places, radii, own, shares, moved, sums):
    """``moved`` (3, n): xx, xy, yy of how fast shares of a force move the bodies of cluster c."""
    for one in range(cells[c], cells[c + 1]):
        for k in range(4):
            sums[k, one] = 0.0
        for i in range(starts[one], starts[one + 1]):
            sums[3, one] += shares[i]
            for k in range(3):
                moved[k, i] = own[k, i] * shares[i]
    for one in range(cells[c], cells[c + 1]):
        for other in range(cells[c], one + 1):
            if not are_near(grid, one, other):
                far = push(grid[one, 2] - grid[other, 2], grid[one, 3] - grid[other, 3], 0.0, 0.0)
                add_push(sums, one, other, far, sums[3, one], sums[3, other])
                continue
            for i in range(starts[one], starts[one + 1]):
                for j in range(starts[other], min(i, starts[other + 1])):
                    x, y = places[i, 0] - places[j, 0], places[i, 1] - places[j, 1]
                    near = push(x, y, radii[i], radii[j])
                    add_push(moved, i, j, near, shares[i], shares[j])
    for one in range(cells[c], cells[c + 1]):
        for i in range(starts[one], starts[one + 1]):
            for k in range(3):
                moved[k, i] += sums[k, one]


def are_near(grid, one, other):
    """Whether two cells of a grid are next to each other, or one: then all pairs of bodies count
    by themselves, others by those of cells."""
    return max(abs(grid[one, 0] - grid[other, 0]), abs(grid[one, 1] - grid[other, 1])) < 1.5


def mean_of(moved, i):
    """Of a body in the two directions."""
    return 0.5 * (moved[0, i] + moved[2, i])


def find_shares(c, cells, starts, grid, places, radii, own, scratch, moved, sums):
    """The shares of a force by which all bodies of cluster c move alike: conjugate gradients, by
    the drag of each, from shares that go by their radii."""
    shares, left, way = scratch[0], scratch[1], scratch[2]
    first, last = starts[cells[c]], starts[cells[c + 1]]
    for i in range(first, last):
        shares[i] = radii[i]
    pushed_by(c, cells, starts, grid, places, radii, own, shares, moved, sums)
    speed = total = size = alike = 0.0
    for i in range(first, last):
        speed += shares[i] * mean_of(moved, i)
        total += shares[i]
        alike += 1.0 / mean_of(own, i)
    for i in range(first, last):
        shares[i] *= total / speed
        left[i] = 1.0 - mean_of(moved, i) * total / speed
        way[i] = left[i] / mean_of(own, i)
        size += left[i] * way[i]
    for _ in range(MOST_CHANGES):
        if size <= SHARE_ERROR * SHARE_ERROR * alike:
            break
        pushed_by(c, cells, starts, grid, places, radii, own, way, moved, sums)
        against = 0.0
        for i in range(first, last):
            against += way[i] * mean_of(moved, i)
        before, size = size, 0.0
        for i in range(first, last):
            shares[i] += before / against * way[i]
            left[i] -= before / against * mean_of(moved, i)
            size += left[i] * left[i] / mean_of(own, i)
        for i in range(first, last):
            way[i] = left[i] / mean_of(own, i) + size / before * way[i]
    total = 0.0
    for i in range(first, last):
        total += shares[i]
    for i in range(first, last):
        shares[i] /= total


def cluster_mobilities(cells, starts, grid, places, radii, own, scratch, moved, sums, found):
    """``found`` (c, 3): (xx, xy, yy) [1/m], the velocity of a cluster by a force on it, over the
    viscosity.

    The cells of cluster c are those from ``cells[c]`` to before ``cells[c + 1]``, the bodies of
    cell k those from ``starts[k]`` to before ``starts[k + 1]``; ``grid`` (k, 4): column and row of
    a cell, and the middle of its bodies [m]. Of the bodies: ``places`` (n, 2) [m], whole across the
    seams of a box, ``radii`` [m] of the spheres that stand for them, ``own`` (3, n) [1/m], their
    mobilities alone. ``scratch`` and ``moved`` (3, n), ``sums`` (4, k).
    """
    shares = scratch[0]
    for c in range(cells.shape[0] - 1):
        find_shares(c, cells, starts, grid, places, radii, own, scratch, moved, sums)
        pushed_by(c, cells, starts, grid, places, radii, own, shares, moved, sums)
        for i in range(starts[cells[c]], starts[cells[c + 1]]):
            for k in range(3):
                found[c, k] += shares[i] * moved[k, i]


def mobilities(
    label: np.ndarray, places: np.ndarray, radii: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """(xx, xy, yy) (c, 3) [1/m], the velocity of each cluster by a force on it, viscosity 1.

    Of n bodies: ``label`` (n,) of their cluster, 0, 1, …, of which none is left out; ``places``
    (n, 2) [m], whole across the seams of a box; ``radii`` [m] of the spheres that stand for them;
    ``own`` (n, 3) [1/m], the mobility of each alone.

    Clusters of many bodies are cut into cells, as many as n^⅔ for a full one, and bodies of cells
    that are not next to each other push each other together: some n^(4/3) pushes in all.
    """
    count = np.bincount(label)
    order = np.argsort(label, kind="stable")
    first = np.append(0, np.cumsum(count)[:-1])
    low, high = (each.reduceat(places[order], first, axis=0) for each in (np.minimum, np.maximum))
    extent = (high - low).max(axis=1)
    side = np.where(count > FEW, extent / np.cbrt(count), 2.0 * extent + 1.0)
    cell = np.floor((places - low[label]) / side[label, None])
    order = np.lexsort((cell[:, 1], cell[:, 0], label))
    known = np.column_stack([label, cell])[order]
    starts = np.flatnonzero(np.r_[True, np.any(known[1:] != known[:-1], axis=1)])
    radii, places = radii[order], places[order]
    weight = np.add.reduceat(radii, starts)
    middle = np.add.reduceat(radii[:, None] * places, starts, axis=0) / weight[:, None]
    found = np.zeros((len(count), 3))
    compiled(cluster_mobilities, what="the drag of clusters")(
        np.searchsorted(known[starts, 0], np.arange(len(count) + 1)).astype(np.int64),
        np.append(starts, len(label)), np.hstack([known[starts, 1:], middle]), places, radii,
        own[order].T.copy(), *np.zeros((2, 3, len(label))), np.zeros((4, len(starts))), found,
    )  # fmt: skip
    return found
