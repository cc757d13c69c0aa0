"""Which flocs count: what a user corrects in a segmentation, and the weights that undo the filters.

A floc of h × w pixels is kept clear of the border at (H − h)(W − w) of the places where its picture
of H × W could have shown it: each stands for HW/((H − h)(W − w)) (Miles and Lantuéjoul).

A floc is kept in focus up to a softness that grows with its size, so large ones are kept from a
deeper slice of the water.  Softness does not depend on size otherwise; how it is distributed, the
flocs tell, each of which could have been seen up to its own limit (the product-limit estimator of
Lynden-Bell): a floc stands for the share of flocs, of those within the largest limit, that are
within its own.
"""

import io
import re
from collections.abc import Iterable, Mapping, Sequence

import attrs
import numpy as np

from flocsim.errors import ImageError, UsageError
from flocsim.io.images.outlines import SHARP
from flocsim.io.images.pictures import Segmentation
from flocsim.io.images.regions import Region

DROPPED = "dropped"
NOT_CHOSEN = "not among those kept"
MOST_LABEL = 65535
"""The largest number that a label image of 16 bits has."""

Names = tuple[tuple[str | None, int], ...]
"""(picture, number) of regions; None where only the number was given."""

Correction = Mapping[str, Names]
"""Regions by name: "drop" leaves flocs out, "keep", if any, all others, "add" takes regions in.
Named as in the overlay and the table, "023.png#7", also if they were left out."""


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


def read_names(option: str, text: str) -> Names:
    """The regions in a list such as "3,5", "023.png#7" or "023.png#7,9,024.png#2".

    A bare number belongs to the picture named before it.  UsageError, which names the option.
    """
    names: list[tuple[str | None, int]] = []
    picture, begun = None, ""
    for piece in text.split(","):
        before, mark, number = (begun + piece).strip().rpartition("#")
        if not re.fullmatch("[0-9]{1,9}", number):
            begun += piece + ","  # a picture's name with a comma in it
            continue
        picture, begun = before if mark else picture, ""
        names.append((picture, int(number)))
    if begun:
        raise UsageError(
            f"{option} takes numbers or names of flocs, such as 3,5 or 023.png#7, found {text!r}"
        )
    return tuple(names)


def check_names(correction: Correction, found: Sequence[tuple[str, Segmentation]]) -> None:
    """UsageError for a name that none of the (picture's name, Segmentation) has, or several."""
    known = dict(found)
    for option, names in correction.items():
        for picture, number in names:
            if picture is None and len(known) != 1:
                raise UsageError(
                    f"--{option} {number}: there are {len(known)} pictures; name the picture too, "
                    f"for example {next(iter(known), 'a.png')}#{number}"
                )
            name = next(iter(known)) if picture is None else picture
            if name not in known:
                raise UsageError(
                    f"--{option} {name}#{number}: no picture is called {name!r}; the first is "
                    f"{next(iter(known), 'missing')!r}"
                )
            numbers = {each.label for each in (*known[name].regions, *known[name].rejected)}
            if number not in numbers:
                raise UsageError(
                    f"--{option} {name}#{number}: the picture has no such region; its last is "
                    f"{max(numbers, default=0)}; the table of all regions and the overlay name them"
                )


def corrected(picture: str, found: Segmentation, correction: Correction) -> Segmentation:
    """The Segmentation with regions moved between flocs and those left out; numbers stay."""

    def named(names):
        return {number for name, number in names if name in (None, picture)}

    drop, keep, add = (named(correction[key]) for key in ("drop", "keep", "add"))
    regions: list[Region] = []
    rejected: list[Region] = []
    for each in (*found.regions, *found.rejected):
        reason = each.reason
        if each.label in drop:
            reason = reason or DROPPED
        elif each.label in (keep | add):
            reason = ""
        elif correction["keep"]:
            reason = reason or NOT_CHOSEN
        (rejected if reason else regions).append(attrs.evolve(each, reason=reason))
    return attrs.evolve(found, regions=tuple(regions), rejected=tuple(rejected))


def label_image(shape: tuple[int, int], regions: Iterable[Region], name: str = "") -> bytes:
    """A PNG of 16 bits: 0 outside, in every region its number; `flocsim fit --masks` reads it.

    ImageError for a number above 65535.
    """
    from PIL import Image

    labels = np.zeros(shape, np.uint16)
    for region in regions:
        if region.label > MOST_LABEL:
            raise ImageError(
                f"{name}: a label image has numbers up to {MOST_LABEL}, found {region.label}; "
                "leave out small regions with --min-radius"
            )
        top, left, bottom, right = region.bbox
        labels[top:bottom, left:right][region.mask[1:-1, 1:-1]] = region.label
    picture = io.BytesIO()
    Image.fromarray(labels).save(picture, format="PNG")
    return picture.getvalue()
