"""What kernels are shown: views of bodies, pairs and contacts, made from the arrays."""

import math

from flocsim.constants import CENTRE_SOFTENING
from flocsim.geometry.contact.points import length_of, row_radii, separation
from flocsim.hooks import hook
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.views import BodyView, ContactView, PairView, PlainBodyView, moved_contact
from flocsim.state.work import NOW


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
    """The same without the numbers of its shape."""
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
    """M = m_a m_b/(m_a + m_b) [kg]; the mass of the free one where the other is fixed."""
    if scene.bodies[a].free == 0.0:
        return scene.bodies[b].mass
    if scene.bodies[b].free == 0.0:
        return scene.bodies[a].mass
    mass_a, mass_b = scene.bodies[a].mass, scene.bodies[b].mass
    return mass_a * mass_b / (mass_a + mass_b)


def smaller_radius(scene, a, b):
    """Equivalent radius of the smaller of two bodies [m]."""
    return min(scene.bodies[a].equivalent_radius, scene.bodies[b].equivalent_radius)


def pair_view(scene, time, a, b, gap, gap_rate, centre_distance):
    radius_a = scene.bodies[a].equivalent_radius
    radius_b = scene.bodies[b].equivalent_radius
    return PairView(
        time, gap, gap_rate, centre_distance, radius_a, radius_b,
        radius_a * radius_b / (radius_a + radius_b), effective_mass(scene, a, b),
    )  # fmt: skip


def along_normal(work, row, of, state):
    """n · (what the vertex's body has − what the edge's has) at a pair's contact point, in the
    direction of now, ``of`` a state's places, a change of the gap [m], or velocities, its rate
    [m/s]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g = work.geometry
    change = g[NOW, row].normal_x * (of[state, a, X] - of[state, b, X])
    change += g[NOW, row].normal_y * (of[state, a, Y] - of[state, b, Y])
    change += g[NOW, row].vertex_arm_n * of[state, a, ANGLE]
    return change - g[NOW, row].edge_arm_n * of[state, b, ANGLE]


def normal_rate(work, state, row):
    """n · (velocity of the vertex's body − velocity of the edge's) at a pair's contact point."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g = work.geometry
    rate = g[state, row].normal_x * (work.velocity[state, a, X] - work.velocity[state, b, X])
    rate += g[state, row].normal_y * (work.velocity[state, a, Y] - work.velocity[state, b, Y])
    return (
        rate
        + work.velocity[state, a, ANGLE] * g[state, row].vertex_arm_n
        - work.velocity[state, b, ANGLE] * g[state, row].edge_arm_n
    )


def tangential_rate(work, state, row):
    """t · (velocity of the vertex's body − velocity of the edge's) at a pair's contact point."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g = work.geometry
    rate = g[state, row].normal_x * (work.velocity[state, a, Y] - work.velocity[state, b, Y])
    rate -= g[state, row].normal_y * (work.velocity[state, a, X] - work.velocity[state, b, X])
    return (
        rate
        + work.velocity[state, a, ANGLE] * g[state, row].vertex_arm_t
        - work.velocity[state, b, ANGLE] * g[state, row].edge_arm_t
    )


def memory_of(work, row):
    """How long a velocity of either body of a pair is remembered [s]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    return max(work.errors[a].memory, work.errors[b].memory)


def contact_view(scene, work, state, row):
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    radius_a, radius_b = row_radii(scene, work, row)
    return ContactView(
        -work.geometry[state, row].gap, -normal_rate(work, state, row),
        work.slip[state, row], tangential_rate(work, state, row), effective_mass(scene, a, b),
        radius_a, radius_b, smaller_radius(scene, a, b),
    )  # fmt: skip


def pressed_view(view, overlap, overlap_rate):
    """The ContactView of the same contact pressed so far and so fast, without any slip."""
    return moved_contact(view, overlap, overlap_rate, 0.0, 0.0)


@hook
def inertia(scene, body, axis):
    """Mass [kg], or moment of inertia [kg m²] for axis 2."""
    return scene.bodies[body].inertia if axis == 2 else scene.bodies[body].mass


def lever(scene, body, axis):
    """How far the outline moves for a unit of a coordinate: 1, or the bounding radius [m/rad]."""
    return scene.bodies[body].bounding_radius if axis == 2 else 1.0


def add_force(work, state, body, fx, fy, torque):
    work.force[state, body, X] += fx
    work.force[state, body, Y] += fy
    work.force[state, body, ANGLE] += torque


def push_pair(work, state, row, normal, tangential):
    """Add a force (along n and t) on the vertex's body, its reverse on the edge's."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g = work.geometry
    fx = normal * g[state, row].normal_x - tangential * g[state, row].normal_y
    fy = normal * g[state, row].normal_y + tangential * g[state, row].normal_x
    torque_a = normal * g[state, row].vertex_arm_n + tangential * g[state, row].vertex_arm_t
    torque_b = normal * g[state, row].edge_arm_n + tangential * g[state, row].edge_arm_t
    add_force(work, state, a, fx, fy, torque_a)
    add_force(work, state, b, -fx, -fy, -torque_b)


def centre_line(scene, work, state, a, b):
    """(n_x, n_y, d_c): unit vector from body b's centroid to body a's, and their distance."""
    dx, dy = separation(scene, work, state, a, b)
    distance = length_of(dx, dy)
    if distance == 0.0:
        return 0.0, 1.0, 0.0
    return dx / distance, dy / distance, distance


def soft_centre_line(scene, work, state, a, b):
    """The same of d = √(d_c² + ε²), whose gradient (n_x, n_y) fades out towards d_c = 0."""
    dx, dy = separation(scene, work, state, a, b)
    reach = scene.bodies[a].equivalent_radius + scene.bodies[b].equivalent_radius
    softening = CENTRE_SOFTENING * reach
    distance = math.sqrt(dx * dx + dy * dy + softening * softening)
    return dx / distance, dy / distance, distance


def centre_view(scene, work, time, state, a, b):
    """The PairView of two bodies, their gap being that of the equivalent spheres."""
    nx, ny, distance = soft_centre_line(scene, work, state, a, b)
    rate = nx * (work.velocity[state, a, X] - work.velocity[state, b, X])
    rate += ny * (work.velocity[state, a, Y] - work.velocity[state, b, Y])
    gap = distance - scene.bodies[a].equivalent_radius - scene.bodies[b].equivalent_radius
    return pair_view(scene, time, a, b, gap, rate, distance)
