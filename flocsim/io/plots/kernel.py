"""Figures of a kernel study: what shapes do to kernels and efficiencies, by size and mechanism.

A figure is a function of Results that have a kernel, and stands in KERNEL_FIGURES under the name
that `flocsim plot` gives it.
"""

from collections.abc import Callable

import numpy as np

from flocsim.io.plots.style import MARKERS, Figure, graded_colours, house_style, new_figure, plain
from flocsim.io.results.kernel_group import Kernel
from flocsim.io.results.schema import Results

MICRO = 1e6
MOST_LINES = 6
BOUND_WORDS = "no hydrodynamic interaction: upper bounds"
WATER_WORDS = "with hydrodynamic interaction"


def kernel_of(results: Results) -> Kernel:
    """The rates of results that are known to have some."""
    assert results.kernel is not None, "a figure of a kernel study"
    return results.kernel


def kernels(results: Results) -> Figure:
    """Kernels over those of equivalent spheres, against size: panels by mechanism, lines by N."""
    return by_ratio(
        kernel_of(results), "efficiency3", "β₃ of shapes over that\nof equivalent spheres"
    )


def efficiency(results: Results) -> Figure:
    """Efficiencies: encounters that aggregate of those that touch, against size."""
    return by_ratio(kernel_of(results), "alpha", "efficiency α")


def by_ratio(kernel: Kernel, name: str, label: str) -> Figure:
    """An estimate of all pairs against r_i/r_j, the larger one's size in colours, N by markers."""
    with house_style():
        figure = new_figure(2.6 * len(kernel.mechanisms) + 1.6, 2.9)
        panels = figure.subplots(1, len(kernel.mechanisms), squeeze=False, sharey=True)[0]
        chosen = chosen_sizes(len(kernel.labels))
        colours = dict(zip(chosen, graded_colours(len(chosen)), strict=True))
        for m, (axes, mechanism) in enumerate(zip(panels, kernel.mechanisms, strict=True)):
            for v in range(len(kernel.vertices)):
                for larger in chosen:
                    draw_line(axes, kernel, name, (m, v, larger), colours[larger])
            axes.set_title(plain(mechanism))
            axes.set_xlabel("r of the smaller over r of the larger")
            axes.set_ylim(bottom=0.0)
            axes.set_xlim(0.0, 1.05)
            axes.grid(axis="y", color="0.9", linewidth=0.6)
        panels[0].set_ylabel(label)
        legend(panels[-1], kernel, colours)
        words = WATER_WORDS if kernel.water else BOUND_WORDS
        figure.supxlabel(words, fontsize=7, color="0.4")
        return figure


def chosen_sizes(count: int) -> list[int]:
    """Places of the larger classes whose lines are drawn: no more than can be told apart."""
    first = min(1, count - 1)
    return (
        np.unique(np.linspace(first, count - 1, min(MOST_LINES, count)).round())
        .astype(int)
        .tolist()
    )


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
    style = {"color": colour, "marker": MARKERS[v % len(MARKERS)]}
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
        axes.plot([], [], color="0.3", marker=MARKERS[v % len(MARKERS)], label=word, **hollow)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))


KERNEL_FIGURES: dict[str, Callable[[Results], Figure]] = {
    "kernels": kernels,
    "efficiency": efficiency,
}
"""Name → figure."""
