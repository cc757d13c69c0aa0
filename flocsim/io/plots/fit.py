"""The picture of a fit: outlines of the shapes over the grey picture they were made from."""

import numpy as np

from flocsim.geometry.shapes.outline import swept_rings
from flocsim.io.plots.style import house_style

OUTLINE_COLOUR = "#d55e00"
REJECTED_COLOUR = "#56b4e9"
REASONS = {"too small": "·"}
"""Shorter words: the small are many."""

LONGEST_SIDE = 12.0
"""Longer side of the drawing [inch]."""


def picture_rings(region, fit):
    """Closed rings [(k, 2), …] of a region's Fit, in picture pixels, x right and y down."""
    top, left = region.bbox[:2]
    # The mask has a margin of one pixel, and the fit's y counts upwards.
    rings = swept_rings(fit.vertices, fit.radius)
    return [ring * (1.0, -1.0) + (left - 1, top - 1) for ring in rings]


def draw_overlay(grey, flocs, title, rejected=()):
    """A figure of the picture with the outline of every floc, and why others are left out.

    grey: (h, w) in [0, 1]; flocs: pairs (Region, Fit); title: one line; rejected: Rejections.
    Returns the figure, for flocsim.io.plots.figures.save.
    """
    with house_style():
        axes = _picture_axes(grey.shape)
        axes.imshow(grey, cmap="gray", interpolation="nearest")
        axes.set_axis_off()
        axes.set_title(title)
        for region, fit in flocs:
            _draw_floc(axes, region, fit)
        for region in rejected:
            axes.annotate(REASONS.get(region.reason, region.reason), region.centroid,
                          color=REJECTED_COLOUR, fontsize=6, ha="center", va="center")  # fmt: skip
    return axes.figure


def _picture_axes(shape):
    """Axes that a picture of this shape fills, with a strip for the title."""
    from matplotlib.figure import Figure

    height, width = (size * LONGEST_SIDE / max(shape) for size in shape)
    strip = 0.3
    figure = Figure(figsize=(max(width, 4.0), max(height, 2.0) + strip))
    return figure.add_axes((0.0, 0.0, 1.0, 1.0 - strip / figure.get_figheight()))


def _draw_floc(axes, region, fit):
    rings = picture_rings(region, fit)
    for ring in rings:
        axes.plot(*ring.T, color=OUTLINE_COLOUR, linewidth=0.8)
    right, top = np.max(rings[0][:, 0]), np.min(rings[0][:, 1])
    axes.annotate(str(region.label), (right, top), color=OUTLINE_COLOUR, fontsize=7)
