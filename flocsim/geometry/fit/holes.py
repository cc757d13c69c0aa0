"""The holes of a floc in a fit: which are kept, with how many vertices, and where those go.

A hole is a ring of the core, and what the disk leaves of it: the ring reaches into the floc by the
spheroradius. It is searched like the outline, on the pixels around it, but with what lies outside
of it covered.
"""

from collections.abc import Sequence

import attrs
import numpy as np

from flocsim.geometry.fit.coverage import crossed_and_near
from flocsim.geometry.fit.search import COARSE, FINE, searched
from flocsim.geometry.fit.simple import is_simple
from flocsim.geometry.fit.starts import telling_points, trace_outline
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


def ring_around(inside: np.ndarray, count: int, reach: float) -> np.ndarray:
    """``count`` points that tell most of what lies within a reach [px] of a hole's pixels."""
    from scipy.ndimage import distance_transform_edt

    return telling_points(trace_outline(distance_transform_edt(~inside) <= reach), count)
