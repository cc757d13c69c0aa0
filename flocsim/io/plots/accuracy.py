"""Error against run time: what a study costs with each method and tolerance, as
`flocsim work-precision -o FIGURE` draws it."""

from collections.abc import Mapping, Sequence

from flocsim.io.plots.style import (
    Figure,
    marker,
    panel_grid,
    place_legend,
    set_log_axis,
    type_titles,
)

Points = Sequence[tuple[float, float]]
"""(CPU time of a replicate [ms], median error of an outline point [m]) of one method."""


def error_against_time(ladders: Mapping[str, Mapping[str, Points]]) -> Figure:
    """Draw the error against the CPU time: a panel for each collision type, a line for each method.

    ``ladders``: {collision type: {method: Points, from the loosest tolerance on}}. Errors that are
    exactly 0, or unknown as no run was decided, are left out.
    """
    titles, x_label = type_titles(list(ladders)), "CPU time [ms]"
    with panel_grid(titles, "median error [m]", x_label) as (figure, panels, spare):
        for axes, lines in zip(panels, ladders.values(), strict=True):
            for number, (method, points) in enumerate(lines.items()):
                known = [point for point in points if min(point) > 0.0]
                if known:
                    axes.loglog(*zip(*known, strict=True), marker=marker(number), label=method)
        if any(axes.lines for axes in panels):
            set_log_axis(panels[0].xaxis)
            set_log_axis(panels[0].yaxis)
        place_legend(figure, {"method": panels[0].get_legend_handles_labels()[0]}, spare)
    return figure
