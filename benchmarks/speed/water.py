"""What it takes to know what slow flow makes of two spheres, and of an outline: CPU seconds; and
how much longer a study of rates takes with the water between two bodies.

python -m benchmarks.speed.water
"""

import time
from pathlib import Path
from statistics import mean
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.reporting import Table, begin
from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.kind import study_of
from flocsim.hydrodynamics import Meeting, SpherePair, prism_drag
from flocsim.hydrodynamics.two_spheres import functions_of
from flocsim.io.shape_library import SHIPPED, read_library

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


STUDY = """
preset = "si"
replicates = 4096
[scene]
kind = "kernel"
meeting = "{}"
{}
sizes = ["5 um", "10 um"]
[shapes]
source = "library"
file = "synthetic"
vertices = [{}]
[forces.double_layer]
potential = 0
"""


def study_of_pairs(folder, meeting, vertices, more=""):
    """A study of quartz."""
    path = Path(folder) / "kernel.toml"
    rate = "" if meeting == "settling" else 'rate = "10 1/s"'
    path.write_text(STUDY.format(meeting, rate, vertices) + more, "utf-8")
    return study_of(load_any_config(path))


def study_table(count):
    """CPU seconds of the same points with the water over those without, and steps; 5 with 10 µm."""
    table = Table("Studies with the water", ("meeting", "N", "ms a pair", "ratio", "of steps"))
    for meeting in ("settling", "shear"):
        for vertices in (1, 16):
            with TemporaryDirectory() as folder:
                plain, wet = (
                    study_of_pairs(folder, meeting, vertices, more)
                    for more in ("", "[forces.hydrodynamics]\n")
                )
            spent, steps = {plain: 0.0, wet: 0.0}, {plain: 0, wet: 0}
            place = [each.endswith("5um-10um") for each in plain.config.scene.names].index(True)
            for study in (plain, wet):  # what it takes to compile, and tables
                study.run(place, vertices, 1.0, 0)
            for replicate in range(count):
                for study in (plain, wet):
                    began = time.process_time()
                    row = study.run(place, vertices, 1.0, replicate)
                    spent[study] += time.process_time() - began
                    steps[study] += row["steps"]
            table.add(
                meeting, vertices, 1e3 * spent[wet] / count, spent[wet] / spent[plain],
                steps[wet] / steps[plain],
            )  # fmt: skip
    return table


def main():
    """Print the tables."""
    arguments = begin(__doc__)
    pair_table().print()
    outline_table(6 if arguments.quick else 24).print()
    study_table(40 if arguments.quick else 400).print()


if __name__ == "__main__":
    main()
