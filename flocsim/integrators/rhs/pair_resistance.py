"""What two bodies' motion and a flow's strain put on both through the water between them.

The resistance is a sum of squares (hydrodynamics/pair_table.py), each of a sum of the velocities of
both bodies: three of common motion, at the distance of the centres, and three of relative motion,
at a gap between that of the outlines and that of spheres of the same drag. So it is positive
whatever the shapes. All are along and across the line of centres: the normal of the nearest points
jumps from one arm of a floc to the next while the gap is still wide, at 16 times the steps. Body 1
of the tables is the earlier one of a pair.
"""

import math
from collections.abc import Callable

import flocsim.arrays as at
from flocsim.compiler.linker import apart
from flocsim.hooks import hook
from flocsim.hydrodynamics.pair_table import COLUMNS, NEAREST, NODES_A_UNIT
from flocsim.hydrodynamics.two_spheres import fading
from flocsim.integrators.rhs.blocks import lower_block, upper_block
from flocsim.integrators.rhs.surface_gap import soften
from flocsim.integrators.rhs.views import add_force, centre_line

(
    N_1, N_2, A_V1, A_V2, A_W1, A_W2, B_V1, B_V2, B_W1, B_W2, K_N, K_A, K_B,
    GAP, SLIDE, MIXED, TURN, T_N, T_T, T_S,
) = range(len(COLUMNS))  # fmt: skip
"""Columns of ``Scene.pair_table``."""

LOAD = 6
"""Column of ``Work.squares`` behind those of the velocities (v_x, v_y, spin) of both bodies."""

COMMON, RELATIVE, PULL = 0, 3, at.SQUARES
"""First rows of ``Work.squares`` of the two parts, and the row of what a strain pulls with."""

LEAN, LEAN_FALLS, LEAN_MOST = 1.5, 0.9, 0.8
"""By what a relative gap lies from that of the outlines towards that of the spheres, how that falls
with the gap, and by how many mean radii the two may differ in it: fitted to rigid multiblobs of 160
pairs of real flocs at .25 to 3 mean radii (benchmarks/accuracy/water_pairs.py)."""

SPHERE_DRAG, SPHERE_TURN = 6.0 * math.pi, 8.0 * math.pi
"""Of a sphere in slow flow, over µ r and µ r³."""


def interval_of(scene, gap):
    """(interval, share of it) of the tables at a gap [m]; at an end where they do not reach."""
    place = math.log(gap / (scene.water[at.MEAN_RADIUS] * NEAREST)) * NODES_A_UNIT
    last = scene.pair_table.shape[0] - 1
    interval = int(min(max(place, 0.0), last))
    return interval, min(max(place - interval, 0.0), 1.0)


def column(scene, interval, share, which):
    """The value of a column there."""
    c = scene.pair_table
    found = c[interval, which, 3] * share + c[interval, which, 2]
    return (found * share + c[interval, which, 1]) * share + c[interval, which, 0]


def column_slope(scene, interval, share, which, gap):
    """Its derivative by the gap there."""
    c = scene.pair_table
    found = 3.0 * c[interval, which, 3] * share + 2.0 * c[interval, which, 2]
    return (found * share + c[interval, which, 1]) * NODES_A_UNIT / gap


def write_row(work, row, one, two, load):
    """Write a square: entries (v_x, v_y, spin) of body 1 and of body 2, and its load."""
    for axis in range(3):
        work.squares[row, axis] = one[axis]
        work.squares[row, 3 + axis] = two[axis]
    work.squares[row, LOAD] = load


def value_in(work, row, state, one, two):
    """A row times the velocities of two bodies in a state."""
    total = 0.0
    for axis in range(at.VELOCITY, at.VELOCITY + 3):
        total += work.squares[row, axis - at.VELOCITY] * work.motion[state, one, axis]
        total += work.squares[row, axis - at.VELOCITY + 3] * work.motion[state, two, axis]
    return total


def flow_in(scene, work, state, body):
    """(u_x, u_y, spin) of the flow at a body."""
    f = scene.water
    x, y = work.motion[state, body, at.X], work.motion[state, body, at.Y]
    u = f[at.FLOW] + f[at.FLOW + 2] * x + f[at.FLOW + 3] * y
    v = f[at.FLOW + 1] + f[at.FLOW + 4] * x + f[at.FLOW + 5] * y
    return u, v, 0.5 * (f[at.FLOW + 4] - f[at.FLOW + 3])


def strain_along(scene, nx, ny):
    """(E_nn, E_nt) of the flow [1/s], t being n turned counter-clockwise."""
    f = scene.water
    e_xx = 0.5 * (f[at.FLOW + 2] - f[at.FLOW + 5])
    e_xy = 0.5 * (f[at.FLOW + 3] + f[at.FLOW + 4])
    cosine, sine = nx * nx - ny * ny, 2.0 * nx * ny
    return e_xx * cosine + e_xy * sine, e_xy * cosine - e_xx * sine


def add_flow(scene, work, row, state, one, two):
    """Add what the flow at both bodies comes to in a square to its load."""
    for body, first in ((one, 0), (two, 3)):
        u, v, spin = flow_in(scene, work, state, body)
        s = work.squares
        s[row, LOAD] += s[row, first] * u + s[row, first + 1] * v + s[row, first + 2] * spin


def write_common(scene, work, state, one, two, nx, ny, place):
    """The squares of common motion; their loads are those of the flow as well."""
    interval, share = place
    e_nn, e_nt = strain_along(scene, nx, ny)
    first = column(scene, interval, share, N_1)
    other = column(scene, interval, share, N_2)
    load = column(scene, interval, share, K_N) * e_nn
    write_row(work, COMMON, (first * nx, first * ny, 0.0), (other * nx, other * ny, 0.0), load)
    for row, v, w, k in ((1, A_V1, A_W1, K_A), (2, B_V1, B_W1, K_B)):
        first = column(scene, interval, share, v)
        other = column(scene, interval, share, v + 1)
        turn_1 = column(scene, interval, share, w)
        turn_2 = column(scene, interval, share, w + 1)
        one_row = -first * ny, first * nx, turn_1
        two_row = -other * ny, other * nx, turn_2
        load = column(scene, interval, share, k) * e_nt
        write_row(work, COMMON + row, one_row, two_row, load)
    for row in range(COMMON, COMMON + 3):
        add_flow(scene, work, row, state, one, two)


def write_relative(scene, work, place, normal, tangent):
    """The squares of relative motion, of the directions along which the gap opens and the bodies
    slide."""
    interval, share = place
    opens = column(scene, interval, share, GAP)
    slides = column(scene, interval, share, SLIDE)
    mixed = column(scene, interval, share, MIXED)
    turns = column(scene, interval, share, TURN)
    (n_1, n_2), (t_1, t_2) = normal, tangent
    write_row(work, RELATIVE, scaled(n_1, opens), scaled(n_2, opens), 0.0)
    x, y, spin = scaled(t_1, slides)
    x_2, y_2, spin_2 = scaled(t_2, slides)
    write_row(work, RELATIVE + 1, (x, y, spin - mixed), (x_2, y_2, spin_2 + mixed), 0.0)
    write_row(work, RELATIVE + 2, (0.0, 0.0, -turns), (0.0, 0.0, turns), 0.0)


def scaled(entries, size):
    x, y, spin = entries
    return size * x, size * y, size * spin


def centre_directions(scene, one, two, nx, ny, distance, gap):
    """(along, across) the line of centres, entries on both bodies: the gap's rate, and sliding
    where its middle is."""
    radius_1 = water_radius(scene, one)
    sum_ = radius_1 + water_radius(scene, two) + gap
    arm = distance * (radius_1 + 0.5 * gap) / sum_
    along = (-nx, -ny, 0.0), (nx, ny, 0.0)
    return along, ((ny, -nx, -arm), (-ny, nx, arm - distance))


def water_radius(scene, body):
    """Of the sphere that has the body's drag [m]."""
    return scene.water[at.FIRST_RADIUS + body]


def relative_gap(scene, work, state, between):
    """(the gap of two spheres that move against each other as the bodies do [m], how fast it grows
    with the gap of the outlines), ``between`` being that of the spheres of their drag.

    Far outlines are of no account, and at touch theirs is the gap.
    """
    spheres = max(between, 0.0)
    if work.tally[at.CANDIDATES] == 0:
        return spheres, 0.0
    found, _ = soften(scene, work, state, 0, work.tally[at.CANDIDATES])
    near, _ = fading(found, scene.water[at.NEAR_CUT])
    outlines, mean = max(found, 0.0), scene.water[at.MEAN_RADIUS]
    lean = LEAN_MOST * math.tanh((between - found) / (LEAN_MOST * mean))
    factor = math.exp(LEAN * mean / (mean + LEAN_FALLS * outlines) * lean)
    return near * outlines * factor + (1.0 - near) * spheres, near * factor


@apart
def write_squares(scene, work, state, one, two):
    """Write the resistance of two bodies to ``work.squares``: (the share of it that counts, by how
    much relative resistance along the gap of the outlines grows with that gap [N s/m²])."""
    nx, ny, distance = centre_line(scene, work, state, two, one)
    sizes = water_radius(scene, one) + water_radius(scene, two)
    far, _ = fading(distance - sizes, scene.water[at.CUT])
    if far == 0.0:
        return 0.0, 0.0
    floor, slope = scene.water[at.FLOOR], 0.0
    gap = max(distance - sizes, floor)
    write_common(scene, work, state, one, two, nx, ny, interval_of(scene, gap))
    along, across = centre_directions(scene, one, two, nx, ny, distance, gap)
    found, grows = relative_gap(scene, work, state, distance - sizes)
    gap = max(found, floor)
    place = interval_of(scene, gap)
    write_relative(scene, work, place, along, across)
    t_n, t_t, t_s = pull_at(scene, place, distance / (sizes + found))
    if found > floor:
        interval, share = place
        size = column(scene, interval, share, GAP)
        slope = 2.0 * far * grows * size * column_slope(scene, interval, share, GAP, gap)
    e_nn, e_nt = strain_along(scene, nx, ny)
    t_n, t_t, t_s = t_n * e_nn, t_t * e_nt, t_s * e_nt
    (n_1, n_2), (a_1, a_2) = along, across
    one_x, one_y, one_turn = (
        n_1[0] * t_n + a_1[0] * t_t, n_1[1] * t_n + a_1[1] * t_t, a_1[2] * t_t - t_s,
    )  # fmt: skip
    two_x, two_y, two_turn = (
        n_2[0] * t_n + a_2[0] * t_t, n_2[1] * t_n + a_2[1] * t_t, a_2[2] * t_t + t_s,
    )  # fmt: skip
    write_row(work, PULL, (one_x, one_y, one_turn), (two_x, two_y, two_turn), 0.0)
    return far, slope


def pull_at(scene, place, size):
    """What a strain of 1/s pulls at the two with while they are held together, times ``size``:
    tension, shear [N s] and torque [N m s]."""
    interval, share = place
    return (
        size * column(scene, interval, share, T_N), size * column(scene, interval, share, T_T),
        size * column(scene, interval, share, T_S),
    )  # fmt: skip


def own_drag(scene, body):
    """(of velocities, of the spin) Stokes drag of the sphere of its drag [N s/m, N m s]."""
    radius, viscosity = water_radius(scene, body), scene.water[at.VISCOSITY]
    return SPHERE_DRAG * viscosity * radius, SPHERE_TURN * viscosity * radius**3


def add_own(scene, work, state, body, far, first):
    """Add to a body's force what the water does to both beside their Stokes drag: ``PULL`` of it
    and the reverse of that drag."""
    u, v, spin = flow_in(scene, work, state, body)
    drag, turn = own_drag(scene, body)
    pull, m = work.squares, work.motion
    add_force(
        work, state, body,
        far * (pull[PULL, first] + drag * (m[state, body, at.VX] - u)),
        far * (pull[PULL, first + 1] + drag * (m[state, body, at.VY] - v)),
        far * (pull[PULL, first + 2] + turn * (m[state, body, at.SPIN] - spin)),
    )  # fmt: skip


@hook
def add_pair_resistance(scene, work, state):
    """Add what the water between two bodies puts on them in a state, which is located."""
    if scene.water[at.CUT] == 0.0:
        return
    s = work.squares
    for pair in range(work.tally[at.PAIRS]):
        one, two = work.pairs[pair, at.EARLIER], work.pairs[pair, at.LATER]
        far, _ = write_squares(scene, work, state, one, two)
        if far == 0.0:
            continue
        for row in range(at.SQUARES):
            size = far * (s[row, LOAD] - value_in(work, row, state, one, two))
            add_force(work, state, one, size * s[row, 0], size * s[row, 1], size * s[row, 2])
            add_force(work, state, two, size * s[row, 3], size * s[row, 4], size * s[row, 5])
        add_own(scene, work, state, one, far, 0)
        add_own(scene, work, state, two, far, 3)


@hook
def add_pair_damping(scene, work):
    """Its derivatives now: by the velocities all of them, by the places that of the resistance
    along the gap of the outlines, which grows without bounds."""
    if scene.water[at.CUT] == 0.0:
        return
    s, jacobian = work.squares, work.jacobian
    for pair in range(work.tally[at.PAIRS]):
        one, two = work.pairs[pair, at.EARLIER], work.pairs[pair, at.LATER]
        far, slope = write_squares(scene, work, at.NOW, one, two)
        if far == 0.0:
            continue
        blocks = (one, upper_block(work, pair), lower_block(work, pair), two)
        for row in range(at.SQUARES):
            for half in range(4):
                for i in range(3):
                    for j in range(3):
                        entry = s[row, 3 * (half // 2) + i] * s[row, 3 * (half % 2) + j]
                        jacobian[at.DAMPING, blocks[half], i, j] += far * entry
        for body in (one, two):
            drag, turn = own_drag(scene, body)
            jacobian[at.DAMPING, body, 0, 0] -= far * drag
            jacobian[at.DAMPING, body, 1, 1] -= far * drag
            jacobian[at.DAMPING, body, 2, 2] -= far * turn
        if slope != 0.0:
            add_narrowing(work, blocks, slope, value_in(work, RELATIVE, at.NOW, one, two))


def add_narrowing(work, blocks, slope, rate):
    """Add that the resistance to the rate of the gap grows as it closes; row RELATIVE of the
    squares is along the gap, ``rate`` what it comes to."""
    s = work.squares
    size = s[RELATIVE, 3] * s[RELATIVE, 3] + s[RELATIVE, 4] * s[RELATIVE, 4]
    if size == 0.0:
        return
    weight = slope * rate / (size * math.sqrt(size))
    for half in range(4):
        for i in range(3):
            for j in range(3):
                entry = s[RELATIVE, 3 * (half // 2) + i] * s[RELATIVE, 3 * (half % 2) + j]
                work.jacobian[at.STIFFNESS, blocks[half], i, j] += weight * entry


def nothing_between(scene, work, state):
    """Nothing acts between bodies through the water."""


def nothing_to_damp(scene, work):
    """The same of its derivatives."""


LEFT_OUT: dict[Callable, Callable] = {
    add_pair_resistance: nothing_between,
    add_pair_damping: nothing_to_damp,
}
"""{hook: function} of a scene without, so that nothing of it is compiled."""
