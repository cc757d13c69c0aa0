"""How rigid clusters of bodies move through slow flow: the sum of Kirkwood and Riseman.

Of a force on a cluster every body bears a share, and moves the others by the tensor of Rotne,
Prager and Yamakawa, the sphere of its drag in its place; the shares are those with which all move
alike in the mean of two directions, which makes the least of the sum. Touching spheres push each
other by less than that tensor says when they move as one, as neither yields to what the other does
around it: by as much as is exact for two alike, which fades by the cube of the distance.

Kernels: plain functions on scalars and arrays, viscosity 1.

Sources: J. G. Kirkwood and J. Riseman (1948), J. Chem. Phys. 16, 565; of unequal and overlapping
spheres P. J. Zuk et al. (2014), J. Fluid Mech. 741, R5; of two that touch D. J. Jeffrey and
Y. Onishi (1984), J. Fluid Mech. 139, 261.
"""

import math

LESS_ALONG, LESS_ACROSS = 0.120, 0.1315
"""By which shares of the tensor two alike push each other less where they touch, along the line of
centres and across."""

CENTRED = 1e-6
"""Centres nearer to each other than this share of both radii count as so far apart."""

SHARE_ERROR, MOST_CHANGES = 0.03, 30
"""Shares are good where bodies move alike to so much; after so many changes at most. The sum is
wrong by the square of that."""


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


def pushed_by(x, y, radii, own, shares, first, last, moved):
    """``moved``: how fast shares of a force move the bodies of a cluster, in the mean of two
    directions."""
    for i in range(first, last):
        moved[i] = own[i] * shares[i]
    for i in range(first, last):
        for j in range(first, i):
            xx, _, yy = push(x[i] - x[j], y[i] - y[j], radii[i], radii[j])
            mean = 0.5 * (xx + yy)
            moved[i] += mean * shares[j]
            moved[j] += mean * shares[i]


def find_shares(x, y, radii, own, first, last, shares, left, way, moved):
    """The ``shares`` of a force by which all bodies of a cluster move alike: conjugate gradients,
    by the drag of each, from shares that go by their radii."""
    total = 0.0
    for i in range(first, last):
        total += radii[i]
    for i in range(first, last):
        shares[i] = radii[i] / total
    pushed_by(x, y, radii, own, shares, first, last, moved)
    speed = 0.0
    for i in range(first, last):
        speed += shares[i] * moved[i]
    size = 0.0
    for i in range(first, last):
        shares[i] /= speed
        left[i] = 1.0 - moved[i] / speed
        way[i] = left[i] / own[i]
        size += left[i] * way[i]
    alike = 0.0
    for i in range(first, last):
        alike += 1.0 / own[i]
    for _ in range(MOST_CHANGES):
        if size <= SHARE_ERROR * SHARE_ERROR * alike:
            break
        pushed_by(x, y, radii, own, way, first, last, moved)
        against = 0.0
        for i in range(first, last):
            against += way[i] * moved[i]
        for i in range(first, last):
            shares[i] += size / against * way[i]
            left[i] -= size / against * moved[i]
        before, size = size, 0.0
        for i in range(first, last):
            size += left[i] * left[i] / own[i]
        for i in range(first, last):
            way[i] = left[i] / own[i] + size / before * way[i]
    total = 0.0
    for i in range(first, last):
        total += shares[i]
    for i in range(first, last):
        shares[i] /= total


def cluster_mobilities(starts, x, y, radii, own, scratch, found):
    """``found`` (c, 3): (xx, xy, yy) [1/m], the velocity of a cluster by a force on it, over the
    viscosity.

    The bodies of cluster c are those from ``starts[c]`` to before ``starts[c + 1]``: their places
    [m], whole across the seams of a box, ``radii`` (n,) [m] of the spheres that stand for them, and
    ``own`` (n, 3) [1/m], their mobilities alone. ``scratch`` (5, n).
    """
    shares, left, way, moved, mean = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    for i in range(x.shape[0]):
        mean[i] = 0.5 * (own[i, 0] + own[i, 2])
    for c in range(starts.shape[0] - 1):
        first, last = starts[c], starts[c + 1]
        find_shares(x, y, radii, mean, first, last, shares, left, way, moved)
        sum_xx = sum_xy = sum_yy = 0.0
        for i in range(first, last):
            share = shares[i] * shares[i]
            sum_xx += share * own[i, 0]
            sum_xy += share * own[i, 1]
            sum_yy += share * own[i, 2]
            for j in range(first, i):
                xx, xy, yy = push(x[i] - x[j], y[i] - y[j], radii[i], radii[j])
                share = 2.0 * shares[i] * shares[j]
                sum_xx += share * xx
                sum_xy += share * xy
                sum_yy += share * yy
        found[c, 0], found[c, 1], found[c, 2] = sum_xx, sum_xy, sum_yy
