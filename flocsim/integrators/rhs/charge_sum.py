"""Forces between double layers: those of all charges of one body in the field of another.

What charges are, why there are any, and the tables of their field:
flocsim.geometry.contact.charges. The two sums of forces between outlines share the way in
(outline_sum.py).
"""

from typing import NamedTuple

from flocsim.compiler.linker import apart, loops_apart
from flocsim.hooks import hook
from flocsim.state.outlines import (
    BY_Y,
    CELL_X,
    CELL_Y,
    FIELD_COLUMNS,
    FIRST_CHARGE,
    FIRST_CORNER,
    GRID_ACROSS,
    GRID_FINENESS,
    GRID_TILE,
    GRID_UP,
    GRID_X,
    GRID_Y,
    GROUP,
    GROUP_COUNT,
    GROUP_EXTENT,
    GROUP_X,
    GROUP_Y,
    MOST_NODES,
    NODE_NORMAL_X,
    NODE_NORMAL_Y,
    NODE_WEIGHT,
    NODE_X,
    NODE_Y,
    TILE,
    TILE_BITS,
)


def cubics(t):
    """Hermite's polynomials at t of [0, 1]: those of both values and both slopes."""
    s = 1.0 - t
    return s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t), t * s * s, -t * t * s


def slopes_of_cubics(t):
    """Their derivatives."""
    s = 1.0 - t
    return -6.0 * t * s, 6.0 * t * s, s * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)


class Grid(NamedTuple):
    """A row of ``grids`` as numbers, whole where they count."""

    x: float
    y: float
    fineness: float
    across: int
    wide: float
    high: float
    tile: int


def grid_of(scene, body):
    """The Grid of a body's field."""
    grid = scene.grids
    across, up = grid[body, GRID_ACROSS], grid[body, GRID_UP]
    return Grid(
        grid[body, GRID_X], grid[body, GRID_Y], grid[body, GRID_FINENESS], int(across),
        TILE * across, TILE * up, int(grid[body, GRID_TILE]),
    )  # fmt: skip


def cell_of(tiles, grid, x, y):
    """(node, shares of a step beyond it along x and y) of the cell in which a point of a body's
    frame lies, by its lower left corner; a node of −1 beyond the tiles that have some."""
    across, up = (x - grid.x) * grid.fineness, (y - grid.y) * grid.fineness
    if not (0.0 <= across < grid.wide and 0.0 <= up < grid.high):
        return -1, 0.0, 0.0
    # Tiles and steps are counted from the corner, by whole numbers that are not below 0.
    i, j = int(across), int(up)
    first = tiles[grid.tile + (j >> TILE_BITS) * grid.across + (i >> TILE_BITS)]
    if first < 0:
        return -1, 0.0, 0.0
    within = TILE - 1
    return first + (j & within) * (TILE + 1) + (i & within), across - i, up - j


def put_charge(scene, nodes, count, grid, x, y, charge):
    """Put a charge in the field of a Grid, with what is known at the corners of its cell, after
    so many others; how many there are then: none more where there is no field."""
    node, across, up = cell_of(scene.tiles, grid, x, y)
    if node < 0:
        return count
    nodes[NODE_X, count], nodes[NODE_Y, count] = x, y
    nodes[NODE_WEIGHT, count] = charge
    nodes[CELL_X, count], nodes[CELL_Y, count] = across, up
    for corner in range(4):
        # Two beside each other, and the two above them.
        place = node + (corner >> 1) * (TILE + 1) + (corner & 1)
        row = FIRST_CORNER + corner * FIELD_COLUMNS
        for column in range(FIELD_COLUMNS):
            nodes[row + column, count] = scene.field[place, column]
    return count + 1


def along_side(nodes, k, row, x):
    """What is known at two corners of a cell, ``row`` being the first one's, blended along x: φ
    from its rows, its derivative by y from those that follow."""
    first, second = nodes[row, k], nodes[row + FIELD_COLUMNS, k]
    slope, slope_2 = nodes[row + 1, k], nodes[row + FIELD_COLUMNS + 1, k]
    return x[0] * first + x[1] * second + x[2] * slope + x[3] * slope_2


def between_corners(nodes, k, x, y):
    """φ in a cell, or its derivative by x or y, of a step, ``x`` and ``y`` being the cubics or
    their slopes."""
    low, high = FIRST_CORNER, FIRST_CORNER + 2 * FIELD_COLUMNS
    value, value_2 = along_side(nodes, k, low, x), along_side(nodes, k, high, x)
    rise = along_side(nodes, k, low + BY_Y, x)
    rise_2 = along_side(nodes, k, high + BY_Y, x)
    return y[0] * value + y[1] * value_2 + y[2] * rise + y[3] * rise_2


@loops_apart
def write_forces(nodes, count):
    """Write the forces on so many charges, times a step, to where nodes have their normals."""
    for k in range(count):
        tx, ty = nodes[CELL_X, k], nodes[CELL_Y, k]
        across = between_corners(nodes, k, slopes_of_cubics(tx), cubics(ty))
        up = between_corners(nodes, k, cubics(tx), slopes_of_cubics(ty))
        nodes[NODE_NORMAL_X, k] = -nodes[NODE_WEIGHT, k] * across
        nodes[NODE_NORMAL_Y, k] = -nodes[NODE_WEIGHT, k] * up


def add_forces(nodes, total, count):
    """(fx, fy, torque) of so many charges, times a step, added to a total."""
    fx, fy, torque = total
    write_forces(nodes, count)
    for k in range(count):
        across, up = nodes[NODE_NORMAL_X, k], nodes[NODE_NORMAL_Y, k]
        fx, fy = fx + across, fy + up
        torque += nodes[NODE_X, k] * up - nodes[NODE_Y, k] * across
    return fx, fy, torque


@hook
@apart
def sum_charges(scene, work, a, b, x, y, cosine, sine):
    """(fx, fy, torque about b's centroid) on a metre of body a [N/m, N/m, N], in the frame of b,
    where a lies at x, y [m] turned by an angle of that cosine and sine."""
    _, strength, reach = scene.layer
    bound, charges = scene.bodies[b].bounding_radius + reach, scene.charges
    total, count, grid = (0.0, 0.0, 0.0), 0, grid_of(scene, b)
    for row in range(scene.first_charge[a], scene.first_charge[a + 1]):
        px, py = charges[row, GROUP_X], charges[row, GROUP_Y]
        most = bound + charges[row, GROUP_EXTENT]
        mx, my = x + cosine * px - sine * py, y + sine * px + cosine * py
        if mx * mx + my * my > most * most:
            continue
        for k in range(int(charges[row, GROUP_COUNT])):
            place = FIRST_CHARGE + 3 * k
            px, py = charges[row, place], charges[row, place + 1]
            ax, ay = x + cosine * px - sine * py, y + sine * px + cosine * py
            count = put_charge(scene, work.nodes, count, grid, ax, ay, charges[row, place + 2])
        if count > MOST_NODES - GROUP:
            total = add_forces(work.nodes, total, count)
            count = 0
    fx, fy, torque = add_forces(work.nodes, total, count)
    strength *= grid.fineness
    return strength * fx, strength * fy, strength * torque


def no_charges(scene, work, a, b, x, y, cosine, sine):
    """There are none."""
    return 0.0, 0.0, 0.0
