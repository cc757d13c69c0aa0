"""The image processing of the paper as it stands in its section 2.1, step by step.

A low-pass in Fourier space against noise, stretching of the grey between two thresholds (Matlab's
``imadjust`` saturates 1 % at both ends) and Otsu's threshold (``graythresh``), one for all of a
picture. It has no notion of uneven light. What lies beyond the mask is shared with `segment`.
"""

import numpy as np

from flocsim.io.images.annotations import without_annotations
from flocsim.io.images.focus import Focus
from flocsim.io.images.outlines import background_noise, filled, outlines_at
from flocsim.io.images.pictures import Segmentation, guess_polarity
from flocsim.io.images.regions import Filters, find_regions

CUTOFF = 0.2
"""Default cut-off [cycles/px]; the paper gives none. Here the gain is half, as it is at 0.19 for
the Gaussian low-pass of `segment` at its default scale of 1 px."""

STRETCHED = (1.0, 99.0)
"""Percentiles of the grey that become black and white: those of ``imadjust``."""


def segment_as_paper(
    grey: np.ndarray,
    *,
    cutoff: float = CUTOFF,
    flocs: str = "auto",
    min_radius: float = 4.0,
    max_radius: float = np.inf,
    max_blur: float = 0.25,
    neck: float | None = 0.0,
) -> Segmentation:
    """Separate the flocs of a grey picture from its background as the paper does.

    Parameters
    ----------
    grey : (h, w) float array in [0, 1]
    cutoff : float
        Frequency at which the low-pass lets half through [cycles/px], above 0 to 0.5.
    flocs : {"auto", "bright", "dark"}
        Dark flocs are found in the negative.
    min_radius, max_radius, max_blur, neck
        Filters of regions, as for `segment`; touching flocs are not separated by default.

    Returns
    -------
    Segmentation
        ``threshold`` is Otsu's, of the stretched grey: 0 = black, 1 = white.
    """
    from skimage.exposure import rescale_intensity
    from skimage.filters import butterworth, threshold_otsu

    grey, burnt_in = without_annotations(grey)
    smooth = butterworth(grey, cutoff, high_pass=False)
    if flocs == "auto":
        flocs = guess_polarity(smooth)
    black, white = np.percentile(smooth, STRETCHED)
    if black < white:
        stretched = rescale_intensity(
            smooth if flocs == "bright" else -smooth,
            in_range=(black, white) if flocs == "bright" else (-white, -black),
            out_range=(0.0, 1.0),
        ).astype(np.float32, copy=False)
    else:  # nothing but background
        stretched = np.zeros(grey.shape, np.float32)
    level = float(threshold_otsu(stretched))
    _, slope = background_noise(stretched, 0.0, 0.5 / cutoff)
    outlines = outlines_at(stretched, level, Focus(stretched, slope, 0.0))
    regions, rejected, whole = find_regions(
        outlines, stretched, Filters(min_radius, max_radius, max_blur, neck), burnt_in
    )
    seen = stretched > level
    foreground = filled(seen)
    return Segmentation(foreground, regions, rejected, flocs, level, whole, foreground & ~seen)
