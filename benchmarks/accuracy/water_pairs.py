"""Two real flocs in water, by `[forces.hydrodynamics]` and the drag of their shape, against
boundary elements on both: by how much how fast they move is off.

python -m benchmarks.accuracy.water_pairs [--quick] [--markdown] [--images DIR]
"""

from functools import partial

import numpy as np

from benchmarks.pictures import PICTURES, checked, silhouettes
from benchmarks.reporting import Table, begin
from tests.helpers.real_pairs import (
    Resistance,
    boundary_elements,
    line_mobilities,
    random_pair,
    real_flocs,
    settling,
)

GAPS = 0.25, 0.5, 1.0, 3.0
"""Of the outlines, over the mean r_eq."""

MOTIONS = "together, along", "across", "against, along", "across", "settling"


def differences(shapes, places):
    """Of the mobilities along and across the line of centres, together and against each other (4,),
    and the larger of both bodies' velocities, over the faster speed, in the worst direction."""
    found, exact = Resistance(shapes)(places), boundary_elements(shapes, places)
    lines = line_mobilities(found, places) / line_mobilities(exact, places) - 1.0
    ours, theirs = settling(found, shapes), settling(exact, shapes)
    speed = np.linalg.norm(theirs, axis=2).max(axis=1)
    return [*lines, np.max(np.linalg.norm(ours - theirs, axis=2) / speed[:, None])]


def table_of(count, images):
    """By the gap: the rms of a difference and the largest, in per cent."""
    rng, flocs = np.random.default_rng(1), real_flocs(16, read=partial(silhouettes, images))
    table = Table(f"{count} pairs at each gap, rms and largest, %", ("gap", *MOTIONS))
    for gap in GAPS:
        off = 100.0 * np.array([differences(*random_pair(rng, flocs, gap)) for _ in range(count)])
        rms, most = np.sqrt(np.mean(off**2, axis=0)), np.abs(off).max(axis=0)
        told = [f"{a:.1f}, {b:.1f}" for a, b in zip(rms, most, strict=True)]
        table.add(gap, *told)
    return table


def main():
    """Print the table."""
    arguments = begin(__doc__, images=PICTURES)
    images = checked(arguments.images, "silhouettes")
    table_of(4 if arguments.quick else 20, images).print()


if __name__ == "__main__":
    main()
