"""Aggregation against the Hamaker constant, or the potential, by forces of spheres and of outlines.

    python -m benchmarks.accuracy.hamaker [--preset clay] [--hamaker 1e-20 …] [--film clay]
        [--figure FILE]
    python -m benchmarks.accuracy.hamaker --preset clay --potential 0.015 0.04 … --vertices 4 16 64
        --film clay --figure FILE

runs flocs at δ = .5 with both forces as the preset has them and with both by law = "outline": of
N = 16 from H_A = 1e-23 to 1e-18 J, or with the preset's H_A at each ``--potential`` [V]. Pr[A] is
here the share of all approaches that ends in contact for good, with its 95 % interval; held: those
that attraction holds at a distance, in a secondary minimum, and that the figure adds with open
markers. ``--film``: presets whose bodies meet with the resistance of the water between
(``[forces.lubrication]``), without which outlines that are held at a nanometre swing a thousand
times before they rest.
"""

import time
from itertools import product
from pathlib import Path

import numpy as np

import flocsim
from benchmarks.reporting import EXAMPLES, Table, begin
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.runner import run
from flocsim.io.confidence import wilson
from flocsim.io.plots.style import (
    BODY_COLOURS,
    add_foot,
    line_handles,
    marker,
    panel_grid,
    place_legend,
    save,
    set_probability_axis,
)
from flocsim.io.results.schema import OUTCOMES

PRESETS = ("tang2014", "clay")
HAMAKER = (1e-23, 1e-22, 1e-21, 1e-20, 1e-19, 1e-18)
LAWS = ("spheres", "outline")
VARIED = {
    "hamaker": ("van_der_waals", "Hamaker constant [J]", 1.0),
    "potential": ("double_layer", "zeta potential [mV]", 1e3),
}
"""{key: (its force, label of the axis, factor of its unit)}."""


def outcomes_of(preset, vertices, law, varied, value, args):
    """({outcome: how many}, seconds)."""
    forces = {"van_der_waals": {}, "double_layer": {}}
    forces[VARIED[varied][0]][varied] = value
    if law == "outline":
        for each in forces.values():
            each["law"] = law
    if preset in args.film:
        forces["lubrication"] = {}
    config = load_config(EXAMPLES / "quickstart.toml", {
        "preset": preset, "seed": 1, "replicates": args.replicates, "forces": forces,
        # The zone divides outcomes, which is not asked for here; its root moves with H_A.
        "zone": {"distance": 5.925e-6 if preset == "tang2014" else 1e-8},
        "scene": {"types": [args.type], "delta": [0.5]}, "shapes": {"vertices": [vertices]},
        "integrator": {"check_share": 0.0},
        # The strongest attraction presses contacts deeper than their law is valid for.
        "stop": {"failed": 1.0},
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


def draw(rows, varied, path, foot):
    """Both laws of each preset and N, a panel for each."""
    from matplotlib.lines import Line2D

    _, label, unit = VARIED[varied]
    panels = list(dict.fromkeys(row[:2] for row in rows))
    several = len({vertices for _, vertices in panels}) > 1
    titles = [f"{preset}, $N$ = {n}" if several else preset for preset, n in panels]
    hollow = {"marker": "o", "ls": "", "mfc": "none", "ms": 5.5, "clip_on": False}
    with panel_grid(titles, r"$\Pr[A]$", label) as (figure, all_axes, spare):
        for axes, panel in zip(all_axes, panels, strict=True):
            for k, (law, colour) in enumerate(zip(LAWS, BODY_COLOURS, strict=False)):
                here = [row for row in rows if row[:3] == (*panel, law)]
                apart = 1.0 + (0.15 if varied == "hamaker" else 0.012) * k
                x = [unit * row[3] * apart for row in here]
                p, low, high = np.array([aggregated(row[4]) for row in here]).T
                look = {"color": colour, "marker": marker(k), "elinewidth": 0.8, "clip_on": False}
                axes.errorbar(x, p, np.clip([p - low, high - p], 0.0, None), **look)
                both = [aggregated(row[4], "held")[0] for row in here]
                axes.plot(x, both, color=colour, **hollow)
            set_probability_axis(axes)
            if varied == "hamaker":
                axes.set_xscale("log")
        handles = line_handles(LAWS, BODY_COLOURS)
        handles.append(Line2D([], [], color="grey", label="or held apart", **hollow))
        place_legend(figure, {"forces by": handles}, spare)
        add_foot(figure, "Bars: 95 % sampling intervals.")
        path.unlink(missing_ok=True)
        save(figure, path, foot=foot)


def main():
    """Print the table, and draw it."""
    args = begin(
        __doc__, replicates=30, type="I", preset=PRESETS, vertices=(16,), hamaker=HAMAKER,
        potential={"nargs": "+", "type": float}, film={"nargs": "*", "default": ()},
        figure={"type": Path},
    )  # fmt: skip
    if args.quick:
        args.replicates = 6
    varied = "potential" if args.potential else "hamaker"
    _, label, unit = VARIED[varied]
    columns = "preset", "N", "law", label, "Pr[A]", "95 %", *OUTCOMES, "s"
    table, rows = Table(f"Aggregation against the {label.partition(' [')[0]}", columns), []
    for case in product(args.preset, args.vertices, LAWS, args.potential or args.hamaker):
        counts, spent = outcomes_of(*case[:3], varied, case[3], args)
        rows.append((*case, counts))
        p, low, high = aggregated(counts)
        interval = f"{low:.2f} to {high:.2f}"
        table.add(*case[:3], f"{unit * case[3]:.3g}", p, interval, *counts.values(), spent)
    table.print()
    if args.figure:
        words = f"type {args.type}, δ = 0.5 · grown flocs · n = {args.replicates}"
        draw(rows, varied, args.figure, f"{words} · flocsim {flocsim.__version__}")


if __name__ == "__main__":
    main()
