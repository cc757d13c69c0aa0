"""Figures of a results file: the paper's Figs 4, 5, 6 and 8, what holds flocs, an overview.

A figure is a function of a `Results`, which may come without its table of replicates, and stands in
FIGURES at the end, under the name that `flocsim plot` gives it; the first line of its docstring is
the command's help.
"""

import contextlib
import textwrap
from collections.abc import Callable

import numpy as np

from flocsim.io.confidence import efficiency
from flocsim.io.plots import outcomes as ends
from flocsim.io.plots import style
from flocsim.io.plots.outcomes import shape_effects
from flocsim.io.plots.style import Figure, drawing, plain
from flocsim.io.results.events import ENDS_COUNTED
from flocsim.io.results.schema import Results

PANELS_PER_ROW = 3
PANEL_SIZE = (2.35, 2.15)
LEGEND_WIDTH = 1.15
BARS = "\n(bars: 95 %;\nthin: plus numerical error)"
BARS_OF_BANDS = BARS.replace(" error)", "\nand shape error)")
"""What bars mean, where outlines were cut closer and wider as well."""
HOLLOW = "\nhollow: n < 10"
BOND_WORDS = {
    "certificate": "certificate: no load opens it",
    "hook": "hook: hangs by its shape",
    "rest": "rest: sticks as it lies",
}
DELTA_LABEL = r"displacement $\delta\,/\,\delta_{\max}$"
LABELS = {
    "pr_inside": r"$\Pr[C(d_c<D_0)]$",
    "pr_a_given_inside": r"$\Pr[A\mid C(d_c<D_0)]$",
    "pr_a_given_outside": r"$\Pr[A\mid C(d_c\geq D_0)]$",
    "pr_a": r"$\Pr[A]$",
    "classes": "probability of class",
    "bonds": "share of aggregations",
}
POINTS = 20.0
"""Points of a slot in which lines are drawn beside each other, where an axis has no slots."""
LETTERS_WIDE, MOST_LINES = 18, 6
"""Of what a legend tells of displacements."""
ROOM = 0.8
"""Share of a panel's width that its axis takes, about."""

SIZE_COLOURS = "viridis"
MOST_SIZES_NAMED = 6
"""Up to so many receiving sizes are all named beside their colours."""


def figure_4(results: Results) -> Figure:
    """Pr[C inside]: probability that a collision happens inside the attraction zone."""
    return probability_figure(results, "pr_inside")


def figure_5(results: Results) -> Figure:
    """Pr[A | inside]: probability of aggregation after a collision inside the zone."""
    return probability_figure(results, "pr_a_given_inside")


def figure_6(results: Results) -> Figure:
    """Pr[A | outside]: probability of aggregation after a collision outside the zone."""
    return probability_figure(results, "pr_a_given_outside")


def probability_figure(results, name):
    """One panel per type, one line per delta, against N, with bars for both errors."""
    titles = style.type_titles(results.types)
    with panel_grid(titles, LABELS[name], 1.35) as (figure, panels, last):
        marked = set()
        for number, axes in enumerate(panels):
            marked |= ends.draw_probability(axes, results, number, name)
        add_delta_legend(last, results, marked)
        return figure


def figure_8(results: Results) -> Figure:
    """Probability of the classes A, B, C, D, all displacements pooled.

    A replicate has the same flocs and orientations at all delta: a cluster, for the intervals.
    """
    return shares_figure(results, "classes", legend_width=1.75)


def bonds(results: Results) -> Figure:
    """What holds aggregated flocs: shares of certificate, hook and rest, displacements pooled."""
    return shares_figure(results, "bonds", legend_width=2.1)


def shares_figure(results, name, legend_width):
    """One panel per type, one line for each class or kind of bond, against N."""
    titles = style.type_titles(results.types)
    with panel_grid(titles, LABELS[name], legend_width) as (figure, panels, last):
        for number, axes in enumerate(panels):
            ends.draw_shares(axes, results, number, name)
        add_shares_legend(last, name, results)
        return figure


def overview(results: Results) -> Figure:
    """Pr[C inside], Pr[A], the classes and the bonds in one picture, a column for each type."""
    rows = ("pr_inside", "pr_a", *ends.SHARES)
    count, marked = len(results.types), set()
    with drawing(2.1 * count + 2.2, 7.1) as figure:
        grid = figure.subplots(len(rows), count, sharex=True, sharey=True, squeeze=False)
        for number in range(count):
            for axes, name in zip(grid[:2, number], rows[:2], strict=True):
                marked |= ends.draw_probability(axes, results, number, name)
            for axes, name in zip(grid[2:, number], ends.SHARES, strict=True):
                ends.draw_shares(axes, results, number, name)
            grid[0, number].set_title(style.type_titles(results.types)[number])
            grid[-1, number].set_xlabel("vertices $N$")
        for axes, name in zip(grid[:, 0], rows, strict=True):
            axes.set_ylabel(LABELS[name])
        add_delta_legend(grid[0, -1], results, marked)
        for axes, name in zip(grid[2:, -1], ends.SHARES, strict=True):
            add_shares_legend(axes, name, results)
        return figure


def against_delta(results: Results) -> Figure:
    """Pr[A] against delta: a panel for each type, a line for each number of vertices."""
    titles = style.type_titles(results.types)
    with panel_grid(titles, LABELS["pr_a"], 1.35, DELTA_LABEL) as (figure, panels, last):
        colours = style.graded_colours(len(results.vertices))
        order, marked = np.argsort(results.delta), set()
        places = results.delta[order]
        causes = ends.causes_of(results.probabilities, "pr_a")
        for number, axes in enumerate(panels):
            style.set_probability_axis(axes)
            axes.set_xlim(-0.05, 1.05)
            if places[-1] == 1.0:
                axes.axvline(1.0, color="0.85", zorder=0)
                axes.text(1.0, 1.02, "grazes", color="0.4", fontsize=6.5, ha="right")
            for index, colour in enumerate(colours[: len(results.vertices)]):
                bands = [band[number, index][order] for band in ends.bands_of(results, "pr_a")]
                shift = POINTS * style.dodge(index, len(results.vertices))
                few = ends.trials_of(results, "pr_a")[number, index][order] < ends.FEW
                ends.draw_bars(axes, places, bands, index, colour, few, shift)
                why = causes[number, index][order]
                marked |= ends.mark_causes(axes, places, why, colour, shift)
            known = results.probabilities["pr_a"][number]
            ends.note_if_empty(axes, known, ends.NO_EVENTS["pr_a"])
        words = ["sphere" if count == 1 else str(count) for count in results.vertices]
        title = "vertices $N$" + bars_of(results) + HOLLOW + ends.words_of(marked)
        style.add_line_legend(last, words, colours, title)
        return figure


def outcomes(results: Results) -> Figure:
    """What becomes of replicates, stacked to 1: panels by type, N on the axis, a bar each delta."""
    titles = style.type_titles(results.types)
    with panel_grid(titles, "share of replicates", 1.35) as (figure, panels, last):
        count = results.delta.size
        order = np.argsort(results.vertices)
        places = style.vertex_positions(results.vertices)[order]
        slot = 72.0 * PANEL_SIZE[0] * ROOM / len(places)
        for number, axes in enumerate(panels):
            style.set_vertex_axis(axes, results.vertices)
            style.set_share_axis(axes)
            for index, place in enumerate(np.argsort(results.delta)):
                counts = {name: values[number, order, place]
                          for name, values in results.probabilities.items()
                          if name in ENDS_COUNTED}  # fmt: skip
                shift = slot * 0.8 * ((index + 0.5) / count - 0.5)
                ends.draw_ends(axes, places, counts, 0.68 * slot / count, shift)
        shares = ", ".join(f"{share:g}" for share in np.sort(results.delta))
        told = "\n".join(textwrap.wrap(shares, LETTERS_WIDE)[:MOST_LINES])
        graze = "\n1: grazes" if 1.0 in results.delta else ""
        title = "bars from left:\n" + r"$\delta\,/\,\delta_{\max}$ = " + f"\n{told}{graze}"
        style.place_legend(last, ends.end_handles(), title)
        return figure


def efficiencies(results: Results) -> Figure:
    """Efficiency: the probability of aggregation integrated over delta, in the plane and axially.

    docs/results.md has the formula; bars: the sums of the 95 % bounds at each delta.
    """
    titles = style.type_titles(results.types)
    with panel_grid(titles, "efficiency $E$", 1.9) as (figure, panels, last):
        words = [
            r"plane, $\int_0^1 P\,d\delta$", r"axial, $\int_0^1 P\,2\delta\,d\delta$"
        ]  # fmt: skip
        colours = [style.CLASS_COLOURS["A"], style.CLASS_COLOURS["C"]]
        for number, axes in enumerate(panels):
            style.set_vertex_axis(axes, results.vertices)
            style.set_probability_axis(axes)
            for index, axial in enumerate((False, True)):
                found = efficiency(results.probabilities, results.delta, axial)
                if found is None:
                    style.note(axes, "delta does not\nspan 0 to 1")
                    break
                bands = [*(each[number] for each in found), *np.zeros((2, len(results.vertices)))]
                ends.draw_line(axes, results.vertices, bands, index, 2, colours[index])
        style.add_line_legend(last, words, colours, "aggregations per approach\n(bars: 95 %)")
        return figure


def against_size(results: Results) -> Figure:
    """Pr[A], all displacements pooled, against the approaching floc's size; a panel for each N.

    A point for each collision type, coloured by the size of the receiving floc; points of one
    receiving size are joined.
    """
    r_i, r_j = (1e6 * np.asarray(results.radii[name]) for name in ("r_i", "r_j"))
    known = (r_i > 0.0) & (r_j > 0.0)
    receivers = np.unique(r_i[known].round(9))
    titles = ["sphere" if count == 1 else f"$N$ = {count}" for count in results.vertices]
    x_label = "approaching $r_j$ [µm]"
    with panel_grid(titles, LABELS["pr_a"], x_label=x_label) as (figure, panels, _):
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import LogNorm
        from matplotlib.ticker import LogLocator

        low, high = (receivers[0], receivers[-1]) if known.any() else (1.0, 1.0)
        shade = ScalarMappable(LogNorm(0.95 * low, 1.05 * high), SIZE_COLOURS)
        missing = "sizes unknown" if results.pooled else "not yet pooled"
        for number, axes in enumerate(panels):
            style.set_probability_axis(axes)
            axes.set(xscale="log", xlim=room_for(r_j[known]))
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.minorticks_off()
            if not (known.any() and results.pooled):
                style.note(axes, missing)
                continue
            for index, receiver in enumerate(receivers):
                rows = np.flatnonzero(known & (r_i.round(9) == receiver))
                rows = rows[np.argsort(r_j[rows])]
                bands = [band[rows, number] for band in ends.bands_in(results.pooled, "pr_a")]
                ends.draw_bars(axes, r_j[rows], bands, index, shade.to_rgba(receiver))
        if known.any() and results.pooled:
            bar = figure.colorbar(shade, ax=panels, label="receiving $r_i$ [µm]", shrink=0.9)
            bar.minorticks_off()
            apart = np.append(True, np.diff(np.log(receivers)) > 0.06 * np.log(1.1 * high / low))
            few = len(receivers) <= MOST_SIZES_NAMED
            marks = receivers[apart] if few else np.geomspace(low, high, 4)
            bar.set_ticks(marks, labels=[f"{each:.3g}" for each in marks])
        return figure


def room_for(sizes):
    """Limits of a logarithmic axis around sizes, wide enough for one of the ticks 1, 2, 5, ...."""
    low, high = (sizes.min(), sizes.max()) if sizes.size else (1.0, 10.0)
    margin = max(1.15, np.sqrt(2.6 * low / high))
    return low / margin, high * margin


@contextlib.contextmanager
def panel_grid(titles, y_label, legend_width=LEGEND_WIDTH, x_label="vertices $N$"):
    """(a figure with equal panels of these titles, at most three a row, and room for a legend, the
    panels, the last one of the first row, beside which the legend stands)."""
    count = len(titles)
    columns = min(count, PANELS_PER_ROW)
    rows = -(-count // PANELS_PER_ROW)
    width, height = PANEL_SIZE[0] * columns + legend_width, PANEL_SIZE[1] * rows + 0.25
    with drawing(width, height) as figure:
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axes in grid[count:]:
            axes.set_visible(False)
        for axes in grid[max(count - columns, 0) : count]:
            axes.xaxis.set_tick_params(labelbottom=True)
            axes.set_xlabel(x_label)
        for axes, title in zip(grid, titles, strict=False):
            axes.set_title(title)
        for axes in grid[:count:PANELS_PER_ROW]:
            axes.set_ylabel(y_label)
        yield figure, list(grid[:count]), grid[columns - 1]


def add_delta_legend(axes, results, marked=frozenset()):
    words = [f"{share:g}" + (" (grazes)" if share == 1.0 else "") for share in results.delta]
    title = r"$\delta\,/\,\delta_{\max}$" + bars_of(results) + HOLLOW + ends.words_of(marked)
    style.add_line_legend(axes, words, style.graded_colours(len(words)), title)


def bars_of(results):
    """What the bars of a figure mean."""
    return BARS_OF_BANDS if results.outlines else BARS


def add_shares_legend(axes, name, results):
    words, title = (style.CLASS_WORDS, "class") if name == "classes" else (BOND_WORDS, "bond")
    colours = ends.SHARES[name][-1]
    told = [plain(words[each]) for each in colours]
    style.add_line_legend(axes, told, colours.values(), title + bars_of(results))


FIGURES: dict[str, Callable[[Results], Figure]] = {
    "4": figure_4,
    "5": figure_5,
    "6": figure_6,
    "8": figure_8,
    "bonds": bonds,
    "delta": against_delta,
    "efficiency": efficiencies,
    "outcomes": outcomes,
    "overview": overview,
    "shape": shape_effects,
    "size": against_size,
}
