"""What does not change in a run: Scene."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from flocsim.state.outlines import CHARGE_COLUMNS, FIELD_COLUMNS, GRID_COLUMNS, PIECE_COLUMNS

# Places in ``Scene.water``: what two bodies' resistance follows from beside ``Scene.pair_table``.
(
    VISCOSITY,  # [Pa s]
    MEAN_RADIUS,  # of the two [m]
    FLOOR,  # the gap below which it stays what it is [m]
    CUT,  # the gap at which it ends [m]; 0: there is none
    NEAR_CUT,  # the gap of outlines up to which they count [m]; 0: of two spheres
    FLOW,  # from here on: Fluid.flow
) = range(6)


FIRST_RADIUS = FLOW + 6
"""And behind it, of either body, the radius of the sphere that has its drag [m]."""


WATER_SIZE = FIRST_RADIUS + 2


TABLE_COLUMNS = 20
"""Columns of ``Scene.pair_table``: flocsim.hydrodynamics.pair.COLUMNS."""


# What a Scene has where there are no such forces, and where nothing repeats.
NO_OUTLINES = (-1.0, 0.0, 0.0, 0.0)


NO_LAYER = (0.0, 0.0, -1.0)


NO_WATER = (np.zeros((0, TABLE_COLUMNS, 4)), np.zeros(WATER_SIZE))


NO_BOX = (math.inf, math.inf)


class Scene(NamedTuple):
    """What does not change in a run: n bodies, all their core points, the forces' numbers."""

    bodies: np.ndarray  # (n,) of BodyConstants
    first: np.ndarray  # (n + 1,): where a body's core points begin
    vertices: np.ndarray  # (points, 2 or more): geometry.contact.compounds.Outlines
    tree: Annotated[np.ndarray, ("nodes", 3)]  # see there
    pieces: Annotated[
        np.ndarray, ("pieces", PIECE_COLUMNS)
    ]  # see PLACE_X; none if nothing reads it
    first_piece: np.ndarray  # (n + 1,): where a body's pieces begin
    charges: Annotated[np.ndarray, ("groups", CHARGE_COLUMNS)]  # see GROUP_X; none likewise
    first_charge: np.ndarray  # (n + 1,): where a body's charges begin
    grids: Annotated[np.ndarray, ("n", GRID_COLUMNS)]  # see GRID_X; zeros likewise
    tiles: np.ndarray  # (tiles,): where the nodes of each begin in ``field``; −1: it has none
    field: Annotated[np.ndarray, ("nodes", FIELD_COLUMNS)]  # see POTENTIAL
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
    water: Annotated[np.ndarray, (WATER_SIZE,)] = NO_WATER[1]  # see VISCOSITY
    listed_reach: float = -1.0  # the gap up to which outlines are listed for what acts between them
