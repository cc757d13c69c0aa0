"""The outline of a pixel mask, and choices of N points on it that a fit can start from."""

import numpy as np

from flocsim.errors import ShapeError

HEADINGS = ((0, 1), (1, 0), (0, -1), (-1, 0))
"""Walks along pixel edges as (rows, columns): right, down, left, up, each a right turn on."""


def trace_outline(mask):
    """The outer outline of a mask's first region, (M, 2) as x = column, y = row.

    The points are the middles of the pixel edges between the region and its outside, in order
    around the region, which is taken 8-connected.  Their polygon is simple.  `mask` has a margin
    of at least one empty pixel.
    """
    start = row, column = tuple(int(place[0]) for place in np.nonzero(mask))
    inside = mask.tolist()
    heading, middles = 0, []
    while True:
        down, right = HEADINGS[heading]
        middles.append((column - 0.5 + 0.5 * right, row - 0.5 + 0.5 * down))
        row, column = row + down, column + right
        heading = _turn(inside, row, column, heading)
        if (row, column) == start and heading == 0:
            return np.array(middles)


def _turn(inside, row, column, heading):
    """The heading after the upper left corner of pixel (row, column), the region on the right."""
    down, right = HEADINGS[heading]
    left_row, left_column = _ahead(row, column, down, right, -1)
    right_row, right_column = _ahead(row, column, down, right, 1)
    if inside[left_row][left_column]:
        return (heading - 1) % 4
    return heading if inside[right_row][right_column] else (heading + 1) % 4


def _ahead(row, column, down, right, hand):
    """The pixel ahead of a corner, to the left (hand −1) or the right (hand 1) of the heading."""
    beside_down, beside_right = hand * right, -hand * down
    return (
        row + (down + beside_down - 1) // 2,
        column + (right + beside_right - 1) // 2,
    )


def even_points(outline, count, shift=0.0):
    """`count` points evenly spaced along the closed outline; `shift` in spacings moves them on."""
    closed = np.vstack([outline, outline[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    places = (np.arange(count) + shift) / count * along[-1]
    return np.column_stack([np.interp(places, along, axis) for axis in closed.T])


def ring_inside(mask, count):
    """A regular polygon around the deepest pixel of the mask: a start that is always simple."""
    from scipy.ndimage import distance_transform_edt

    depth = distance_transform_edt(mask)
    row, column = np.unravel_index(np.argmax(depth), depth.shape)
    radius = max(0.5 * depth[row, column], 1.0, 0.01 * count)
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([column + radius * np.cos(angles), row + radius * np.sin(angles)])


def require_one_region(mask):
    """The mask as a bool array; ShapeError unless it holds just one 8-connected region."""
    from scipy.ndimage import label

    mask = np.asarray(mask)
    if mask.ndim != 2 or not np.isin(mask, (0, 1)).all():
        raise ShapeError(f"a mask is an (h, w) array of 0 and 1, found shape {mask.shape}")
    regions = label(mask, structure=np.ones((3, 3)))[1]
    if regions != 1:
        raise ShapeError(f"a mask must hold one floc, found {regions} separate regions")
    return mask.astype(bool)
