"""Derivatives of the forces: DAMPING = −∂F/∂v and STIFFNESS = −∂F/∂q in the coordinates of all
bodies.

A force F along a direction J (a row of six entries on two bodies), whose size depends on the gap
J·q and its rate J·v, contributes outer products:

    STIFFNESS += −∂F/∂gap JᵀJ,   DAMPING += −∂F/∂(gap rate) JᵀJ.

Geometric stiffness. The direction itself changes as bodies turn and slide. With f = N n + T t the
normal turns by ψ, and the force changes by (N t − T n) ψ. The torque on the vertex's body changes
by A (ψ − θ_a), where A = p·f and p leads from the centroid to the vertex. On the edge's body the
same holds at an end of the edge; inside the edge the foot slides by σ instead, and the torque
changes by N σ. Only terms of first order in the contact forces are included: the Jacobian steers
Newton's iteration, and its fixed point does not depend on it.

``Work.jacobian`` stores blocks of 3 × 3; see blocks.py.
"""

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import separation
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
from flocsim.integrators.rhs.error import set_velocity_lifetimes
from flocsim.integrators.rhs.friction import limit_slope
from flocsim.integrators.rhs.orientation import DIFFERENCE, distance_step, oriented_now
from flocsim.integrators.rhs.outline_sum import has_outline_forces, outline_forces_at, outline_reach
from flocsim.integrators.rhs.pair_resistance import add_pair_damping
from flocsim.integrators.rhs.propagated_error import grazing_error_source
from flocsim.integrators.rhs.surface_gap import (
    pair_end,
    share_sensitivity,
    smooth_gap_gradient,
    surface_view,
)
from flocsim.integrators.rhs.views import (
    body_view,
    centre_view,
    contact_view,
    soft_centre_line,
)
from flocsim.state.bodies import ANGLE
from flocsim.state.contacts import CLOSED, GRAZING
from flocsim.state.views import moved_contact
from flocsim.state.work import DAMPING, FORCING, NOW, STIFFNESS


def normal_rows(work, row):
    """Return the present normal direction of a pair as entries (x, y, angle) on its two bodies."""
    g = work.geometry
    nx, ny = g[NOW, row].normal_x, g[NOW, row].normal_y
    return (nx, ny, g[NOW, row].vertex_arm_n), (-nx, -ny, -g[NOW, row].edge_arm_n)


def tangent_rows(work, row):
    """Return the present tangential direction of a pair as entries (x, y, angle) on its two
    bodies."""
    g = work.geometry
    tx, ty = -g[NOW, row].normal_y, g[NOW, row].normal_x
    return (tx, ty, g[NOW, row].vertex_arm_t), (-tx, -ty, -g[NOW, row].edge_arm_t)


def add_outer(work, which, block, out, by, weight):
    """Add weight · outᵀ by to a block; ``out`` and ``by`` are entries (x, y, angle) of two
    directions."""
    matrix = work.jacobian
    for i in range(3):
        for j in range(3):
            matrix[which, block, i, j] += weight * out[i] * by[j]


def add_outer_products(scene, work, which, pair, a, b, out, by, weight):
    """Add weight · outᵀ by of two directions with entries on bodies a and b, which are those of a
    pair."""
    if weight == 0.0:
        return
    (out_a, out_b), (by_a, by_b) = out, by
    # Pairs store (earlier, later) as the upper block.
    ab, ba = upper_block(work, pair), lower_block(work, pair)
    if a == work.pairs[pair].later:
        ab, ba = ba, ab
    add_outer(work, which, a, out_a, by_a, weight)
    add_outer(work, which, ab, out_a, by_b, weight)
    add_outer(work, which, ba, out_b, by_a, weight)
    add_outer(work, which, b, out_b, by_b, weight)
    # The part of a free body's diagonal block that comes from a fixed one is stored apart as well:
    # it is an external force, which may change total momentum.
    if scene.bodies[a].free == 0.0:
        add_outer(work, which, own_block(work, b), out_b, by_b, weight)
    elif scene.bodies[b].free == 0.0:
        add_outer(work, which, own_block(work, a), out_a, by_a, weight)


RELATIVE_X, RELATIVE_Y = (
    ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0)),
)
"""Unit rows of two bodies that move apart along an axis."""

ZERO_ROW = (0.0, 0.0, 0.0)
"""Entries of a direction that does not involve this body."""

UNIT_TURN = (0.0, 0.0, 1.0)
"""Entries of a body's own rotation."""


def sliding_row(scene, work, row):
    """Return the row of σ, the sliding of the vertex along the edge, on both bodies, and its arms
    p·n.

    ``arm_a`` leads from the vertex body's centroid to the vertex, ``arm_b`` from the edge body's to
    the foot.
    """
    radius_a, radius_b = work.candidates[row].vertex_radius, work.candidates[row].edge_radius
    g = work.geometry
    tx, ty = -g[NOW, row].normal_y, g[NOW, row].normal_x
    # Arms in the geometry end at the middle of the overlap; shift them to the vertex and the foot.
    difference = radius_a - radius_b
    distance = g[NOW, row].gap + radius_a + radius_b
    arm_a = g[NOW, row].vertex_arm_t + 0.5 * (distance + difference)
    arm_b = g[NOW, row].edge_arm_t - 0.5 * (distance - difference)
    # An end of the edge moves with its body. Inside an edge that turns, the vertex slides along it
    # by its distance from it, too.
    beside = distance if g[NOW, row].turning == 0.0 else 0.0
    return (tx, ty, arm_a), (-tx, -ty, -arm_b - beside), arm_a, arm_b


def add_geometric_stiffness(scene, work, row, normal, tangential):
    """Add the derivative by position of a pair's force of constant size (N, T) [N]; see the
    module."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g, stiffness, pair = work.geometry, work.jacobian, candidate.pair
    slide_a, slide_b, arm_a, arm_b = sliding_row(scene, work, row)
    nx, ny, turning = g[NOW, row].normal_x, g[NOW, row].normal_y, g[NOW, row].turning
    # N t − T n, and A − (torque of the turned arm), for a unit turn ψ.
    fx, fy = -normal * ny - tangential * nx, normal * nx - tangential * ny
    torque_a = normal * arm_a - tangential * g[NOW, row].vertex_arm_n
    torque_b = normal * arm_b - tangential * g[NOW, row].edge_arm_n
    stiffness[STIFFNESS, a, ANGLE, ANGLE] += torque_a
    # Foot inside the edge: ψ = θ_b, and the foot slides by σ.
    if turning == 0.0:
        out = (fx, fy, torque_a), (-fx, -fy, 0.0)
        on_b = ZERO_ROW, UNIT_TURN
        add_outer_products(scene, work, STIFFNESS, pair, a, b, out, on_b, -1.0)
        add_outer_products(scene, work, STIFFNESS, pair, a, b, on_b, (slide_a, slide_b), -normal)
    else:
        # Foot at an end: the normal turns by ψ = σ/distance.
        out = (fx, fy, torque_a), (-fx, -fy, -torque_b)
        add_outer_products(scene, work, STIFFNESS, pair, a, b, out, (slide_a, slide_b), -turning)
        stiffness[STIFFNESS, b, ANGLE, ANGLE] -= torque_b


def sliding_derivatives(scene, work, row, normal, tangential):
    """Return the derivatives of (N, T) by the overlap of a sliding contact, along which ξ = s L
    [N/m]."""
    view = contact_view(scene, work, NOW, row)
    # The difference step: a thousandth of the overlap.
    by = 1e-3 * abs(view.overlap) + 1e-18
    more = work.candidates[row].slide_direction * limit_slope(scene, work, NOW, row) * by
    deeper = moved_contact(
        view, view.overlap + by, view.overlap_rate, view.slip + more, view.slip_rate
    )
    more_normal, more_tangential = contact_force(scene, deeper)
    return (more_normal - normal) / by, (more_tangential - tangential) / by


def add_contact(scene, work, row):
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    pair = candidate.pair
    # Layout: N, T, then both by overlap, overlap rate, slip and slip rate.
    found = contact_derivatives(scene, contact_view(scene, work, NOW, row))
    along, across = normal_rows(work, row), tangent_rows(work, row)
    # ∂/∂overlap. While sliding, ξ = s L follows the overlap, and T with it.
    normal_slope, tangential_slope = found[2], found[3]
    if candidate.slide_direction != 0:
        normal_slope, tangential_slope = sliding_derivatives(scene, work, row, found[0], found[1])
    add_outer_products(scene, work, STIFFNESS, pair, a, b, along, along, normal_slope)
    add_outer_products(scene, work, STIFFNESS, pair, a, b, across, along, tangential_slope)
    # ∂/∂(overlap rate), ∂/∂ξ, ∂/∂(slip rate).
    for axis in range(1, 4):
        # While sliding, ξ is a function of the overlap alone.
        if axis == 2 and candidate.slide_direction != 0:
            continue
        # The overlap grows against the normal, the slip along the tangent.
        sign, by = (1.0, along) if axis < 2 else (-1.0, across)
        which = STIFFNESS if axis % 2 == 0 else DAMPING
        add_outer_products(scene, work, which, pair, a, b, along, by, sign * found[2 + 2 * axis])
        add_outer_products(scene, work, which, pair, a, b, across, by, sign * found[3 + 2 * axis])
    add_geometric_stiffness(scene, work, row, found[0], found[1])
    # ξ counts from touch, so an error of position that existed then does not stretch the spring:
    # the propagated error needs this source.
    if candidate.slide_direction == 0:
        offset = work.contacts[row].slip_offset
        add_error_source(work, a, b, along, found[6] * offset)
        add_error_source(work, a, b, across, found[7] * offset)


def add_grazing(scene, work, row):
    """Add the derivatives of a grazing pair, whose tangential force falls with the rate of the
    gap."""
    candidate = work.candidates[row]
    contact = work.contacts[row]
    a, b = candidate.vertex_body, candidate.edge_body
    pair, resistance = candidate.pair, contact.grazing_resistance
    along, across = normal_rows(work, row), tangent_rows(work, row)
    force = contact.grazing_force
    add_outer_products(scene, work, DAMPING, pair, a, b, across, along, resistance)
    add_geometric_stiffness(scene, work, row, 0.0, force)
    pressed, tangential = grazing_error_source(scene, work, row, force)
    add_error_source(work, a, b, along, pressed)
    add_error_source(work, a, b, across, tangential)


def add_error_source(work, a, b, out, size):
    """Add a force of a given size along a direction to the source of the error propagation
    (FORCING)."""
    out_a, out_b = out
    for axis in range(3):
        work.velocity[FORCING, a, axis] += size * out_a[axis]
        work.velocity[FORCING, b, axis] += size * out_b[axis]


def add_contact_derivatives(scene, work):
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.velocity[FORCING, body, axis] = 0.0
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.contact_mode == CLOSED:
            add_contact(scene, work, row)
        elif candidate.contact_mode == GRAZING:
            add_grazing(scene, work, row)


def add_body_blocks(work, which, body, derivatives):
    """Add the derivatives of one body's force, ordered by coordinate and then by component."""
    for axis in range(3):
        for part in range(3):
            entry = derivatives[3 * axis + part]
            work.jacobian[which, body, part, axis] -= entry
            work.jacobian[which, own_block(work, body), part, axis] -= entry


def add_body_derivatives(scene, work, time):
    for body in range(scene.bodies.shape[0]):
        view = body_view(scene, work, time, NOW, body)
        if has(scene, VELOCITY_DERIVATIVES):
            add_body_blocks(work, DAMPING, body, velocity_derivatives(scene, view))
        if has(scene, POSITION_DERIVATIVES):
            add_body_blocks(work, STIFFNESS, body, position_derivatives(scene, view))


def add_centre_derivatives(scene, work, time):
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        view = centre_view(scene, work, time, NOW, a, b)
        nx, ny, distance = soft_centre_line(scene, work, NOW, a, b)
        along = ((nx, ny, 0.0), (-nx, -ny, 0.0))
        slope, damping = centre_derivatives(scene, view)
        # F = f(d) ∇d has ∂F/∂q = f' ∇d ∇dᵀ + f ∇∇d with ∇∇d = (1 − n nᵀ)/d for the softened
        # distance d.
        turning = -centre_force(scene, view) / distance
        add_outer_products(scene, work, STIFFNESS, pair, a, b, along, along, -slope - turning)
        add_outer_products(scene, work, STIFFNESS, pair, a, b, RELATIVE_X, RELATIVE_X, turning)
        add_outer_products(scene, work, STIFFNESS, pair, a, b, RELATIVE_Y, RELATIVE_Y, turning)
        add_outer_products(scene, work, DAMPING, pair, a, b, along, along, damping)


def add_surface_derivatives(scene, work, time):
    """Add the derivatives of surface forces F(g̃) Σ s_k n_k: of F, of the fractions s_k and of the
    normals.

    With κ = (1 + dℓ/dg)/ℓ (share_sensitivity) and m = Σ s_k n_k the gradient of g̃, d ln s_k =
    κ(g̃) dg̃ − κ(g_k) dg_k, so that

        STIFFNESS = −(F' + F κ(g̃)) mᵀm + F Σ s_k κ(g_k) n_kᵀn_k + turning of the n_k.
    """
    row = 0
    while row < work.tally.candidates:
        end = pair_end(work, row)
        a, b = work.candidates[row].vertex_body, work.candidates[row].edge_body
        pair = work.candidates[row].pair
        view = surface_view(scene, work, time, NOW, row, end)
        repulsion = surface_force(scene, view)
        slope, damping = surface_derivatives(scene, view)
        mean = smooth_gap_gradient(work, row, end)
        spread = repulsion * share_sensitivity(scene, view.gap)
        add_outer_products(scene, work, STIFFNESS, pair, a, b, mean, mean, -slope - spread)
        add_outer_products(scene, work, DAMPING, pair, a, b, mean, mean, damping)
        for each in range(row, end):
            share = work.geometry[NOW, each].force_share
            if share > 0.0:
                c, d = work.candidates[each].vertex_body, work.candidates[each].edge_body
                along = normal_rows(work, each)
                spread = share * repulsion * share_sensitivity(scene, work.geometry[NOW, each].gap)
                add_outer_products(scene, work, STIFFNESS, pair, c, d, along, along, spread)
                add_geometric_stiffness(scene, work, each, share * repulsion, 0.0)
        row = end


OUTLINE_DIFFERENCE = 1e-5
"""Difference step, as a fraction of the least gap d_min that forces along outlines resolve.

In a contact, attraction is 1e5 times the force that rolls a floc, so an error of the derivative by
1e-3 of itself dominates: with 1e-3 Newton's method needed up to sixteen times as many steps.
"""


def slopes(shifted, here, by):
    """Return the forces and torques of a shifted evaluation less those here, over the shift."""
    return (
        (shifted[0] - here[0]) / by,
        (shifted[1] - here[1]) / by,
        (shifted[2] - here[2]) / by,
        (shifted[3] - here[3]) / by,
    )


@hook
def add_outline_derivatives(scene, work, time):
    """Add the derivatives of forces along outlines, and of oriented forces, by differences.

    Forces depend on the relative position and on both angles. Three shifted evaluations (of the
    later body's x, y and angle) suffice: the rest follows from invariance under a common shift and
    rotation.
    """
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        x, y = separation(scene, work, NOW, a, b)
        angle_a, angle_b = work.place[NOW, a, ANGLE], work.place[NOW, b, ANGLE]
        fx, fy = work.outline_forces[pair, 0], work.outline_forces[pair, 1]
        here = fx, fy, work.outline_forces[pair, 2], work.outline_forces[pair, 3]
        # Nothing acts here; the forces themselves were stored by add_outline_forces.
        if here == (0.0, 0.0, 0.0, 0.0):
            continue
        by = OUTLINE_DIFFERENCE * scene.outlines[1]
        turn = by / scene.bodies[a].bounding_radius
        if not outline_reach(scene) > 0.0:
            by, turn = distance_step(oriented_now(scene, work, time, a, b)), DIFFERENCE
        # Forward differences by x, y and angle of a.
        across = outline_forces_at(scene, work, time, a, b, x + by, y, angle_a, angle_b)
        up = outline_forces_at(scene, work, time, a, b, x, y + by, angle_a, angle_b)
        turned = outline_forces_at(scene, work, time, a, b, x, y, angle_a + turn, angle_b)
        by_x, by_y = slopes(across, here, by), slopes(up, here, by)
        by_a = slopes(turned, here, turn)
        # Turning b alone is turning the whole scene and turning a back: ∂F/∂θ_b = ẑ × F − ∂F/∂x (ẑ
        # × r) − ∂F/∂θ_a.
        by_b = (
            by_x[0] * y - by_y[0] * x - by_a[0] - fy,
            by_x[1] * y - by_y[1] * x - by_a[1] + fx,
            by_x[2] * y - by_y[2] * x - by_a[2],
            by_x[3] * y - by_y[3] * x - by_a[3],
        )
        # −∂F/∂q, with the reverse force on b.
        for column, (on_x, on_y, on_a, on_b) in (
            (RELATIVE_X, by_x),
            (RELATIVE_Y, by_y),
            ((UNIT_TURN, ZERO_ROW), by_a),
            ((ZERO_ROW, UNIT_TURN), by_b),
        ):
            out = (on_x, on_y, on_a), (-on_x, -on_y, on_b)
            add_outer_products(scene, work, STIFFNESS, pair, a, b, out, column, -1.0)


def weigh_velocities(scene, work, time, remaining):
    """Clear the Jacobian, add the derivatives of body forces, and set each body's velocity
    lifetime.

    Methods without a Jacobian call this alone. ``remaining`` [s] is the time left to run.
    """
    for which in range(2):
        for block in range(block_count(work)):
            for row in range(3):
                for column in range(3):
                    work.jacobian[which, block, row, column] = 0.0
    add_body_derivatives(scene, work, time)
    set_velocity_lifetimes(scene, work, remaining)


def assemble_without_contacts(scene, work, time, remaining):
    """Assemble DAMPING and STIFFNESS of the current state without contact forces."""
    weigh_velocities(scene, work, time, remaining)
    if has(scene, CENTRE_FORCE):
        add_centre_derivatives(scene, work, time)
    if scene.surface_reach > 0.0:
        add_surface_derivatives(scene, work, time)
    if has_outline_forces(scene):
        add_outline_derivatives(scene, work, time)
    add_pair_damping(scene, work)


@apart
def assemble_jacobian(scene, work, time, remaining):
    """Assemble DAMPING and STIFFNESS of the current state, whose contact geometry is located."""
    assemble_without_contacts(scene, work, time, remaining)
    if has(scene, CONTACT_FORCE):
        add_contact_derivatives(scene, work)
