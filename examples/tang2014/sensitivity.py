"""Pr[A] against H_A, φ, 1/κ, k_n, ρ_s and δ: what the paper does not have.

    python examples/tang2014/sensitivity.py [--library shapes.h5] [--replicates 200] [-o DIR]

Each value is varied alone around the preset `tang2014`, for the three types at N = 16, δ = ½ δ_max.
One process; orientations and flocs are the same for every value. Writes sensitivity.png, .pdf, .csv
and the transitions into sensitivity.md.
"""

import time

import numpy as np
from claims.table import number_text
from output import marked, save_all, write_page, write_table
from sweeps import TYPES, Sweep, config_of, parse_arguments, sweep, transition

from flocsim.ensembles.config.loader import nested
from flocsim.io.plots.style import house_style, new_figure, set_probability_axis
from flocsim.io.terminal import markdown_table

COLOURS, MARKERS = ("#0072B2", "#D55E00", "#009E73"), "osD"
MOST_OPEN = 0.05
"""Share of undecided or failed collisions above which a point is hollow."""
QUANTITIES = {
    # name: (keys in the config, the preset's value [SI], unit, values [SI])
    "$H_A$": (("forces", "van_der_waals", "hamaker"), 1e-18, "J", np.geomspace(1e-23, 1e-17, 19)),
    "$\\varphi$": (("forces", "double_layer", "potential"), 15e-3, "V",
                   np.geomspace(7.5e-3, 1.5, 13)),
    "$1/\\kappa$": (("forces", "double_layer", "debye_length"), 0.98e-6, "m",
                    np.geomspace(2e-7, 1e-5, 9)),
    "$k_n$": (("forces", "contact", "k_n"), 20.0, "N/m", np.geomspace(2.0, 2000.0, 10)),
    "$\\rho_s$": (("bodies", "surface_density"), 2.0, "kg/m²", np.geomspace(2e-3, 200.0, 11)),
}  # fmt: skip
PLAIN = {"$H_A$": "H_A", "$\\varphi$": "φ", "$1/\\kappa$": "1/κ", "$k_n$": "k_n",
         "$\\rho_s$": "ρ_s"}  # fmt: skip
"""Names in tables."""
SHARES = (0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 0.99)
DELTA = r"$\delta / \delta_{\max}$"
LEVELS = (0.05, 0.5, 0.95)


def plain(name):
    """ "H_A [J]" of a quantity's name in the figure."""
    return f"{PLAIN[name]} [{QUANTITIES[name][2]}]" if name in QUANTITIES else "δ/δ_max"


def run_all(library, replicates):
    """{name: Sweep} of all quantities."""
    found = {}
    for name, (keys, _, _, values) in QUANTITIES.items():
        found[name] = sweep(
            name, values, lambda v, k=keys: config_of(library, replicates, nested([(k, float(v))]))
        )
    found[DELTA] = sweep(
        DELTA, SHARES, lambda f: config_of(library, replicates, {"scene": {"delta": [f]}})
    )
    return found


def draw(axes, found: Sweep):
    """One panel: Pr[A] of the three types with intervals, and the share left open."""
    value, low, high = found.bands
    for kind, (colour, marker) in enumerate(zip(COLOURS, MARKERS, strict=True)):
        reach = np.clip([value - low, high - value], 0.0, None)[..., kind]
        axes.errorbar(found.values, value[:, kind], reach, color=colour, elinewidth=0.7, lw=1.0)
        few = found.open_share[:, kind] > MOST_OPEN
        for hollow, face in ((False, colour), (True, "white")):
            places = few == hollow
            axes.plot(found.values[places], value[places, kind], marker, ms=3.5, color=colour,
                      markerfacecolor=face)  # fmt: skip
    if found.open_share.max() > 0.0:
        axes.plot(found.values, found.open_share.max(axis=1), color="0.55", ls="--", lw=0.9)
    set_probability_axis(axes)


def figure(sweeps):
    with house_style():
        whole = new_figure(8.2, 4.3)
        panels = whole.subplots(2, 3, sharey=True).ravel()
        for axes, (name, found) in zip(panels, sweeps.items(), strict=True):
            draw(axes, found)
            axes.set_xlabel(f"{name} [{QUANTITIES[name][2]}]" if name in QUANTITIES else name)
            if name in QUANTITIES:
                axes.set_xscale("log")
                axes.axvline(QUANTITIES[name][1], color="0.6", linewidth=0.8, linestyle=":")
        for axes in panels[::3]:
            axes.set_ylabel(r"$\Pr[A]$")
        add_legend(panels[2])
        return whole


def add_legend(axes):
    """What lines and marks mean."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=colour, marker=marker, ms=3.5, label=f"Type {name}")
        for colour, marker, name in zip(COLOURS, MARKERS, TYPES, strict=True)
    ]
    handles += [
        Line2D([], [], color="0.3", marker="o", ms=3.5, markerfacecolor="white", ls="",
               label="more than 5 %\nundecided or failed"),
        Line2D([], [], color="0.55", ls="--", label="largest share\nundecided or failed"),
        Line2D([], [], color="0.6", ls=":", label="value in tang2014"),
    ]  # fmt: skip
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.02, 1.0))


def write_points(path, sweeps):
    rows = [["quantity", "value", "type", "pr_a", "low", "high", "decided", "open"]]
    for name, found in sweeps.items():
        for place, kind in np.ndindex(found.bands[0].shape):
            band = [f"{each[place, kind]:.4g}" for each in found.bands]
            counts = [int(each[place, kind].sum()) for each in (found.decided, found.open)]
            rows.append([plain(name), f"{found.values[place]:.6g}", TYPES[kind], *band, *counts])
    write_table(path, rows)


def transitions(sweeps):
    """A table: where Pr[A] has made 5, 50 and 95 % of the ways way between the ends of a sweep."""
    rows = []
    for name, found in sweeps.items():
        kept = solid(found)
        for kind, word in enumerate(TYPES):
            shares = kept.bands[0][:, kind]
            ends = shares[np.isfinite(shares)][[0, -1]]
            found_at = [transition(kept, kind, level, name in QUANTITIES) for level in LEVELS]
            cells = [f"{number_text(v)} [{number_text(a)}, {number_text(b)}]" if v == v else "-"
                     for v, a, b in found_at]  # fmt: skip
            rows.append((plain(name), word, f"{ends[0]:.2f} → {ends[1]:.2f}", *cells))
    heads = (
        "quantity",
        "type",
        "Pr[A] from → to",
        *(f"{100 * level:g} % of the way" for level in LEVELS),
    )
    return markdown_table(heads, rows)


def solid(found):
    """The part of a sweep in which hardly anything is undecided or failed."""
    kept = (found.open_share <= MOST_OPEN).all(axis=1)
    return Sweep(found.name, *(np.asarray(each)[kept] for each in
                 (found.values, found.decided, found.aggregated, found.open)))  # fmt: skip


def main():
    arguments = parse_arguments(__doc__)
    began = time.process_time()
    sweeps = run_all(arguments.library, arguments.replicates)
    spent = f"{(time.process_time() - began) / 60.0:.1f} minutes of one core"
    save_all(figure(sweeps), arguments.output / "sensitivity")
    write_points(arguments.output / "sensitivity.csv", sweeps)
    text = marked("transitions", transitions(sweeps)) + f"\n\n{spent}\n"
    write_page(arguments.output / "sensitivity.md", text)
    print(text)


if __name__ == "__main__":
    main()
