"""What the filters select, and the weights that undo it.

A floc of h × w pixels is kept clear of the border at (H − h)(W − w) of the places where its picture
of H × W could have shown it: each stands for HW/((H − h)(W − w)) (Miles and Lantuéjoul).

A floc is kept in focus up to a softness that grows with its size, so large ones are kept from a
deeper slice of the water.  Softness does not depend on size otherwise; how it is distributed, the
flocs tell, each of which could have been seen up to its own limit (the product-limit estimator of
Lynden-Bell): a floc stands for the share of flocs, of those within the largest limit, that are
within its own.
"""

from collections.abc import Sequence

import attrs
import numpy as np

from flocsim.io.images.outlines import SHARP
from flocsim.io.images.pictures import Segmentation


def weighed(found: Sequence[Segmentation], max_blur: float) -> list[Segmentation]:
    """The Segmentations, all of one study, with the weights of their flocs.

    max_blur: share of r_eq up to which an outline was in focus.
    """
    regions = [each for one in found for each in one.regions]
    blur = np.array([each.blur for each in regions])
    radius = np.array([each.equivalent_radius for each in regions])
    focus = iter(focus_weights(blur, np.maximum(SHARP, max_blur * radius)))
    weighted = []
    for one in found:
        borders = [border_weight(each.bbox, one.foreground.shape) for each in one.regions]
        weights = [float(next(focus)) * border for border in borders]
        pairs = zip(one.regions, weights, strict=True)
        again = tuple(attrs.evolve(each, weight=weight) for each, weight in pairs)
        weighted.append(attrs.evolve(one, regions=again))
    return weighted


def border_weight(bbox: tuple[int, int, int, int], shape: tuple[int, ...]) -> float:
    """For how many flocs of its extent one stands that does not touch the border."""
    top, left, bottom, right = bbox
    height, width = bottom - top, right - left
    # One that touches the border was added by hand, and stands for itself.
    clear = max(shape[0] - height - 1, 0) * max(shape[1] - width - 1, 0)
    touches = top == 0 or left == 0 or bottom == shape[0] or right == shape[1]
    return 1.0 if touches or not clear else shape[0] * shape[1] / clear


def focus_weights(blur: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """1/F(limit) of flocs of softness `blur` [px] that were kept up to `limit` [px].

    F(s), the share of all flocs no softer than s, is ∏ (1 − 1/(n + 1)) over the flocs softer than
    s, n the number of flocs of at most that softness that could have had it, and been kept.
    """
    weights = np.ones(len(blur))
    known = np.flatnonzero(blur <= limit)
    if not known.size or not np.isfinite(limit[known]).all():
        return weights
    blur, limit = blur[known], limit[known]
    order = np.argsort(-blur, kind="stable")
    at_risk = np.array([np.count_nonzero((blur <= s) & (limit >= s)) for s in blur[order].tolist()])
    shares = np.concatenate([[1.0], np.cumprod(1.0 - 1.0 / (at_risk + 1.0))])
    softer = np.searchsorted(-blur[order], -limit, side="left")
    weights[known] = 1.0 / shares[softer]
    return weights
