"""Figures of a results file: the paper's Figs 4, 5, 6 and 8, what holds flocs, an overview.

A figure is a function of a `Results`, which may come without its table of replicates, and stands in
FIGURES at the end, under the name that `flocsim plot` gives it; the first line of its docstring is
the command's help.
"""

from collections.abc import Callable

import numpy as np

from flocsim.io.plots import outcomes as ends
from flocsim.io.plots import style
from flocsim.io.plots.outcomes import shape_effects
from flocsim.io.plots.style import WIDTH, Figure, drawing, plain
from flocsim.io.results.events import ENDS_COUNTED, FEW
from flocsim.io.results.numerics import numerics_matter
from flocsim.io.results.schema import Results

NARROW = 4
"""Labels of vertex counts that fit a panel of three beside each other."""
HOLLOW = f" Hollow: fewer than {FEW} pairs."
DELTA_LABEL = r"displacement $\delta\,/\,\delta_{\max}$"
LABELS = {
    "pr_inside": r"$\Pr[C(d_c<D_0)]$",
    "pr_a_given_inside": r"$\Pr[A\mid C(d_c<D_0)]$",
    "pr_a_given_outside": r"$\Pr[A\mid C(d_c\geq D_0)]$",
    "pr_a": r"$\Pr[A]$",
    "classes": "Pr[class]",
    "bonds": "fraction of bonds",
}
POINTS = 20.0
"""Points of a slot in which lines are drawn beside each other, where an axis has no slots."""


def figure_4(results: Results, numerics: bool = False) -> Figure:
    """Pr[C inside]: probability that a collision happens inside the attraction zone."""
    return probability_figure(results, "pr_inside", numerics)


def figure_5(results: Results, numerics: bool = False) -> Figure:
    """Pr[A | inside]: probability of aggregation after a collision inside the zone."""
    return probability_figure(results, "pr_a_given_inside", numerics)


def figure_6(results: Results, numerics: bool = False) -> Figure:
    """Pr[A | outside]: probability of aggregation after a collision outside the zone."""
    return probability_figure(results, "pr_a_given_outside", numerics)


def probability_figure(results, name, numerics):
    """One panel per type, one line per delta, against N."""
    numerics = numerics or numerics_matter(results)
    titles = style.type_titles(results.types)
    with style.panel_grid(titles, LABELS[name]) as (figure, panels, spare):
        for number, axes in enumerate(panels):
            ends.draw_probability(axes, results, number, name, numerics)
        style.place_legend(figure, delta_legend(results), spare)
        style.add_foot(figure, ends.bars_of(results, numerics) + HOLLOW)
        return figure


def figure_8(results: Results, numerics: bool = False) -> Figure:
    """Probability of the classes A, B, C, D, all displacements pooled.

    A replicate has the same flocs and orientations at all delta: a cluster, for the intervals.
    """
    numerics = numerics or numerics_matter(results)
    titles = style.type_titles(results.types)
    with style.panel_grid(titles, LABELS["classes"]) as (figure, panels, spare):
        for number, axes in enumerate(panels):
            ends.draw_shares(axes, results, number, "classes", numerics)
        style.place_legend(figure, shares_legend("classes"), spare)
        style.add_foot(figure, ends.bars_of(results, numerics))
        return figure


def overview(results: Results, numerics: bool = False) -> Figure:
    """Pr[C inside], Pr[A], the classes and the bonds in one picture, a column for each type."""
    rows = ("pr_inside", "pr_a", *ends.SHARES)
    numerics = numerics or numerics_matter(results)
    count, titles = len(results.types), style.type_titles(results.types)
    with drawing(max(WIDTH, 1.0 * count + 0.4), 4.4) as figure:
        grid = figure.subplots(len(rows), count, sharex=True, sharey=True, squeeze=False)
        for number in range(count):
            for axes, name in zip(grid[:2, number], rows[:2], strict=True):
                ends.draw_probability(axes, results, number, name, numerics, NARROW)
            for axes, name in zip(grid[2:, number], ends.SHARES, strict=True):
                ends.draw_shares(axes, results, number, name, numerics, NARROW)
            grid[0, number].set_title(titles[number])
            grid[-1, number].set_xlabel("vertices $N$")
        for axes, name in zip(grid[:, 0], rows, strict=True):
            axes.set_ylabel(LABELS[name])
        legends = [delta_legend(results), *map(shares_legend, ends.SHARES)]
        style.place_legend(figure, {k: each for one in legends for k, each in one.items()})
        style.add_foot(figure, ends.bars_of(results, numerics) + HOLLOW)
        return figure


def against_delta(results: Results, numerics: bool = False) -> Figure:
    """Pr[A] against delta: a panel for each type, a line for each number of vertices."""
    numerics = numerics or numerics_matter(results)
    titles = style.type_titles(results.types)
    with style.panel_grid(titles, LABELS["pr_a"], DELTA_LABEL) as (figure, panels, spare):
        colours = style.graded_colours(len(results.vertices))
        order = np.argsort(results.delta)
        places = results.delta[order]
        found = ends.bands_of(results, "pr_a", numerics)
        for number, axes in enumerate(panels):
            style.set_probability_axis(axes)
            axes.set(xlim=(-0.05, 1.05), xticks=[0.0, 0.5, 1.0])
            if places[-1] == 1.0:
                axes.axvline(1.0, color="0.85", zorder=0)
            for index, colour in enumerate(colours[: len(results.vertices)]):
                bands = [band[number, index][order] for band in found]
                shift = POINTS * style.dodge(index, len(results.vertices))
                few = ends.trials_of(results, "pr_a")[number, index][order] < FEW
                ends.draw_bars(axes, places, bands, index, colour, few, shift)
            known = results.probabilities["pr_a"][number]
            ends.note_if_empty(axes, known, ends.NO_EVENTS["pr_a"])
        words = ["sphere" if count == 1 else str(count) for count in results.vertices]
        legend = {"vertices $N$": style.line_handles(words, colours)}
        style.place_legend(figure, legend, spare)
        style.add_foot(figure, ends.bars_of(results, numerics) + HOLLOW)
        return figure


def outcomes(results: Results) -> Figure:
    """Outcomes of the replicates: a panel for each type, a bar for each N and displacement."""
    titles = style.type_titles(results.types)
    with style.panel_grid(titles, "fraction of replicates") as (figure, panels, spare):
        count = results.delta.size
        order = np.argsort(results.vertices)
        places = style.vertex_positions(results.vertices)[order]
        slot = 72.0 * style.panel_width(len(titles)) / len(places)
        for number, axes in enumerate(panels):
            style.set_vertex_axis(axes, results.vertices)
            style.set_share_axis(axes)
            for index, place in enumerate(np.argsort(results.delta)):
                counts = {name: values[number, order, place]
                          for name, values in results.probabilities.items()
                          if name in ENDS_COUNTED}  # fmt: skip
                shift = slot * 0.8 * ((index + 0.5) / count - 0.5)
                ends.draw_ends(axes, places, counts, 0.68 * slot / count, shift)
        style.place_legend(figure, {"": ends.end_handles(results.probabilities)}, spare)
        if count > 1:
            deltas = ", ".join(f"{delta:g}" for delta in np.sort(results.delta))
            grazes = " (grazes)" * (1.0 in results.delta)
            style.add_foot(figure, f"Bars of each N, from left: δ/δmax = {deltas}{grazes}.")
        return figure


def against_size(results: Results, numerics: bool = False) -> Figure:
    """Pr[A], all displacements pooled, against the approaching floc's size; a panel for each N.

    A point for each collision type, coloured by the size of the receiving floc; points of one
    receiving size are joined.
    """
    numerics = numerics or numerics_matter(results)
    r_i, r_j = (1e6 * np.asarray(results.radii[name]) for name in ("r_i", "r_j"))
    known = (r_i > 0.0) & (r_j > 0.0)
    receivers = np.unique(r_i[known].round(9))
    titles = ["sphere" if count == 1 else f"$N$ = {count}" for count in results.vertices]
    x_label = "approaching $r_j$ [µm]"
    with style.panel_grid(titles, LABELS["pr_a"], x_label) as (figure, panels, spare):
        if not (known.any() and results.pooled):
            for axes in panels:
                style.set_probability_axis(axes)
                style.note(axes, "sizes unknown" if results.pooled else "not yet pooled")
            return figure
        colours = style.graded_colours(len(receivers))
        for number, axes in enumerate(panels):
            style.set_probability_axis(axes)
            axes.set(xscale="log", xlim=room_for(r_j[known]))
            style.set_log_axis(axes.xaxis)
            bands = ends.bands_in(results.pooled, "pr_a", numerics)
            for index, receiver in enumerate(receivers):
                rows = np.flatnonzero(known & (r_i.round(9) == receiver))
                rows = rows[np.argsort(r_j[rows])]
                mine = [band[rows, number] for band in bands]
                ends.draw_bars(axes, r_j[rows], mine, index, colours[index])
        words = [f"{receiver:.3g}" for receiver in receivers]
        legend = {"receiving $r_i$ [µm]": style.line_handles(words, colours)}
        style.place_legend(figure, legend, spare)
        style.add_foot(figure, ends.bars_of(results, numerics))
        return figure


def room_for(sizes):
    """Limits of a logarithmic axis around sizes, wide enough for one of the ticks 1, 2, 5, ...."""
    low, high = (sizes.min(), sizes.max()) if sizes.size else (1.0, 10.0)
    margin = max(1.15, np.sqrt(2.6 * low / high))
    return low / margin, high * margin


def delta_legend(results):
    """{title: handles} of the lines of displacements."""
    words = [f"{share:g}" + (" (grazes)" if share == 1.0 else "") for share in results.delta]
    return {
        r"$\delta\,/\,\delta_{\max}$": style.line_handles(words, style.graded_colours(len(words)))
    }


def shares_legend(name):
    """{title: handles} of the lines of classes or bonds."""
    words, colours = SHARE_WORDS[name], ends.SHARES[name][-1]
    told = [plain(words[each]) for each in colours]
    return {{"classes": "class", "bonds": "bond"}[name]: style.line_handles(told, colours.values())}


SHARE_WORDS = {"classes": style.CLASS_WORDS, "bonds": {name: name for name in style.BOND_COLOURS}}


FIGURES: dict[str, Callable[[Results], Figure]] = {
    "4": figure_4,
    "5": figure_5,
    "6": figure_6,
    "8": figure_8,
    "delta": against_delta,
    "outcomes": outcomes,
    "overview": overview,
    "shape": shape_effects,
    "size": against_size,
}
