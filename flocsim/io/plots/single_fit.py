"""A picture of one fit: mask, core, the core swept by its disk, and the pixels that differ."""

from typing import TYPE_CHECKING

import numpy as np

from flocsim.errors import visible
from flocsim.geometry.shapes.outline import swept_rings
from flocsim.io.plots.style import Figure, house_style, new_figure, plain

if TYPE_CHECKING:
    from flocsim.geometry.fit.fit import Fit

MASK, CORE, DISK = "#c7c7c7", "#0072B2", "#D55E00"
MISSED, ADDED = "#0072B2", "#D55E00"
"""Pixels of the mask that the shape leaves out; pixels beside it that it takes in."""

ROUND_POINTS = 64


def single_fit(mask: np.ndarray, fit: "Fit", name: str = "") -> Figure:
    """The fit of a mask (h, w) bool in four panels, as in the paper's Fig. 1: the mask; the core
    polygon; the disk along it and the outline that it sweeps; the pixels that differ."""
    from matplotlib.patches import Polygon

    mask = np.asarray(mask, bool)
    # The fit's y counts upwards.
    cores = [ring * (1.0, -1.0) for ring in fit.parts[0].rings]
    outlines = [ring * (1.0, -1.0) for ring in swept_rings(fit.parts, ROUND_POINTS)]
    inside = covered_by(outlines, mask.shape)
    count = len(fit.vertices)
    with house_style():
        height = min(max(2.2 * mask.shape[0] / mask.shape[1], 1.2), 4.0)
        figure = new_figure(9.2, height + 0.6)
        panels = figure.subplots(1, 4, sharex=True, sharey=True)
        for axes in panels:
            axes.imshow(np.where(mask, 0.78, 1.0), cmap="gray", vmin=0.0, vmax=1.0,
                        interpolation="nearest")  # fmt: skip
            axes.set_axis_off()
        for core in cores:
            for axes in panels[1:3]:
                axes.add_patch(Polygon(core, closed=True, fill=False, edgecolor=CORE))
                axes.plot(*core.T, "o", color=CORE, ms=2.5)
            draw_disks(panels[2], core, fit.radius)
        for ring in outlines:
            panels[2].plot(*ring.T, color=DISK, linewidth=1.0)
        colours = np.ones((*mask.shape, 3))
        for wrong, colour in (
            (mask & ~inside, MISSED),
            (inside & ~mask, ADDED),
            (mask & inside, MASK),
        ):
            colours[wrong] = rgb(colour)
        panels[3].imshow(colours, interpolation="nearest")
        words = (
            f"mask: {int(mask.sum())} px", f"core: N = {count}",
            f"swept by a disk of r = {fit.radius:.3g} px",
            f"V = {fit.wrong_pixels} px, RE = {fit.relative_error:.2f} %",
        )  # fmt: skip
        for axes, text in zip(panels, words, strict=True):
            axes.set_title(text, fontsize=8)
        panels[3].text(0.0, -0.02, "blue: left out, orange: too much", fontsize=7, va="top",
                       transform=panels[3].transAxes)  # fmt: skip
        if name:
            figure.suptitle(plain(visible(name, keep="")), x=0.01, ha="left", fontsize=9)
        return figure


def draw_disks(axes, core, radius):
    """The disk at every vertex."""
    from matplotlib.patches import Circle

    for x, y in core:
        axes.add_patch(Circle((x, y), radius, fill=False, edgecolor=DISK, linewidth=0.4))


def covered_by(rings, shape):
    """(h, w) bool of the pixels whose centres lie inside of rings, those of holes among them."""
    from matplotlib.path import Path

    y, x = np.indices(shape)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    inside = np.zeros(points.shape[0], bool)
    for ring in rings:
        inside ^= Path(ring).contains_points(points)
    return inside.reshape(shape)


def rgb(colour):
    return [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
