"""Pr[A] against H_A, φ, 1/κ, k_n, ρ_s and δ: what the paper does not have.

    python examples/tang2014/sensitivity.py [--library shapes.h5] [--replicates 100] [-o DIR]

Each value is varied alone around the preset `tang2014`, for Type I at N = 16. One process; the
orientations and flocs are the same for every value.
"""

import argparse
from pathlib import Path

import numpy as np

from flocsim.ensembles import load_config, run
from flocsim.io.plot_style import house_style, new_figure
from flocsim.io.plots import save

STUDY = Path(__file__).resolve().parent / "study.toml"
VERTICES, SHARE = 16, 0.5
QUANTITIES = {
    # name: (keys in the config, the preset's value [SI], factors on it)
    "$H_A$": (("forces", "van_der_waals", "hamaker"), 1e-18, np.geomspace(1e-5, 10, 13)),
    "$\\varphi$": (("forces", "double_layer", "potential"), 15e-3, np.geomspace(0.5, 100.0, 13)),
    "$1/\\kappa$": (("forces", "double_layer", "debye_length"), 0.98e-6, np.geomspace(0.2, 10, 9)),
    "$k_n$": (("forces", "contact", "k_n"), 20.0, np.geomspace(0.3, 10.0, 5)),
    "$\\rho_s$": (("bodies", "surface_density"), 2.0, np.geomspace(1e-3, 3.0, 8)),
}


def nested(keys, value):
    """{"a": {"b": value}} of ("a", "b")."""
    for key in reversed(keys):
        value = {key: value}
    return value


def probability(arguments, changes, shares):
    """Pr[A] with its interval, (3, δ), under changes of the study."""
    shapes = {"vertices": [VERTICES]}
    if arguments.library:
        shapes |= {"source": "library", "file": str(arguments.library.resolve())}
    # The zone decides no outcome; a given one lets parameters without a root run too.
    fixed = {"shapes": shapes, "replicates": arguments.replicates, "zone": {"distance": 5.925e-6},
             "stop": {"failed": 1.0}, "scene": {"types": ["I"], "delta": list(shares)}}  # fmt: skip
    table = run(load_config(STUDY, fixed | changes)).probabilities
    open_ends = [int(table[f"n_{end}"].sum()) for end in ("undecided", "failed")]
    print(changes, np.round(table["pr_a"][0, 0], 3), "undecided, failed:", open_ends, flush=True)
    return [table[name][0, 0] for name in ("pr_a", "pr_a_low", "pr_a_high")]


def draw(axes, places, bands, name):
    """One panel: Pr[A] with intervals."""
    value, low, high = bands
    reach = np.clip([value - low, high - value], 0.0, None)
    axes.errorbar(places, value, reach, marker="o", ms=3, color="#0072B2", elinewidth=0.7)
    axes.set_xlabel(name)
    axes.set_ylim(-0.03, 1.03)
    axes.grid(axis="y", color="0.9", linewidth=0.6)


def main():
    """Run all values, draw all panels."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--library", type=Path, metavar="FILE")
    parser.add_argument("--replicates", type=int, default=100)
    parser.add_argument("-o", "--output", type=Path, default=Path("tang2014"), metavar="DIR")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    with house_style():
        figure = new_figure(7.2, 4.2)
        panels = figure.subplots(2, 3, sharey=True).ravel()
        for axes, (name, (keys, base, factors)) in zip(panels, QUANTITIES.items(), strict=False):
            bands = [probability(arguments, nested(keys, float(f * base)), [SHARE])
                     for f in factors]  # fmt: skip
            draw(axes, factors, np.array(bands)[:, :, 0].T, f"{name} / its value in tang2014")
            axes.set_xscale("log")
            axes.axvline(1.0, color="0.6", linewidth=0.7, linestyle=":")
        shares = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 0.99]
        draw(panels[-1], shares, probability(arguments, {}, shares), r"$\delta / \delta_{\max}$")
        for axes in panels[::3]:
            axes.set_ylabel(r"$\Pr[A]$")
    for ending in ("png", "pdf"):
        save(figure, arguments.output / f"sensitivity.{ending}")


if __name__ == "__main__":
    main()
