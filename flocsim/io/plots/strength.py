"""The figure of `flocsim strength`: what share of the bonds a flow has opened, over its rate."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from flocsim.io.plots.results import add_line_legend, note_if_empty, panel_grid
from flocsim.io.plots.style import Figure, graded_colours, house_style, type_titles
from flocsim.io.results.strength_file import STATUS, Strengths

OPENED = [STATUS.index(name) for name in ("opened", "opens_at_least_rate")]
FAILED = STATUS.index("failed")

WIDE = 5.0
"""Rates that differ by so much have two labels or more at 1, 2 and 5 of a decade."""


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
        x_label = f"rate G of the {found.about.get('flow')} [1/s]"
        figure, panels, last = panel_grid(type_titles(types), "share of bonds opened", 2.0, x_label)
        colours = graded_colours(len(vertices))
        for number, axes in enumerate(panels):
            any_opened = 0
            for place in range(len(vertices)):
                rates, shares = shares_opened(found, number, place)
                any_opened += len(rates)
                if len(rates):
                    axes.step(rates, shares, where="post", color=colours[place])
                    axes.plot(rates, shares, ".", color=colours[place], markersize=3)
            axes.set_ylim(0.0, 1.04)
            axes.set_xscale("log")
            note_if_empty(axes, np.array([1.0] if any_opened else [np.nan]), "no bond opened")
        label_rates(panels[0])
        add_line_legend(last, [f"{n}" for n in vertices], colours, "N")
        return figure


def label_rates(axes: Any) -> None:
    """Labels at 1, 2 and 5 of a decade, where there are enough of them: more would overlap."""
    from matplotlib.ticker import LogFormatterSciNotation, LogLocator, NullFormatter

    low, high = axes.get_xlim()
    if high > WIDE * low:
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        formatter = LogFormatterSciNotation(minor_thresholds=(math.inf, math.inf))
        axes.xaxis.set_major_formatter(formatter)
        axes.xaxis.set_minor_formatter(NullFormatter())


STRENGTH_FIGURES: dict[str, Callable[[Any], Figure]] = {"strength": over_rate}
