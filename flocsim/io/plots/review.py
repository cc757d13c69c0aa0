"""The page of `flocsim fit --review`: outlines over the pictures, to be rejected or restored."""

import base64
import json
import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np

from flocsim.errors import visible
from flocsim.io.fit_report import MOST_ERROR
from flocsim.io.images.pictures import UNDECIDED
from flocsim.io.images.regions import Region
from flocsim.io.images.review import KEEP, jpeg_of, outline_of

LONGEST_SIDE, SHORTEST_SIDE = 2000, 500
"""Longer side of a picture on the page [px] if there are few, and the least if there are many."""

FEW = 40

CLIPPED = 0.5
"""Percent of the pixels that may become black, and white."""

DARK_SHARE, DARK_GREY, LEAST_GAMMA = 20, 0.35, 0.4
"""So many percent of the pixels lie below this grey, unless the picture is as dark as it can."""


def review_page(template: str, pictures: Sequence[Any], greys: Iterable[np.ndarray]) -> str:
    """Return the HTML of the page, which needs no other file.

    template: its text, with @PICTURES@ and @CHOICES@; pictures: with name, found (Segmentation),
    choices, pixel_size [m], fits {label: …} and finest(region); greys: what they show, in [0, 1].
    """
    side = int(LONGEST_SIDE * min(1.0, math.sqrt(FEW / len(pictures))))
    sections = [
        section_of(place, picture, jpeg_of(stretched(grey), max(side, SHORTEST_SIDE)))
        for place, (picture, grey) in enumerate(zip(pictures, greys, strict=True))
    ]
    # A browser looks for "</script>" in JSON, too.
    choices = json.dumps({"pictures": [each.choices for each in pictures]}).replace("<", "\\u003c")
    parts = {"PICTURES": "\n".join(sections), "CHOICES": choices}
    return re.sub("@(PICTURES|CHOICES)@", lambda found: parts[found[1]], template)


def stretched(grey: np.ndarray) -> np.ndarray:
    """Grey from black to white, the dark brightened: what a dim or vignetted picture shows.

    (grey − low)/(high − low) to the power γ ≤ 1; low and high leave out half a percent of the
    pixels each, and γ brings the 20th percentile to .35, if 0.4 or more does.
    """
    values = np.asarray(grey, float)
    low, high = np.percentile(values, [CLIPPED, 100.0 - CLIPPED])
    if high <= low:
        low, high = values.min(), max(values.max(), values.min() + 1e-9)
    spread = np.clip((values - low) / (high - low), 0.0, 1.0)
    dark = np.clip(np.percentile(spread, DARK_SHARE), 1e-6, 1.0 - 1e-6)
    return spread ** np.clip(np.log(DARK_GREY) / np.log(dark), LEAST_GAMMA, 1.0)


def section_of(place: int, picture: Any, jpeg: bytes) -> str:
    """Return the HTML of a picture, the one at a place among all of them."""
    found = picture.found
    height, width = found.foreground.shape
    regions = {each.label: each for each in (*found.regions, *found.rejected)}
    outlines = [
        outline_on_page(picture, regions[each["floc"]], each, f"{place} {number}")
        for number, each in enumerate(picture.choices["flocs"])
    ]
    name = escape(visible(picture.name, ""))
    alarms = "".join(f"<p><b>Check: {escape(each)}.</b></p>" for each in found.alarms)
    # Whole numbers are the centres of pixels.
    return (
        f"<section><h2>{name}</h2>{alarms}<div class='frame'>"
        f"<svg role='group' aria-label='{name}' viewBox='-0.5 -0.5 {width} {height}' "
        f"style='--wide: {width}; --high: {height}'>"
        f"<image x='-0.5' y='-0.5' width='{width}' height='{height}' "
        f"href='data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}'/>\n"
        + "\n".join(outlines)
        + "</svg></div></section>"
    )


def outline_on_page(picture: Any, region: Region, choice: Any, place: str) -> str:
    """Return the outline of a region as the page has it; place: of its picture, and of itself among
    the choices for that."""
    alarms = alarms_of(picture, region)
    classes = "filtered" * bool(choice["left_out_because"]) or "check" * bool(alarms)
    words = [f"{picture.name}, floc {region.label}", *facts_of(picture, region)]
    if reason := choice["left_out_because"]:
        words.append(f"left out: {reason}")
    words += [f"check: {each}" for each in alarms]
    checked = str(choice["choice"] == KEEP).lower()
    return (
        f"<path class='{classes}' data-place='{place}' d='{outline_of(region)}' tabindex='0' "
        f"role='checkbox' aria-checked='{checked}'><title>{escape(visible('; '.join(words), ''))}"
        "</title></path>"
    )


def facts_of(picture: Any, region: Region) -> list[str]:
    """Return the size of a region, and the error of its fit if it has one."""
    radius = region.equivalent_radius
    facts = [f"r_eq {1e6 * radius * picture.pixel_size:.3g} µm ({radius:.3g} px)"]
    if region.label in picture.fits:
        fit = picture.finest(region)
        facts.append(f"RE {fit.relative_error:.2g} % at N = {len(fit.vertices)}")
    return facts


def alarms_of(picture: Any, region: Region) -> list[str]:
    """Return what speaks against the outline of a region."""
    alarms = []
    if region.parted == region.parted:
        alarms.append(f"separated at a neck, confidence {region.parted:.2f}")
    if region.band is not None:
        inner, outer = (int(mask.sum()) for mask in region.band)
        if outer - inner > UNDECIDED * region.area:
            low, high = region.radius_band
            alarms.append(f"the outline is undecided, r_eq {low:.3g} to {high:.3g} px")
    if region.label in picture.fits and picture.finest(region).relative_error > MOST_ERROR:
        alarms.append("the fit is coarse")
    return alarms
