"""What it takes to know what slow flow makes of two spheres, and of an outline: CPU seconds.

python -m benchmarks.speed.water
"""

import time
from statistics import mean

import numpy as np

from benchmarks.reporting import Table, parse_arguments, print_heading
from flocsim.hydrodynamics import Meeting, SpherePair, prism_drag
from flocsim.hydrodynamics.two_spheres import functions_of
from flocsim.io.shapes.library import SHIPPED, read_library

RATIOS = (1.0, 0.5, 0.1, 0.02)


def seconds(work):
    """CPU time of this process."""
    began = time.process_time()
    work()
    return time.process_time() - began


def meeting(ratio):
    """Quartz of 10 µm and less."""
    radii = 10e-6 * ratio, 10e-6
    reduced = radii[0] * radii[1] / sum(radii)
    return Meeting(
        SpherePair(radii, 0.89e-3),
        lambda gap: -4.7e-20 * reduced / (6.0 * np.maximum(gap, 1e-9) ** 2), 1e-9,
    )  # fmt: skip


def pair_table():
    """By the ratio of the radii."""
    table = Table("CPU seconds of a pair", ("radii", "functions", "settling", "shear", "extension"))
    for ratio in RATIOS:
        functions = seconds(lambda ratio=ratio: functions_of.__wrapped__(ratio))
        two = meeting(ratio)
        two.pair.along(1e-6)
        weights = ratio**3, 1.01
        table.add(
            ratio, functions, seconds(lambda two=two, weights=weights: two.settling(weights)),
            *(seconds(lambda two=two, flow=flow: two.in_flow(flow, 10.0))
              for flow in ("shear", "extension")),
        )  # fmt: skip
    return table


def outline_table(count):
    """By N, of the library that ships with flocsim."""
    table = Table("Drag of outlines", ("N", "s a floc", "stated error"))
    entries = read_library(SHIPPED)[:count]
    for vertices in (8, 16, 64):
        outlines = [entry.fits[vertices].shape.outline() for entry in entries]
        found = []
        spent = seconds(
            lambda outlines=outlines, found=found: found.extend(map(prism_drag, outlines))
        )
        table.add(vertices, spent / count, mean(each.error for each in found))
    return table


def main():
    """Print the tables."""
    arguments = parse_arguments(__doc__)
    print_heading()
    pair_table().print(arguments.markdown)
    outline_table(6 if arguments.quick else 24).print(arguments.markdown)


if __name__ == "__main__":
    main()
