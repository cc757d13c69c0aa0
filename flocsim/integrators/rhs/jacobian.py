"""Derivatives of the forces: DAMPING = −∂F/∂v and STIFFNESS = −∂F/∂q, of all bodies' coordinates.

A force along a direction J (its entries on two bodies, three each) whose size depends on J·q and
J·v gives products JᵀJ. What turning does to the directions is kept where it is of first order in
the contact forces; the rest is left to Newton's iterations, whose result it does not touch.

Turning changes the force of a pair, whose normal and arms go with the bodies' places.
With f = N n + T t the normal turns by ψ, and the force by (N t − T n) ψ. On the vertex's body the
torque changes by A (ψ − θ_a), where A = p·f and p leads from the centroid to the vertex. On the
edge's body, the same holds for an end of the edge; on its inside the foot slides by σ instead, and
the torque changes by N σ.
"""

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import row_radii, separation
from flocsim.hooks import (
    CENTRE_FORCE,
    CONTACT_FORCE,
    POSITION_DERIVATIVES,
    VELOCITY_DERIVATIVES,
    centre_derivatives,
    centre_force,
    contact_derivatives,
    contact_force,
    has,
    hook,
    position_derivatives,
    surface_derivatives,
    surface_force,
    velocity_derivatives,
)
from flocsim.integrators.rhs.blocks import block_count, lower_block, own_block, upper_block
from flocsim.integrators.rhs.error import remember_velocities
from flocsim.integrators.rhs.friction import limit_slope
from flocsim.integrators.rhs.outline_sum import acts_along, between_outlines, outline_reach
from flocsim.integrators.rhs.pair_resistance import add_pair_damping
from flocsim.integrators.rhs.stated_error import doubted
from flocsim.integrators.rhs.surface_gap import (
    mean_direction,
    run_end,
    sharpness,
    surface_view,
)
from flocsim.integrators.rhs.views import (
    body_view,
    centre_view,
    contact_view,
    soft_centre_line,
)
from flocsim.state.bodies import ANGLE
from flocsim.state.contacts import GRAZES, TOUCHES
from flocsim.state.views import moved_contact
from flocsim.state.work import DAMPING, FORCING, NOW, STIFFNESS


def normal_rows(work, row):
    """Entries of a pair's normal direction on its two bodies, now."""
    g = work.geometry
    nx, ny = g[NOW, row].normal_x, g[NOW, row].normal_y
    return (nx, ny, g[NOW, row].vertex_arm_n), (-nx, -ny, -g[NOW, row].edge_arm_n)


def tangent_rows(work, row):
    """Entries of a pair's tangential direction on its two bodies, now."""
    g = work.geometry
    tx, ty = -g[NOW, row].normal_y, g[NOW, row].normal_x
    return (tx, ty, g[NOW, row].vertex_arm_t), (-tx, -ty, -g[NOW, row].edge_arm_t)


def add_outer(work, which, block, out, by, weight):
    """weight · outᵀ by of the entries of two directions on two bodies, to a block."""
    matrix = work.jacobian
    for i in range(3):
        for j in range(3):
            matrix[which, block, i, j] += weight * out[i] * by[j]


def add_product(scene, work, which, pair, a, b, out, by, weight):
    """weight · outᵀ by of two directions, each with its entries on bodies a and b, which are the
    ones of a pair."""
    if weight == 0.0:
        return
    (out_a, out_b), (by_a, by_b) = out, by
    ab, ba = upper_block(work, pair), lower_block(work, pair)
    if a == work.pairs[pair].later:
        ab, ba = ba, ab
    add_outer(work, which, a, out_a, by_a, weight)
    add_outer(work, which, ab, out_a, by_b, weight)
    add_outer(work, which, ba, out_b, by_a, weight)
    add_outer(work, which, b, out_b, by_b, weight)
    if scene.bodies[a].free == 0.0:
        add_outer(work, which, own_block(work, b), out_b, by_b, weight)
    elif scene.bodies[b].free == 0.0:
        add_outer(work, which, own_block(work, a), out_a, by_a, weight)


SHIFT_OF_X, SHIFT_OF_Y = (
    ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0)),
)
"""Directions of two bodies: apart along an axis."""

NOTHING = (0.0, 0.0, 0.0)
"""A body on which a direction has no entries."""

TURN = (0.0, 0.0, 1.0)
"""A body that turns."""


def sliding_row(scene, work, row):
    """Entries of σ, by which the vertex moves along the edge, on the two bodies; and the arms.

    The arms are p·n and the same for the foot.
    """
    radius_a, radius_b = row_radii(scene, work, row)
    g = work.geometry
    tx, ty = -g[NOW, row].normal_y, g[NOW, row].normal_x
    difference = radius_a - radius_b
    distance = g[NOW, row].gap + radius_a + radius_b
    arm_a = g[NOW, row].vertex_arm_t + 0.5 * (distance + difference)
    arm_b = g[NOW, row].edge_arm_t - 0.5 * (distance - difference)
    # An end goes with its body; along an edge that turns, the vertex slides by its own arm.
    beside = distance if g[NOW, row].turning == 0.0 else 0.0
    return (tx, ty, arm_a), (-tx, -ty, -arm_b - beside), arm_a, arm_b


def scaled(row, share):
    x, y, angle = row
    return x * share, y * share, angle * share


def add_turning(scene, work, row, normal, tangential):
    """Derivative by the places of a pair's force whose size stays the same."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g, stiffness, pair = work.geometry, work.jacobian, candidate.pair
    slide_a, slide_b, arm_a, arm_b = sliding_row(scene, work, row)
    nx, ny, turning = (
        g[NOW, row].normal_x,
        g[NOW, row].normal_y,
        g[NOW, row].turning,
    )
    fx, fy = -normal * ny - tangential * nx, normal * nx - tangential * ny
    torque_a = normal * arm_a - tangential * g[NOW, row].vertex_arm_n
    torque_b = normal * arm_b - tangential * g[NOW, row].edge_arm_n
    stiffness[STIFFNESS, a, ANGLE, ANGLE] += torque_a
    if turning == 0.0:
        out = (fx, fy, torque_a), (-fx, -fy, 0.0)
        add_product(scene, work, STIFFNESS, pair, a, b, out, (NOTHING, (0.0, 0.0, 1.0)), -1.0)
        on_b = NOTHING, (0.0, 0.0, 1.0)
        add_product(scene, work, STIFFNESS, pair, a, b, on_b, (slide_a, slide_b), -normal)
    else:
        out = (fx, fy, torque_a), (-fx, -fy, -torque_b)
        by = scaled(slide_a, turning), scaled(slide_b, turning)
        add_product(scene, work, STIFFNESS, pair, a, b, out, by, -1.0)
        stiffness[STIFFNESS, b, ANGLE, ANGLE] -= torque_b


def sliding_slopes(scene, work, row, normal, tangential):
    """Derivatives of (normal, tangential) by the overlap of a contact that slides, ξ along."""
    view = contact_view(scene, work, NOW, row)
    by = 1e-3 * abs(view.overlap) + 1e-13
    more = work.candidates[row].sliding * limit_slope(scene, work, NOW, row) * by
    deeper = moved_contact(
        view, view.overlap + by, view.overlap_rate, view.slip + more, view.slip_rate
    )
    more_normal, more_tangential = contact_force(scene, deeper)
    return (more_normal - normal) / by, (more_tangential - tangential) / by


def add_contact(scene, work, row):
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    pair = candidate.pair
    found = contact_derivatives(scene, contact_view(scene, work, NOW, row))
    along, across = normal_rows(work, row), tangent_rows(work, row)
    normal_slope, tangential_slope = found[2], found[3]
    if candidate.sliding != 0:
        normal_slope, tangential_slope = sliding_slopes(scene, work, row, found[0], found[1])
    add_product(scene, work, STIFFNESS, pair, a, b, along, along, normal_slope)
    add_product(scene, work, STIFFNESS, pair, a, b, across, along, tangential_slope)
    for axis in range(1, 4):
        # Sliding, ξ goes with the overlap alone.
        if axis == 2 and candidate.sliding != 0:
            continue
        # An overlap grows against the normal, a slip along the tangent.
        sign, by = (1.0, along) if axis < 2 else (-1.0, across)
        which = STIFFNESS if axis % 2 == 0 else DAMPING
        add_product(scene, work, which, pair, a, b, along, by, sign * found[2 + 2 * axis])
        add_product(scene, work, which, pair, a, b, across, by, sign * found[3 + 2 * axis])
    add_turning(scene, work, row, found[0], found[1])
    if candidate.sliding == 0:
        offset = work.contacts[row].slip_offset
        add_forcing(work, a, b, along, found[6] * offset)
        add_forcing(work, a, b, across, found[7] * offset)


def add_grazing(scene, work, row):
    """Derivatives of the force of a pair that grazes, which falls with the rate of the gap."""
    candidate = work.candidates[row]
    contact = work.contacts[row]
    a, b = candidate.vertex_body, candidate.edge_body
    pair, resistance = candidate.pair, contact.grazing_resistance
    along, across = normal_rows(work, row), tangent_rows(work, row)
    force = contact.grazing_force
    add_product(scene, work, DAMPING, pair, a, b, across, along, resistance)
    add_turning(scene, work, row, 0.0, force)
    pressed, tangential = doubted(scene, work, row, force)
    add_forcing(work, a, b, along, pressed)
    add_forcing(work, a, b, across, tangential)


def add_forcing(work, a, b, out, size):
    """Add a force of a size along a direction, by which the error is carried otherwise."""
    out_a, out_b = out
    for axis in range(3):
        work.velocity[FORCING, a, axis] += size * out_a[axis]
        work.velocity[FORCING, b, axis] += size * out_b[axis]


def add_contacts(scene, work):
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.velocity[FORCING, body, axis] = 0.0
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.closed == TOUCHES:
            add_contact(scene, work, row)
        elif candidate.closed == GRAZES:
            add_grazing(scene, work, row)


def add_body(work, which, body, derivatives):
    """Add the derivatives of one body's force by its coordinates, of one after another."""
    for axis in range(3):
        for part in range(3):
            entry = derivatives[3 * axis + part]
            work.jacobian[which, body, part, axis] -= entry
            work.jacobian[which, own_block(work, body), part, axis] -= entry


def add_bodies(scene, work, time):
    for body in range(scene.bodies.shape[0]):
        view = body_view(scene, work, time, NOW, body)
        if has(scene, VELOCITY_DERIVATIVES):
            add_body(work, DAMPING, body, velocity_derivatives(scene, view))
        if has(scene, POSITION_DERIVATIVES):
            add_body(work, STIFFNESS, body, position_derivatives(scene, view))


def add_centres(scene, work, time):
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        view = centre_view(scene, work, time, NOW, a, b)
        nx, ny, distance = soft_centre_line(scene, work, NOW, a, b)
        along = ((nx, ny, 0.0), (-nx, -ny, 0.0))
        slope, damping = centre_derivatives(scene, view)
        # The gradient (x, y)/d turns and, near d_c = 0, grows by (1 − n nᵀ)/d.
        turning = -centre_force(scene, view) / distance
        add_product(scene, work, STIFFNESS, pair, a, b, along, along, -slope - turning)
        add_product(scene, work, STIFFNESS, pair, a, b, SHIFT_OF_X, SHIFT_OF_X, turning)
        add_product(scene, work, STIFFNESS, pair, a, b, SHIFT_OF_Y, SHIFT_OF_Y, turning)
        add_product(scene, work, DAMPING, pair, a, b, along, along, damping)


def add_surfaces(scene, work, time):
    """Derivatives of the surface forces: of the gap g̃, of the shares in it and of the normals."""
    row = 0
    while row < work.tally.candidates:
        end = run_end(work, row)
        a, b = work.candidates[row].vertex_body, work.candidates[row].edge_body
        pair = work.candidates[row].pair
        view = surface_view(scene, work, time, NOW, row, end)
        repulsion = surface_force(scene, view)
        slope, damping = surface_derivatives(scene, view)
        mean = mean_direction(work, row, end)
        spread = repulsion * sharpness(scene, view.gap)
        add_product(scene, work, STIFFNESS, pair, a, b, mean, mean, -slope - spread)
        add_product(scene, work, DAMPING, pair, a, b, mean, mean, damping)
        for each in range(row, end):
            share = work.geometry[NOW, each].share
            if share > 0.0:
                c, d = work.candidates[each].vertex_body, work.candidates[each].edge_body
                along = normal_rows(work, each)
                spread = share * repulsion * sharpness(scene, work.geometry[NOW, each].gap)
                add_product(scene, work, STIFFNESS, pair, c, d, along, along, spread)
                add_turning(scene, work, each, share * repulsion, 0.0)
        row = end


NUDGE = 1e-5
"""Of the least gap that counts, by which outlines are moved to see how their forces change: in a
contact an attraction is 1e5 times as large as what moves a floc that rolls, and a derivative that
is off by its share of that costs Newton's method more steps than all the rest."""

OF_SIZE = 1e-6
"""The same of their size, where nothing acts along outlines."""


@hook
def add_outlines(scene, work, time):
    """Derivatives of the forces between outlines, and by how bodies are turned, by the places of
    both, from differences to what they are, which has been summed: all three follow from those by
    j's place, forces going with them."""
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        x, y = separation(scene, work, NOW, a, b)
        angle_a, angle_b = work.place[NOW, a, ANGLE], work.place[NOW, b, ANGLE]
        fx, fy = work.along[pair, 0], work.along[pair, 1]
        torque_a, torque_b = work.along[pair, 2], work.along[pair, 3]
        if fx == 0.0 and fy == 0.0 and torque_a == 0.0 and torque_b == 0.0:
            continue
        by = NUDGE * scene.outlines[1]
        if not outline_reach(scene) > 0.0:
            by = OF_SIZE * scene.bodies[a].bounding_radius
        turn = by / scene.bodies[a].bounding_radius
        across = between_outlines(scene, work, time, a, b, x + by, y, angle_a, angle_b)
        up = between_outlines(scene, work, time, a, b, x, y + by, angle_a, angle_b)
        turned = between_outlines(scene, work, time, a, b, x, y, angle_a + turn, angle_b)
        by_x = ((across[0] - fx) / by, (across[1] - fy) / by, (across[2] - torque_a) / by)
        by_y = ((up[0] - fx) / by, (up[1] - fy) / by, (up[2] - torque_a) / by)
        by_a = ((turned[0] - fx) / turn, (turned[1] - fy) / turn, (turned[2] - torque_a) / turn)
        on_b_x, on_b_y = (across[3] - torque_b) / by, (up[3] - torque_b) / by
        on_b_a = (turned[3] - torque_b) / turn
        # Turning b alone is turning both, with all that is between them, and a back.
        by_b = (
            -fy + by_x[0] * y - by_y[0] * x - by_a[0],
            fx + by_x[1] * y - by_y[1] * x - by_a[1],
            by_x[2] * y - by_y[2] * x - by_a[2],
        )
        on_b_b = on_b_x * y - on_b_y * x - on_b_a
        for column, on_a, on_b in (
            (SHIFT_OF_X, by_x, on_b_x),
            (SHIFT_OF_Y, by_y, on_b_y),
            ((TURN, NOTHING), by_a, on_b_a),
            ((NOTHING, TURN), by_b, on_b_b),
        ):
            out = on_a, (-on_a[0], -on_a[1], on_b)
            add_product(scene, work, STIFFNESS, pair, a, b, out, column, -1.0)


def weigh_velocities(scene, work, time, remaining):
    """Derivatives of the body forces, and from them how long each body remembers its velocity."""
    for which in range(2):
        for block in range(block_count(work)):
            for row in range(3):
                for column in range(3):
                    work.jacobian[which, block, row, column] = 0.0
    add_bodies(scene, work, time)
    remember_velocities(scene, work, remaining)


def assemble_others(scene, work, time, remaining):
    """DAMPING and STIFFNESS of the current state but for contacts."""
    weigh_velocities(scene, work, time, remaining)
    if has(scene, CENTRE_FORCE):
        add_centres(scene, work, time)
    if scene.surface_reach > 0.0:
        add_surfaces(scene, work, time)
    if acts_along(scene):
        add_outlines(scene, work, time)
    add_pair_damping(scene, work)


@apart
def assemble_jacobian(scene, work, time, remaining):
    """DAMPING and STIFFNESS of the current state, whose contact geometry is located."""
    assemble_others(scene, work, time, remaining)
    if has(scene, CONTACT_FORCE):
        add_contacts(scene, work)
