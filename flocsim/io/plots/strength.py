"""The figure of `flocsim strength`: what share of the bonds a flow has opened, over its rate."""

from collections.abc import Callable
from typing import Any

import numpy as np

from flocsim.io.plots.results import note_if_empty, panel_grid
from flocsim.io.plots.style import (
    MARKERS,
    Figure,
    add_line_legend,
    graded_colours,
    house_style,
    plain,
    set_log_axis,
    type_titles,
)
from flocsim.io.results.strength_file import STATUS, Strengths

OPENED = [STATUS.index(name) for name in ("opened", "opens_at_least_rate")]
FAILED = STATUS.index("failed")


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
    with house_style():
        x_label = f"rate G of the {plain(found.about.get('flow'))} [1/s]"
        figure, panels, last = panel_grid(type_titles(types), "share of bonds opened", 2.0, x_label)
        colours = graded_colours(len(vertices))
        for number, axes in enumerate(panels):
            any_opened = 0
            for place in range(len(vertices)):
                rates, shares = shares_opened(found, number, place)
                any_opened += len(rates)
                if len(rates):
                    axes.step(rates, shares, where="post", color=colours[place])
                    marker = MARKERS[place % len(MARKERS)]
                    axes.plot(rates, shares, marker, color=colours[place], markersize=3)
            axes.set_ylim(0.0, 1.04)
            axes.set_xscale("log")
            note_if_empty(axes, np.array([1.0] if any_opened else [np.nan]), "no bond opened")
        set_log_axis(panels[0].xaxis)
        add_line_legend(last, [f"{n}" for n in vertices], colours, "N")
        return figure


STRENGTH_FIGURES: dict[str, Callable[[Any], Figure]] = {"strength": over_rate}
