"""What is published of a population of flocs: D10, D50, D90, and its fractal dimension."""

from collections.abc import Sequence
from typing import NamedTuple

import attrs
import numpy as np

from flocsim.geometry.shapes.outline import ShapeMeasures
from flocsim.io.shapes.library import ShapeEntry

SHARES = (0.1, 0.5, 0.9)
"""Of the flocs, or of their volume, that are smaller than D10, D50 and D90."""

FEWEST = 3
"""Flocs of different sizes from which on a slope has an error."""


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
