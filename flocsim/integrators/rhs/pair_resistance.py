"""Hydrodynamic resistance of two bodies: lubrication and the pull of a strained flow.

The resistance matrix is a sum of squares, R = Σ_k q_k q_kᵀ (hydrodynamics/pair.py), each q_k·v a
linear combination of the velocities of both bodies: three of common motion, tabulated by the
distance of the centres, and three of relative motion, tabulated by a gap between that of the
outlines and that of spheres of the same drag. So R is positive for any shapes. The force on both is

    F = Σ_k q_k (load_k − q_k·v),

load_k being what the strain rate of the flow adds. Directions are along and across the line of
centres: the normal at the nearest points jumps from one arm of a floc to the next while the gap is
still wide, which took 16 times the steps. Body 1 of the tables is the earlier one of a pair.
"""

import math
from collections.abc import Callable

from flocsim.compiler.linker import apart
from flocsim.hooks import hook
from flocsim.hydrodynamics.pair import COLUMNS, NEAREST, NODES_A_UNIT
from flocsim.hydrodynamics.two_spheres import fading
from flocsim.integrators.rhs.blocks import lower_block, upper_block
from flocsim.integrators.rhs.surface_gap import evaluate_smooth_gap
from flocsim.integrators.rhs.views import add_force, centre_line
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import DAMPING, NOW, SQUARES, STIFFNESS

(
    N_1, N_2, A_V1, A_V2, A_W1, A_W2, B_V1, B_V2, B_W1, B_W2, K_N, K_A, K_B,
    GAP, SLIDE, MIXED, TURN, T_N, T_T, T_S,
) = range(len(COLUMNS))  # fmt: skip
"""Columns of ``Scene.pair_table``."""

LOAD = 6
"""Column of ``Work.squares`` behind those of the velocities (v_n, v_t, spin) of both bodies."""

COMMON, RELATIVE, TENSION = 0, 3, SQUARES
"""First rows of ``Work.squares`` for common and for relative motion, and the row of the tension
that a strain exerts."""

BLEND, BLEND_DECAY, BLEND_LIMIT = 1.5, 0.9, 0.8
"""Position of the effective gap of relative motion between that of the outlines and that of the
spheres: strength, decay with the gap, and largest difference in mean radii.

Fitted to rigid multiblobs of 160 pairs of real flocs at .25 to 3 mean radii
(benchmarks/accuracy/water_pairs.py).
"""

SPHERE_DRAG, SPHERE_TURN = 6.0 * math.pi, 8.0 * math.pi
"""Stokes drag of a sphere over µ r, and of its rotation over µ r³."""


def interval_of(scene, gap):
    """Return (interval, fraction of it) of the tables at a gap [m], the ends where they do not
    reach."""
    place = math.log(gap / (scene.water.mean_radius * NEAREST)) * NODES_A_UNIT
    last = scene.pair_table.shape[0] - 1
    interval = int(min(max(place, 0.0), last))
    return interval, min(max(place - interval, 0.0), 1.0)


def column(scene, place, which):
    """Return the value of a column of the tables there: a cubic per interval."""
    c, (interval, share) = scene.pair_table, place
    found = c[interval, which, 3] * share + c[interval, which, 2]
    return (found * share + c[interval, which, 1]) * share + c[interval, which, 0]


def column_slope(scene, place, which, gap):
    """Return the derivative of a column by the gap there."""
    c, (interval, share) = scene.pair_table, place
    found = 3.0 * c[interval, which, 3] * share + 2.0 * c[interval, which, 2]
    return (found * share + c[interval, which, 1]) * NODES_A_UNIT / gap


def write_row(work, row, direction, one, two, load):
    """Write one q and its load, given its entries (v_n, v_t, spin) of body 1 and of body 2.

    Rows stand along x and y; ``direction`` is n.
    """
    s, (nx, ny) = work.squares, direction
    s[row, 0], s[row, 1] = one[0] * nx - one[1] * ny, one[0] * ny + one[1] * nx
    s[row, 3], s[row, 4] = two[0] * nx - two[1] * ny, two[0] * ny + two[1] * nx
    s[row, 2], s[row, 5], s[row, LOAD] = one[2], two[2], load


def row_times(work, row, one, two):
    """Return q·v of a row and the velocities (v_x, v_y, spin) of body 1 and of body 2."""
    s, total = work.squares, 0.0
    for k in range(3):
        total += s[row, k] * one[k] + s[row, 3 + k] * two[k]
    return total


def velocity_in(work, state, body):
    """Return (v_x, v_y, spin) of a body in a state."""
    v = work.velocity
    return v[state, body, X], v[state, body, Y], v[state, body, ANGLE]


def relative_to_flow(scene, work, state, body):
    """Return the same relative to the flow at the body."""
    vx, vy, spin = velocity_in(work, state, body)
    u, v, turning = flow_in(scene, work, state, body)
    return vx - u, vy - v, spin - turning


def flow_in(scene, work, state, body):
    """Return (u_x, u_y, spin) of the flow at a body."""
    f = scene.water
    x, y = work.place[state, body, X], work.place[state, body, Y]
    u = f.flow_x + f.flow_x_by_x * x + f.flow_x_by_y * y
    v = f.flow_y + f.flow_y_by_x * x + f.flow_y_by_y * y
    return u, v, 0.5 * (f.flow_y_by_x - f.flow_x_by_y)


def strain_along(scene, nx, ny):
    """Return (E_nn, E_nt) of the flow [1/s], t being n turned counter-clockwise."""
    f = scene.water
    e_xx = 0.5 * (f.flow_x_by_x - f.flow_y_by_y)
    e_xy = 0.5 * (f.flow_x_by_y + f.flow_y_by_x)
    cosine, sine = nx * nx - ny * ny, 2.0 * nx * ny
    return e_xx * cosine + e_xy * sine, e_xy * cosine - e_xx * sine


def write_common(scene, work, direction, place, e_nn, e_nt):
    """Write the rows of common motion, which is relative to the flow."""
    first, other = column(scene, place, N_1), column(scene, place, N_2)
    load = column(scene, place, K_N) * e_nn
    write_row(work, COMMON, direction, (first, 0.0, 0.0), (other, 0.0, 0.0), load)
    for row, v, w, k in ((1, A_V1, A_W1, K_A), (2, B_V1, B_W1, K_B)):
        one = 0.0, column(scene, place, v), column(scene, place, w)
        two = 0.0, column(scene, place, v + 1), column(scene, place, w + 1)
        write_row(work, COMMON + row, direction, one, two, column(scene, place, k) * e_nt)


def write_relative(scene, work, direction, place, arm, arm_2):
    """Write the rows of relative motion: the rate of the gap, and sliding at its middle."""
    opening, sliding = column(scene, place, GAP), column(scene, place, SLIDE)
    mixed, turning = column(scene, place, MIXED), column(scene, place, TURN)
    write_row(work, RELATIVE, direction, (-opening, 0.0, 0.0), (opening, 0.0, 0.0), 0.0)
    one, two = -sliding * arm - mixed, -sliding * arm_2 + mixed
    write_row(work, RELATIVE + 1, direction, (0.0, -sliding, one), (0.0, sliding, two), 0.0)
    write_row(work, RELATIVE + 2, direction, (0.0, 0.0, -turning), (0.0, 0.0, turning), 0.0)


def water_radius(scene, body):
    """Return the radius of the sphere that has the body's drag [m]."""
    return scene.water.first_radius if body == 0 else scene.water.second_radius


def relative_gap(scene, work, state, between):
    """Return the gap of two spheres with the same relative resistance as the bodies [m], and its
    derivative by the gap of the outlines.

    ``between`` is the gap of the spheres of their drag. Far apart the outlines do not matter; at
    touch their gap is the gap.
    """
    spheres = max(between, 0.0)
    if scene.water.near_cut == 0.0:
        return spheres, 1.0
    if work.tally.candidates == 0:
        return spheres, 0.0
    if scene.surface_reach > 0.0:
        # Forces between the two outlines have asked for it just now.
        found = work.tally.smooth_gap
    else:
        found, _ = evaluate_smooth_gap(scene, work, state, 0, work.tally.candidates)
    # Fade from the outlines' gap to the spheres'.
    near, _ = fading(found, scene.water.near_cut)
    outlines, mean = max(found, 0.0), scene.water.mean_radius
    difference = BLEND_LIMIT * math.tanh((between - found) / (BLEND_LIMIT * mean))
    factor = math.exp(BLEND * mean / (mean + BLEND_DECAY * outlines) * difference)
    return near * outlines * factor + (1.0 - near) * spheres, near * factor


@apart
def write_squares(scene, work, state, one, two):
    """Write the resistance of two bodies to ``work.squares``.

    Return (fraction that counts, derivative of the relative resistance along the gap by the gap of
    the outlines [N s/m²]).
    """
    # From body 1 to body 2.
    nx, ny, distance = centre_line(scene, work, state, two, one)
    direction = nx, ny
    radius = water_radius(scene, one)
    sizes = radius + water_radius(scene, two)
    far, _ = fading(distance - sizes, scene.water.cut)
    if far == 0.0:
        return 0.0, 0.0
    # Common motion, at the gap of the spheres.
    floor, slope = scene.water.floor, 0.0
    gap = max(distance - sizes, floor)
    e_nn, e_nt = strain_along(scene, nx, ny)
    write_common(scene, work, direction, interval_of(scene, gap), e_nn, e_nt)
    # Relative motion, at the gap between outlines and spheres; sliding acts in the middle of the
    # gap.
    arm = distance * (radius + 0.5 * gap) / (sizes + gap)
    found, sensitivity = relative_gap(scene, work, state, distance - sizes)
    gap = max(found, floor)
    place = interval_of(scene, gap)
    write_relative(scene, work, direction, place, arm, distance - arm)
    # Below ``floor`` the resistance is constant.
    if found > floor:
        size = column(scene, place, GAP)
        slope = 2.0 * far * sensitivity * size * column_slope(scene, place, GAP, gap)
    # Tension, shear [N] and torque [N m] by the strain, on bodies that are held together.
    size = distance / (sizes + found)
    t_n, t_t = size * e_nn * column(scene, place, T_N), size * e_nt * column(scene, place, T_T)
    t_s = size * e_nt * column(scene, place, T_S)
    one_pull, two_pull = (-t_n, -t_t, -arm * t_t - t_s), (t_n, t_t, (arm - distance) * t_t + t_s)
    write_row(work, TENSION, direction, one_pull, two_pull, 0.0)
    return far, slope


def sphere_drag(scene, body):
    """Return the Stokes drag of the sphere of a body's drag, for velocity and spin [N s/m, N m
    s]."""
    radius, viscosity = water_radius(scene, body), scene.water.viscosity
    return SPHERE_DRAG * viscosity * radius, SPHERE_TURN * viscosity * radius**3


@hook
def add_pair_resistance(scene, work, state):
    """Add to the forces of a located state what the water between two bodies exerts beyond Stokes
    drag."""
    if scene.water.cut == 0.0:
        return
    s = work.squares
    for pair in range(work.tally.pairs):
        one, two = work.pairs[pair].earlier, work.pairs[pair].later
        far, _ = write_squares(scene, work, state, one, two)
        if far == 0.0:
            continue
        motion, motion_2 = velocity_in(work, state, one), velocity_in(work, state, two)
        against = relative_to_flow(scene, work, state, one)
        against_2 = relative_to_flow(scene, work, state, two)
        # The tables hold the whole resistance: take each body's own Stokes drag off.
        for body, (vx, vy, spin) in ((one, against), (two, against_2)):
            drag, turn = sphere_drag(scene, body)
            add_force(work, state, body, far * drag * vx, far * drag * vy, far * turn * spin)
        for row in range(SQUARES + 1):
            # Tension counts as it is.
            size = far
            if row < RELATIVE:
                size *= s[row, LOAD] - row_times(work, row, against, against_2)
            elif row < TENSION:
                size *= -row_times(work, row, motion, motion_2)
            add_force(work, state, one, size * s[row, 0], size * s[row, 1], size * s[row, 2])
            add_force(work, state, two, size * s[row, 3], size * s[row, 4], size * s[row, 5])


@hook
def add_pair_damping(scene, work):
    """Add the derivatives of that resistance to the Jacobian.

    By velocities all of them; by positions only that of the resistance along the gap, which
    diverges as the gap closes.
    """
    if scene.water.cut == 0.0:
        return
    s, jacobian = work.squares, work.jacobian
    for pair in range(work.tally.pairs):
        one, two = work.pairs[pair].earlier, work.pairs[pair].later
        far, slope = write_squares(scene, work, NOW, one, two)
        if far == 0.0:
            continue
        blocks = (one, upper_block(work, pair), lower_block(work, pair), two)
        motion, motion_2 = velocity_in(work, NOW, one), velocity_in(work, NOW, two)
        opening = slope * row_times(work, RELATIVE, motion, motion_2)
        # R = Σ q qᵀ, less each body's own drag.
        for row in range(SQUARES):
            add_square(work, DAMPING, blocks, row, far)
        for body in (one, two):
            drag, turn = sphere_drag(scene, body)
            jacobian[DAMPING, body, 0, 0] -= far * drag
            jacobian[DAMPING, body, 1, 1] -= far * drag
            jacobian[DAMPING, body, 2, 2] -= far * turn
        size = s[RELATIVE, 3] * s[RELATIVE, 3] + s[RELATIVE, 4] * s[RELATIVE, 4]
        if opening != 0.0 and size > 0.0:
            # The resistance to the rate of the gap grows as the gap closes.
            add_square(work, STIFFNESS, blocks, RELATIVE, opening / (size * math.sqrt(size)))


def add_square(work, kind, blocks, row, weight):
    """Add weight · q qᵀ of a row, with entries along x and y, to the blocks of both bodies."""
    s = work.squares
    for half in range(4):
        for i in range(3):
            for j in range(3):
                entry = s[row, 3 * (half // 2) + i] * s[row, 3 * (half % 2) + j]
                work.jacobian[kind, blocks[half], i, j] += weight * entry


def nothing_between(scene, work, state):
    """Add nothing: no water acts between the bodies."""


def nothing_to_damp(scene, work):
    """Add nothing, likewise."""


LEFT_OUT: dict[Callable, Callable] = {
    add_pair_resistance: nothing_between,
    add_pair_damping: nothing_to_damp,
}
"""{hook: function} for a scene without such water; nothing of it is compiled then."""
