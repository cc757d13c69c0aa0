"""What kernels are shown: views of bodies, pairs and contacts, made from the arrays."""

import math

from flocsim.layout import (
    BUOYANT_MASS,
    CANDIDATES,
    EQUIVALENT_RADIUS,
    FORCE,
    FREE,
    INERTIA,
    MASS,
    RADIUS,
)
from flocsim.state import BodyView, ContactView, PairView


def body_view(scene, work, time, place, speed, body):
    """The BodyView of one body: its place from one state, its velocity from another."""
    motion, known = work.motion, scene.bodies
    return BodyView(
        time,
        motion[place, body, 0], motion[place, body, 1], motion[place, body, 2],
        motion[speed, body, 3], motion[speed, body, 4], motion[speed, body, 5],
        known[body, MASS], known[body, BUOYANT_MASS], known[body, INERTIA],
        known[body, EQUIVALENT_RADIUS],
    )  # fmt: skip


def effective_mass(scene, a, b):
    """M = m_a m_b/(m_a + m_b) [kg]; the mass of the free one where the other is fixed."""
    if scene.bodies[a, FREE] == 0.0:
        return scene.bodies[b, MASS]
    if scene.bodies[b, FREE] == 0.0:
        return scene.bodies[a, MASS]
    mass_a, mass_b = scene.bodies[a, MASS], scene.bodies[b, MASS]
    return mass_a * mass_b / (mass_a + mass_b)


def pair_view(scene, time, a, b, gap, gap_rate, centre_distance):
    """The PairView of two bodies."""
    radius_a = scene.bodies[a, EQUIVALENT_RADIUS]
    radius_b = scene.bodies[b, EQUIVALENT_RADIUS]
    return PairView(
        time, gap, gap_rate, centre_distance, radius_a, radius_b,
        radius_a * radius_b / (radius_a + radius_b), effective_mass(scene, a, b),
    )  # fmt: skip


def centre_rates(work, speed, a, b):
    """Velocity of body a's centroid less that of body b's."""
    motion = work.motion
    return motion[speed, a, 3] - motion[speed, b, 3], motion[speed, a, 4] - motion[speed, b, 4]


def normal_rate(work, speed, row):
    """n · (velocity of the vertex's body − velocity of the edge's) at a pair's contact point."""
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    g = work.geometry
    motion = work.motion
    dvx, dvy = centre_rates(work, speed, a, b)
    turning = motion[speed, a, 5] * g[row, 3] - motion[speed, b, 5] * g[row, 5]
    return g[row, 0] * dvx + g[row, 1] * dvy + turning


def tangential_rate(work, speed, row):
    """t · (velocity of the vertex's body − velocity of the edge's) at a pair's contact point."""
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    g = work.geometry
    motion = work.motion
    dvx, dvy = centre_rates(work, speed, a, b)
    turning = motion[speed, a, 5] * g[row, 4] - motion[speed, b, 5] * g[row, 6]
    return g[row, 0] * dvy - g[row, 1] * dvx + turning


def contact_view(scene, work, row, overlap, overlap_rate, slip, slip_rate):
    """The ContactView of a listed pair."""
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    return ContactView(
        overlap, overlap_rate, slip, slip_rate, effective_mass(scene, a, b),
        scene.bodies[a, RADIUS], scene.bodies[b, RADIUS],
    )  # fmt: skip


def both_fixed(scene, a, b):
    """Whether nothing between these two bodies can matter."""
    return scene.bodies[a, FREE] == 0.0 and scene.bodies[b, FREE] == 0.0


def add_force(work, body, fx, fy, torque):
    """Add to the force and torque on a body."""
    work.bodies[body, FORCE] += fx
    work.bodies[body, FORCE + 1] += fy
    work.bodies[body, FORCE + 2] += torque


def push_pair(work, row, normal, tangential):
    """Add a force (along n and t) on the vertex's body, its reverse on the edge's."""
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    g = work.geometry
    fx = normal * g[row, 0] - tangential * g[row, 1]
    fy = normal * g[row, 1] + tangential * g[row, 0]
    torque_a = normal * g[row, 3] + tangential * g[row, 4]
    torque_b = normal * g[row, 5] + tangential * g[row, 6]
    add_force(work, a, fx, fy, torque_a)
    add_force(work, b, -fx, -fy, -torque_b)


def closest_rows(work, row):
    """(end of the run of rows that belong to the same two bodies, row with the smallest gap)."""
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    closest = row
    end = row
    while end < work.tally[CANDIDATES]:
        c, d = work.candidates[end, 0], work.candidates[end, 2]
        if not ((c == a and d == b) or (c == b and d == a)):
            break
        if work.geometry[end, 2] < work.geometry[closest, 2]:
            closest = end
        end += 1
    return end, closest


def centre_line(work, place, a, b):
    """(n_x, n_y, d_c): unit vector from body b's centroid to body a's, and their distance."""
    dx = work.motion[place, a, 0] - work.motion[place, b, 0]
    dy = work.motion[place, a, 1] - work.motion[place, b, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return 0.0, 1.0, 0.0
    return dx / distance, dy / distance, distance


def centre_view(scene, work, time, place, speed, a, b):
    """The PairView of two bodies, their gap being that of the equivalent spheres."""
    nx, ny, distance = centre_line(work, place, a, b)
    motion = work.motion
    rate = nx * (motion[speed, a, 3] - motion[speed, b, 3])
    rate += ny * (motion[speed, a, 4] - motion[speed, b, 4])
    gap = distance - scene.bodies[a, EQUIVALENT_RADIUS] - scene.bodies[b, EQUIVALENT_RADIUS]
    return pair_view(scene, time, a, b, gap, rate, distance)


def surface_view(scene, work, time, place, speed, row):
    """The PairView of the two bodies of a listed pair, their gap being the pair's."""
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    _, _, distance = centre_line(work, place, a, b)
    rate = normal_rate(work, speed, row)
    return pair_view(scene, time, a, b, work.geometry[row, 2], rate, distance)
