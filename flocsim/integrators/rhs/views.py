"""Views: what force kernels are given of a body, a pair or a contact, read from the arrays.

Also the kinematics of a contact (rates of gap and slip) and how a force on a pair is added to both
bodies. Along the normal n and the tangent t of a contact a pair of forces N, T acts as

    F_a = N n + T t,   τ_a = N a_n + T a_t,      F_b = −F_a,   τ_b = −(N b_n + T b_t),

a_n, a_t being the moments of unit forces (VertexAtEdge.vertex_arm_n, …). The rates of the gap and
of the slip are the transposed relations, n·(v_a − v_b) + ω_a a_n − ω_b b_n and likewise for t.
"""

import math

from flocsim.constants import CENTRE_SOFTENING
from flocsim.geometry.contact.points import (
    normal_component,
    relative_velocity,
    separation,
    tangential_component,
    unit_vector,
)
from flocsim.hooks import hook
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.views import BodyView, ContactView, PairView, PlainBodyView, moved_contact


@hook
def body_view(scene, work, time, state, body):
    place, velocity, own, kick = work.place, work.velocity, scene.bodies[body], work.kicks[body]
    return BodyView(
        time,
        place[state, body, X], place[state, body, Y], place[state, body, ANGLE],
        velocity[state, body, X], velocity[state, body, Y], velocity[state, body, ANGLE],
        own.mass, own.buoyant_mass, own.inertia,
        own.equivalent_radius, own.elongation, own.long_axis,
        kick.x, kick.y, kick.turn,
        own.resistance_xx, own.resistance_xy, own.resistance_yy,
        own.resistance_xs, own.resistance_ys, own.resistance_ss,
        own.strain_xx_x, own.strain_xx_y, own.strain_xx_s,
        own.strain_xy_x, own.strain_xy_y, own.strain_xy_s,
        own.shielding_xx, own.shielding_xy, own.shielding_yy,
    )  # fmt: skip


def plain_body_view(scene, work, time, state, body):
    """Return the BodyView without the numbers of its shape."""
    place, velocity, own, kick = work.place, work.velocity, scene.bodies[body], work.kicks[body]
    return PlainBodyView(
        time,
        place[state, body, X], place[state, body, Y], place[state, body, ANGLE],
        velocity[state, body, X], velocity[state, body, Y], velocity[state, body, ANGLE],
        own.mass, own.buoyant_mass, own.inertia,
        own.equivalent_radius, own.elongation, own.long_axis,
        kick.x, kick.y, kick.turn,
    )  # fmt: skip


def effective_mass(scene, a, b):
    """Return M = m_a m_b/(m_a + m_b) [kg]; the mass of the free body if the other is fixed."""
    # A fixed body has infinite mass.
    if scene.bodies[a].free == 0.0:
        return scene.bodies[b].mass
    if scene.bodies[b].free == 0.0:
        return scene.bodies[a].mass
    mass_a, mass_b = scene.bodies[a].mass, scene.bodies[b].mass
    return mass_a * mass_b / (mass_a + mass_b)


def smaller_radius(scene, a, b):
    """Return the equivalent radius of the smaller of two bodies [m]."""
    return min(scene.bodies[a].equivalent_radius, scene.bodies[b].equivalent_radius)


def pair_view(scene, time, a, b, gap, gap_rate, centre_distance):
    radius_a = scene.bodies[a].equivalent_radius
    radius_b = scene.bodies[b].equivalent_radius
    # r* = r_a r_b/(r_a + r_b).
    return PairView(
        time, gap, gap_rate, centre_distance, radius_a, radius_b,
        radius_a * radius_b / (radius_a + radius_b), effective_mass(scene, a, b),
    )  # fmt: skip


def normal_rate(work, state, row):
    """Return the rate of the gap of a pair in a state [m/s]: n · (v_a − v_b) at the contact
    point."""
    return normal_component(work, row, work.velocity, state, state)


def tangential_rate(work, state, row):
    """Return the tangential velocity v_t of a pair in a state [m/s]: t · (v_a − v_b) at the contact
    point."""
    return tangential_component(work, row, work.velocity, state, state)


def velocity_lifetime_of(work, row):
    """Return the longer velocity lifetime of a pair's two bodies [s]
    (BodyErrors.velocity_lifetime)."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    return max(work.errors[a].velocity_lifetime, work.errors[b].velocity_lifetime)


def contact_view(scene, work, state, row):
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    radius_a, radius_b = work.candidates[row].vertex_radius, work.candidates[row].edge_radius
    # The law takes overlap and its rate, positive in compression: minus gap and its rate.
    return ContactView(
        -work.geometry[state, row].gap, -normal_rate(work, state, row),
        work.slip[state, row], tangential_rate(work, state, row), effective_mass(scene, a, b),
        radius_a, radius_b, smaller_radius(scene, a, b),
    )  # fmt: skip


def view_without_slip(view, overlap, overlap_rate):
    """Return the ContactView of the same contact with another overlap [m] and rate [m/s], without
    slip."""
    return moved_contact(view, overlap, overlap_rate, 0.0, 0.0)


@hook
def inertia(scene, body, axis):
    """Return the mass [kg], or the moment of inertia [kg m²] for axis 2."""
    return scene.bodies[body].inertia if axis == 2 else scene.bodies[body].mass


def lever(scene, body, axis):
    """Return how far the outline moves per unit of a coordinate: 1, or the bounding radius
    [m/rad]."""
    return scene.bodies[body].bounding_radius if axis == 2 else 1.0


def add_force(work, state, body, fx, fy, torque):
    work.force[state, body, X] += fx
    work.force[state, body, Y] += fy
    work.force[state, body, ANGLE] += torque


def pair_loads(work, state, row, normal, tangential):
    """Return (fx, fy, torque on a, torque on b) of a force (N along n, T along t) [N] on the
    vertex's body a of a pair; its reverse acts on the edge's body b, and takes torque b off."""
    geometry = work.geometry[state, row]
    # f = N n + T t; arms give the moments of n and t.
    fx = normal * geometry.normal_x - tangential * geometry.normal_y
    fy = normal * geometry.normal_y + tangential * geometry.normal_x
    torque_a = normal * geometry.vertex_arm_n + tangential * geometry.vertex_arm_t
    return fx, fy, torque_a, normal * geometry.edge_arm_n + tangential * geometry.edge_arm_t


def add_pair_force(work, state, row, normal, tangential):
    """Add such a force to both bodies of a pair."""
    fx, fy, torque_a, torque_b = pair_loads(work, state, row, normal, tangential)
    add_force(work, state, work.candidates[row].vertex_body, fx, fy, torque_a)
    add_force(work, state, work.candidates[row].edge_body, -fx, -fy, -torque_b)


def centre_line(scene, work, state, a, b):
    """Return (n_x, n_y, d_c): the unit vector from body b's centroid to body a's, and their
    distance [m]."""
    dx, dy = separation(scene, work, state, a, b)
    # Nested bodies may be concentric.
    return unit_vector(dx, dy)


def soft_centre_line(scene, work, state, a, b):
    """Return the gradient (n_x, n_y) and the value of d = √(d_c² + ε²) [m].

    The gradient fades out towards d_c = 0, where the unit vector would jump; ε is CENTRE_SOFTENING
    of the sum of equivalent radii.
    """
    dx, dy = separation(scene, work, state, a, b)
    reach = scene.bodies[a].equivalent_radius + scene.bodies[b].equivalent_radius
    # ε is a fixed fraction of the pair's size.
    softening = CENTRE_SOFTENING * reach
    distance = math.sqrt(dx * dx + dy * dy + softening * softening)
    return dx / distance, dy / distance, distance


def centre_view(scene, work, time, state, a, b):
    """Return the PairView of two bodies whose gap is that of the equivalent spheres."""
    nx, ny, distance = soft_centre_line(scene, work, state, a, b)
    # Rate of the softened distance: its gradient times the relative velocity.
    ux, uy = relative_velocity(work, state, a, b)
    gap = distance - scene.bodies[a].equivalent_radius - scene.bodies[b].equivalent_radius
    return pair_view(scene, time, a, b, gap, nx * ux + ny * uy, distance)
