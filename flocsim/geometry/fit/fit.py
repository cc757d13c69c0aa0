"""Pixel masks → spheropolygons: the fit of the paper's section 2.3, and of holes.

A hole is a ring of the core, and what the disk leaves of it: the ring reaches into the floc by the
spheroradius. It is searched like the outline, on the pixels around it, but with what lies outside
of it covered.
"""

import warnings
from collections.abc import Sequence

import attrs
import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import ShapeError, UsageError
from flocsim.fields import is_number
from flocsim.geometry.fit.coverage import crossed_and_near, padded, wrong_pixels
from flocsim.geometry.fit.search import (
    AREA,
    COARSE,
    FINE,
    INSCRIBED,
    INSIDE,
    PLAIN,
    even_start,
    paper_fit,
    pattern_fit,
    searched,
    telling_points,
    trace_outline,
)
from flocsim.geometry.fit.simple import is_simple, simple_inset
from flocsim.geometry.shapes.cores import Part, Parts
from flocsim.geometry.shapes.outline import simplicity_fault
from flocsim.geometry.shapes.shape import Shape, Sphere
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon, parts_factor

METHODS = ("pattern", "paper", "even")

SLACK = 0.01
"""Share of the mask's area by which the swept area may be off before the outline is settled."""


FEWEST_PIXELS = 9
"""A hole of fewer pixels is noise."""

FEWEST_VERTICES = 3
"""Corners of a hole."""

OUTLINE_SHARE = 0.5
"""Holes are kept as long as this share of the vertices is left for the outline."""

REACHES = (1.0, 0.5, 0.0)
"""Spheroradii by which a ring is tried to reach into the floc, where walls are thin."""


@attrs.frozen(eq=False)
class Fit:
    """A shape fitted to a mask.

    shape: SpheroPolygon, or Sphere for one vertex, in pixels around its own centroid.
    vertices: (N, 2) [px] in the mask's frame, x right and y **up**: the centre of the mask's pixel
    (row i, column j) is (j, −i), so that the body looks as it does in the picture; those of the
    outline first, then those of holes, ``hole_sizes`` of each.
    radius: spheroradius [px].  wrong_pixels: V, the pixels where shape and mask differ.
    relative_error: RE = 100 V/P(I) [%], P(I) the mask's pixels (paper, eq. 2).
    """

    shape: Shape
    vertices: np.ndarray
    radius: float
    wrong_pixels: int
    relative_error: float
    hole_sizes: tuple[int, ...] = ()

    @property
    def parts(self) -> Parts:
        """The vertices as one part, [px] in the mask's frame."""
        ends = np.cumsum([len(self.vertices) - sum(self.hole_sizes), *self.hole_sizes])
        return (Part(tuple(np.split(self.vertices, ends[:-1])), self.radius),)

    def scaled(self, pixel_size: float) -> Shape:
        """The shape in metres, for pixels of `pixel_size` [m]; UsageError unless positive."""
        if not is_number(pixel_size) or pixel_size <= 0:
            raise UsageError(f"the pixel size must be a length above 0 m, found {pixel_size!r}")
        return self.shape.scaled(pixel_size)


def fit_mask(
    mask: ArrayLike,
    *,
    vertices: int,
    radius: float = 1.0,
    method: str = "pattern",
    preserve_area: bool = False,
    inscribed: bool = False,
    holes: bool = False,
) -> Fit:
    """Fit a spheropolygon to a floc's mask: minimise the pixels where the two differ.

    A pixel belongs to the spheropolygon if its centre lies in the core polygon or within the
    spheroradius of its boundary.

    mask: (h, w) bool or 0/1, one 8-connected region; vertices: N ≥ 1; radius: spheroradius [px].
    method: "pattern" starts from the best N of points along the outline, moves all vertices at
    once while V falls, anneals them, and moves one after the other by shrinking steps
    (1 … 0.25 px) while V falls; more vertices than an outline has room for, one in some 2 px, lie
    on edges of the fit of fewer; "paper" lets the vertices move as damped
    particles down the gradient of V (paper, section 2.3), from even spacing; "even" spaces N points
    evenly on the outline, drawn in by the radius, and leaves them there (the plain baseline).
    preserve_area: the swept area is exactly the mask's; "pattern" then also minimises the
    difference of the pixel counts.  inscribed: no pixel outside of the mask is covered ("pattern"
    only); the shape is then smaller than the floc.  holes: the N vertices go to the outline and to
    the holes of the mask, the largest ones first, as long as half of them are left for the outline;
    a hole that the disk would close stays covered, and all where that makes V less.
    N = 1 is the circle of the mask's area about its centroid; all other options are then ignored.

    Returns a Fit, the same for the same input; its polygon is simple.  By plain V,
    "pattern" and "paper" never end above "even".  Warns if radius ≥ r_eq (paper, section 3.2:
    "condition r < r_eq should be satisfied").  Raises ShapeError for a mask that is not one region
    or too thin to inscribe a shape in, UsageError for a wrong option.
    """
    floc = _require_one_region(mask)
    if not isinstance(vertices, int | np.integer) or isinstance(vertices, bool) or vertices < 1:
        raise UsageError(f"vertices must be a whole number of at least 1, found {vertices!r}")
    if not is_number(radius) or radius <= 0:
        raise UsageError(f"the spheroradius must be a number of pixels above 0, found {radius!r}")
    if method not in METHODS:
        raise UsageError(f"method must be {' or '.join(map(repr, METHODS))}, found {method!r}")
    if vertices == 1:
        return _equal_area_circle(floc)
    if inscribed and (method != "pattern" or preserve_area):
        raise UsageError(
            "an inscribed fit needs method='pattern' and preserve_area=False, found "
            f"{method!r} and {preserve_area}"
        )
    equivalent = np.sqrt(floc.sum() / np.pi)
    if radius >= equivalent and preserve_area:
        raise UsageError(
            f"the area cannot be preserved: a single disk with the spheroradius {radius:g} px is "
            f"larger than the floc of r_eq = {equivalent:.2f} px; use r < r_eq"
        )
    if radius >= equivalent:
        warnings.warn(
            f"spheroradius {radius:g} px is not below the floc's r_eq = {equivalent:.2f} px: "
            "the fit cannot follow its outline; use r < r_eq",
            stacklevel=2,
        )
    options = float(radius), method, preserve_area, inscribed
    found = find_holes(floc, int(vertices)) if holes else []
    if not found:
        return _fit_polygon(floc, int(vertices), *options)
    fit = _fit_with_holes(floc, found, int(vertices), *options)
    if inscribed:
        return fit
    plain = _fit_polygon(floc, int(vertices), *options)
    return plain if plain.wrong_pixels < fit.wrong_pixels else fit


def _require_one_region(mask: object) -> np.ndarray:
    """The mask as a bool array; ShapeError unless it holds just one 8-connected region."""
    from scipy.ndimage import label

    mask = np.asarray(mask)
    if mask.ndim != 2 or not np.isin(mask, (0, 1)).all():
        raise ShapeError(f"a mask is an (h, w) array of 0 and 1, found shape {mask.shape}")
    regions = label(mask, structure=np.ones((3, 3)))[1]
    if regions != 1:
        raise ShapeError(f"a mask must hold one floc, found {regions} separate regions")
    return mask.astype(bool, order="C")


def _equal_area_circle(mask):
    rows, columns = np.nonzero(mask)
    radius = float(np.sqrt(mask.sum() / np.pi))
    vertices = np.array([[columns.mean(), -rows.mean()]])
    wrong, _ = wrong_pixels(mask, [vertices], radius)
    return Fit(Sphere(radius), vertices, radius, wrong, 100.0 * wrong / float(mask.sum()))


def _fit_polygon(mask, count, radius, method, preserve_area, inscribed):
    room, margin = padded(mask, count, radius)
    # Points are x and y-down here [px], as the pixels are.
    if method == "pattern":
        weights = INSCRIBED if inscribed else AREA if preserve_area else PLAIN
        points = pattern_fit(room, count, radius, weights)
    else:
        points = even_start(room, count, radius)
        points = paper_fit(room, points, radius)[0] if method == "paper" else points
    vertices = (points - margin) * (1.0, -1.0)
    shape = SpheroPolygon(vertices, radius)
    off = shape.area - mask.sum()
    if method == "pattern" and not (inscribed or preserve_area) and abs(off) > SLACK * mask.sum():
        vertices, before = _settled(mask, vertices, radius, off), vertices
        shape = shape if vertices is before else SpheroPolygon(vertices, radius)
    return _fit_of(mask, [vertices], shape, radius, preserve_area, inscribed)


def _fit_with_holes(mask, holes, count, radius, method, preserve_area, inscribed):
    """The Fit of a mask whose ``holes`` are kept, as far as they lower V."""
    whole = mask.copy()
    for hole in holes:
        whole |= hole.mask
    left = count - sum(hole.vertices for hole in holes)
    outer = _fit_polygon(whole, left, radius, method, False, inscribed)
    weights = INSIDE if inscribed else AREA if preserve_area else PLAIN
    rings = [outer.vertices]
    for hole in holes:
        # Rings that go round clockwise where y is up.
        ring = hole_ring(hole, radius, weights, method != "even", rings)
        if ring is not None:
            rings.append(ring)
    spare = count - sum(map(len, rings))
    if spare:
        # What a hole has not needed, the outline has.
        outer = _fit_polygon(whole, left + spare, radius, method, False, inscribed)
        if simplicity_fault(outer.vertices, rings[1:]) is None:
            rings[0] = outer.vertices
    shape = SpheroPolygon(rings[0], radius, holes=rings[1:])
    return _fit_of(mask, rings, shape, radius, preserve_area, inscribed)


def _fit_of(mask, rings, shape, radius, preserve_area, inscribed):
    """The Fit of a shape of an outline and holes, of the mask's area if that is asked for."""
    if preserve_area:
        factor = parts_factor(shape.parts, float(mask.sum()))
        rings = [ring * factor + (1.0 - factor) * shape.centroid for ring in rings]
        shape = SpheroPolygon(rings[0], radius, holes=rings[1:])
    vertices = np.concatenate(rings)
    wrong, outside = wrong_pixels(mask, rings, radius)
    if inscribed and outside:
        with_holes = " with holes" if len(rings) > 1 else ""
        raise ShapeError(
            f"no shape of {len(vertices)} vertices and spheroradius {radius:g} px{with_holes} was "
            f"found that lies inside the floc ({outside} pixels outside); use a smaller "
            "spheroradius"
        )
    error = 100.0 * wrong / float(mask.sum())
    return Fit(shape, vertices, radius, wrong, error, tuple(len(ring) for ring in rings[1:]))


def _settled(mask, vertices, radius, excess):
    """The outline moved towards the mask's area, of which it has an ``excess`` [px²], as far as V
    does not rise.

    Pixel centres leave an outline about half a pixel of play; V does not say where in it to be.
    """
    points = vertices * (1.0, -1.0)
    wrong, _ = wrong_pixels(mask, [vertices], radius)
    perimeter = np.hypot(*(np.roll(points, -1, axis=0) - points).T).sum() + 2.0 * np.pi * radius
    for share in (1.0, 0.5, 0.25):
        moved = np.array(points)
        simple = simple_inset(moved, share * excess / perimeter)
        if simple and wrong_pixels(mask, [moved * (1.0, -1.0)], radius)[0] <= wrong:
            return moved * (1.0, -1.0)
    return vertices


@attrs.frozen(eq=False)
class Hole:
    """A hole of a mask: its pixels (h, w) bool, and the vertices that it gets."""

    mask: np.ndarray
    vertices: int


def find_holes(mask: np.ndarray, count: int) -> list[Hole]:
    """The holes of a mask that are kept by a fit of ``count`` vertices, the largest first; each has
    vertices in proportion to its outline."""
    from scipy.ndimage import label

    # A floc is 8-connected, what is around it and in it 4-connected.
    around, many = label(np.pad(~mask, 1, constant_values=True))
    sizes = np.bincount(around.ravel(), minlength=many + 1)
    names = [k for k in range(1, many + 1) if k != around[0, 0] and sizes[k] >= FEWEST_PIXELS]
    names.sort(key=lambda k: (-sizes[k], k))
    masks = [around == k for k in names]
    lengths = [len(trace_outline(each)) for each in masks]
    total = len(trace_outline(np.pad(mask, 1))) + sum(lengths)
    found, left = [], int(count * (1.0 - OUTLINE_SHARE))
    for each, length in zip(masks, lengths, strict=True):
        own = max(FEWEST_VERTICES, round(count * length / total))
        if own <= left:
            found.append(Hole(each[1:-1, 1:-1], own))
            left -= own
    return found


def hole_ring(
    hole: Hole, radius: float, weights: tuple[int, int], search: bool,
    rings: Sequence[np.ndarray],
) -> np.ndarray | None:  # fmt: skip
    """The ring (k, 2) [px], y up, of a hole, beside the outline and other ``rings``; None where
    none makes V less: the disk would close it, or walls are too thin for it."""
    from scipy.ndimage import distance_transform_edt

    margin = int(np.ceil(2.0 * radius)) + 8
    inside = np.pad(hole.mask, margin)
    away = distance_transform_edt(~inside)
    best, least = None, int(hole.mask.sum())
    for reach in REACHES:
        # The points that tell most of what lies within the reach of the hole's pixels.
        ring = telling_points(trace_outline(away <= reach * radius), hole.vertices)
        if not is_simple(ring):
            continue
        trials = [ring]
        if search:
            steps = np.append(COARSE[2:], FINE[1:])
            trials.insert(0, searched(~inside, ring, radius, steps, weights, hole=True)[0])
        for trial in trials:
            placed = (trial - margin) * (1.0, -1.0)
            if simplicity_fault(rings[0], [*rings[1:], placed]) is not None:
                continue
            crossed, near = crossed_and_near(inside.shape, trial, radius)
            solid = ~crossed | near
            wrong, outside = int(np.count_nonzero(solid == inside)), np.any(solid & inside)
            if wrong < least and not (weights[1] and outside):
                best, least = placed, wrong
        if best is not None:
            break
    return best
