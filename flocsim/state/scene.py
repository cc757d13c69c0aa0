"""What does not change in a run: Scene."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from flocsim.state.records import Record


class Water(Record):
    """What the resistance of two bodies follows from, beside ``Scene.pair_table``."""

    viscosity: float  # [Pa s]
    mean_radius: float  # of the two [m]
    floor: float  # the gap below which it stays what it is [m]
    cut: float  # the gap at which it ends [m]; 0: there is none
    near_cut: float  # the gap of outlines up to which they count [m]; 0: of two spheres
    flow_x: float  # the velocity of the flow at the origin [m/s]
    flow_y: float
    flow_x_by_x: float  # and its gradient: ∂u_x/∂x … [1/s]
    flow_x_by_y: float
    flow_y_by_x: float
    flow_y_by_y: float
    first_radius: float  # of the sphere that has the drag of the earlier body [m]
    second_radius: float  # and of the later one [m]


TABLE_COLUMNS = 20
"""Columns of ``Scene.pair_table``: flocsim.hydrodynamics.pair.COLUMNS."""


# What a Scene has where there are no such forces, and where nothing repeats.
NO_OUTLINES = (-1.0, 0.0, 0.0, 0.0)


NO_LAYER = (0.0, 0.0, -1.0)


NO_WATER = (np.zeros((0, TABLE_COLUMNS, 4)), Water.one())


NO_BOX = (math.inf, math.inf)


class Scene(NamedTuple):
    """What does not change in a run: n bodies, all their core points, the forces' numbers."""

    bodies: np.ndarray  # (n,) of BodyConstants
    first: np.ndarray  # (n + 1,): where a body's core points begin
    vertices: np.ndarray  # (points, 2 or more): geometry.contact.compounds.Outlines
    tree: Annotated[np.ndarray, ("nodes", 3)]  # see there
    pieces: np.ndarray  # (pieces,) of outlines.Piece; none where nothing reads them
    first_piece: np.ndarray  # (n + 1,): where a body's pieces begin
    groups: np.ndarray  # (groups,) of outlines.ChargeGroup; none likewise
    first_group: np.ndarray  # (n + 1,): where a body's groups begin
    charges: np.ndarray  # (charges,) of outlines.Charge
    grids: np.ndarray  # (n,) of outlines.Grid; zeros likewise
    tiles: np.ndarray  # (tiles,): where the nodes of each begin in ``field``; −1: it has none
    field: np.ndarray  # (nodes,) of outlines.FieldNode
    parameters: np.ndarray  # what the laws read of the forces
    laws: Any  # see flocsim.hooks
    surface_reach: float = -1.0  # the gap up to which surface forces act [m]; −1: there are none
    centre_reach: float = -1.0  # the same of centre forces [m]
    outlines: tuple[float, float, float, float] = NO_OUTLINES  # of forces between: forces.outline
    layer: tuple[float, float, float] = NO_LAYER  # of the charges' double layers: forces.outline
    smoothing: tuple[float, float, float] = (1.0, 0.0, 0.0)  # see flocsim.forces.outline
    events: int = 0  # how many the contact forces have
    box: tuple[float, float] = NO_BOX  # periods along x and y [m]
    # How long random forces stay (integrators.loop.kicks), and what they are drawn by.
    kicks: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    key: tuple[int, int] = (0, 0)
    pair_table: Annotated[np.ndarray, ("intervals", TABLE_COLUMNS, 4)] = NO_WATER[0]
    water: Water = NO_WATER[1]
    listed_reach: float = -1.0  # the gap up to which outlines are listed for what acts between them
