"""From a mask of pixels to the spheropolygon that covers it best: ``fit_mask``.

May import ``geometry.shapes``; runs depend on its results, never on its code.
"""

from flocsim.geometry.fit.fit import Fit, fit_mask

__all__ = ["Fit", "fit_mask"]
