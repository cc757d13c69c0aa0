"""Van der Waals forces along outlines against the slopes of their energy, in random poses.

    python -m benchmarks.accuracy.outline_forces [--poses 1000] [--d-min 1e-9]

compares force and torque of rough flocs, 1 to 100 nm apart, with −∂E/∂q of `attraction_energy`, by
differences that leave 1e-6 of it: the largest of |ΔF| and |ΔT|/r_eq over |F|. Goal: 1e-6 in 10,000
poses.
"""

import math
from itertools import pairwise

import numpy as np

from benchmarks.reporting import Table, begin
from flocsim.forces import VanDerWaals
from flocsim.geometry.contact.attraction import attraction_energy
from flocsim.geometry.shapes.pieces import outline_pieces
from tests.integrators.rhs.test_outline_sum import HAMAKER, SIZE, Pair, at_gap, rough, slopes

GAPS = (1e-9, 3e-9, 1e-8, 3e-8, 1e-7)
"""Ends of ranges of gaps [m]."""


def off_by(random, low, high, d_min):
    """How far force and torque are off in a random pose at a gap from ``low`` to ``high`` [m]."""
    first, second = random.integers(12, size=2)
    one, other = rough(8, SIZE, first), rough(8 + second, 1.7 * SIZE, 50 + second)
    gap = low * (high / low) ** random.uniform()
    pose = at_gap(one, other, gap, *random.uniform(0.0, 2.0 * math.pi, 2))
    force = VanDerWaals(HAMAKER, d_min, law="outline", depth=1.0)
    found = Pair(other, one, pose, force).loads(*pose)
    pieces = outline_pieces(one.parts), outline_pieces(other.parts)
    wanted = slopes(lambda each: attraction_energy(*pieces, each, HAMAKER), pose, 2e-3 * gap, SIZE)
    off = np.abs(found[:3] - wanted) / (1.0, 1.0, SIZE)
    return float(off.max() / math.hypot(*wanted[:2]))


def main():
    """Print the table."""
    args = begin(__doc__, poses=1000, d_min=1e-9)
    poses, random = (40 if args.quick else args.poses) // (len(GAPS) - 1), np.random.default_rng(0)
    columns = "gap from [m]", "to", "poses", "median", "90 %", "99 %", "largest"
    table = Table("How far forces are off the slopes of their energy", columns)
    for low, high in pairwise(GAPS):
        found = [off_by(random, low, high, args.d_min) for _ in range(poses)]
        table.add(low, high, poses, *map(float, np.quantile(found, (0.5, 0.9, 0.99, 1.0))))
    table.print()


if __name__ == "__main__":
    main()
