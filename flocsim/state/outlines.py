"""Records of outlines: core points; for distributed forces pieces, quadrature nodes, charges and
their fields."""

from functools import cache
from typing import Annotated, NamedTuple

import numpy as np

from flocsim.state.records import Record


class CorePoint(Record):
    """A point of a core, in the frame of its body, and what begins there."""

    x: float  # [m]
    y: float
    excess_radius: float  # spheroradius of its part, less the smallest of the body [m]
    edge_offset: int  # rows to the end of the edge that begins here; 0 without one
    feature: int  # kind of the feature that begins here, see NOTHING


# Kinds of feature (CorePoint.feature).
(
    NOTHING,  # the second end of a segment
    EDGE,
    LONE,  # a point of its own: the core of a disk
) = range(3)


FeatureRows = Annotated[np.ndarray, ("features",), np.int64]


class NearFeatures(NamedTuple):
    """Core points of two bodies at which features near the other body begin; element 0 of each list
    is its length."""

    later: FeatureRows
    earlier: FeatureRows


class Piece(Record):
    """A segment or an arc of an outline, in the frame of its body."""

    x: float  # midpoint of a segment, centre of an arc [m]
    y: float
    direction_x: float  # unit tangent of a segment (body on its left); direction of an arc's …
    direction_y: float  # … midpoint from its centre
    half: float  # half the length of a segment [m]; tan(α/2) of an arc of angle 2α
    arc_radius: float  # radius of an arc [m]; 0 for a segment
    middle_x: float  # centre of a circle that encloses the piece [m]
    middle_y: float
    extent: float  # radius of that circle [m]
    core_depth: float  # distance from the piece back to the core that it is the offset of [m]


PieceRows = Annotated[np.ndarray, ("pieces",), np.int64]


class NearPieces(NamedTuple):
    """Lists of rows of relevant pieces of two bodies; element 0 of each is its length."""

    first: PieceRows  # of the body integrated over: pieces that may be near the other body
    second: PieceRows  # pieces of the other body that may be near this one
    around: PieceRows  # of these, pieces that may be near the piece being integrated over
    seen: PieceRows  # of these, pieces that may be near any piece integrated over so far


class Listed(Record):
    """The bodies, and their relative pose, for which NearPieces was made."""

    first_body: int  # −1: no list has been made
    second_body: int
    x: float  # position of the first body in the frame of the second [m]
    y: float
    cosine: float  # of their relative angle
    sine: float
    reach: float  # pieces closer than this are listed [m]


MOST_NODES = 144
"""Nodes that are evaluated together: loops over them vectorise."""

MOST_ORDER = 16
"""Most nodes of a Gauss–Legendre rule."""

MOST_FEET = 16
"""Most feet (nearest points) on one piece in rhs.outline_sum; any further are left out, and nodes
are less dense there."""


NodeArray = Annotated[np.ndarray, (MOST_NODES,)]


class Nodes(NamedTuple):
    """Quadrature nodes of an outline, or charges behind it, in arrays of MOST_NODES."""

    x: NodeArray  # position [m]
    y: NodeArray
    normal_x: NodeArray  # outward normal; of a charge, the force on it
    normal_y: NodeArray
    weight: NodeArray  # length of outline that a node represents [m]; strength of a charge
    gap: NodeArray  # distance of the other outline [m]
    attraction: NodeArray  # S of geometry.contact.attraction [1/m³]
    plate_gap: NodeArray  # gap of plates with equal attraction [m]
    log_share: NodeArray  # scratch of S: coefficient of a logarithm
    log_of: NodeArray  # scratch of S: its argument; negative without one
    # Of a charge, where it lies in a cell of a field: from its corner, in steps of the grid.
    cell_x: NodeArray
    cell_y: NodeArray
    # Field values at all four corners of that cell (4, MOST_NODES), see FieldNode.
    potential: Annotated[np.ndarray, (4, MOST_NODES)]
    by_x: Annotated[np.ndarray, (4, MOST_NODES)]
    by_y: Annotated[np.ndarray, (4, MOST_NODES)]
    by_xy: Annotated[np.ndarray, (4, MOST_NODES)]


GROUP = 8
"""Most charges in a group of neighbours."""


class ChargeGroup(Record):
    """Neighbouring charges of a body, skipped together if their enclosing circle is out of
    reach."""

    x: float  # centre of the circle, in the frame of the body [m]
    y: float
    extent: float  # radius of the circle [m]
    first: int  # first of the charges in ``Scene.charges``
    count: int  # number of charges


class Charge(Record):
    """A charge behind an outline, in the frame of its body (geometry.contact.charges)."""

    x: float  # [m]
    y: float
    strength: float  # q, for a potential of 1 on the outline [-]


TILE_BITS = 3
TILE = 1 << TILE_BITS
"""Grid steps along a tile. A tile stores all (TILE + 1)² nodes, those on its edges included."""


class Grid(Record):
    """Grid of the tabulated field of a body's charges, in its own frame."""

    x: float  # lower left corner [m]
    y: float
    fineness: float  # reciprocal of the grid spacing [1/m]
    across: int  # number of tiles along x
    up: int  # number of tiles along y
    tile: int  # first of its tiles in ``Scene.tiles``


class FieldNode(Record):
    """Field, at a grid node, of charges for a potential of 1 on their outline."""

    potential: float  # [-]
    by_x: float  # derivatives per grid spacing [-]
    by_y: float
    by_xy: float


@cache
def gauss_rules() -> np.ndarray:
    """Return nodes and weights of the Gauss–Legendre rules on [−1, 1], by number of nodes,
    read-only: all runs share them."""
    rules = np.zeros((MOST_ORDER + 1, 2, MOST_ORDER))
    for order in range(1, MOST_ORDER + 1):
        rules[order, :, :order] = np.polynomial.legendre.leggauss(order)
    rules.flags.writeable = False
    return rules
