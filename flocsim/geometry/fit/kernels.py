"""The kernels of a fit, compiled on first use and kept on disk (flocsim.compiler.composer)."""

from functools import cache

import numpy as np

from flocsim.compiler.composer import compose
from flocsim.geometry.fit.coverage import cover
from flocsim.geometry.fit.outline import ring_inside
from flocsim.geometry.fit.pattern import PLAIN, pattern_search
from flocsim.geometry.fit.simple import simple_inset

ANGLES = np.pi / 4.0 * np.arange(8)
DIRECTIONS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
NO_STEPS = np.zeros(0)


@cache
def compiled(kernel):
    """A kernel of flocsim.geometry.fit_*, compiled."""
    return compose(kernel, {}, allocates=True)


def searched(mask, start, radius, steps, weights=PLAIN, active=None):
    """pattern_search of a start, which is left as it is: (vertices, objective)."""
    vertices = np.array(start)
    active = np.ones(len(vertices), bool) if active is None else active
    search = compiled(pattern_search)
    return vertices, int(search(mask, vertices, radius, DIRECTIONS, steps, active, weights))


def count_errors(mask, vertices, radius):
    """V of the swept polygon against the mask: a search without steps."""
    return searched(mask, vertices, radius, NO_STEPS)[1]


def covered(shape, vertices, radius):
    """The pixels (h, w) bool whose centres the swept polygon covers."""
    odd, near = compiled(cover)(np.array(vertices), radius, shape)
    return odd | (near > 0)


def is_simple(vertices):
    """Whether no edges cross or nearly touch: simple_inset leaves such a polygon as it is."""
    drawn = np.array(vertices)
    return bool(compiled(simple_inset)(drawn, 0.0)) and np.array_equal(drawn, vertices)


def inset(points, mask, depth):
    """A simple polygon through the points, drawn in by `depth` [px] or less where it must.

    Points whose polygon is not simple are reordered, or a ring inside the mask takes their place.
    """
    drawn = np.array(points)
    if compiled(simple_inset)(drawn, float(depth)):
        return drawn
    drawn = ring_inside(mask, len(points))
    compiled(simple_inset)(drawn, float(depth))
    return drawn


def padded(mask, count, radius):
    """The mask with room around it for the swept polygon, and the width of that margin [px]."""
    margin = int(np.ceil(radius)) + 6 + count // 100
    return np.pad(mask, margin), margin
