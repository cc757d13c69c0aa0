"""Photograph or mask?  Told by the values: in labels, neighbouring pixels nearly always agree."""

import numpy as np

from flocsim.errors import ImageError

AGREEING = 0.75
"""Least share of like neighbours, in the median over labels.

Of ten photographs, listed in docs/images.md, the median grey level has .25 at most, and .70
smoothed by 2 px or more; labels have 1 where flocs lie apart, and .8 where squares of 5 px cover
everything.
"""

BETWEEN = 0.02
"""Share of pixels that are neither black nor white, away from all edges, that no JPEG mask has."""

EDGE = 2
"""Pixels on either side of an edge that packing as JPEG makes grey."""

WAY = "fit it without --masks, or give a mask of two values or labels, one value for each floc"


def agreement(labels: np.ndarray) -> float:
    """Median over the values of (h, w) whole numbers ≥ 0, but 0, of their share of like neighbours.

    The neighbours of a pixel are those beside, above and below it, those of value 0 left out: a
    floc whose outline touches no other has 1.  NaN where there is no pair of neighbours.
    """
    length = int(labels.max(initial=0)) + 1
    like, unlike = np.zeros(length), np.zeros(length)
    for one, other in ((labels[:, 1:], labels[:, :-1]), (labels[1:], labels[:-1])):
        inside = (one > 0) & (other > 0)
        one, other = one[inside], other[inside]
        same = one == other
        like += 2 * np.bincount(one[same], minlength=length)
        unlike += np.bincount(one[~same], minlength=length)
        unlike += np.bincount(other[~same], minlength=length)
    pairs = like + unlike
    return float(np.median(like[pairs > 0] / pairs[pairs > 0])) if pairs.any() else float("nan")


def check_labels(name: object, labels: np.ndarray, count: int) -> None:
    """ImageError for labels, numbered from 0, that are ``count`` grey levels of a photograph."""
    share = agreement(labels)
    if share < AGREEING:
        raise ImageError(
            f"{name}: is a photograph, not a mask: {count} grey levels, and only "
            f"{100 * share:.0f} % of neighbouring pixels agree; {WAY}"
        )


def check_halves(name: object, grey: np.ndarray) -> None:
    """ImageError for a JPEG, (h, w), that is more than black and white."""
    from scipy.ndimage import binary_dilation

    least, most = float(grey.min()), float(grey.max())
    level = (grey - least) / max(most - least, 1.0)
    inside = level > 0.5
    near = binary_dilation(inside, iterations=EDGE) & binary_dilation(~inside, iterations=EDGE)
    between = int(((level > 0.25) & (level < 0.75) & ~near).sum())
    smaller = min(int(inside.sum()), int((~inside).sum()))
    if between > BETWEEN * max(smaller, 1):
        raise ImageError(
            f"{name}: is a photograph, not a mask: {between} pixels are neither black nor white; "
            f"{WAY} (JPEG does not preserve labels: use PNG)"
        )


def is_mask(pixels: np.ndarray) -> bool:
    """Whether the pixels of a picture file are a mask or labels: 0 outside, flocs of one value.

    A picture of two values of which neither is 0 counts as a photograph, however odd.
    """
    flat = pixels
    if pixels.ndim == 3:
        flat = pixels[..., 0]
        if not (pixels[..., :3] == flat[..., None]).all():  # an alpha channel says nothing
            return False
    if flat.dtype == bool:
        return bool(flat.any() and not flat.all())
    if flat.dtype.kind not in "iu" or flat.min(initial=1) != 0:
        return False
    if flat.dtype.itemsize > 2:
        flat = np.unique(flat, return_inverse=True)[1].reshape(flat.shape)
    return agreement(flat) >= AGREEING
