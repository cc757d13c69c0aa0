"""Figures along a quantity: probabilities along a swept key, clusters along time for its values;
kernels and efficiencies along sizes, opened bonds along the rate of a flow.

A figure stands in one of the dicts of FIGURES under the name that `flocsim plot` gives it.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from flocsim.io.plots import outcomes, style
from flocsim.io.plots.results import LABELS
from flocsim.io.plots.style import MICRO, WIDTH, Figure, drawing, plain
from flocsim.io.results.events import ENDS_COUNTED
from flocsim.io.results.numerics import numerics_matter
from flocsim.io.results.schema import Results
from flocsim.io.results.strength_file import FAILED, OPENED, OPENS_AT_LEAST, Strengths
from flocsim.io.results.swarm_file import mean
from flocsim.io.results.sweep_file import SweepResults

PREFIXED = ("m", "s", "J", "N", "V")
"""Units whose values are written with a prefix, as 500 nm."""

STEEP = 20.0
"""Ratio of the largest value to the least from which on the axis is logarithmic."""

LEAST_APART = 18.0
"""Points between two values of an axis from which on both are written."""

WIDEST = 7.0
"""Points from one line to the next."""

MARGIN = 0.5
"""Of the axis on either side, over the distance of two values if they were evenly spaced."""


def against_key(results: SweepResults, numerics: bool = False) -> Figure:
    """What becomes of replicates, and Pr[A], against the first swept key.

    Two panels per type, the bars stacked to 1; a bar and a line per N, delta and further keys.
    """
    numerics = numerics or numerics_matter(results)
    first = next(iter(results.swept.values()))
    table = results.labelled("probabilities")
    names = table.columns["pr_a"].axes
    others = [name for name in names[1:] if name != "type"]
    words = line_words([(name, table.axes[name].values.tolist()) for name in others])
    types = table.axes["type"].values.tolist()
    where = np.arange(len(first.values)) if first.words else np.array(first.values)
    order = np.argsort(where)
    columns = {
        name: lines_of(table.columns[name].values, names.index("type"))[:, :, order]
        for name in [*ENDS_COUNTED, *EVENT_COUNTS, *(f"pr_a{end}" for end in outcomes.ENDS)]
    }
    count = len(types)
    with drawing(max(WIDTH, 1.3 * count + 0.4), 2.9) as figure:
        grid = figure.subplots(2, count, sharex=True, sharey="row", squeeze=False)
        step = set_key_axis(grid[0, 0], first, where[order].astype(float), count)
        step = min(WIDEST, step / len(words))
        colours = style.graded_colours(len(words))
        for number, title in enumerate(style.type_titles(types)):
            above, below = grid[:, number]
            above.set_title(title)
            style.set_share_axis(above)
            style.set_probability_axis(below)
            below.set_xlabel(key_label(first))
            for index in range(len(words)):
                shift = step * (index - 0.5 * (len(words) - 1))
                mine = {name: values[number, index] for name, values in columns.items()}
                outcomes.draw_ends(above, where[order], mine, 0.85 * step, shift)
                line = outcomes.bands_in(mine, "pr_a", numerics)
                outcomes.draw_bars(below, where[order], line, index, colours[index], shift=shift)
            outcomes.note_if_empty(below, columns["pr_a"][number], "no decided collision")
        grid[0, 0].set_ylabel("fraction of\nreplicates")
        grid[1, 0].set_ylabel(LABELS["pr_a"])
        title = ", ".join(line_title(name, results) for name in others)
        style.place_legend(figure, {
            "replicates": outcomes.end_handles(columns), title: style.line_handles(words, colours)
        })  # fmt: skip
        side = "Above, bars from left: as the lines below. " * (len(words) > 1)
        style.add_foot(figure, side + outcomes.bars_of(results, numerics))
        return figure


EVENT_COUNTS = ("n_collided", "n_inside", "n_bond")


def lines_of(values, place):
    """(type, the others one after the other, the first key, any last axis) of values (first key, …,
    type, …, N, delta, …), the type at a ``place``."""
    axes = 1 + place + 2
    moved = np.moveaxis(values, (place, 0), (0, axes - 1))
    return moved.reshape(moved.shape[0], -1, *moved.shape[axes - 1 :])


def key_label(swept, prefixed=PREFIXED):
    """A key with its unit in brackets, but for units that stand at the values."""
    unit = f" [{swept.unit}]" if swept.unit not in ("1", *prefixed) else ""
    return plain(swept.key + unit)


def line_title(name, results):
    """What a legend calls an axis whose values it lists as they are."""
    swept = results.swept.get(name)
    return key_label(swept, ()) if swept else plain(name)


def set_key_axis(axes, swept, places, count):
    """An axis with a mark at every value (k,), in ascending order, and room beside the outermost;
    the distance of the two nearest in points, of ``count`` panels beside each other."""
    from matplotlib.ticker import EngFormatter, FixedLocator, NullLocator, StrMethodFormatter

    steep = not swept.words and places[0] > 0.0 and places[-1] > STEEP * places[0]
    if steep:
        axes.set_xscale("log")
    at = np.log(places) if steep else places
    margin = MARGIN * (np.ptp(at) / max(len(at) - 1, 1) or 0.1 * abs(at[0]) or 1.0)
    ends = at[0] - margin, at[-1] + margin
    axes.set_xlim(*(np.exp(ends) if steep else ends))
    points = (at - ends[0]) / (ends[1] - ends[0]) * 72.0 * style.panel_width(count)
    axes.xaxis.set_major_locator(FixedLocator(places))
    axes.xaxis.set_minor_locator(NullLocator())
    if swept.words:
        labels = [plain(swept.values[int(place)]) for place in places]
    else:
        prefixed = EngFormatter(swept.unit)
        form = prefixed if swept.unit in PREFIXED else StrMethodFormatter("{x:g}")
        labels = [form(place) for place in places]
        last = -np.inf
        for k, point in enumerate(points):
            labels[k], last = (labels[k], point) if point - last >= LEAST_APART else ("", last)
    axes.set_xticks(places, labels=labels)
    return float(np.diff(points).min(initial=72.0)) * 0.9


def line_words(axes):
    """The values of all axes but the first key and the type, one text a line."""
    found = [""]
    for name, values in axes:
        told = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
        if name == "delta":
            told = [f"{word} (grazes)" if word == "1" else word for word in told]
        found = [f"{before}, {each}" if before else each for before in found for each in told]
    return [plain(each) for each in found]


def over_time(results: SweepResults) -> Figure:
    """Of swarms: mean size, number, settling of clusters over time, a line for each value."""
    table, names = results.labelled("counts"), list(results.swept)
    times = table.axes["time"].values
    words = line_words([(name, table.axes[name].values.tolist()) for name in names])
    colours = style.graded_colours(len(words))
    with drawing(WIDTH, 3.9) as figure:
        panels = figure.subplots(len(SHOWN), 1, sharex=True)
        for axes, (name, factor, label) in zip(panels, SHOWN, strict=True):
            values = table.columns[name].values
            lines = mean(np.moveaxis(values, -2, 0)).reshape(-1, len(times))
            for index, (line, colour) in enumerate(zip(lines, colours, strict=True)):
                look = {"color": colour, "marker": style.marker(index)}
                axes.plot(times, factor * line, markevery=0.2, **look)
            axes.set_title(label)
        panels[-1].set_xlabel("time [s]")
        title = ", ".join(line_title(name, results) for name in names)
        style.place_legend(figure, {title: style.line_handles(words, colours)})
        return figure


SHOWN = (
    ("mean_size", 1.0, "body-weighted mean cluster size"), ("clusters", 1.0, "clusters"),
    ("settling", 1e3, "settling [mm/s]"),
)  # fmt: skip
"""Columns of the counts, factors to the units of their labels."""

SWEEP_FIGURES: dict[str, dict[str, Callable[[Any], Figure]]] = {
    "probabilities": {"sweep": against_key}, "counts": {"sweep": over_time},
}  # fmt: skip
"""Figures of a joined file, by the first of its groups."""


MOST_LINES = 5
BOUND_WORDS = "Without hydrodynamic interaction: upper bounds."
WATER_WORDS = "With hydrodynamic interaction."


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
    titles = list(map(plain, kernel.mechanisms))
    with style.panel_grid(titles, label, "$r$ of smaller / larger") as (figure, panels, spare):
        # Places of the larger classes whose lines are drawn: no more than can be told apart.
        count = len(kernel.labels)
        places = np.linspace(min(1, count - 1), count - 1, min(MOST_LINES, count))
        chosen = np.unique(places.round().astype(int)).tolist()
        colours = dict(zip(chosen, style.graded_colours(len(chosen)), strict=True))
        for m, axes in enumerate(panels):
            for v in range(len(kernel.vertices)):
                for larger in chosen:
                    draw_line(axes, kernel, name, (m, v, larger), colours[larger])
            axes.set(xlim=(0.0, 1.05), ylim=(0.0, None))
            axes.grid(axis="y", color="0.9", linewidth=0.6)
        style.place_legend(figure, legend(kernel, colours), spare)
        bars = "Bars: 95 % sampling intervals. "
        style.add_foot(figure, bars + (WATER_WORDS if kernel.water else BOUND_WORDS))
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
    reach = np.maximum([(value - low)[known], (high - value)[known]], 0.0)
    look = {"color": colour, "clip_on": False, **look_of(kernel, v)}
    axes.errorbar(ratio[known], value[known], reach, elinewidth=0.7, **look)


def look_of(kernel, v):
    """Marker and dashes of a number of vertices: spheres are hollow and dotted."""
    hollow = {"linestyle": ":", "markerfacecolor": "white"} if kernel.vertices[v] == 1 else {}
    return {"marker": style.marker(v), **hollow}


def legend(kernel, colours):
    """{title: handles}: colours for sizes, markers for N."""
    from matplotlib.lines import Line2D

    sizes = [
        Line2D([], [], color=colour, label=f"{MICRO * kernel.radii[place]:.3g} µm")
        for place, colour in colours.items()
    ]
    counts = [
        Line2D([], [], color="0.3", label="sphere" if count == 1 else str(count),
               **look_of(kernel, v))
        for v, count in enumerate(kernel.vertices)
    ]  # fmt: skip
    return {"$r$ of larger": sizes, "vertices $N$": counts}


KERNEL_FIGURES: dict[str, Callable[[Results], Figure]] = {
    "kernels": kernels,
    "efficiency": efficiency,
}
"""Name → figure."""


def shares_opened(found: Strengths, type_place: int, vertices_place: int) -> tuple:
    """(rates (k,), shares (k,) opened by then) of all doublets of a type and an N."""
    rows = (found.column("type") == type_place) & (found.column("vertices") == vertices_place)
    status = found.column("status")[rows]
    opens = np.sort(found.column("opens")[rows][np.isin(status, (OPENED, OPENS_AT_LEAST))])
    tested = int(np.sum(status != FAILED))
    return opens, np.arange(1, len(opens) + 1) / max(tested, 1)


def over_rate(found: Strengths) -> Figure:
    """A panel per type, a line per N, all displacements together."""
    types, vertices = found.table("type"), found.table("vertices")
    x_label = f"$G$ of the {plain(found.about.get('flow'))} [1/s]"
    titles = style.type_titles(types)
    with style.panel_grid(titles, "fraction of bonds opened", x_label) as (figure, panels, spare):
        colours = style.graded_colours(len(vertices))
        for number, axes in enumerate(panels):
            any_opened = 0
            for place in range(len(vertices)):
                rates, shares = shares_opened(found, number, place)
                any_opened += len(rates)
                if len(rates):
                    look = {"color": colours[place], "marker": style.marker(place)}
                    axes.plot(rates, shares, drawstyle="steps-post", **look)
            axes.set(ylim=(0.0, 1.04), xscale="log")
            if not any_opened:
                style.note(axes, "no bond opened")
        style.set_log_axis(panels[0].xaxis)
        words = ["sphere" if n == 1 else f"{n}" for n in vertices]
        style.place_legend(figure, {"vertices $N$": style.line_handles(words, colours)}, spare)
        return figure


STRENGTH_FIGURES: dict[str, Callable[[Any], Figure]] = {"strength": over_rate}
