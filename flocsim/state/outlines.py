"""How outlines are laid out for forces along them: pieces, nodes, charges and their fields."""

from functools import cache

import numpy as np

# Columns of ``Scene.pieces``: segments and arcs of an outline, in the frame of its body.
(
    PLACE_X,  # of a segment its middle, of an arc the centre of its circle [m]
    PLACE_Y,
    WAY_X,  # of a segment its unit tangent, the body on its left; of an arc the outward …
    WAY_Y,  # … direction of its middle
    SIZE,  # of a segment half its length [m], of an arc tan(α/2), 2 α being its angle
    BEND,  # the radius of an arc [m], 0 of a segment
    MIDDLE_X,  # the centre of a circle that holds the piece [m]
    MIDDLE_Y,
    EXTENT,  # and its radius [m]
    INWARD,  # how far behind the piece the core lies that it is the offset of [m]
    PIECE_COLUMNS,
) = range(11)


# Rows of ``Work.near``, each with its number of pieces in front (rhs.outline_sum).
(
    NEAR_A,  # of the body that is gone along, those that may be near the other one
    NEAR_B,  # of that one
    AROUND,  # of these, those that may be near the piece that is gone along
    SEEN,  # those that may be near any piece that has been
) = range(4)


# Places in ``Work.listed``: for what the first two hold.
(
    LISTED_A,  # the bodies
    LISTED_B,
    LISTED_X,  # where the first one was, in the frame of the second [m]
    LISTED_Y,
    LISTED_COSINE,  # and how it was turned
    LISTED_SINE,
    LISTED_REACH,  # how near to each other pieces that are listed may have been [m]
    LISTED_SIZE,
) = range(8)


# Rows of ``Work.nodes``: places along an outline at which the other one is looked at.
(
    NODE_X,  # [m]
    NODE_Y,
    NODE_NORMAL_X,  # the outward normal
    NODE_NORMAL_Y,
    NODE_WEIGHT,  # how much of the outline it stands for [m]
    NODE_GAP,  # how far the other outline is [m]
    NODE_SUM,  # what attraction comes to there: geometry.contact.attraction [1/m³]
    NODE_PLATES,  # at which gap plates attract each other as strongly [m]
    NODE_LOG_SHARE,  # scratch of that: what a logarithm counts for
    NODE_LOG_OF,  # and of what it is; below 0 where there is none
    CELL_X,  # of a charge, where it lies in a cell of a field: from its corner, of a step
    CELL_Y,
    FIRST_CORNER,  # from here on the columns of ``Scene.field`` at all four corners
) = range(13)


MOST_NODES = 144
"""Nodes at a time."""


MOST_ORDER = 16
"""Nodes of a rule at most."""


# Columns of ``Scene.charges``: up to GROUP neighbours, in the frame of their body.
(
    GROUP_X,  # the centre of a circle that holds them [m]
    GROUP_Y,
    GROUP_EXTENT,  # and its radius [m]
    GROUP_COUNT,  # how many there are
    FIRST_CHARGE,  # from here on, of each x, y [m], and its charge: geometry.contact.charges
) = range(5)


GROUP = 8
"""Charges in a row at most."""


CHARGE_COLUMNS = FIRST_CHARGE + 3 * GROUP


# Columns of ``Scene.grids``: where the field of a body's charges is known, in its own frame.
(
    GRID_X,  # the lower left corner [m]
    GRID_Y,
    GRID_STEP,  # from node to node [m]
    GRID_ACROSS,  # how many tiles there are along x
    GRID_UP,  # and along y
    GRID_TILE,  # where they begin in ``tiles``
    GRID_FINENESS,  # one over the step [1/m]
    GRID_COLUMNS,
) = range(8)


TILE_BITS = 3


TILE = 1 << TILE_BITS
"""Steps along a tile; its nodes are (TILE + 1)², those along its edges being its own."""


# Columns of ``Scene.field``: of charges that make a potential of 1 on their outline.
(
    POTENTIAL,  # [-]
    BY_X,  # its derivatives, of a step
    BY_Y,
    BY_XY,
    FIELD_COLUMNS,
) = range(5)


NODE_ROWS = FIRST_CORNER + 4 * FIELD_COLUMNS


MOST_FEET = 16
"""Feet on one piece at most (rhs.outline_sum); more are left out, with nodes further apart."""


@cache
def gauss_rules() -> np.ndarray:
    """Nodes and weights of Gauss's rules on [−1, 1], by their numbers of nodes."""
    rules = np.zeros((MOST_ORDER + 1, 2, MOST_ORDER))
    for order in range(1, MOST_ORDER + 1):
        rules[order, :, :order] = np.polynomial.legendre.leggauss(order)
    return rules
