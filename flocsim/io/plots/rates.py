"""Figures of rates: what shapes do to kernels and efficiencies; at what rate a flow opens bonds.

A figure stands in KERNEL_FIGURES or STRENGTH_FIGURES under the name that `flocsim plot` gives it.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from flocsim.io.plots.results import panel_grid
from flocsim.io.plots.style import (
    Figure,
    add_line_legend,
    drawing,
    graded_colours,
    marker,
    note,
    plain,
    set_log_axis,
    type_titles,
)
from flocsim.io.results.schema import Results
from flocsim.io.results.strength_file import STATUS, Strengths

MICRO = 1e6
MOST_LINES = 6
BOUND_WORDS = "no hydrodynamic interaction: upper bounds"
WATER_WORDS = "with hydrodynamic interaction"

FAILED = STATUS.index("failed")


def kernels(results: Results) -> Figure:
    """Kernels over those of equivalent spheres, against size: panels by mechanism, lines by N."""
    return by_ratio(results, "efficiency3", "β₃ of shapes over that\nof equivalent spheres")


def efficiency(results: Results) -> Figure:
    """Efficiencies: encounters that aggregate of those that touch, against size."""
    return by_ratio(results, "alpha", "efficiency α")


def by_ratio(results: Results, name: str, label: str) -> Figure:
    """An estimate of all pairs against r_i/r_j, the larger one's size in colours, N by markers."""
    kernel = results.kernel
    assert kernel is not None, "a figure of a kernel study"
    with drawing(2.6 * len(kernel.mechanisms) + 1.6, 2.9) as figure:
        panels = figure.subplots(1, len(kernel.mechanisms), squeeze=False, sharey=True)[0]
        # Places of the larger classes whose lines are drawn: no more than can be told apart.
        count = len(kernel.labels)
        places = np.linspace(min(1, count - 1), count - 1, min(MOST_LINES, count))
        chosen = np.unique(places.round().astype(int)).tolist()
        colours = dict(zip(chosen, graded_colours(len(chosen)), strict=True))
        for m, (axes, mechanism) in enumerate(zip(panels, kernel.mechanisms, strict=True)):
            for v in range(len(kernel.vertices)):
                for larger in chosen:
                    draw_line(axes, kernel, name, (m, v, larger), colours[larger])
            axes.set(title=plain(mechanism), xlabel="r of the smaller over r of the larger")
            axes.set(xlim=(0.0, 1.05), ylim=(0.0, None))
            axes.grid(axis="y", color="0.9", linewidth=0.6)
        panels[0].set_ylabel(label)
        legend(panels[-1], kernel, colours)
        words = WATER_WORDS if kernel.water else BOUND_WORDS
        figure.supxlabel(words, fontsize=7, color="0.4")
        return figure


def draw_line(axes, kernel, name, place, colour):
    """One larger class against all that are not above it."""
    m, v, larger = place
    smaller = np.arange(larger + 1)
    ratio = kernel.radii[smaller] / kernel.radii[larger]
    value, low, high = (
        kernel.arrays[name + end][m, v, smaller, larger] for end in ("", "_low", "_high")
    )
    known = np.isfinite(value)
    left_open = ~known & np.isfinite(high)
    axes.vlines(ratio[left_open], low[left_open], high[left_open], color=colour, linestyle=":")
    style = {"color": colour, "marker": marker(v)}
    if kernel.vertices[v] == 1:
        style |= {"linestyle": ":", "markerfacecolor": "white"}
    axes.errorbar(
        ratio[known], value[known],
        yerr=np.maximum([(value - low)[known], (high - value)[known]], 0.0),
        linewidth=1.0, elinewidth=0.7, markersize=3.5, **style,
    )  # fmt: skip


def legend(axes, kernel, colours):
    """Colours for sizes, markers for N, beside the last panel."""
    for place, colour in colours.items():
        axes.plot([], [], color=colour, label=f"larger: {MICRO * kernel.radii[place]:.3g} µm")
    for v, count in enumerate(kernel.vertices):
        word = "spheres" if count == 1 else f"N = {count}"
        hollow = {"linestyle": ":", "markerfacecolor": "white"} if count == 1 else {}
        axes.plot([], [], color="0.3", marker=marker(v), label=word, **hollow)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))


KERNEL_FIGURES: dict[str, Callable[[Results], Figure]] = {
    "kernels": kernels,
    "efficiency": efficiency,
}
"""Name → figure."""


OPENED = [STATUS.index(name) for name in ("opened", "opens_at_least_rate")]


def shares_opened(found: Strengths, type_place: int, vertices_place: int) -> tuple:
    """(rates (k,), shares (k,) opened by then) of all doublets of a type and an N."""
    rows = (found.column("type") == type_place) & (found.column("vertices") == vertices_place)
    status = found.column("status")[rows]
    opens = np.sort(found.column("opens")[rows][np.isin(status, OPENED)])
    tested = int(np.sum(status != FAILED))
    return opens, np.arange(1, len(opens) + 1) / max(tested, 1)


def over_rate(found: Strengths) -> Figure:
    """A panel per type, a line per N, all displacements together."""
    types, vertices = (found.conditions.axes[name].values for name in ("type", "vertices"))
    x_label = f"rate G of the {plain(found.about.get('flow'))} [1/s]"
    titles = type_titles(types)
    with panel_grid(titles, "share of bonds opened", 2.0, x_label) as (figure, panels, last):
        colours = graded_colours(len(vertices))
        for number, axes in enumerate(panels):
            any_opened = 0
            for place in range(len(vertices)):
                rates, shares = shares_opened(found, number, place)
                any_opened += len(rates)
                if len(rates):
                    axes.plot(rates, shares, drawstyle="steps-post", color=colours[place],
                              marker=marker(place), markersize=3)  # fmt: skip
            axes.set(ylim=(0.0, 1.04), xscale="log")
            if not any_opened:
                note(axes, "no bond opened")
        set_log_axis(panels[0].xaxis)
        add_line_legend(last, [f"{n}" for n in vertices], colours, "N")
        return figure


STRENGTH_FIGURES: dict[str, Callable[[Any], Figure]] = {"strength": over_rate}
