"""The figure of elasticities: which parameter matters."""

from typing import Any

import numpy as np

from flocsim.io.plots.style import (
    MARKERS,
    Figure,
    dodge,
    graded_colours,
    house_style,
    new_figure,
    plain,
    type_titles,
)


def elasticities(found: Any) -> Figure:
    """dPr[A]/d ln p of Elasticities: a panel for each type, a row for each parameter, a mark for
    each N and delta; hollow where 0 is in the interval."""
    count = len(found.types)
    conditions = list(np.ndindex(len(found.vertices), len(found.delta)))
    with house_style():
        height = 0.9 + 0.12 * len(found.keys) * max(len(conditions), 3)
        figure = new_figure(2.2 * count + 3.4, height)
        panels = figure.subplots(1, count, sharex=True, sharey=True, squeeze=False)[0]
        rows = np.arange(len(found.keys), dtype=float)[::-1]
        colours = graded_colours(len(conditions))
        for t, (axes, title) in enumerate(zip(panels, type_titles(found.types), strict=True)):
            axes.axvline(0.0, color="0.75", linewidth=0.8)
            for index, (v, d) in enumerate(conditions):
                colour, marker = colours[index], MARKERS[index % len(MARKERS)]
                for k, row in enumerate(rows):
                    place = (k, t, v, d)
                    value, low, high = (
                        each[place] for each in (found.value, found.low, found.high)
                    )
                    if np.isnan(value):
                        continue
                    at = row - dodge(index, len(conditions))
                    axes.plot([low, high], [at, at], color=colour, linewidth=1.0)
                    down, up = np.nan_to_num([found.change_low[place], found.change_high[place]])
                    axes.plot([low + down, high + up], [at, at], color=colour, linewidth=0.4)
                    axes.plot(value, at, marker=marker, color=colour, ms=4.0,
                              mfc=colour if found.matters(place) else "white")  # fmt: skip
            axes.set_title(title)
            axes.set_xlabel(r"$d\Pr[A]\,/\,d\ln p$")
            axes.grid(axis="x", color="0.92", linewidth=0.6)
        panels[0].set_yticks(rows, labels=[plain(key) for key in found.keys])
        panels[0].set_ylim(-0.6, len(rows) - 0.4)
        for index, (v, d) in enumerate(conditions):
            word = f"N = {found.vertices[v]}, δ = {found.delta[d]:g}"
            panels[-1].plot([], [], color=colours[index], marker=MARKERS[index % len(MARKERS)],
                            label=word)  # fmt: skip
        title = "bars: 95 %, paired; thin:\nplus numerics; hollow: may be 0"
        panels[-1].legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), title=title)
        return figure
