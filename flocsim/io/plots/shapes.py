"""Figures of fitted flocs: sizes (Fig. 2), errors (Fig. 3) and shapes of a library; a single fit
(Fig. 1).

A figure of a shape library is a function of its entries that stands in POPULATION_FIGURES, under
the name that `flocsim plot` gives it; the first line of its docstring is the command's help.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocsim.geometry.shapes.outline import swept_rings
from flocsim.io.fit_report import (
    SHARES,
    diameters_at,
    measures_in,
    one_each,
    perimeter_dimension,
)
from flocsim.io.plots import style
from flocsim.io.plots.style import Figure, drawing, plain
from flocsim.io.shape_library import ShapeEntry

if TYPE_CHECKING:
    from flocsim.geometry.fit.fit import Fit

CLASS_LIMIT = 5.0
"""r_eq [px] that separates the two size classes of Fig. 3 (the paper's 5 µm at 1 µm a pixel)."""

BARS = {"color": "#56B4E9", "edgecolor": "white", "linewidth": 0.5}
CLASS_STYLES = (("≤", "#D55E00", "o"), (">", "#0072B2", "s"))
DODGE = 0.06
"""Shift of the two classes against each other, in steps of the axis of N."""

BELOW_LEGEND = 0.66
"""Share of a panel's height that is left to the data below a legend."""


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
    with drawing(style.WIDTH, 2.0) as figure:
        axes = figure.subplots()
        axes.hist(sizes, bins=bins, **BARS)
        marks = ((np.median(sizes), "median", "--"), (sizes.mean(), "mean", ":"))
        for value, name, dashes in marks:
            axes.axvline(value, color="0.25", linestyle=dashes, label=f"{name} {value:.3g} µm")
        title = f"{len(sizes)} flocs, {sizes.min():.3g} to {sizes.max():.3g} µm"
        axes.set(xlabel=r"equivalent radius $r_\mathrm{eq}$ [µm]", ylabel="number of flocs",
                 title=title, xlim=(0.0, None))  # fmt: skip
        axes.yaxis.get_major_locator().set_params(integer=True)
        style.place_legend(figure, {"": axes.get_legend_handles_labels()[0]})
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
    titles, x_label = ("by number", "by volume"), "diameter $2r_\\mathrm{eq}$ [µm]"
    with style.panel_grid(titles, "share", x_label, 1.8) as (figure, panels, _):
        for axes, by_volume in zip(panels, (False, True), strict=True):
            weights = found**3 if by_volume else np.ones(found.size)
            bars, _, _ = axes.hist(found, bins=bins, weights=weights / weights.sum(), **BARS)
            top = max(top, bars.max())
            marks = zip(diameters_at(found, by_volume), SHARES, (":", "--", "-."), strict=True)
            for value, share, dashes in marks:
                label = f"D{100 * share:.0f} = {value:.3g} µm"
                axes.axvline(value, ymax=BELOW_LEGEND, color="0.25", linestyle=dashes, label=label)
            axes.set_xlim(left=0.0)
            axes.legend(loc="upper left")
        panels[0].set(ylim=(0.0, top / BELOW_LEGEND))
        return figure


def shape(entries: Sequence[ShapeEntry]) -> Figure:
    """Aspect ratio, circularity and solidity of the flocs, and perimeter against area with D_f2."""
    flocs = one_each(entries)
    found = [measures_in(entry) for entry in flocs]
    areas = np.array([np.pi * (1e6 * entry.measured_radius) ** 2 for entry in flocs])
    perimeters = np.array([1e6 * each.perimeter for each in found])
    with drawing(style.WIDTH, 3.2) as figure:
        panels = figure.subplots(2, 2).ravel()
        for axes, (name, label) in zip(panels, MEASURES.items(), strict=False):
            values = np.array([getattr(each, name) for each in found])
            axes.hist(values, bins=bins_of(values, values.min()), **BARS)
            middle = np.median(values)
            axes.axvline(middle, color="0.25", linestyle="--")
            axes.set(xlabel=label, ylabel="number of flocs", title=f"median {middle:.3g}")
            axes.yaxis.get_major_locator().set_params(integer=True)
        draw_dimension(panels[3], areas, perimeters)
        return figure


def draw_dimension(axes, areas, perimeters):
    """Perimeter against area, a disc's, and the line of D_f2."""
    axes.plot(areas, perimeters, "o", color="#0072B2", ms=2.5)
    ends = np.array([areas.min(), areas.max()])
    axes.plot(ends, 2.0 * np.sqrt(np.pi * ends), color="0.5", linestyle="--", label="disc")
    if (found := perimeter_dimension(areas, perimeters)) is not None:
        slope, error = found
        middle = np.exp(np.log(perimeters).mean() - 0.5 * slope * np.log(areas).mean())
        axes.plot(ends, middle * ends ** (0.5 * slope), color="#D55E00")
        axes.set_title(f"$D_{{f2}}$ = {slope:.2f} ± {error:.2f}")
    axes.set(xscale="log", yscale="log", xlabel="area [µm²]", ylabel="perimeter [µm]")
    style.set_log_axis(axes.xaxis)
    style.set_log_axis(axes.yaxis)
    axes.legend(loc="lower right")


def figure_3(entries: Sequence[ShapeEntry]) -> Figure:
    """Relative error of the fits against N by size class, for every spheroradius.

    Mean and standard deviation of RE [%], a panel for each r. Dashed: the equivalent spheres
    (N = 1).  The classes part at r_eq = 5 px, the paper's 5 µm.
    """
    radii = sorted({entry.spheroradius for entry in entries})
    titles = [f"spheroradius r = {radius:g} px" for radius in radii]
    with style.panel_grid(titles, "error RE [%]") as (figure, panels, spare):
        for radius, axes in zip(radii, panels, strict=True):
            draw_errors(axes, [e for e in entries if e.spheroradius == radius])
        panels[0].set_ylim(bottom=0.0)
        style.place_legend(figure, {"": panels[0].get_legend_handles_labels()[0]}, spare)
        style.add_foot(figure, "Mean ± standard deviation of the relative error; dashed: circle of "
                       "equal area.")  # fmt: skip
        return figure


def draw_errors(axes, entries):
    counts = [count for count in entries[0].fits if count > 1] or [1]
    places = np.asarray(style.vertex_positions(counts), float)
    for shift, (sign, colour, marker) in zip((-DODGE, DODGE), CLASS_STYLES, strict=True):
        members = [e for e in entries if (e.equivalent_radius <= CLASS_LIMIT) == (sign == "≤")]
        if not members:
            continue
        errors = np.array([[e.fits[n].relative_error for n in counts] for e in members])
        mean, spread = errors.mean(axis=0), errors.std(axis=0)
        reach = [np.minimum(spread, mean), spread]
        label = rf"$r_\mathrm{{eq}}$ {sign} {CLASS_LIMIT:g} px ({len(members)})"
        look = {"color": colour, "marker": marker, "label": label, "clip_on": False}
        axes.errorbar(places + shift, mean, reach, elinewidth=0.7, capsize=2, **look)
        if 1 in entries[0].fits:
            spheres = np.mean([e.fits[1].relative_error for e in members])
            axes.axhline(spheres, color=colour, linestyle="--", linewidth=0.8)
    style.set_vertex_axis(axes, counts)


POPULATION_FIGURES: dict[str, Callable[[Sequence[ShapeEntry]], Figure]] = {
    "2": figure_2,
    "3": figure_3,
    "sizes": sizes,
    "shape": shape,
}


MASK, CORE, DISK = "#c7c7c7", "#0072B2", "#D55E00"
MISSED, ADDED = "#0072B2", "#D55E00"
"""Pixels of the mask that the shape leaves out; pixels beside it that it takes in."""

ROUND_POINTS = 64


def single_fit(mask: np.ndarray, fit: "Fit", name: str = "") -> Figure:
    """The fit of a mask (h, w) bool in four panels, as in the paper's Fig. 1: the mask; the core
    polygon; the disk along it and the outline that it sweeps; the pixels that differ."""
    mask = np.asarray(mask, bool)
    # The fit's y counts upwards.
    cores = [ring * (1.0, -1.0) for ring in fit.parts[0].rings]
    outlines = [ring * (1.0, -1.0) for ring in swept_rings(fit.parts, ROUND_POINTS)]
    count = len(fit.vertices)
    height = min(max(1.6 * mask.shape[0] / mask.shape[1], 0.9), 3.0)
    with drawing(style.WIDTH, 2.0 * (height + 0.25)) as figure:
        from matplotlib.colors import to_rgb
        from matplotlib.patches import Circle, Polygon

        inside = covered_by(outlines, mask.shape)
        panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
        for axes in panels:
            axes.imshow(np.where(mask, 0.78, 1.0), cmap="gray", vmin=0.0, vmax=1.0,
                        interpolation="nearest")  # fmt: skip
            axes.set_axis_off()
        for core in cores:
            for axes in panels[1:3]:
                axes.add_patch(Polygon(core, closed=True, fill=False, edgecolor=CORE))
                axes.plot(*core.T, "o", color=CORE, ms=2.5)
            for vertex in core:
                disk = Circle(vertex, fit.radius, fill=False, edgecolor=DISK, linewidth=0.4)
                panels[2].add_patch(disk)
        for ring in outlines:
            panels[2].plot(*ring.T, color=DISK, linewidth=1.0)
        colours = np.ones((*mask.shape, 3))
        for wrong, colour in (
            (mask & ~inside, MISSED),
            (inside & ~mask, ADDED),
            (mask & inside, MASK),
        ):
            colours[wrong] = to_rgb(colour)
        panels[3].imshow(colours, interpolation="nearest")
        words = (
            f"mask: {int(mask.sum())} px", f"core: N = {count}",
            f"swept by a disk, r = {fit.radius:.3g} px",
            f"V = {fit.wrong_pixels} px, RE = {fit.relative_error:.2f} %",
        )  # fmt: skip
        for axes, text in zip(panels, words, strict=True):
            axes.set_title(text)
        style.add_foot(figure, "Lower right: blue pixels are missing, orange ones in excess.")
        if name:
            figure.suptitle(plain(name, style.MOST_OF_TITLE), x=0.01, ha="left", fontsize=7)
        return figure


def covered_by(rings, shape):
    """(h, w) bool of the pixels whose centres lie inside of rings, those of holes among them."""
    from matplotlib.path import Path

    y, x = np.indices(shape)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    inside = np.zeros(points.shape[0], bool)
    for ring in rings:
        inside ^= Path(ring).contains_points(points)
    return inside.reshape(shape)
