"""Error against run time: what a study costs with each method and tolerance, as
`flocsim work-precision -o FIGURE` draws it."""

from collections.abc import Mapping, Sequence

from flocsim.io.plots.style import (
    WIDTH,
    Figure,
    drawing,
    marker,
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
    with drawing(max(WIDTH, 1.5 * len(ladders) + 0.4), 2.0) as figure:
        panels = figure.subplots(1, len(ladders), squeeze=False, sharex=True, sharey=True)[0]
        for axes, title, lines in zip(
            panels, type_titles(list(ladders)), ladders.values(), strict=True
        ):
            for number, (method, points) in enumerate(lines.items()):
                known = [point for point in points if min(point) > 0.0]
                if known:
                    axes.loglog(*zip(*known, strict=True), marker=marker(number), label=method)
            axes.set_title(title)
            axes.set_xlabel("CPU time [ms]")
        panels[0].set_ylabel("median error [m]")
        if any(axes.lines for axes in panels):
            set_log_axis(panels[0].xaxis)
            set_log_axis(panels[0].yaxis)
        place_legend(figure, {"method": panels[0].get_legend_handles_labels()[0]})
    return figure
