"""The shape measures of a floc in a picture, from its pixels."""

import numpy as np

from flocsim.geometry.shapes.outline import ShapeMeasures, feret_diameters

PIXEL_MOMENT = 1.0 / 12.0
"""Second moment of a pixel about its own centre, over its area [px²]."""


def mask_measures(mask: np.ndarray) -> ShapeMeasures:
    """The ShapeMeasures [px] of a mask (h, w) bool, as scikit-image's regionprops has them.

    The perimeter is Crofton's, by lines in four directions (``perimeter_crofton``): of a disc of
    8 px it is .2 % too short, where the length along pixels (``perimeter``) is up to 4 % too long.
    A row of single pixels has the aspect ratio of the rectangle that it is.
    """
    from scipy.spatial import ConvexHull
    from skimage.measure import find_contours, regionprops

    found = regionprops(np.asarray(mask, np.uint8))[0]
    perimeter = float(found.perimeter_crofton)
    # As feret_diameter_max has it: on the sides of the pixels.
    outline = np.concatenate(find_contours(np.pad(found.image_convex, 1).astype(float), 0.5))
    long, short = found.axis_major_length / 4.0, found.axis_minor_length / 4.0
    if short == 0.0:
        long, short = np.sqrt(long**2 + PIXEL_MOMENT), np.sqrt(PIXEL_MOMENT)
    return ShapeMeasures(
        perimeter, float(long / short), 4.0 * np.pi * float(found.area) / perimeter**2,
        float(found.solidity), *feret_diameters(outline[ConvexHull(outline).vertices]),
    )  # fmt: skip
