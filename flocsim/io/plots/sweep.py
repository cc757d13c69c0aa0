"""The figure of a sweep's joined file: probabilities against the swept key."""

from collections.abc import Callable
from typing import Any

import numpy as np

from flocsim.io.plots.results import (
    BARS,
    LABELS,
    add_line_legend,
    draw_bars,
    note_if_empty,
    panel_grid,
)
from flocsim.io.plots.style import (
    Figure,
    dodge,
    graded_colours,
    house_style,
    new_figure,
    plain,
    set_probability_axis,
    type_titles,
)
from flocsim.io.results.swarm_file import mean
from flocsim.io.results.sweep_file import SweepResults

PREFIXED = ("m", "s", "J", "N", "V")
"""Units whose values are written with a prefix, as 500 nm."""

STEEP = 20.0
"""Ratio of the largest value to the least from which on the axis is logarithmic."""


def against_key(results: SweepResults) -> Figure:
    """Pr[A] against the first swept key: a panel per type, a line per N, delta and further keys."""
    from matplotlib.ticker import EngFormatter, NullFormatter, StrMethodFormatter

    first = next(iter(results.swept.values()))
    table = results.labelled("probabilities")
    axes_names = table.columns["pr_a"].axes
    place = axes_names.index("type")
    ends = ("", "_low", "_high", "_numerical")
    # (type, the others one after the other, the first key): what every line is drawn of.
    bands = [np.moveaxis(table.columns["pr_a" + end].values, (place, 0), (0, -1)) for end in ends]
    lines = [band.reshape(band.shape[0], -1, band.shape[-1]) for band in bands]
    others = [name for name in axes_names[1:] if name != "type"]
    words = line_words([(name, table.axes[name].values.tolist()) for name in others])
    types = table.axes["type"].values.tolist()
    numbers = None if first.words else np.array(first.values, dtype=float)
    where = np.arange(len(first.values), dtype=float) if numbers is None else numbers
    order = np.argsort(where)
    is_log = numbers is not None and numbers.min() > 0.0 and numbers.max() > STEEP * numbers.min()
    with house_style():
        unit = f" [{first.unit}]" if first.unit not in ("1", *PREFIXED) else ""
        x_label = plain(first.key) + unit
        figure, panels, last = panel_grid(type_titles(types), LABELS["pr_a"], 2.0, x_label)
        colours = graded_colours(len(words))
        for number, axes in enumerate(panels):
            set_probability_axis(axes)
            for index in range(len(words)):
                line = [each[number, index][order] for each in lines]
                aside = dodge(index, len(words))
                if numbers is None:
                    places = where[order] + 0.3 * aside
                elif is_log:
                    places = where[order] * (where.max() / where.min()) ** (0.1 * aside)
                else:
                    places = where[order] + 0.1 * aside * np.ptp(where)
                draw_bars(axes, places, line, index, colours[index])
            note_if_empty(axes, bands[0][number], "no decided collision")
            if numbers is None:
                axes.set_xticks(where, labels=[plain(each) for each in first.values])
                continue
            if is_log:
                axes.set_xscale("log")
                axes.xaxis.set_minor_formatter(NullFormatter())
            else:
                axes.locator_params(axis="x", nbins=5)
            style = (
                EngFormatter(first.unit) if first.unit in PREFIXED else StrMethodFormatter("{x:g}")
            )
            axes.xaxis.set_major_formatter(style)
        title = ", ".join(plain(name) for name in others) + BARS
        add_line_legend(last, words, colours, title)
        return figure


def line_words(axes):
    """The values of all axes but the first key and the type, one text a line."""
    found = [""]
    for _, values in axes:
        told = [f"{value:g}" if isinstance(value, float) else plain(value) for value in values]
        found = [f"{before}, {each}" if before else each for before in found for each in told]
    return found


def over_time(results: SweepResults) -> Figure:
    """Of swarms: mean size, number, settling of clusters over time, a line for each value."""
    table, names = results.labelled("counts"), list(results.swept)
    times = table.axes["time"].values
    words = line_words([(name, table.axes[name].values.tolist()) for name in names])
    colours = graded_colours(len(words))
    with house_style():
        figure = new_figure(9.2, 2.6)
        panels = figure.subplots(1, len(SHOWN))
        for axes, (name, factor, label) in zip(panels, SHOWN, strict=True):
            values = table.columns[name].values
            lines = mean(np.moveaxis(values, -2, 0)).reshape(-1, len(times))
            for line, word, colour in zip(lines, words, colours, strict=True):
                axes.plot(times, factor * line, color=colour, label=word)
            axes.set_xlabel("time [s]")
            axes.set_title(label, fontsize=8.0)
        panels[-1].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0),
                          title=", ".join(plain(name) for name in names))  # fmt: skip
        return figure


SHOWN = (
    ("mean_size", 1.0, "bodies of a body's cluster"), ("clusters", 1.0, "clusters"),
    ("settling", 1e3, "settling [mm/s]"),
)  # fmt: skip
"""Columns of the counts, factors to the units of their labels."""

SWEEP_FIGURES: dict[str, Callable[[Any], Figure]] = {"sweep": against_key}
SWARM_SWEEP_FIGURES: dict[str, Callable[[Any], Figure]] = {"sweep": over_time}
