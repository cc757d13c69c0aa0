"""How many replicates of kernel studies a core runs in a second, and what nine classes would take.

    python -m benchmarks.speed.kernels [--replicates 384] [--vertices 32 64]

CPU time of this process on small shares of the points; both errors are included, as the share of
points that a study of 4096 runs again is, and every rank makes all pairs of flocs.
"""

import argparse
import tempfile
import time
from pathlib import Path
from statistics import mean
from typing import NamedTuple

from flocsim.ensembles.collision.draw import MORE_STEPS, count_checks
from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.kernels import study_of

SIZES = ("4 um", "5 um", "6 um", "8 um", "10 um", "13 um", "16 um", "20 um", "25 um")
POINTS = 4096
RANKS = 2
EVERY = 6
"""Of the points, so many are run again, at a 100 times tighter tolerance."""

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


class Costs(NamedTuple):
    """CPU times [s] of making a pair of flocs, a first run and a second one; how many points of a
    condition the last are for; flips among those that were run again here."""

    pair: float
    first: float
    second: float
    share: float
    flips: int
    checked: int

    @property
    def each(self) -> float:
        """Of a point, its share of second runs included [s]."""
        return self.first + self.share * self.second


def measured(study, vertices, replicates):
    """The Costs of a Study."""
    names, config = study.config.scene.names, study.config
    places = [len(names) // 4, len(names) // 2, (3 * len(names)) // 4]
    steps, exact = config.integrator.max_steps, study.exact[0]
    study.run(places[0], vertices, 1.0, 0)
    pair, first, second, flips = [], [], [], 0
    for place in places:
        for k in range(replicates // len(places)):
            known, began = len(study.encounters), time.process_time()
            draw = study.draw(place, vertices, 1.0, k)
            _ = draw.encounter.scene, draw.encounter.observed()
            if len(study.encounters) > known:
                pair.append(time.process_time() - began)
            driver, began = study.driver(draw.encounter), time.process_time()
            row = draw.run(driver, steps)
            first.append(time.process_time() - began)
            if k % EVERY == 0:
                began = time.process_time()
                again = draw.run(driver, MORE_STEPS * steps, integrator=exact)
                second.append(time.process_time() - began)
                flips += again["outcome"] != row["outcome"]
    share = count_checks(config.seed, POINTS, "auto") / POINTS
    return Costs(mean(pair), mean(first), mean(second), share, flips, len(second))


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--replicates", type=int, default=384)
    parser.add_argument("--vertices", type=int, nargs="+", default=[32, 64])
    parser.add_argument("--presets", nargs="+", default=["tang2014", "si"])
    args = parser.parse_args()
    print(f"preset      mechanism   N  points/s  ms first  ms again  flips  ms/pair of flocs  "
          f"{POINTS} points of all pairs on {RANKS} ranks")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for preset in args.presets:
            for meeting in ("settling", "shear"):
                for vertices in args.vertices:
                    study = study_for(folder, preset, meeting, vertices)
                    costs = measured(study, vertices, args.replicates)
                    conditions, pool = len(study.config.scene.names), study.config.shapes.pool
                    whole = conditions * POINTS * costs.each / RANKS
                    whole += conditions * pool * (pool - 1) * costs.pair
                    print(f"{preset:<11} {meeting:<9} {vertices:>3} {1.0 / costs.each:>9.0f} "
                          f"{1e3 * costs.first:>9.2f} {1e3 * costs.second:>9.2f}  "
                          f"{costs.flips}/{costs.checked:<4} {1e3 * costs.pair:>17.1f}  "
                          f"{whole / 60.0:.1f} min", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
