"""Figures of fitted flocs: sizes (Fig. 2), errors (Fig. 3) and shapes of a library.

A figure of a shape library is a function of its entries that stands in POPULATION_FIGURES, under
the name that `flocsim plot` gives it; the first line of its docstring is the command's help.
"""

from collections.abc import Callable, Sequence

import numpy as np

from flocsim.io.plots.style import (
    Figure,
    drawing,
    set_log_axis,
    set_vertex_axis,
    vertex_positions,
)
from flocsim.io.shapes.fit_report import (
    CLASS_LIMIT,
    SHARES,
    diameters_at,
    measures_in,
    one_each,
    perimeter_dimension,
)
from flocsim.io.shapes.library import ShapeEntry

BAR_COLOUR = "#56B4E9"
CLASS_STYLES = (("≤", "#D55E00", "o"), (">", "#0072B2", "s"))
DODGE = 0.06
"""Shift of the two classes against each other, in steps of the axis of N."""

BELOW_LEGEND = 0.66
"""Share of a panel's height that is left to the data below a legend."""

PANEL_SIZE = (2.6, 2.3)
MARGIN = 0.75


MEASURES = {
    "aspect_ratio": "aspect ratio",
    "circularity": r"circularity $4\pi A/P^2$",
    "solidity": "solidity",
}
"""What is drawn of the shapes of flocs, and its label."""


def figure_2(entries: Sequence[ShapeEntry]) -> Figure:
    """Histogram of the equivalent radii of ShapeEntries [µm], median and mean marked.

    Equal bins from 0, their width by Freedman and Diaconis, at least five of them.
    """
    sizes = np.array([1e6 * entry.measured_radius for entry in one_each(entries)])
    bins = bins_of(sizes, 0.0)
    with drawing(4.2, 2.8) as figure:
        axes = figure.subplots()
        axes.hist(sizes, bins=bins, color=BAR_COLOUR, edgecolor="white", linewidth=0.5)
        marks = ((np.median(sizes), "median", "--"), (sizes.mean(), "mean", ":"))
        for value, name, dashes in marks:
            axes.axvline(value, color="0.25", linestyle=dashes, label=f"{name} {value:.3g} µm")
        title = f"{len(sizes)} flocs, {sizes.min():.3g} to {sizes.max():.3g} µm"
        axes.set(xlabel=r"equivalent radius $r_\mathrm{eq}$ [µm]", ylabel="number of flocs",
                 title=title, xlim=(0.0, None))  # fmt: skip
        axes.legend()
        return figure


def bins_of(values, first):
    """Edges of equal bins from ``first``, their width by Freedman and Diaconis, 5 to 60 of them."""
    width = 2.0 * np.subtract(*np.percentile(values, [75, 25])) / len(values) ** (1 / 3)
    span = values.max() - first
    count = int(np.clip(np.ceil(span / width) if width > 0 else 5, 5, 60))
    return np.linspace(first, first + 1.001 * span if span > 0 else first + 1.0, count + 1)


def sizes(entries: Sequence[ShapeEntry]) -> Figure:
    """Diameters 2 r_eq: shares of the flocs and of their volume, with D10, D50 and D90."""
    found = np.array([2e6 * entry.measured_radius for entry in one_each(entries)])
    bins = bins_of(found, 0.0)
    top = 0.0
    with drawing(6.4, 2.8) as figure:
        panels = figure.subplots(1, 2, sharex=True, sharey=True)
        for axes, word, by_volume in zip(panels, ("number", "volume"), (False, True), strict=True):
            weights = found**3 if by_volume else np.ones(found.size)
            bars, _, _ = axes.hist(found, bins=bins, weights=weights / weights.sum(),
                                   color=BAR_COLOUR, edgecolor="white",
                                   linewidth=0.5)  # fmt: skip
            top = max(top, bars.max())
            marks = zip(diameters_at(found, by_volume), SHARES, (":", "--", "-."), strict=True)
            for value, share, dashes in marks:
                axes.axvline(value, ymax=BELOW_LEGEND, color="0.25", linestyle=dashes,
                             label=f"D{100 * share:.0f} = {value:.3g} µm")  # fmt: skip
            axes.set(title=f"by {word}", xlabel="diameter $2r_\\mathrm{eq}$ [µm]")
            axes.set_xlim(left=0.0)
            axes.legend(loc="upper left")
        panels[0].set(ylabel="share", ylim=(0.0, top / BELOW_LEGEND))
        return figure


def shape(entries: Sequence[ShapeEntry]) -> Figure:
    """Aspect ratio, circularity and solidity of the flocs, and perimeter against area with D_f2."""
    flocs = one_each(entries)
    found = [measures_in(entry) for entry in flocs]
    areas = np.array([np.pi * (1e6 * entry.measured_radius) ** 2 for entry in flocs])
    perimeters = np.array([1e6 * each.perimeter for each in found])
    with drawing(6.4, 4.8) as figure:
        panels = figure.subplots(2, 2).ravel()
        for axes, (name, label) in zip(panels, MEASURES.items(), strict=False):
            values = np.array([getattr(each, name) for each in found])
            axes.hist(values, bins=bins_of(values, values.min()), color=BAR_COLOUR,
                      edgecolor="white", linewidth=0.5)  # fmt: skip
            axes.axvline(np.median(values), color="0.25", linestyle="--",
                         label=f"median {np.median(values):.3g}")  # fmt: skip
            room = 1.2 * axes.get_ylim()[1]  # for the legend above the bars
            axes.set(xlabel=label, ylabel="number of flocs", ylim=(0.0, room))
            axes.yaxis.get_major_locator().set_params(integer=True)
            axes.legend()
        draw_dimension(panels[3], areas, perimeters)
        return figure


def draw_dimension(axes, areas, perimeters):
    """Perimeter against area, a disc's, and the line of D_f2."""
    axes.plot(areas, perimeters, "o", color="#0072B2", ms=2.5)
    ends = np.array([areas.min(), areas.max()])
    axes.plot(ends, 2.0 * np.sqrt(np.pi * ends), color="0.6", linewidth=0.8, label="disc")
    if (slope := perimeter_dimension(areas, perimeters)) is not None:
        middle = np.exp(np.log(perimeters).mean() - 0.5 * slope.value * np.log(areas).mean())
        label = f"$D_{{f2}}$ = {slope.value:.2f} ± {slope.error:.2f}"
        axes.plot(ends, middle * ends ** (0.5 * slope.value), color="#D55E00", label=label)
    axes.set(xscale="log", yscale="log", xlabel="area [µm²]", ylabel="perimeter [µm]")
    set_log_axis(axes.xaxis)
    set_log_axis(axes.yaxis)
    axes.legend()


def figure_3(entries: Sequence[ShapeEntry]) -> Figure:
    """Relative error of the fits against N by size class, for every spheroradius.

    Mean and standard deviation of RE [%], a panel for each r. Dashed: the equivalent spheres
    (N = 1).  The classes part at r_eq = 5 px, the paper's 5 µm.
    """
    radii = sorted({entry.spheroradius for entry in entries})
    with drawing(PANEL_SIZE[0] * len(radii) + MARGIN, PANEL_SIZE[1] + MARGIN) as figure:
        panels = figure.subplots(1, len(radii), sharey=True, squeeze=False)[0]
        for radius, axes in zip(radii, panels, strict=True):
            draw_errors(axes, [e for e in entries if e.spheroradius == radius])
            axes.set(title=f"spheroradius r = {radius:g} px", xlabel="vertices $N$")
        panels[0].set_ylabel("relative error RE [%]")
        room = panels[0].dataLim.ymax / BELOW_LEGEND
        panels[0].set_ylim(0.0, max(panels[0].get_ylim()[1], room))
        title = "mean ± standard deviation\ndashed: circle of equal area"
        panels[0].legend(title=title, alignment="left", loc="upper right")
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
    "sizes": sizes,
    "shape": shape,
}
