"""Figures of fitted flocs: sizes (Fig. 2) and errors (Fig. 3) of a library.

A figure of a shape library is a function of its entries that stands in POPULATION_FIGURES, under
the name that `flocsim plot` gives it; the first line of its docstring is the command's help.
"""

from collections.abc import Callable, Sequence

import numpy as np

from flocsim.io.plots.style import (
    Figure,
    house_style,
    new_figure,
    set_vertex_axis,
    vertex_positions,
)
from flocsim.io.shapes.fit_report import CLASS_LIMIT
from flocsim.io.shapes.library import ShapeEntry

BAR_COLOUR = "#56B4E9"
CLASS_STYLES = (("≤", "#D55E00", "o"), (">", "#0072B2", "s"))
DODGE = 0.06
"""Shift of the two classes against each other, in steps of the axis of N."""

PANEL_SIZE = (2.6, 2.3)
MARGIN = 0.75


def figure_2(entries: Sequence[ShapeEntry]) -> Figure:
    """Histogram of the equivalent radii of ShapeEntries [µm], median and mean marked.

    Equal bins from 0, their width by Freedman and Diaconis, at least five of them.
    """
    # A library may hold a floc at several spheroradii.
    first = min(entry.spheroradius for entry in entries)
    flocs = [entry for entry in entries if entry.spheroradius == first]
    sizes = np.array([1e6 * entry.measured_radius for entry in flocs])
    width = 2.0 * np.subtract(*np.percentile(sizes, [75, 25])) / len(sizes) ** (1 / 3)
    count = int(np.clip(np.ceil(sizes.max() / width) if width > 0 else 5, 5, 60))
    bins = np.linspace(0.0, 1.001 * sizes.max(), count + 1)
    with house_style():
        figure = new_figure(4.2, 2.8)
        axes = figure.subplots()
        axes.hist(sizes, bins=bins, color=BAR_COLOUR, edgecolor="white", linewidth=0.5)
        marks = ((np.median(sizes), "median", "--"), (sizes.mean(), "mean", ":"))
        for value, name, dashes in marks:
            axes.axvline(value, color="0.25", linestyle=dashes, label=f"{name} {value:.3g} µm")
        axes.set_xlabel(r"equivalent radius $r_\mathrm{eq}$ [µm]")
        axes.set_ylabel("number of flocs")
        axes.set_xlim(left=0.0)
        axes.set_title(f"{len(sizes)} flocs, {sizes.min():.3g} to {sizes.max():.3g} µm")
        axes.legend()
        return figure


def figure_3(entries: Sequence[ShapeEntry]) -> Figure:
    """Relative error of the fits against N by size class, for every spheroradius.

    Mean and standard deviation of RE [%], a panel for each r. Dashed: the equivalent spheres
    (N = 1).  The classes part at r_eq = 5 px, the paper's 5 µm.
    """
    radii = sorted({entry.spheroradius for entry in entries})
    with house_style():
        figure = new_figure(PANEL_SIZE[0] * len(radii) + MARGIN, PANEL_SIZE[1] + MARGIN)
        panels = figure.subplots(1, len(radii), sharey=True, squeeze=False)[0]
        for radius, axes in zip(radii, panels, strict=True):
            draw_errors(axes, [e for e in entries if e.spheroradius == radius])
            axes.set_title(f"spheroradius r = {radius:g} px")
            axes.set_xlabel("vertices N")
        panels[0].set_ylabel("relative error RE [%]")
        panels[0].set_ylim(bottom=0.0)
        title = "mean ± standard deviation\ndashed: circle of equal area"
        panels[0].legend(title=title, alignment="left", loc="upper left")
        return figure


def draw_errors(axes, entries):
    counts = [count for count in entries[0].fits if count > 1] or [1]
    places = np.asarray(vertex_positions(counts), float)
    for shift, (sign, colour, marker) in zip((-DODGE, DODGE), CLASS_STYLES, strict=True):
        members = [e for e in entries if (e.equivalent_radius <= CLASS_LIMIT) == (sign == "≤")]
        if not members:
            continue
        errors = np.array([[e.fits[n].relative_error for n in counts] for e in members])
        mean, spread = errors.mean(axis=0), errors.std(axis=0)
        below = np.minimum(spread, mean)
        label = rf"$r_\mathrm{{eq}}$ {sign} {CLASS_LIMIT:g} px ({len(members)})"
        axes.errorbar(places + shift, mean, [below, spread], color=colour, marker=marker,
                      elinewidth=0.7, capsize=2, label=label)  # fmt: skip
        if 1 in entries[0].fits:
            spheres = np.mean([e.fits[1].relative_error for e in members])
            axes.axhline(spheres, color=colour, linestyle="--", linewidth=0.8)
    set_vertex_axis(axes, counts)


POPULATION_FIGURES: dict[str, Callable[[Sequence[ShapeEntry]], Figure]] = {
    "2": figure_2,
    "3": figure_3,
}
