"""What kernels are shown: views of bodies, pairs and contacts, made from the arrays."""

import math

import flocsim.arrays as at
from flocsim.arrays import BodyView, ContactView, PairView, PlainBodyView, moved_contact
from flocsim.constants import CENTRE_SOFTENING
from flocsim.geometry.contact.points import length_of, row_radii, separation
from flocsim.hooks import hook


@hook
def body_view(scene, work, time, state, body):
    motion, known = work.motion, scene.bodies
    return BodyView(
        time,
        motion[state, body, at.X], motion[state, body, at.Y], motion[state, body, at.ANGLE],
        motion[state, body, at.VX], motion[state, body, at.VY], motion[state, body, at.SPIN],
        known[body, at.MASS], known[body, at.BUOYANT_MASS], known[body, at.INERTIA],
        known[body, at.EQUIVALENT_RADIUS], known[body, at.ELONGATION], known[body, at.LONG_AXIS],
        work.bodies[body, at.KICK_X], work.bodies[body, at.KICK_X + 1],
        work.bodies[body, at.KICK_X + 2],
        known[body, at.RESISTANCE], known[body, at.RESISTANCE + 1],
        known[body, at.RESISTANCE + 2], known[body, at.RESISTANCE + 3],
        known[body, at.RESISTANCE + 4], known[body, at.RESISTANCE + 5],
        known[body, at.RESISTANCE + 6], known[body, at.RESISTANCE + 7],
        known[body, at.RESISTANCE + 8], known[body, at.RESISTANCE + 9],
        known[body, at.RESISTANCE + 10], known[body, at.RESISTANCE + 11],
        known[body, at.SHIELDING], known[body, at.SHIELDING + 1], known[body, at.SHIELDING + 2],
    )  # fmt: skip


def plain_body_view(scene, work, time, state, body):
    """The same without the numbers of its shape."""
    motion, known = work.motion, scene.bodies
    return PlainBodyView(
        time,
        motion[state, body, at.X], motion[state, body, at.Y], motion[state, body, at.ANGLE],
        motion[state, body, at.VX], motion[state, body, at.VY], motion[state, body, at.SPIN],
        known[body, at.MASS], known[body, at.BUOYANT_MASS], known[body, at.INERTIA],
        known[body, at.EQUIVALENT_RADIUS], known[body, at.ELONGATION], known[body, at.LONG_AXIS],
        work.bodies[body, at.KICK_X], work.bodies[body, at.KICK_X + 1],
        work.bodies[body, at.KICK_X + 2],
    )  # fmt: skip


def effective_mass(scene, a, b):
    """M = m_a m_b/(m_a + m_b) [kg]; the mass of the free one where the other is fixed."""
    if scene.bodies[a, at.FREE] == 0.0:
        return scene.bodies[b, at.MASS]
    if scene.bodies[b, at.FREE] == 0.0:
        return scene.bodies[a, at.MASS]
    mass_a, mass_b = scene.bodies[a, at.MASS], scene.bodies[b, at.MASS]
    return mass_a * mass_b / (mass_a + mass_b)


def smaller_radius(scene, a, b):
    """Equivalent radius of the smaller of two bodies [m]."""
    return min(scene.bodies[a, at.EQUIVALENT_RADIUS], scene.bodies[b, at.EQUIVALENT_RADIUS])


def pair_view(scene, time, a, b, gap, gap_rate, centre_distance):
    radius_a = scene.bodies[a, at.EQUIVALENT_RADIUS]
    radius_b = scene.bodies[b, at.EQUIVALENT_RADIUS]
    return PairView(
        time, gap, gap_rate, centre_distance, radius_a, radius_b,
        radius_a * radius_b / (radius_a + radius_b), effective_mass(scene, a, b),
    )  # fmt: skip


def along_normal(work, row, kind, first):
    """n · (what the vertex's body has − what the edge's has) at a pair's contact point, in the
    direction of now, of the three columns of a row of ``motion`` from ``first`` on: X, a change of
    the gap by one of places [m]; VELOCITY, its rate [m/s]."""
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    g, v = work.geometry, work.motion
    change = g[at.NOW, row, at.NORMAL_X] * (v[kind, a, first] - v[kind, b, first])
    change += g[at.NOW, row, at.NORMAL_Y] * (v[kind, a, first + 1] - v[kind, b, first + 1])
    change += g[at.NOW, row, at.VERTEX_ARM_N] * v[kind, a, first + 2]
    return change - g[at.NOW, row, at.EDGE_ARM_N] * v[kind, b, first + 2]


def normal_rate(work, state, row):
    """n · (velocity of the vertex's body − velocity of the edge's) at a pair's contact point."""
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    g, motion = work.geometry, work.motion
    rate = g[state, row, at.NORMAL_X] * (motion[state, a, at.VX] - motion[state, b, at.VX])
    rate += g[state, row, at.NORMAL_Y] * (motion[state, a, at.VY] - motion[state, b, at.VY])
    return (
        rate
        + motion[state, a, at.SPIN] * g[state, row, at.VERTEX_ARM_N]
        - motion[state, b, at.SPIN] * g[state, row, at.EDGE_ARM_N]
    )


def tangential_rate(work, state, row):
    """t · (velocity of the vertex's body − velocity of the edge's) at a pair's contact point."""
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    g, motion = work.geometry, work.motion
    rate = g[state, row, at.NORMAL_X] * (motion[state, a, at.VY] - motion[state, b, at.VY])
    rate -= g[state, row, at.NORMAL_Y] * (motion[state, a, at.VX] - motion[state, b, at.VX])
    return (
        rate
        + motion[state, a, at.SPIN] * g[state, row, at.VERTEX_ARM_T]
        - motion[state, b, at.SPIN] * g[state, row, at.EDGE_ARM_T]
    )


def memory_of(work, row):
    """How long a velocity of either body of a pair is remembered [s]."""
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    return max(work.bodies[a, at.MEMORY], work.bodies[b, at.MEMORY])


def contact_view(scene, work, state, row):
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    radius_a, radius_b = row_radii(scene, work, row)
    return ContactView(
        -work.geometry[state, row, at.GAP], -normal_rate(work, state, row),
        work.slip[state, row], tangential_rate(work, state, row), effective_mass(scene, a, b),
        radius_a, radius_b, smaller_radius(scene, a, b),
    )  # fmt: skip


def pressed_view(view, overlap, overlap_rate):
    """The ContactView of the same contact pressed so far and so fast, without any slip."""
    return moved_contact(view, overlap, overlap_rate, 0.0, 0.0)


@hook
def inertia(scene, body, axis):
    """Mass [kg], or moment of inertia [kg m²] for axis 2."""
    return scene.bodies[body, at.INERTIA] if axis == 2 else scene.bodies[body, at.MASS]


def lever(scene, body, axis):
    """How far the outline moves for a unit of a coordinate: 1, or the bounding radius [m/rad]."""
    return scene.bodies[body, at.BOUNDING_RADIUS] if axis == 2 else 1.0


def add_force(work, state, body, fx, fy, torque):
    work.rates[state, body, at.FX] += fx
    work.rates[state, body, at.FY] += fy
    work.rates[state, body, at.TORQUE] += torque


def push_pair(work, state, row, normal, tangential):
    """Add a force (along n and t) on the vertex's body, its reverse on the edge's."""
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    g = work.geometry
    fx = normal * g[state, row, at.NORMAL_X] - tangential * g[state, row, at.NORMAL_Y]
    fy = normal * g[state, row, at.NORMAL_Y] + tangential * g[state, row, at.NORMAL_X]
    torque_a = normal * g[state, row, at.VERTEX_ARM_N] + tangential * g[state, row, at.VERTEX_ARM_T]
    torque_b = normal * g[state, row, at.EDGE_ARM_N] + tangential * g[state, row, at.EDGE_ARM_T]
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
    reach = scene.bodies[a, at.EQUIVALENT_RADIUS] + scene.bodies[b, at.EQUIVALENT_RADIUS]
    softening = CENTRE_SOFTENING * reach
    distance = math.sqrt(dx * dx + dy * dy + softening * softening)
    return dx / distance, dy / distance, distance


def centre_view(scene, work, time, state, a, b):
    """The PairView of two bodies, their gap being that of the equivalent spheres."""
    nx, ny, distance = soft_centre_line(scene, work, state, a, b)
    motion = work.motion
    rate = nx * (motion[state, a, at.VX] - motion[state, b, at.VX])
    rate += ny * (motion[state, a, at.VY] - motion[state, b, at.VY])
    gap = distance - scene.bodies[a, at.EQUIVALENT_RADIUS] - scene.bodies[b, at.EQUIVALENT_RADIUS]
    return pair_view(scene, time, a, b, gap, rate, distance)
