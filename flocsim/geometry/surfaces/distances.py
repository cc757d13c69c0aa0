"""Distances of pieces of two outlines, by the parts of the cores that they are offsets of.

Negative where the outlines overlap. A piece is seen through a Placed: its numbers in the frame of
the other body.
"""

import math
from typing import NamedTuple

import flocsim.arrays as at


class Pose(NamedTuple):
    """Where a body lies in the frame of another: x, y [m], cosine and sine of its angle."""

    x: float
    y: float
    cosine: float
    sine: float


class Placed(NamedTuple):
    """A piece in some frame: the columns of ``pieces``."""

    x: float
    y: float
    way_x: float
    way_y: float
    size: float
    bend: float
    middle_x: float
    middle_y: float
    extent: float
    inward: float


def piece_at(pieces, row):
    """A piece in the frame of its own body."""
    return Placed(
        pieces[row, at.PLACE_X], pieces[row, at.PLACE_Y],
        pieces[row, at.WAY_X], pieces[row, at.WAY_Y],
        pieces[row, at.SIZE], pieces[row, at.BEND],
        pieces[row, at.MIDDLE_X], pieces[row, at.MIDDLE_Y],
        pieces[row, at.EXTENT], pieces[row, at.INWARD],
    )  # fmt: skip


def placed(pieces, row, pose):
    """A piece of a body that lies in a Pose."""
    x, y, c, s = pose
    own = piece_at(pieces, row)
    return Placed(
        x + c * own.x - s * own.y, y + s * own.x + c * own.y,
        c * own.way_x - s * own.way_y, s * own.way_x + c * own.way_y,
        own.size, own.bend,
        x + c * own.middle_x - s * own.middle_y, y + s * own.middle_x + c * own.middle_y,
        own.extent, own.inward,
    )  # fmt: skip


def core_of(piece):
    """(middle, half the way from it to either end) of the core of a piece, (x, y), (x, y) [m]."""
    if piece.bend > 0.0:
        return (piece.x, piece.y), (0.0, 0.0)
    # The outward normal is the tangent turned clockwise.
    x = piece.x - piece.inward * piece.way_y
    y = piece.y + piece.inward * piece.way_x
    return (x, y), (piece.size * piece.way_x, piece.size * piece.way_y)


def place_beside(x, y, middle, half):
    """Where on a core, from −1 to 1, it is nearest to a point."""
    squared = half[0] * half[0] + half[1] * half[1]
    if squared == 0.0:
        return 0.0
    along = ((x - middle[0]) * half[0] + (y - middle[1]) * half[1]) / squared
    return min(max(along, -1.0), 1.0)


def from_core(x, y, piece):
    """(dx, dy) to a point from where the core of a piece is nearest to it [m], and whether that is
    an end of the core."""
    middle, half = core_of(piece)
    place = place_beside(x, y, middle, half)
    dx, dy = x - middle[0] - place * half[0], y - middle[1] - place * half[1]
    return dx, dy, piece.bend > 0.0 or abs(place) == 1.0


def distance_to(x, y, piece):
    """How far a point is outside of what lies behind a piece [m], negative inside of it."""
    dx, dy, _ = from_core(x, y, piece)
    return math.sqrt(dx * dx + dy * dy) - piece.inward


def beside_end(end, middle, half, middle_2, half_2):
    """(squared distance, x, y of an end of a core, x, y on the other one) where that is nearest."""
    x, y = middle[0] + end * half[0], middle[1] + end * half[1]
    place = place_beside(x, y, middle_2, half_2)
    x_2, y_2 = middle_2[0] + place * half_2[0], middle_2[1] + place * half_2[1]
    return (x - x_2) * (x - x_2) + (y - y_2) * (y - y_2), x, y, x_2, y_2


def between_cores(one, other):
    """(squared distance, x, y on the one's core, x, y on the other's) where two are nearest."""
    (middle, half), (middle_2, half_2) = core_of(one), core_of(other)
    # The core of an arc is a point.
    if one.bend > 0.0:
        return beside_end(0.0, middle, half, middle_2, half_2)
    least = math.inf
    x, y, x_2, y_2 = 0.0, 0.0, 0.0, 0.0
    for end in (-1.0, 1.0):
        if other.bend == 0.0:
            squared, px, py, qx, qy = beside_end(end, middle, half, middle_2, half_2)
            if squared < least:
                least, x, y, x_2, y_2 = squared, px, py, qx, qy
        squared, qx, qy, px, py = beside_end(end, middle_2, half_2, middle, half)
        if squared < least:
            least, x, y, x_2, y_2 = squared, px, py, qx, qy
    return least, x, y, x_2, y_2


def may_be_within(one, other, reach):
    """Whether two pieces may be nearer to each other than a reach [m], by the circles that hold
    them."""
    dx, dy = one.middle_x - other.middle_x, one.middle_y - other.middle_y
    most = one.extent + other.extent + reach
    return most > 0.0 and dx * dx + dy * dy < most * most


def are_within(one, other, reach):
    """Whether two pieces, or what lies behind them, are nearer to each other than a reach [m]."""
    if not may_be_within(one, other, reach):
        return False
    squared, _, _, _, _ = between_cores(one, other)
    most = reach + one.inward + other.inward
    return squared < most * most
