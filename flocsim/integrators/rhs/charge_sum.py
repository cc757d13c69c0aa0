"""Forces between double layers: those of all charges of one body in the field of another.

What charges are, and why there are any: flocsim.geometry.surfaces.charges; the field is in tables
(field.py there). The two sums of forces between outlines share the way in (outline_sum.py).
"""

import flocsim.arrays as at
from flocsim.compiler.linker import apart
from flocsim.hooks import hook


def cubics(t):
    """Hermite's polynomials at t of [0, 1]: those of both values and both slopes."""
    s = 1.0 - t
    return s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t), t * s * s, -t * t * s


def slopes_of_cubics(t):
    """Their derivatives."""
    s = 1.0 - t
    return -6.0 * t * s, 6.0 * t * s, s * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)


def between_nodes(field, row, tx, ty):
    """(φ, its derivatives by x and y) at shares tx, ty of the steps from a node on, of a step."""
    a, a_slope, c, c_slope = cubics(tx), slopes_of_cubics(tx), cubics(ty), slopes_of_cubics(ty)
    value, by_x, by_y = 0.0, 0.0, 0.0
    for up in range(2):
        for across in range(2):
            node = row + up * (at.TILE + 1) + across
            here, along = field[node, at.POTENTIAL], field[node, at.BY_X]
            above, both = field[node, at.BY_Y], field[node, at.BY_XY]
            at_x = a[across] * here + a[2 + across] * along
            rise = a[across] * above + a[2 + across] * both
            value += c[up] * at_x + c[2 + up] * rise
            by_y += c_slope[up] * at_x + c_slope[2 + up] * rise
            at_x = a_slope[across] * here + a_slope[2 + across] * along
            rise = a_slope[across] * above + a_slope[2 + across] * both
            by_x += c[up] * at_x + c[2 + up] * rise
    return value, by_x, by_y


def field_at(scene, body, x, y):
    """(φ [-], its derivatives [1/m]) of a body's charges at a point of its frame; 0 beyond the
    tiles that have nodes."""
    grid, step = scene.grids, scene.grids[body, at.GRID_STEP]
    # Tiles and steps are counted from the corner, by whole numbers that are not below 0.
    across, up = (x - grid[body, at.GRID_X]) / step, (y - grid[body, at.GRID_Y]) / step
    if not (across >= 0.0 and up >= 0.0):
        return 0.0, 0.0, 0.0
    i, j = int(across), int(up)
    tile_i, tile_j, width = i // at.TILE, j // at.TILE, int(grid[body, at.GRID_ACROSS])
    if tile_i >= width or tile_j >= int(grid[body, at.GRID_UP]):
        return 0.0, 0.0, 0.0
    first = scene.tiles[int(grid[body, at.GRID_TILE]) + tile_j * width + tile_i]
    if first < 0:
        return 0.0, 0.0, 0.0
    row = first + (j % at.TILE) * (at.TILE + 1) + i % at.TILE
    value, by_x, by_y = between_nodes(scene.field, row, across - i, up - j)
    return value, by_x / step, by_y / step


@hook
@apart
def sum_charges(scene, a, b, x, y, cosine, sine):
    """(fx, fy, torque about b's centroid) on a metre of body a [N/m, N/m, N], in the frame of b,
    where a lies at x, y [m] turned by an angle of that cosine and sine."""
    _, strength, reach = scene.layer
    bound, charges = scene.bodies[b, at.BOUNDING_RADIUS] + reach, scene.charges
    fx, fy, torque = 0.0, 0.0, 0.0
    for row in range(scene.first_charge[a], scene.first_charge[a + 1]):
        px, py = charges[row, at.GROUP_X], charges[row, at.GROUP_Y]
        most = bound + charges[row, at.GROUP_EXTENT]
        mx, my = x + cosine * px - sine * py, y + sine * px + cosine * py
        if mx * mx + my * my > most * most:
            continue
        for k in range(int(charges[row, at.GROUP_COUNT])):
            place = at.FIRST_CHARGE + 3 * k
            px, py = charges[row, place], charges[row, place + 1]
            ax, ay = x + cosine * px - sine * py, y + sine * px + cosine * py
            _, by_x, by_y = field_at(scene, b, ax, ay)
            across, up = -charges[row, place + 2] * by_x, -charges[row, place + 2] * by_y
            fx += across
            fy += up
            torque += ax * up - ay * across
    return strength * fx, strength * fy, strength * torque


def no_charges(scene, a, b, x, y, cosine, sine):
    """There are none."""
    return 0.0, 0.0, 0.0
