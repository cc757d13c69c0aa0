"""How outlines are laid out for forces along them: pieces, nodes, charges and their fields."""

from functools import cache
from typing import Annotated, NamedTuple

import numpy as np

from flocsim.state.records import Record


class Piece(Record):
    """A segment or an arc of an outline, in the frame of its body."""

    x: float  # of a segment its middle, of an arc the centre of its circle [m]
    y: float
    way_x: float  # of a segment its unit tangent, the body on its left; of an arc the outward …
    way_y: float  # … direction of its middle
    half: float  # of a segment half its length [m], of an arc tan(α/2), 2 α being its angle
    bend: float  # the radius of an arc [m], 0 of a segment
    middle_x: float  # the centre of a circle that holds the piece [m]
    middle_y: float
    extent: float  # and its radius [m]
    inward: float  # how far behind the piece the core lies that it is the offset of [m]


class NearPieces(NamedTuple):
    """Rows of the pieces of two bodies that count, each list with their number in front."""

    first: np.ndarray  # of the body that is gone along, those that may be near the other one
    second: np.ndarray  # of that one
    around: np.ndarray  # of these, those that may be near the piece that is gone along
    seen: np.ndarray  # those that may be near any piece that has been


class Listed(Record):
    """For which bodies, and for which place of the first in the frame of the second, pieces are
    listed."""

    first_body: int  # −1: none are
    second_body: int
    x: float  # [m]
    y: float
    cosine: float
    sine: float
    reach: float  # how near to each other pieces that are listed may have been [m]


MOST_NODES = 144
"""Nodes at a time."""

MOST_ORDER = 16
"""Nodes of a rule at most."""

MOST_FEET = 16
"""Feet on one piece at most (rhs.outline_sum); more are left out, with nodes further apart."""


class Nodes(NamedTuple):
    """Places along an outline at which the other one is looked at, or charges behind it.

    Arrays of MOST_NODES numbers each: several nodes are worked on at once.
    """

    x: np.ndarray  # [m]
    y: np.ndarray
    normal_x: np.ndarray  # the outward normal; of a charge, the force on it
    normal_y: np.ndarray
    weight: np.ndarray  # how much of the outline a node stands for [m]; the charge
    gap: np.ndarray  # how far the other outline is [m]
    attraction: np.ndarray  # S of geometry.contact.attraction [1/m³]
    plate_gap: np.ndarray  # at which gap plates attract each other as strongly [m]
    log_share: np.ndarray  # scratch of S: what a logarithm counts for
    log_of: np.ndarray  # and of what it is; below 0 where there is none
    cell_x: (
        np.ndarray
    )  # of a charge, where it lies in a cell of a field: from its corner, of a step
    cell_y: np.ndarray
    # What is known at all four corners of that cell (4, MOST_NODES), see FieldNode.
    potential: Annotated[np.ndarray, (4, MOST_NODES)]
    by_x: Annotated[np.ndarray, (4, MOST_NODES)]
    by_y: Annotated[np.ndarray, (4, MOST_NODES)]
    by_xy: Annotated[np.ndarray, (4, MOST_NODES)]


def nodes_of() -> Nodes:
    """Return Nodes of zeros."""
    corners = ("potential", "by_x", "by_y", "by_xy")
    return Nodes(
        *(np.zeros((4, MOST_NODES) if name in corners else MOST_NODES) for name in Nodes._fields)
    )


GROUP = 8
"""Neighbouring charges in a group at most."""


class ChargeGroup(Record):
    """Neighbouring charges of a body, which are left out together, and a circle that holds them."""

    x: float  # its centre, in the frame of the body [m]
    y: float
    extent: float  # and its radius [m]
    first: int  # where their charges begin in ``Scene.charges``
    count: int  # how many there are


class Charge(Record):
    """A charge behind an outline, in the frame of its body (geometry.contact.charges)."""

    x: float  # [m]
    y: float
    strength: float  # of charges that make a potential of 1 on the outline [-]


TILE_BITS = 3
TILE = 1 << TILE_BITS
"""Steps along a tile; its nodes are (TILE + 1)², those along its edges being its own."""


class Grid(Record):
    """Where the field of a body's charges is known, in its own frame."""

    x: float  # the lower left corner [m]
    y: float
    fineness: float  # one over the step from node to node [1/m]
    across: int  # how many tiles there are along x
    up: int  # and along y
    tile: int  # where they begin in ``Scene.tiles``


class FieldNode(Record):
    """The field of charges that make a potential of 1 on their outline, at a node."""

    potential: float  # [-]
    by_x: float  # its derivatives, of a step
    by_y: float
    by_xy: float


@cache
def gauss_rules() -> np.ndarray:
    """Nodes and weights of Gauss's rules on [−1, 1], by their numbers of nodes."""
    rules = np.zeros((MOST_ORDER + 1, 2, MOST_ORDER))
    for order in range(1, MOST_ORDER + 1):
        rules[order, :, :order] = np.polynomial.legendre.leggauss(order)
    return rules
