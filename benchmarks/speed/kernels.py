"""How many replicates of kernel studies a core runs in a second, and what nine classes would take.

    python -m benchmarks.speed.kernels [--replicates 256] [--vertices 32 64]

CPU time of this process, both errors included (the points that are run again), on small shares of
the points: the first pairs of flocs are made before it counts, as later points meet them again.
"""

import argparse
import tempfile
import time
from pathlib import Path

from flocsim.ensembles.chunks import COLUMNS
from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.kernels.study import study_of

SIZES = ("4 um", "5 um", "6 um", "8 um", "10 um", "13 um", "16 um", "20 um", "25 um")
POINTS = 4096
RANKS = 2

CONFIG = """
preset = "{preset}"
replicates = {points}
[scene]
kind = "kernel"
meeting = "{meeting}"
{rate}
sizes = {sizes}
[shapes]
source = "library"
file = "synthetic"
vertices = [{vertices}]
"""


def study_for(folder, preset, meeting, vertices):
    """The Study of nine classes by one mechanism."""
    path = Path(folder) / "kernels.toml"
    rate = "" if meeting == "settling" else 'rate = "10 1/s"'
    path.write_text(
        CONFIG.format(preset=preset, points=POINTS, meeting=meeting, rate=rate,
                      sizes=str(list(SIZES)).replace("'", '"'), vertices=vertices),
        "utf-8",
    )  # fmt: skip
    return study_of(load_any_config(path))


def measured(study, vertices, replicates):
    """(CPU s of making pairs of flocs, pairs, CPU s of runs, replicates, flips, run again)."""
    names = study.config.scene.names
    places = [len(names) // 4, len(names) // 2, (3 * len(names)) // 4]
    study.run(places[0], vertices, 1.0, 0)
    setup, run, flips, checked, count = 0.0, 0.0, 0, 0, 0
    for place in places:
        for k in range(replicates // len(places)):
            began = time.process_time()
            encounter, angles = study.drawn(place, vertices, k)
            study.share_of(encounter, 1.0, k)
            _ = encounter.scene, encounter.observed(), angles
            middle = time.process_time()
            row = study.run(place, vertices, 1.0, k)
            run += time.process_time() - middle
            setup += middle - began
            count += 1
            again = row["checked_outcome"] != 255
            checked += again
            flips += again and row["checked_outcome"] != row["outcome"]
    assert set(COLUMNS) <= set(row)
    return setup, len(study.encounters), run, count, flips, checked


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--replicates", type=int, default=256)
    parser.add_argument("--vertices", type=int, nargs="+", default=[32, 64])
    parser.add_argument("--presets", nargs="+", default=["tang2014", "si"])
    args = parser.parse_args()
    print("preset      mechanism   N   replicates/s   ms per pair of flocs   flips   "
          f"{POINTS} points of all pairs on {RANKS} ranks")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for preset in args.presets:
            for meeting in ("settling", "shear"):
                for vertices in args.vertices:
                    study = study_for(folder, preset, meeting, vertices)
                    setup, pairs, run, count, flips, checked = measured(
                        study, vertices, args.replicates
                    )
                    each, conditions = setup / pairs, len(study.config.scene.names)
                    made = conditions * study.config.shapes.pool * (study.config.shapes.pool - 1)
                    whole = conditions * POINTS * run / count / RANKS + made * each
                    print(f"{preset:<11} {meeting:<10} {vertices:>3} {count / run:>14.0f} "
                          f"{1e3 * each:>22.1f}   {flips}/{checked:<5} {whole / 60.0:.1f} min",
                          flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
