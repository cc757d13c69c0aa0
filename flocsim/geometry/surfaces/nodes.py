"""Where to look at one outline for what another does to it: nodes along its pieces.

What the other does peaks where it is near, at feet, and falls off over a length of its own from
there. So a piece is cut between its feet, and on each side of one a place s from it is
s = a z/(1 − z²), a being where the gap has grown by as much as it is: even in z the peak is as wide
as what lies beside it.
"""

import math

from flocsim.geometry.surfaces.distances import between_cores

TWELVE = (
    (0.009219682876640378, 0.02358766819325591), (0.047941371814762573, 0.05346966299765922),
    (0.11504866290284766, 0.08003916427167311), (0.20634102285669126, 0.10158371336153296),
    (0.31608425050090994, 0.11674626826917740), (0.43738329574426555, 0.12457352290670139),
    (0.5626167042557344, 0.12457352290670139), (0.6839157494990901, 0.11674626826917740),
    (0.7936589771433087, 0.10158371336153296), (0.8849513371852323, 0.08003916427167311),
    (0.9520586281852374, 0.05346966299765922), (0.9907803171233596, 0.02358766819325591),
)  # fmt: skip
"""Gauss's rule of twelve nodes on [0, 1]."""

def ends_of(piece):
    """The parameters at both ends of a piece: metres along a segment, tan(φ/2) along an arc."""
    return -piece.size, piece.size


def at_parameter(piece, parameter):
    """(x, y), (outward normal), and metres for a unit of the parameter, at one of a piece."""
    if piece.bend == 0.0:
        x, y = piece.x + parameter * piece.way_x, piece.y + parameter * piece.way_y
        return x, y, piece.way_y, -piece.way_x, 1.0
    grown = 1.0 + parameter * parameter
    c, s = (1.0 - parameter * parameter) / grown, 2.0 * parameter / grown
    nx, ny = c * piece.way_x - s * piece.way_y, c * piece.way_y + s * piece.way_x
    return piece.x + piece.bend * nx, piece.y + piece.bend * ny, nx, ny, 2.0 * piece.bend / grown


def foot_of(piece, other):
    """(parameter, gap): where a piece is nearest to another, and how far [m]; the parameter may lie
    beyond its ends."""
    squared, x, y, x_2, y_2 = between_cores(piece, other)
    distance = math.sqrt(squared)
    gap = distance - piece.inward - other.inward
    if piece.bend == 0.0:
        return (x - piece.x) * piece.way_x + (y - piece.y) * piece.way_y, gap
    dx, dy = x_2 - piece.x, y_2 - piece.y
    ahead = dx * piece.way_x + dy * piece.way_y
    aside = dy * piece.way_x - dx * piece.way_y
    below = distance + ahead
    if below <= 1e-9 * distance:
        return math.copysign(math.inf, aside), gap
    return aside / below, gap


def stretched(z, scale):
    """s = a z/(1 − z²) and ds/dz [m]."""
    left = 1.0 - z * z
    return scale * z / left, scale * (1.0 + z * z) / (left * left)


def stretch_of(length, scale):
    """The z at which s comes to a length."""
    share = length / scale
    if share < 1e-6:
        return share
    return (math.sqrt(1.0 + 4.0 * share * share) - 1.0) / (2.0 * share)
