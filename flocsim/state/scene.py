"""Scene: all that stays constant in a run."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from flocsim.state.records import Record


class Water(Record):
    """Parameters of the hydrodynamic resistance of two bodies, besides ``Scene.pair_table``."""

    viscosity: float  # [Pa s]
    mean_radius: float  # of the two spheres [m]
    floor: float  # gap below which the resistance is constant [m]
    cut: float  # gap at which it ends [m]; 0: there is no resistance
    near_cut: float  # gap up to which outlines matter [m]; 0: both are spheres
    flow_x: float  # velocity of the flow at the origin [m/s]
    flow_y: float
    flow_x_by_x: float  # its gradient ∂u_x/∂x, … [1/s]
    flow_x_by_y: float
    flow_y_by_x: float
    flow_y_by_y: float
    first_radius: float  # of the sphere with the drag of the earlier body [m]
    second_radius: float  # and of that of the later body [m]


TABLE_COLUMNS = 20
"""Columns of ``Scene.pair_table``: flocsim.hydrodynamics.pair.COLUMNS."""


# Values of a Scene without such forces, and without periodic boundaries.
NO_OUTLINES = (-1.0, 0.0, 0.0, 0.0)


NO_LAYER = (0.0, 0.0, -1.0)


NO_WATER = (np.zeros((0, TABLE_COLUMNS, 4)), Water.one())


NO_BOX = (math.inf, math.inf)


class Scene(NamedTuple):
    """All that stays constant in a run: n bodies, their outlines, parameters of forces, laws."""

    bodies: np.ndarray  # (n,) of BodyConstants
    first: np.ndarray  # (n + 1,): index of a body's first core point in ``vertices``
    vertices: np.ndarray  # (points,) of outlines.CorePoint
    pieces: np.ndarray  # (pieces,) of outlines.Piece; empty if nothing reads them
    first_piece: np.ndarray  # (n + 1,): index of a body's first piece
    groups: np.ndarray  # (groups,) of outlines.ChargeGroup; empty likewise
    first_group: np.ndarray  # (n + 1,): index of a body's first group
    charges: np.ndarray  # (charges,) of outlines.Charge
    grids: np.ndarray  # (n,) of outlines.Grid; zeros likewise
    tiles: np.ndarray  # (tiles,): index of the tile's first node in ``field``; −1: not tabulated
    field: np.ndarray  # (nodes,) of outlines.FieldNode
    parameters: np.ndarray  # parameters of all forces, one after another, as the laws read them
    laws: Any  # addresses of the laws, or functions: flocsim.hooks
    surface_reach: float = -1.0  # gap up to which surface forces act [m]; −1: there are none
    centre_reach: float = -1.0  # gap up to which centre forces act [m]
    # Forces along outlines (forces.outline): reach, least gap, depth, least lens [m].
    outlines: tuple[float, float, float, float] = NO_OUTLINES
    layer: tuple[float, float, float] = NO_LAYER  # double layers of charges: forces.outline
    # Smoothing length of gaps (rhs.surface_gap): at touch [m], its growth [-], where that ends [m].
    smoothing: tuple[float, float, float] = (1.0, 0.0, 0.0)
    events: int = 0  # number of event functions (kinks) of the contact forces
    box: tuple[float, float] = NO_BOX  # periods along x and y [m]; inf: not periodic
    # Random forces (integrators.loop.kicks): lengths of their kicks, and their key.
    kicks: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    key: tuple[int, int] = (0, 0)
    # Hydrodynamic resistance of two bodies (rhs.pair_resistance): cubics by the gap.
    pair_table: Annotated[np.ndarray, ("intervals", TABLE_COLUMNS, 4)] = NO_WATER[0]
    water: Water = NO_WATER[1]
    listed_reach: float = -1.0  # gap up to which features are listed for surface forces [m]
