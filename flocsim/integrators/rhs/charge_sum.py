"""Double-layer forces: all charges of one body in the tabulated field of the other.

Charges, why they exist and the tables of their field: flocsim.geometry.contact.charges. Forces
between outlines reach this sum and that of pressures the same way (outline_sum.py). The potential φ
in a cell of the table is the bicubic Hermite interpolation of φ, ∂φ/∂x, ∂φ/∂y and ∂²φ/∂x∂y at its
corners, so force and energy are consistent and the force is continuous. The force on a charge q is
−q ∇φ.
"""

from flocsim.compiler.linker import apart, loops_apart
from flocsim.hooks import hook
from flocsim.state.outlines import GROUP, MOST_NODES, TILE, TILE_BITS


def hermite_cubics(t):
    """Return the cubic Hermite polynomials at t in [0, 1]: of both values, then of both slopes."""
    s = 1.0 - t
    return s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t), t * s * s, -t * t * s


def hermite_slopes(t):
    """Return the derivatives of the cubic Hermite polynomials at t."""
    s = 1.0 - t
    return -6.0 * t * s, 6.0 * t * s, s * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)


def cell_of(tiles, grid, x, y):
    """Return (node, x, y) of the cell that contains a point in a body's frame.

    ``node`` is its lower left corner, −1 outside the tabulated tiles; x, y in [0, 1) are the
    position within the cell.
    """
    across, up = (x - grid.x) * grid.fineness, (y - grid.y) * grid.fineness
    if not (0.0 <= across < TILE * grid.across and 0.0 <= up < TILE * grid.up):
        return -1, 0.0, 0.0
    # Indices are non-negative, so shifts and masks split them into tile and step.
    i, j = int(across), int(up)
    first = tiles[grid.tile + (j >> TILE_BITS) * grid.across + (i >> TILE_BITS)]
    if first < 0:
        return -1, 0.0, 0.0
    within = TILE - 1
    return first + (j & within) * (TILE + 1) + (i & within), across - i, up - j


def write_charge(scene, nodes, count, grid, x, y, charge):
    """Append a charge in the field of a Grid, with the field at the corners of its cell. Return the
    new count, unchanged where there is no field."""
    node, across, up = cell_of(scene.tiles, grid, x, y)
    if node < 0:
        return count
    nodes.x[count], nodes.y[count] = x, y
    nodes.weight[count] = charge
    nodes.cell_x[count], nodes.cell_y[count] = across, up
    for corner in range(4):
        # Corners in the order lower left, lower right, upper left, upper right.
        place = node + (corner >> 1) * (TILE + 1) + (corner & 1)
        known = scene.field[place]
        nodes.potential[corner, count] = known.potential
        nodes.by_x[corner, count] = known.by_x
        nodes.by_y[corner, count] = known.by_y
        nodes.by_xy[corner, count] = known.by_xy
    return count + 1


def blend_along_x(values, slopes, k, corner, x):
    """Interpolate along x between a corner of a cell and its right neighbour, from values and
    slopes."""
    first, second = values[corner, k], values[corner + 1, k]
    slope, slope_2 = slopes[corner, k], slopes[corner + 1, k]
    return x[0] * first + x[1] * second + x[2] * slope + x[3] * slope_2


def interpolate_cell(nodes, k, x, y):
    """Return φ in a cell, or its derivative by x or y [per step]: ``x`` and ``y`` are the Hermite
    polynomials of that direction, or their slopes."""
    # Along x at the lower and the upper side, then along y.
    value = blend_along_x(nodes.potential, nodes.by_x, k, 0, x)
    value_2 = blend_along_x(nodes.potential, nodes.by_x, k, 2, x)
    rise = blend_along_x(nodes.by_y, nodes.by_xy, k, 0, x)
    rise_2 = blend_along_x(nodes.by_y, nodes.by_xy, k, 2, x)
    return y[0] * value + y[1] * value_2 + y[2] * rise + y[3] * rise_2


@loops_apart
def write_forces(nodes, count):
    """Write the forces on the first ``count`` charges, times a step of the grid, to the nodes'
    normals."""
    for k in range(count):
        tx, ty = nodes.cell_x[k], nodes.cell_y[k]
        across = interpolate_cell(nodes, k, hermite_slopes(tx), hermite_cubics(ty))
        up = interpolate_cell(nodes, k, hermite_cubics(tx), hermite_slopes(ty))
        nodes.normal_x[k] = -nodes.weight[k] * across
        nodes.normal_y[k] = -nodes.weight[k] * up


def add_forces(nodes, total, count):
    """Add (fx, fy, torque) of the first ``count`` charges, times a step of the grid, to a total."""
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
    """Return (fx, fy, torque about b's centroid) per depth on body a [N/m, N/m, N], in the frame of
    b.

    In this frame a lies at x, y [m], turned by the angle of the given cosine and sine.
    """
    _, strength, reach = scene.layer
    bound = scene.bodies[b].bounding_radius + reach
    total, count, grid = (0.0, 0.0, 0.0), 0, scene.grids[b]
    for number in range(scene.first_group[a], scene.first_group[a + 1]):
        group = scene.groups[number]
        most = bound + group.extent
        mx = x + cosine * group.x - sine * group.y
        my = y + sine * group.x + cosine * group.y
        # Skip groups of charges beyond the reach of b's field.
        if mx * mx + my * my > most * most:
            continue
        for row in range(group.first, group.first + group.count):
            charge = scene.charges[row]
            ax = x + cosine * charge.x - sine * charge.y
            ay = y + sine * charge.x + cosine * charge.y
            count = write_charge(scene, work.nodes, count, grid, ax, ay, charge.strength)
        # Work in batches: one vectorised loop per full buffer.
        if count > MOST_NODES - GROUP:
            total = add_forces(work.nodes, total, count)
            count = 0
    fx, fy, torque = add_forces(work.nodes, total, count)
    # Slopes were per step of the grid.
    strength *= grid.fineness
    return strength * fx, strength * fy, strength * torque


def no_charges(scene, work, a, b, x, y, cosine, sine):
    """Return zeros: the scene has no charges."""
    return 0.0, 0.0, 0.0
