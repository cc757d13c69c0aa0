"""What is printed of flocs: a line on every picture, errors of the fits, the table of all regions,
and of a population what is published, D10, D50, D90 and its fractal dimension.
"""

import csv
import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from flocsim.errors import plural
from flocsim.geometry.shapes.outline import ShapeMeasures
from flocsim.io.images.pictures import Segmentation
from flocsim.io.shape_library import MEASURE_COLUMNS, ShapeEntry, scaled_measures

MOST_ERROR = 5.0
"""RE [%] above which the form of a floc is lost on its outline of so few vertices."""

COLUMNS = (
    "picture", "floc", "left_out_because", "x_px", "y_px", "area_px", "r_eq_px", "r_eq_m",
    "blur_px", "level", "r_eq_low_px", "r_eq_high_px", "parted", "weight",
    "perimeter_px", "aspect_ratio", "circularity", "solidity", "feret_max_px", "feret_min_px",
)  # fmt: skip

SHARES = (0.1, 0.5, 0.9)
"""Of the flocs, or of their volume, that are smaller than D10, D50 and D90."""

NAN = math.nan
FEWEST = 3
"""Flocs of different sizes from which on a slope has an error."""


def picture_line(name: str, found: Segmentation) -> str:
    """Return a line on a picture's Segmentation: flocs, rejected regions by reason, foreground."""
    parts = [plural(len(found.regions), f"{found.flocs} floc")]
    if reasons := found.rejected_by_reason():
        listed = (f"{n} {reason.removeprefix('rejected ')}" for reason, n in reasons.items())
        parts.append(f"rejected: {', '.join(listed)}")
    if found.left_whole:
        parts.append(f"{found.left_whole} not separated at their necks (--neck)")
    sure = [each.parted for each in found.regions if each.parted == each.parted]
    if sure:
        low, high = (f"{value:.2f}" for value in (min(sure), max(sure)))
        how = low if low == high else f"{low} to {high}"
        parts.append(f"{len(sure)} separated at necks, confidence {how} (--neck 0 joins them)")
    about = f"foreground {100 * found.foreground_share:.2f} %"
    if found.threshold == found.threshold:
        about += f", threshold {found.threshold:.4g}"
    alarms = "".join(f"; CHECK THE OUTLINES: {alarm}" for alarm in found.alarms)
    return f"{name}: {'; '.join(parts)}; {about}{alarms}"


def coarse_lines(entries: Sequence[ShapeEntry]) -> list[str]:
    """Return warnings of what fits cannot follow: outlines narrower than the disk (paper, section
    3.2), and those for which the largest N is too small."""
    lines = []
    if wide := sum(each.spheroradius >= each.equivalent_radius for each in entries):
        lines.append(
            f"the spheroradius is too large to fit {wide} of {plural(len(entries), 'floc')}, whose "
            "r_eq is not larger: use a smaller --radius"
        )
    # What a disk cannot follow, more vertices do not mend.
    flocs = [e for e in one_each(entries) if e.spheroradius < e.equivalent_radius]
    most = max(entries[0].fits)
    errors = {each.floc_id: each.fits[most].relative_error for each in flocs}
    if most > 1 and (coarse := [name for name in errors if errors[name] > MOST_ERROR]):
        worst = max(coarse, key=errors.__getitem__)
        lines.append(
            f"N = {most} is too small for {len(coarse)} of {plural(len(errors), 'floc')}: RE is "
            f"above {MOST_ERROR:g} %, for {worst} even {errors[worst]:.3g} %; use more vertices"
        )
    return [f"warning: {line}" for line in lines]


def format_errors(entries: Sequence[ShapeEntry]) -> str:
    """Return the mean relative error [%] of ShapeEntries at every N, a line for each r."""
    lines = []
    for radius in sorted({entry.spheroradius for entry in entries}):
        members = [entry for entry in entries if entry.spheroradius == radius]
        means = [
            f"{np.mean([each.fits[count].relative_error for each in members]):.2f} at N = {count}"
            for count in members[0].fits
        ]
        flocs = plural(len(members), "floc")
        lines.append(
            f"mean relative error of area [%], {flocs}, r = {radius:g} px: {', '.join(means)}"
        )
    return "\n".join(lines)


def summary_text(pictures: Sequence[Any]) -> str:
    """Return the table of all regions as CSV: flocs with their shape measures and RE [%] for every
    r [px] and N, others with why.

    pictures: with name, pixel_size [m], found (Segmentation), measures {label: ShapeMeasures} of
    found.regions, and fits {label: [{r: {N: Fit}}, …]} of those of them that are fitted.
    """
    every = (fits[0] for picture in pictures for fits in picture.fits.values())
    pairs = [(radius, count) for radius, fits in next(every, {}).items() for count in fits]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([*COLUMNS, *(f"re_percent_r{r:g}_N{n}" for r, n in pairs)])
    for picture in pictures:
        for region in (*picture.found.regions, *picture.found.rejected):
            fits = picture.fits.get(region.label)
            measures = picture.measures.get(region.label)
            radius = region.equivalent_radius
            band = region.radius_band if region.band else (NAN, NAN)
            table.writerow([
                picture.name, region.label, region.reason,
                *(f"{each:.2f}" for each in region.centroid),
                region.area, f"{radius:.3f}", f"{radius * picture.pixel_size:.4g}",
                cell(region.blur, ".3g"), cell(region.level, ".4g"),
                *(cell(each, ".3f") for each in band),
                cell(region.parted, ".2f"), f"{region.weight:.4g}",
                *(cell(getattr(measures, name, NAN), ".5g") for name in MEASURE_COLUMNS),
                *(cell(fits[0][r][n].relative_error if fits else NAN, ".4f") for r, n in pairs),
            ])  # fmt: skip
    return text.getvalue()


def cell(value: float, form: str) -> str:
    """Return a number as text; nothing for NaN."""
    return "" if math.isnan(value) else f"{value:{form}}"


def one_each(entries: Sequence[ShapeEntry]) -> list[ShapeEntry]:
    """Return the entries at the smallest spheroradius: every floc once."""
    first = min(entry.spheroradius for entry in entries)
    return [entry for entry in entries if entry.spheroradius == first]


def measures_in(entry: ShapeEntry) -> ShapeMeasures:
    """Return the measures of a floc [m]."""
    return scaled_measures(entry.measures, entry.pixel_size)


def diameters_at(
    diameters: np.ndarray, by_volume: bool, shares: Sequence[float] = SHARES
) -> np.ndarray:
    """Return diameters below which these shares of the flocs, or of their volume ∝ D³, lie (k,).

    Half of a floc counts as smaller than itself, and between flocs D goes linearly with the share:
    by number D50 is the median. Beyond the outermost flocs D is theirs.
    """
    # Each floc stands at the middle of its own weight in the cumulative distribution.
    ordered = np.sort(np.asarray(diameters, float))
    weights = ordered**3 if by_volume else np.ones(ordered.size)
    below = (np.cumsum(weights) - 0.5 * weights) / weights.sum()
    return np.interp(shares, below, ordered)


def perimeter_dimension(areas: np.ndarray, perimeters: np.ndarray) -> tuple[float, float] | None:
    """Return the perimeter-based fractal dimension D_f2 of a population: P ∝ A^(D_f2/2), by least
    squares of ln P on ln A (n,) each, and half its 95 % interval; None for fewer than FEWEST flocs
    of different areas.

    1 for outlines that are scaled copies of each other, towards 2 where larger ones are the more
    ragged. Source: B. B. Mandelbrot, The Fractal Geometry of Nature (1982), ch. 12.
    """
    from scipy.special import stdtrit
    from scipy.stats import linregress

    if len(np.unique(areas)) < FEWEST:
        return None
    # ln P = D_f2/2 ln A + constant; the interval is Student's t of the slope.
    line = linregress(np.log(areas), np.log(perimeters))
    return 2.0 * line.slope, 2.0 * float(stdtrit(len(areas) - 2, 0.975)) * line.stderr


def population_lines(entries: Sequence[ShapeEntry]) -> list[str]:
    """Return lines on D10, D50, D90 and D_f2 of some flocs, and on fits that are too coarse."""
    flocs = one_each(entries)
    sizes = np.array([2e6 * each.measured_radius for each in flocs])
    lines = []
    for word, by_volume in (("number", False), ("volume", True)):
        small, middle, large = diameters_at(sizes, by_volume)
        lines.append(
            f"diameters 2 r_eq by {word}: D10 {small:.4g}, D50 {middle:.4g}, D90 {large:.4g} um"
        )
    perimeters = np.array([measures_in(each).perimeter for each in flocs])
    areas = np.array([np.pi * each.measured_radius**2 for each in flocs])
    if found := perimeter_dimension(areas, perimeters):
        lines.append("perimeter-based fractal dimension D_f2 {:.3f} ± {:.3f} (95 %)".format(*found))
    return lines + coarse_lines(entries)
