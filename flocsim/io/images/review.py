"""Choices made by eye: a JSON file that says which regions of which pictures are flocs.

The page of `flocsim fit --review` saves it, and --reviewed applies it.  It names every region that
was found, with its position and size, so that it is never applied to other ones.
"""

import contextlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.errors import FileError, UsageError
from flocsim.io.images.pictures import Segmentation
from flocsim.io.images.reading import check_file
from flocsim.io.images.regions import Region
from flocsim.io.json_text import read_json
from flocsim.io.seals import sha256_of

BY_EYE = "rejected by eye"
KEEP, REJECT = "keep", "reject"

FLOC = {
    "floc": int, "x_px": float, "y_px": float, "area_px": int, "left_out_because": str,
    "choice": str,
}  # fmt: skip
FORM = {"pictures": [{"picture": str, "sha256": str, "flocs": [FLOC]}]}
"""What the file holds, as a pattern of `read_json`; names are those of the table of all regions."""

Choices = Mapping[str, Any]
"""The choices in one picture, as FORM has them."""

LARGEST = 2**25
"""Bytes of a file that are read: 200,000 regions."""

MOVED, GROWN = 1.0, 0.05
"""By so many pixels and by this share of its area a region may differ between two versions of the
libraries that find it."""

SHARPEST = 0.4
"""By so many pixels a drawn outline may differ from that of the mask."""

JPEG_QUALITY = 85


def checksum_of(path: Path) -> str:
    """Return the SHA-256 of a file; "" where it cannot be read: whoever decodes it says why."""
    with contextlib.suppress(OSError, ValueError):
        if path.is_file():
            return sha256_of(path)
    return ""


def choices_of(name: str, checksum: str, found: Segmentation) -> Choices:
    """Return the choices that the filters have made in a picture."""
    flocs = []
    for each in (*found.regions, *found.rejected):
        x, y = (round(value, 2) for value in each.centroid)
        values = each.label, x, y, each.area, each.reason, REJECT if each.reason else KEEP
        flocs.append(dict(zip(FLOC, values, strict=True)))
    return {"picture": name, "sha256": checksum, "flocs": flocs}


def read_choices(path: str) -> dict[str, Choices]:
    """Return {picture: Choices} of a file; FileError or UsageError where there is no such file."""
    check_file(Path(path), "file of choices")
    try:
        with open(path, "rb") as file:
            text = file.read(LARGEST + 1)
        if len(text) > LARGEST:
            raise ValueError(f"it is larger than {LARGEST >> 20} MB")
        pictures = read_json(text, FORM)["pictures"]
        if not {each["choice"] for one in pictures for each in one["flocs"]} <= {KEEP, REJECT}:
            raise ValueError(f"a choice is neither {KEEP!r} nor {REJECT!r}")
    except OSError as error:
        raise FileError(f"{path} could not be read: {error.strerror}; check the path") from error
    except ValueError as error:
        raise UsageError(
            f"{path} holds no choices ({error}): give the file that a page of --review saved"
        ) from None
    return {each["picture"]: each for each in pictures}


def misfit(path: str, reason: str) -> UsageError:
    """Return the UsageError for choices that were made with something else."""
    return UsageError(
        f"{path} does not fit these pictures: {reason}; give the pictures and the options that it "
        "was made with, or choose again with --review"
    )


def judged(path: str, found: Choices, by_eye: Choices | None) -> Choices:
    """Return the choices for a picture that were read from a path; UsageError unless they are about
    what was found in it."""
    name = found["picture"]
    if by_eye is None:
        raise misfit(path, f"there are no choices for {name}")
    if by_eye["sha256"] != found["sha256"]:
        raise misfit(path, f"{name} is another file, or has changed since then")
    ours, theirs = found["flocs"], by_eye["flocs"]
    if len(ours) != len(theirs) or not all(map(is_same, ours, theirs)):
        raise misfit(path, f"other regions are found in {name} now than were judged")
    return by_eye


def is_same(found: Choices, once: Choices) -> bool:
    """Return True if a region that was found is the one that was judged."""
    slack = {"x_px": MOVED, "y_px": MOVED, "area_px": 1.0 + GROWN * found["area_px"]}
    # Numbers of the file may be too large for arithmetic, but not for comparisons.
    near = (found[key] - by <= once[key] <= found[key] + by for key, by in slack.items())
    return all(near) and all(found[key] == once[key] for key in ("floc", "left_out_because"))


def chosen(found: Segmentation, choices: Choices, why: str = BY_EYE) -> Segmentation:
    """Return the Segmentation with the flocs that were chosen; numbers stay."""
    kept = {each["floc"] for each in choices["flocs"] if each["choice"] == KEEP}
    regions: list[Region] = []
    rejected: list[Region] = []
    for each in (*found.regions, *found.rejected):
        if each.label in kept:
            regions.append(attrs.evolve(each, reason=""))
        else:
            rejected.append(attrs.evolve(each, reason=each.reason or why))
    return attrs.evolve(found, regions=tuple(regions), rejected=tuple(rejected))


def outline_of(region: Region) -> str:
    """Return the outline of a region as the path of an SVG, in pixels of the picture."""
    from skimage.measure import approximate_polygon, find_contours

    # The mask has a margin of one pixel.
    corner = np.array(region.bbox[:2]) - 1
    rings = [
        approximate_polygon(ring, SHARPEST)[:-1] + corner
        for ring in find_contours(region.mask.astype(float), 0.5)
    ]
    return "".join(f"M{' '.join(f'{x:.6g},{y:.6g}' for y, x in np.round(r, 1))}Z" for r in rings)


def jpeg_of(grey: np.ndarray, side: int) -> bytes:
    """Return a grey picture in [0, 1] as a JPEG, made smaller where it is longer than a side."""
    from PIL import Image

    image = Image.fromarray(np.round(255.0 * grey).astype(np.uint8))
    image.thumbnail((side, side))
    picture = io.BytesIO()
    image.save(picture, format="JPEG", quality=JPEG_QUALITY)
    return picture.getvalue()
