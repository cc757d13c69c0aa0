"""The holes of a floc in a fit: which are kept, with how many vertices, and where those go.

A hole is a ring of the core, and what the disk leaves of it: the ring reaches into the floc by the
spheroradius. It is searched like the outline, on the pixels around it, but with what lies outside
of it covered.
"""

from collections.abc import Sequence

import attrs
import numpy as np

from flocsim.geometry.fit.coverage import compiled, crossed_and_near
from flocsim.geometry.fit.search import COARSE, DIRECTIONS, FINE, hole_search
from flocsim.geometry.fit.simple import is_simple
from flocsim.geometry.fit.starts import even_points, telling_points, trace_outline
from flocsim.geometry.shapes.outline import simplicity_fault

FEWEST_PIXELS = 9
"""A hole of fewer pixels is noise."""

FEWEST_VERTICES = 3
"""Corners of a hole."""

OUTLINE_SHARE = 0.5
"""Holes are kept as long as this share of the vertices is left for the outline."""

REACHES = (1.0, 0.5, 0.0)
"""Spheroradii by which a ring is tried to reach into the floc, where walls are thin."""


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
    margin = int(np.ceil(2.0 * radius)) + 8
    inside = np.pad(hole.mask, margin)
    open_pixels = int(hole.mask.sum())
    best, least = None, open_pixels
    for reach in REACHES:
        ring = ring_around(inside, hole.vertices, reach * radius)
        if not is_simple(ring):
            continue
        trials = [ring]
        if search:
            trials.insert(0, searched_hole(~inside, ring, radius, weights))
        for trial in trials:
            placed = (trial - margin) * (1.0, -1.0)
            if simplicity_fault(rings[0], [*rings[1:], placed]) is not None:
                continue
            wrong, outside = wrong_in_hole(~inside, trial, radius)
            if wrong < least and not (weights[1] and outside):
                best, least = placed, wrong
        if best is not None:
            break
    return best


def ring_around(inside: np.ndarray, count: int, reach: float) -> np.ndarray:
    """``count`` points that tell most of what lies within a reach [px] of a hole's pixels."""
    from scipy.ndimage import distance_transform_edt

    wide = distance_transform_edt(~inside) <= reach
    outline = trace_outline(wide)
    points = outline if len(outline) >= 2 * count else even_points(outline, 2 * count)
    return telling_points(points, count)


def searched_hole(
    mask: np.ndarray, ring: np.ndarray, radius: float, weights: tuple[int, int]
) -> np.ndarray:
    """The ring around a hole after the search for the least V; ``mask``: all but the hole."""
    vertices, active = np.array(ring), np.ones(len(ring), bool)
    steps = np.append(COARSE[2:], FINE[1:])
    compiled(hole_search)(mask, vertices, radius, DIRECTIONS, steps, active, weights)
    return vertices


def wrong_in_hole(mask: np.ndarray, ring: np.ndarray, radius: float) -> tuple[int, int]:
    """(V, pixels covered outside of the mask) around one hole; ``mask``: all but the hole."""
    inside, near = crossed_and_near(mask.shape, ring, radius)
    solid = ~inside | near
    return int(np.count_nonzero(solid != mask)), int(np.count_nonzero(solid & ~mask))


def wrong_with_holes(
    mask: np.ndarray, rings: Sequence[np.ndarray], radius: float
) -> tuple[int, int]:
    """(V, pixels covered outside of the mask) of a shape of several rings [px], y up."""
    points = np.concatenate(rings) * (1.0, -1.0)
    beyond = np.maximum(-points.min(axis=0), points.max(axis=0) - mask.shape[::-1])
    margin = max(0, int(np.ceil(beyond.max() + radius))) + 2
    around = np.pad(mask, margin)
    inside, close = np.zeros(around.shape, bool), np.zeros(around.shape, bool)
    for ring in rings:
        odd, near = crossed_and_near(around.shape, ring * (1.0, -1.0) + margin, radius)
        inside ^= odd
        close |= near
    solid = inside | close
    return int(np.count_nonzero(solid != around)), int(np.count_nonzero(solid & ~around))
