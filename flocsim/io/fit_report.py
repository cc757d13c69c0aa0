"""What is told of flocs: a line on every picture, tables of errors and regions, and of a
population what is published, D10, D50, D90 and its fractal dimension.
"""

import csv
import io
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np

from flocsim.errors import visible
from flocsim.geometry.shapes.outline import ShapeMeasures
from flocsim.io.images.pictures import Segmentation
from flocsim.io.images.regions import Region
from flocsim.io.shape_library import MEASURE_COLUMNS, ShapeEntry
from flocsim.io.terminal import aligned

CLASS_LIMIT = 5.0
"""r_eq [px] that parts the two size classes of the table (the paper's 5 µm at 1 µm a pixel)."""

MOST_ERROR = 5.0
"""RE [%] above which the form of a floc is lost on its outline of so few vertices."""

LEAST_FALL, MOST_FALL = 1.0, 2.0
"""Powers of N by which RE falls at least and at most: of ragged and of smooth outlines."""

COLUMNS = (
    "picture", "floc", "left_out_because", "x_px", "y_px", "area_px", "r_eq_px", "r_eq_m",
    "blur_px", "level", "r_eq_low_px", "r_eq_high_px", "parted", "weight",
    "perimeter_px", "aspect_ratio", "circularity", "solidity", "feret_max_px", "feret_min_px",
)  # fmt: skip

SHARES = (0.1, 0.5, 0.9)
"""Of the flocs, or of their volume, that are smaller than D10, D50 and D90."""

FEWEST = 3
"""Flocs of different sizes from which on a slope has an error."""


def plural(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def picture_line(name: str, found: Segmentation, fitted: int) -> str:
    """One line on a picture's Segmentation: flocs, rejected regions by reason, foreground."""
    parts = [plural(len(found.regions), f"{found.flocs} floc")]
    if fitted < len(found.regions):
        parts.append(f"the {fitted} largest fitted")
    reasons = [f"{count} {reason}" for reason, count in found.rejected_by_reason().items()]
    if reasons:
        *others, last = reasons
        listed = f"{', '.join(others)} and {last}" if others else last
        parts.append(f"rejected {listed}")
    if found.left_whole:
        parts.append(f"{found.left_whole} with necks not separated (--neck)")
    sure = [each.parted for each in found.regions if each.parted == each.parted]
    if sure:
        low, high = (f"{value:.2f}" for value in (min(sure), max(sure)))
        how = low if low == high else f"{low} to {high}"
        parts.append(f"{len(sure)} separated at necks, confidence {how} (--neck 0 joins them)")
    if found.annotated:
        parts.append("a scale bar or its label left out")
    about = f"foreground {100 * found.foreground_share:.2f} %"
    if found.threshold == found.threshold:
        about += f", threshold {found.threshold:.4g}"
    alarms = "".join(f"; CHECK THE OVERLAY: {alarm}" for alarm in found.alarms)
    return f"{visible(name, keep='')}: {', '.join(parts)}; {about}{alarms}"


def warn_of_coarse(name: str, regions: Iterable[Region], radii: Iterable[float]) -> None:
    """A line on stderr for every spheroradius not below r_eq of some flocs (paper, section 3.2)."""
    for radius in radii:
        coarse = sum(region.equivalent_radius <= radius for region in regions)
        if coarse:
            print(
                f"flocsim: {visible(name, keep='')}: the spheroradius of {radius:g} px is not "
                f"below r_eq of {plural(coarse, 'floc')}, whose outline the fit cannot follow; use "
                "a smaller --radius",
                file=sys.stderr,
            )


def coarse_line(errors: Mapping[str, Mapping[int, float]]) -> str:
    """What to say where the largest N is too small for flocs; "" where it is not.

    errors: {floc: {N: RE [%]}}. The N that would do follows from how RE fell from the N before.
    """
    worst, needed, over = "", 0.0, 0
    most = max((n for found in errors.values() for n in found), default=1)
    for name, found in errors.items():
        if most == 1 or found[most] <= MOST_ERROR:
            continue
        over += 1
        before = max((n for n in found if 1 < n < most), default=0)
        fall = LEAST_FALL
        if before:
            fall = math.log(max(found[before] / found[most], 1.0)) / math.log(most / before)
        fall = min(max(fall, LEAST_FALL), MOST_FALL)
        wanted = most * (found[most] / MOST_ERROR) ** (1.0 / fall)
        if wanted > needed:
            worst, needed = name, wanted
    if not over:
        return ""
    of = "the floc" if len(errors) == 1 else f"{over} of {len(errors)} flocs"
    return (
        f"N = {most} is too small for {of}: RE is above {MOST_ERROR:g} %, and "
        f"{errors[worst][most]:.3g} % for {visible(worst, keep='')}, which needs about "
        f"{math.ceil(needed)} vertices"
    )


def errors_of(entries: Sequence[ShapeEntry]) -> dict[str, dict[int, float]]:
    """{floc: {N: RE [%]}} at the smallest spheroradius, of flocs that are larger than that: what a
    disk cannot follow, more vertices do not mend."""
    least = min((each.spheroradius for each in entries), default=0.0)
    return {
        each.floc_id: {count: fit.relative_error for count, fit in each.fits.items()}
        for each in entries if each.spheroradius == least < each.equivalent_radius
    }  # fmt: skip


def format_errors(entries: Sequence[ShapeEntry]) -> str:
    """A table of the mean relative error [%] of ShapeEntries by N and size class, for each r."""
    lines = []
    for radius in sorted({entry.spheroradius for entry in entries}):
        members = [entry for entry in entries if entry.spheroradius == radius]
        small = [entry for entry in members if entry.equivalent_radius <= CLASS_LIMIT]
        large = [entry for entry in members if entry.equivalent_radius > CLASS_LIMIT]
        below, above = (f"r_eq {sign} {CLASS_LIMIT:g} px" for sign in ("<=", ">"))
        classes = {below: small, above: large, "all": members}
        rows = [["N", *(f"{name} ({len(flocs)})" for name, flocs in classes.items())]]
        for count in members[0].fits:
            errors = ([e.fits[count].relative_error for e in each] for each in classes.values())
            means = (f"{sum(each) / len(each):.2f}" if each else "-" for each in errors)
            rows.append(["1 (circle)" if count == 1 else str(count), *means])
        lines += [
            "mean relative error [%] by vertices and size class (number of flocs), "
            f"r = {radius:g} px", *aligned(rows),
        ]  # fmt: skip
    return "\n".join(lines)


def summary_text(pictures: Sequence[Any]) -> str:
    """The table of all regions as CSV: flocs with their shape measures and RE [%] for every r [px]
    and N, others with why.

    pictures: with name, pixel_size [m], found (Segmentation), measures {label: ShapeMeasures} of
    found.regions, and fits {label: [{r: {N: Fit}}, …]} of those of them that are fitted.
    """
    every = (fits[0] for picture in pictures for fits in picture.fits.values())
    pairs = [(radius, count) for radius, fits in next(every, {}).items() for count in fits]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([*COLUMNS, *(f"re_percent_r{r:g}_N{n}" for r, n in pairs)])
    for picture in pictures:
        for region in picture.found.regions:
            fits = picture.fits.get(region.label)
            why = "" if fits else "not among the largest"
            found = picture.measures[region.label]
            row = [picture.name, region.label, why, *_facts(region, picture.pixel_size),
                   *(f"{getattr(found, name):.5g}" for name in MEASURE_COLUMNS)]  # fmt: skip
            errors = [f"{fits[0][r][n].relative_error:.4f}" if fits else "" for r, n in pairs]
            table.writerow([*row, *errors])
        for region in picture.found.rejected:
            row = [picture.name, region.label, region.reason, *_facts(region, picture.pixel_size)]
            table.writerow([*row, *[""] * (len(MEASURE_COLUMNS) + len(pairs))])
    return text.getvalue()


def _facts(region, pixel_size):
    x, y = region.centroid
    radius = region.equivalent_radius
    low, high = ("", "") if region.band is None else (f"{r:.3f}" for r in region.radius_band)
    told = ("" if value != value else f"{value:.{digits}g}"
            for value, digits in ((region.blur, 3), (region.level, 4)))  # fmt: skip
    parted = "" if region.parted != region.parted else f"{region.parted:.2f}"
    size = region.area, f"{radius:.3f}", f"{radius * pixel_size:.4g}"
    return f"{x:.2f}", f"{y:.2f}", *size, *told, low, high, parted, f"{region.weight:.4g}"


class Slope(NamedTuple):
    """A fractal dimension and half its 95 % interval [-]."""

    value: float
    error: float


def one_each(entries: Sequence[ShapeEntry]) -> list[ShapeEntry]:
    """The entries at the smallest spheroradius: every floc once."""
    first = min(entry.spheroradius for entry in entries)
    return [entry for entry in entries if entry.spheroradius == first]


def measures_in(entry: ShapeEntry) -> ShapeMeasures:
    """The measures of a floc [m]: those of its picture, or of its finest fit where a library of
    before has none."""
    if entry.measures is None:
        return entry.fits[max(entry.fits)].shape.measures
    lengths = {name: getattr(entry.measures, name) * entry.pixel_size
               for name in ("perimeter", "feret_max", "feret_min")}  # fmt: skip
    return attrs.evolve(entry.measures, **lengths)


def diameters_at(
    diameters: np.ndarray, by_volume: bool, shares: Sequence[float] = SHARES
) -> np.ndarray:
    """Diameters below which these shares of the flocs lie, or of their volume ∝ D³ (k,).

    Half of a floc counts as smaller than itself, and between flocs D goes linearly with the share:
    by number D50 is the median. Beyond the outermost flocs D is theirs.
    """
    ordered = np.sort(np.asarray(diameters, float))
    weights = ordered**3 if by_volume else np.ones(ordered.size)
    below = (np.cumsum(weights) - 0.5 * weights) / weights.sum()
    return np.interp(shares, below, ordered)


def perimeter_dimension(areas: np.ndarray, perimeters: np.ndarray) -> Slope | None:
    """The perimeter-based fractal dimension D_f2 of a population: P ∝ A^(D_f2/2), by least squares
    of ln P on ln A (n,) each; None for fewer than FEWEST flocs of different areas.

    1 for outlines that are scaled copies of each other, towards 2 where larger ones are the more
    ragged. Source: B. B. Mandelbrot, The Fractal Geometry of Nature (1982), ch. 12.
    """
    from scipy.special import stdtrit

    x, y = np.log(areas), np.log(perimeters)
    if len(np.unique(x)) < FEWEST:
        return None
    x, y, free = x - x.mean(), y - y.mean(), len(x) - 2
    slope = np.sum(x * y) / np.sum(x * x)
    error = np.sqrt(np.sum((y - slope * x) ** 2) / (free * np.sum(x * x)))
    return Slope(2.0 * float(slope), 2.0 * float(stdtrit(free, 0.975) * error))


def population_lines(entries: Sequence[ShapeEntry]) -> list[str]:
    """D10, D50, D90 and D_f2 of some flocs, in words."""
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
    if (found := perimeter_dimension(areas, perimeters)) is not None:
        lines.append(
            f"perimeter-based fractal dimension D_f2 {found.value:.3f} ± {found.error:.3f} (95 %)"
        )
    return lines
