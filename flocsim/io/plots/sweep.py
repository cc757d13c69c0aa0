"""The figure of a sweep's joined file: probabilities against the swept key."""

from collections.abc import Callable
from typing import Any

import numpy as np

from flocsim.io.plots.results import (
    BARS,
    LABELS,
    PANELS_PER_ROW,
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
    plain,
    set_probability_axis,
    type_title,
)

STEEP = 20.0
"""Ratio of the largest value to the least from which on the axis is logarithmic."""


def against_key(content: tuple[dict[str, Any], dict[str, Any]]) -> Figure:
    """Pr[A] against the first swept key: a panel per type, a line per N, delta and further keys."""
    swept, groups = content
    first = next(iter(swept.values()))
    table = groups["probabilities"]
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
    with house_style():
        unit = "" if first.unit == "1" else f" [{first.unit}]"
        figure, panels = panel_grid(len(types), 2.0, plain(first.key) + unit)
        colours = graded_colours(len(words))
        for number, axes in enumerate(panels):
            set_probability_axis(axes)
            for index in range(len(words)):
                line = [each[number, index][order] for each in lines]
                shift = 0.3 * dodge(index, len(words)) if numbers is None else 0.0
                draw_bars(axes, where[order] + shift, line, index, colours[index])
            note_if_empty(axes, bands[0][number], "no decided collision")
            axes.set_title(type_title(number, types[number]))
            if numbers is None:
                axes.set_xticks(where, labels=[plain(each) for each in first.values])
            elif numbers.min() > 0.0 and numbers.max() > STEEP * numbers.min():
                axes.set_xscale("log")
        for axes in panels[::PANELS_PER_ROW]:
            axes.set_ylabel(LABELS["pr_a"])
        title = ", ".join(plain(name) for name in others) + BARS
        add_line_legend(panels[:PANELS_PER_ROW][-1], words, colours, title)
        return figure


def line_words(axes):
    """The values of all axes but the first key and the type, one text a line."""
    found = [""]
    for _, values in axes:
        told = [f"{value:g}" if isinstance(value, float) else plain(value) for value in values]
        found = [f"{before}, {each}" if before else each for before in found for each in told]
    return found


SWEEP_FIGURES: dict[str, Callable[[Any], Figure]] = {"sweep": against_key}
