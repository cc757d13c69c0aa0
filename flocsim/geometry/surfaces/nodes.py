"""Where to look at one outline for what another does to it: nodes along its pieces.

What the other does peaks where it is near, at feet, and falls off over a length of its own from
there. So a piece is cut between its feet; on each side of one Gauss's rule takes what lies nearer
than the length a over which the gap grows by twice itself, and once more what lies beyond it, by
the logarithm of the way.
"""

import math

from flocsim.geometry.surfaces.distances import between_cores


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


def parameter_beside(piece, x, y):
    """The parameter at which the normal of a piece, or of the line or circle that it is part of,
    leads to a point."""
    dx, dy = x - piece.x, y - piece.y
    ahead = dx * piece.way_x + dy * piece.way_y
    if piece.bend == 0.0:
        return ahead
    aside = dy * piece.way_x - dx * piece.way_y
    distance = math.sqrt(dx * dx + dy * dy)
    if distance + ahead <= 1e-9 * distance:
        return math.inf if aside >= 0.0 else -math.inf
    return aside / (distance + ahead)


def foot_of(piece, other):
    """The parameter at which a piece is nearest to another; it may lie beyond its ends."""
    _, x, y, x_2, y_2 = between_cores(piece, other)
    if piece.bend == 0.0:
        return (x - piece.x) * piece.way_x + (y - piece.y) * piece.way_y
    return parameter_beside(piece, x_2, y_2)


def parameter_before(piece, x, y, way, most):
    """The parameter at which a ray from a point along a unit vector ``way`` meets a piece, or the
    line or circle that it is part of, no further than ``most`` [m] away; inf where it does not."""
    dx, dy = piece.x - x, piece.y - y
    if piece.bend == 0.0:
        crossing = way[0] * piece.way_y - way[1] * piece.way_x
        along = (dx * piece.way_y - dy * piece.way_x) / crossing if crossing != 0.0 else math.inf
    else:
        ahead, aside = dx * way[0] + dy * way[1], dx * way[1] - dy * way[0]
        squared = piece.bend * piece.bend - aside * aside
        along = ahead - math.sqrt(squared) if squared > 0.0 else math.inf
    if not 0.0 < along < most:
        return math.inf
    return parameter_beside(piece, x + along * way[0], y + along * way[1])
