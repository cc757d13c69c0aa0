"""Forces between double layers: those of all charges of one body in the field of another.

What charges are, why there are any, and the tables of their field:
flocsim.geometry.contact.charges. The two sums of forces between outlines share the way in
(outline_sum.py).
"""

from flocsim.compiler.linker import apart, loops_apart
from flocsim.hooks import hook
from flocsim.state.outlines import GROUP, MOST_NODES, TILE, TILE_BITS


def cubics(t):
    """Hermite's polynomials at t of [0, 1]: those of both values and both slopes."""
    s = 1.0 - t
    return s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t), t * s * s, -t * t * s


def slopes_of_cubics(t):
    """Their derivatives."""
    s = 1.0 - t
    return -6.0 * t * s, 6.0 * t * s, s * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)


def cell_of(tiles, grid, x, y):
    """(node, shares of a step beyond it along x and y) of the cell in which a point of a body's
    frame lies, by its lower left corner; a node of −1 beyond the tiles that have some."""
    across, up = (x - grid.x) * grid.fineness, (y - grid.y) * grid.fineness
    if not (0.0 <= across < TILE * grid.across and 0.0 <= up < TILE * grid.up):
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
    nodes.x[count], nodes.y[count] = x, y
    nodes.weight[count] = charge
    nodes.cell_x[count], nodes.cell_y[count] = across, up
    for corner in range(4):
        # Two beside each other, and the two above them.
        place = node + (corner >> 1) * (TILE + 1) + (corner & 1)
        known = scene.field[place]
        nodes.potential[corner, count] = known.potential
        nodes.by_x[corner, count] = known.by_x
        nodes.by_y[corner, count] = known.by_y
        nodes.by_xy[corner, count] = known.by_xy
    return count + 1


def along_side(values, slopes, k, corner, x):
    """What is known at a corner of a cell and the one to its right, blended along x: from values
    there and their slopes along x."""
    first, second = values[corner, k], values[corner + 1, k]
    slope, slope_2 = slopes[corner, k], slopes[corner + 1, k]
    return x[0] * first + x[1] * second + x[2] * slope + x[3] * slope_2


def between_corners(nodes, k, x, y):
    """φ in a cell, or its derivative by x or y, of a step, ``x`` and ``y`` being the cubics or
    their slopes."""
    value = along_side(nodes.potential, nodes.by_x, k, 0, x)
    value_2 = along_side(nodes.potential, nodes.by_x, k, 2, x)
    rise = along_side(nodes.by_y, nodes.by_xy, k, 0, x)
    rise_2 = along_side(nodes.by_y, nodes.by_xy, k, 2, x)
    return y[0] * value + y[1] * value_2 + y[2] * rise + y[3] * rise_2


@loops_apart
def write_forces(nodes, count):
    """Write the forces on so many charges, times a step, to where nodes have their normals."""
    for k in range(count):
        tx, ty = nodes.cell_x[k], nodes.cell_y[k]
        across = between_corners(nodes, k, slopes_of_cubics(tx), cubics(ty))
        up = between_corners(nodes, k, cubics(tx), slopes_of_cubics(ty))
        nodes.normal_x[k] = -nodes.weight[k] * across
        nodes.normal_y[k] = -nodes.weight[k] * up


def add_forces(nodes, total, count):
    """(fx, fy, torque) of so many charges, times a step, added to a total."""
    fx, fy, torque = total
    write_forces(nodes, count)
    for k in range(count):
        across, up = nodes.normal_x[k], nodes.normal_y[k]
        fx, fy = fx + across, fy + up
        torque += nodes.x[k] * up - nodes.y[k] * across
    return fx, fy, torque


@hook
@apart
def sum_charges(scene, work, a, b, x, y, cosine, sine):
    """(fx, fy, torque about b's centroid) on a metre of body a [N/m, N/m, N], in the frame of b,
    where a lies at x, y [m] turned by an angle of that cosine and sine."""
    _, strength, reach = scene.layer
    bound = scene.bodies[b].bounding_radius + reach
    total, count, grid = (0.0, 0.0, 0.0), 0, scene.grids[b]
    for number in range(scene.first_group[a], scene.first_group[a + 1]):
        group = scene.groups[number]
        most = bound + group.extent
        mx = x + cosine * group.x - sine * group.y
        my = y + sine * group.x + cosine * group.y
        if mx * mx + my * my > most * most:
            continue
        for row in range(group.first, group.first + group.count):
            charge = scene.charges[row]
            ax = x + cosine * charge.x - sine * charge.y
            ay = y + sine * charge.x + cosine * charge.y
            count = put_charge(scene, work.nodes, count, grid, ax, ay, charge.strength)
        if count > MOST_NODES - GROUP:
            total = add_forces(work.nodes, total, count)
            count = 0
    fx, fy, torque = add_forces(work.nodes, total, count)
    strength *= grid.fineness
    return strength * fx, strength * fy, strength * torque


def no_charges(scene, work, a, b, x, y, cosine, sine):
    """There are none."""
    return 0.0, 0.0, 0.0
