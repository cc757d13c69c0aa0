"""What flips and what d_c is off, against CPU time, for each method and tolerance of a study."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flocsim.io.plots.style import Figure, drawing, set_log_axis, type_titles

COLOURS = {"Implicit": "#0072B2", "DormandPrince54": "#D55E00"}
MARKERS = {"Implicit": "o", "DormandPrince54": "^"}


class Rung(NamedTuple):
    """A method at a tolerance [m]: ``flips`` of so many ``runs``, Wilson's interval of their
    share, median and 90 % quantile of the error of d_c [m], CPU time of a replicate [ms], and how
    many came to no outcome."""

    method: str
    tolerance: float
    runs: int
    flips: int
    low: float
    high: float
    median: float
    most: float
    cpu: float
    undecided: int


def draw_ladders(
    panels: Mapping[str, Sequence[Rung]], chosen: Mapping[str, tuple[str, float]], target: float
) -> Figure:
    """A column for each type: flips above, error of d_c below, against CPU time.

    ``chosen`` has (method, tolerance) of what is recommended for a type, which gets a ring if it
    was run; ``target`` is the share of flips that is asked for.
    """
    with drawing(2.5 * len(panels) + 0.8, 4.8) as figure:
        rows = figure.subplots(2, len(panels), squeeze=False, sharex="col", sharey="row")
        titles = type_titles(list(panels))
        for place, (name, rungs) in enumerate(panels.items()):
            draw_flips(rows[0, place], rungs, chosen.get(name), target)
            draw_errors(rows[1, place], rungs, chosen.get(name))
            rows[0, place].set_title(titles[place])
            rows[1, place].set_xlabel("CPU time of a replicate [ms]")
        rows[0, 0].set_ylabel("outcomes that flip [%]")
        rows[1, 0].set_ylabel("error of $d_c$ [m], bar to 90 %")
        handles, labels = rows[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


def by_method(rungs):
    """{method: its rungs, from the loosest}."""
    methods = dict.fromkeys(rung.method for rung in rungs)
    return {
        name: sorted((r for r in rungs if r.method == name), key=lambda r: -r.tolerance)
        for name in methods
    }


def draw_flips(axes, rungs, chosen, target):
    """Shares with their intervals; where nothing flipped, an arrow down from the interval's end."""
    for name, line in by_method(rungs).items():
        seen = [each for each in line if each.flips]
        colour = COLOURS[name]
        shares = np.array([[each.low, each.flips / each.runs, each.high] for each in seen])
        low, share, high = 100.0 * shares.reshape(-1, 3).T
        axes.errorbar(
            [each.cpu for each in seen], share, [share - low, high - share], color=colour,
            marker=MARKERS[name], linewidth=1.0, elinewidth=0.6, label=name,
        )  # fmt: skip
        none = [each for each in line if not each.flips]
        ends = [100.0 * each.high for each in none]
        axes.errorbar(
            [each.cpu for each in none], ends, 0.45 * np.array(ends), uplims=True, linestyle="none",
            color=colour, marker="_", elinewidth=0.6,
        )  # fmt: skip
        heights = [100.0 * (each.flips / each.runs or each.high) for each in line]
        say_tolerances(axes, line, heights, (0,))
        ring(axes, line, heights, chosen)
    axes.axhline(100.0 * target, color="0.5", linestyle="--", linewidth=0.8,
                 label="a fifth of the sampling error")  # fmt: skip
    axes.set_yscale("log")
    set_time_axis(axes)


def draw_errors(axes, rungs, chosen):
    for name, line in by_method(rungs).items():
        cpu = [each.cpu for each in line]
        # What agrees to the last digit has no place on this axis.
        median = np.array([max(each.median, 1e-18) for each in line])
        upper = np.array([max(each.most - each.median, 0.0) for each in line])
        axes.errorbar(
            cpu, median, [np.zeros(len(line)), upper], color=COLOURS[name], marker=MARKERS[name],
            linewidth=1.0, elinewidth=0.6,
        )  # fmt: skip
        say_tolerances(axes, line, median, (0, len(line) - 1))
        ring(axes, line, median, chosen)
    axes.set_yscale("log")
    set_time_axis(axes)


def set_time_axis(axes):
    """Logarithmic, with room for the words beside the outermost points."""
    axes.set_xscale("log")
    axes.margins(x=0.12)
    set_log_axis(axes.xaxis)


def say_tolerances(axes, line, heights, places):
    """The tolerances of some rungs of a line beside their markers."""
    for place in places:
        if math.isfinite(heights[place]):
            down = place > 0 and line[place].method != "Implicit"
            axes.annotate(
                f"{line[place].tolerance:.0e} m".replace("e-0", "e-"),
                (line[place].cpu, heights[place]), xytext=(4, -10 if down else 4),
                textcoords="offset points", fontsize=6.0, color=COLOURS[line[place].method],
            )  # fmt: skip


def ring(axes, line, heights, chosen):
    """A ring around what is recommended; between two rungs there is nothing to mark."""
    for each, height in zip(line, heights, strict=True):
        if chosen is not None and (each.method, each.tolerance) == tuple(chosen):
            axes.plot(each.cpu, height, "o", markersize=11, markerfacecolor="none",
                      markeredgecolor="0.2", markeredgewidth=0.9)  # fmt: skip
