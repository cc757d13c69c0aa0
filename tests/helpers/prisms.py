"""Several prisms in slow flow: forces on rigid bodies of one or more of them."""

import numpy as np
from scipy.linalg import block_diag

from flocsim.hydrodynamics.panels import inner_pressure, layer_of


def loads_of(surfaces, bodies=None, centres=((0.0, 0.0),)):
    """Resistance (3 n, 3 n) of n bodies to motions and spins about their centres, viscosity 1.

    ``bodies``: body of each closed surface, by default all of one.
    """
    middles = np.concatenate([each.middles for each in surfaces])
    matrix = np.hstack([layer_of(each, middles) for each in surfaces])
    matrix += block_diag(*map(inner_pressure, surfaces))
    owner = np.repeat(bodies or [0] * len(surfaces), [len(each.middles) for each in surfaces])
    wanted = np.zeros((len(middles), 3, 3 * len(centres)))
    for body, centre in enumerate(centres):
        x, y = (middles[:, :2] - centre).T
        wanted[:, 0, 3 * body], wanted[:, 1, 3 * body + 1] = 1.0, 1.0
        wanted[:, 0, 3 * body + 2], wanted[:, 1, 3 * body + 2] = -y, x
        wanted[owner != body, :, 3 * body : 3 * body + 3] = 0.0
    wanted = wanted.reshape(3 * len(middles), -1)
    areas = np.repeat(np.concatenate([each.areas for each in surfaces]), 3)
    return 2.0 * (areas[:, None] * wanted).T @ np.linalg.solve(matrix, wanted)
