"""Aggregation against the Hamaker constant, by forces of spheres and by those of outlines.

    python -m benchmarks.accuracy.hamaker [--preset clay] [--hamaker 1e-20 …] [--film clay]
        [--figure FILE]

runs flocs of N = 16 at δ = .5 under the presets tang2014 and clay, from H_A = 1e-23 to 1e-18 J,
with both forces as the preset has them and with both by law = "outline". Pr[A] is here the share of
all approaches that ends in contact for good, with its 95 % interval; held: those that attraction
holds at a distance, in a secondary minimum, and that the figure adds with open markers. ``--film``:
presets whose bodies meet with the resistance of the water between (``[forces.lubrication]``),
without which outlines that are held at a nanometre swing a thousand times before they rest.
"""

import time
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.reporting import Table, parser_of, print_heading
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.runner import run
from flocsim.io.confidence import wilson
from flocsim.io.plots.style import house_style, new_figure, save, set_probability_axis
from flocsim.io.results.schema import OUTCOMES

QUICKSTART = Path(__file__).parents[2] / "examples" / "quickstart.toml"
PRESETS = ("tang2014", "clay")
HAMAKER = (1e-23, 1e-22, 1e-21, 1e-20, 1e-19, 1e-18)
LAWS = ("spheres", "outline")


def outcomes_of(preset, law, hamaker, replicates, kind, film):
    """({outcome: how many}, seconds)."""
    forces = {"van_der_waals": {"hamaker": hamaker}}
    if law == "outline":
        forces = {"van_der_waals": {"hamaker": hamaker, "law": law}, "double_layer": {"law": law}}
    if film:
        forces["lubrication"] = {}
    config = load_config(QUICKSTART, {
        "preset": preset, "seed": 1, "replicates": replicates, "forces": forces,
        # The zone divides outcomes, which is not asked for here; its root moves with H_A.
        "zone": {"distance": 5.925e-6 if preset == "tang2014" else 1e-8},
        "scene": {"types": [kind], "delta": [0.5]}, "shapes": {"vertices": [16]},
        "integrator": {"check_share": 0.0},
    })  # fmt: skip
    start = time.perf_counter()
    found = run(config).replicates["outcome"].ravel()
    counts = {name: int(np.sum(found == code)) for code, name in enumerate(OUTCOMES)}
    return counts, time.perf_counter() - start


def aggregated(counts, *more):
    """(share, both ends of its interval) of approaches that aggregate, or end as in ``more``."""
    known = sum(counts.values()) - counts["undecided"] - counts["failed"]
    found = sum(counts[name] for name in ("A", "C", *more))
    low, high = wilson(found, known)
    return found / max(known, 1), float(low), float(high)


def draw(rows, presets, path):
    """Both laws of each preset beside each other."""
    with house_style():
        figure = new_figure(1.0 + 2.75 * len(presets), 3.0)
        panels = figure.subplots(1, len(presets), sharey=True, squeeze=False)[0]
        for axes, preset in zip(panels, presets, strict=True):
            for k, law in enumerate(LAWS):
                here = [row for row in rows if row[:2] == (preset, law)]
                h = [row[2] * (1.0 + 0.15 * k) for row in here]
                p, low, high = np.array([aggregated(row[3]) for row in here]).T
                ends = [p - low, high - p]
                line = axes.errorbar(h, p, yerr=ends, marker="o", capsize=2, label=law)
                both = [aggregated(row[3], "held")[0] for row in here]
                axes.plot(h, both, "o", mfc="none", ms=8, color=line[0].get_color())
            set_probability_axis(axes)
            axes.set(xscale="log", xlabel="Hamaker constant [J]", title=preset)
        panels[0].plot([], [], "o", mfc="none", ms=8, color="grey", label="or held apart")
        panels[0].set_ylabel("Pr[A]")
        panels[0].legend(title="forces by", loc="center right")
        save(figure, path)


def main():
    """Print the table, and draw it."""
    parser = parser_of(__doc__)
    parser.add_argument("--replicates", type=int, default=30)
    parser.add_argument("--type", default="I")
    parser.add_argument("--preset", nargs="+", default=PRESETS)
    parser.add_argument("--hamaker", nargs="+", type=float, default=HAMAKER)
    parser.add_argument("--film", nargs="*", default=())
    parser.add_argument("--figure", type=Path)
    args = parser.parse_args()
    if args.quick:
        args.replicates = 6
    print_heading()
    columns = "preset", "law", "H_A [J]", "Pr[A]", "95 %", *OUTCOMES, "s"
    table, rows = Table("Aggregation against the Hamaker constant", columns), []
    for preset, law, hamaker in product(args.preset, LAWS, args.hamaker):
        counts, spent = outcomes_of(
            preset, law, hamaker, args.replicates, args.type, preset in args.film
        )
        rows.append((preset, law, hamaker, counts))
        p, low, high = aggregated(counts)
        interval = f"{low:.2f} to {high:.2f}"
        table.add(preset, law, f"{hamaker:.0e}", p, interval, *counts.values(), spent)
    table.print(args.markdown)
    if args.figure:
        draw(rows, args.preset, args.figure)


if __name__ == "__main__":
    main()
