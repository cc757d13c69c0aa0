"""The whole model in one short file, without flocsim: two flocs settle, meet, and stick or part.

This is the pair of Tang, Alonso-Marroquín and Maggi (2014), Colloids and Surfaces; numbers in
brackets are the equations of that paper. Read it from top to bottom: shapes, forces, motion,
outcome, and a small study. flocsim computes the same with controlled error, and far faster.

    python examples/minimal_flocsim.py

A floc i settles in water. A larger floc j starts above it, catches up, and touches it. Near each
other the two attract and repel, in contact they are stiff, sticky and damped springs, and their
shapes decide whether they lock or roll off each other. That is counted as

    A  touched inside the attraction zone, stays      B  touched inside, departs
    C  touched outside the attraction zone, stays     D  touched outside, departs

SI units; gravity points to −y; angles are counter-clockwise. Points and vectors of the plane are
complex numbers x + iy, as a turn by θ then is a product with exp(iθ).
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.special import lambertw

# Table 1 and section 2.4 of the paper, with two of its gaps closed so that its findings appear.
# The Debye length 1/κ is printed as 0.98 nm, at which attraction wins at every distance and there is
# no zone; 0.98 µm is that of the distilled water used. The mass per area is not printed; the damping
# of Table 1 implies about 2 kg/m². (Real flocs are about a hundred times lighter.)
GRAVITY = 9.81  # g [m/s²]
VISCOSITY = 8.9e-4  # γ [Pa s]
SURFACE_DENSITY = 2.0  # ρ_s [kg/m²]
HAMAKER = 1.0e-18  # H_A [J]
LEAST_GAP = 1.0e-9  # (5) diverges at contact: attraction no longer grows below this gap [m]
POTENTIAL = 15e-3  # φ [V]
PERMITTIVITY = 78.5 * 8.854e-12  # ε_r ε_0 [F/m]
KAPPA = 1.0 / 0.98e-6  # κ [1/m]
K_N, K_T = 20.0, 2.0  # stiffness of a contact, normal and tangential [N/m]


@njit
def dot(a, b):
    """Return the scalar product of two vectors."""
    return a.real * b.real + a.imag * b.imag


@njit
def cross(a, b):
    """Return the z component of the vector product of two vectors."""
    return a.real * b.imag - a.imag * b.real


# --- Shapes -----------------------------------------------------------------------------------


class Body(NamedTuple):
    """A spheropolygon (1): a polygon, its core, along which a disk of radius r is swept.

    One vertex makes a sphere. The core may have bays, but must not cross itself.
    """

    vertices: np.ndarray  # corners of the core in order, from the centroid of the body [m]
    radius: float  # spheroradius r [m]
    mass: float  # m = ρ_s A [kg]
    inertia: float  # ρ_s J, J the second moment of area [kg m²]
    r_eq: float  # radius of the disk of the same area [m]
    outer: float  # R, largest distance from the centroid to the outline [m]


@njit
def nearest_on_edge(point, start, end):
    """Return the point of an edge, its ends included, that is nearest to another point."""
    edge = end - start
    if edge == 0.0:
        return start
    return start + edge * min(max(dot(point - start, edge) / dot(edge, edge), 0.0), 1.0)


@njit
def core_distance(point, vertices):
    """Return the distance of a point to the core, 0 inside."""
    nearest, inside, start = np.inf, False, vertices[-1]
    for end in vertices:
        nearest = min(nearest, abs(point - nearest_on_edge(point, start, end)))
        # Inside, a ray in the direction of x crosses an odd number of edges.
        if (start.imag > point.imag) != (end.imag > point.imag):
            inside ^= (cross(end - start, point - start) > 0.0) == (end.imag > start.imag)
        start = end
    return 0.0 if inside else nearest


def make_body(vertices, radius, cells=400):
    """Return the Body with these core vertices, its mass by summing over cells of a fine grid."""
    vertices = np.array(vertices, complex)
    low = complex(vertices.real.min(), vertices.imag.min()) - 1.1 * radius * (1 + 1j)
    width = max(np.ptp(vertices.real), np.ptp(vertices.imag)) + 2.2 * radius
    size = width / cells
    middles = size * (np.arange(cells) + 0.5)
    points = (low + middles + 1j * middles[:, None]).ravel()
    # The outline is where the core is r away; it covers part of the cells that it passes through.
    distances = np.array([core_distance(point, vertices) for point in points])
    covered = np.clip(0.5 + (radius - distances) / size, 0.0, 1.0)
    area = size**2 * covered.sum()
    centroid = (covered * points).sum() / covered.sum()
    second_moment = size**2 * (covered * abs(points - centroid) ** 2).sum()
    vertices = vertices - centroid
    mass, inertia = SURFACE_DENSITY * area, SURFACE_DENSITY * second_moment
    return Body(
        vertices, radius, mass, inertia, math.sqrt(area / math.pi), abs(vertices).max() + radius
    )


# --- Forces -----------------------------------------------------------------------------------


@njit
def reduced(a, b):
    """Return ab/(a + b): the effective mass M of two masses, r* of two radii."""
    return a * b / (a + b)


@njit
def body_force(body, velocity, spin):
    """Return weight (3) and Stokes drag (4), and the torque of the same drag on a spinning disk.

    Drag is that of the equivalent sphere. The torque is not in the paper.
    """
    force = -1j * body.mass * GRAVITY - 6.0 * math.pi * VISCOSITY * body.r_eq * velocity
    return force, -8.0 * math.pi * VISCOSITY * body.r_eq**3 * spin


@njit
def repulsion(gap, r_star):
    """Return the double-layer repulsion (6) minus the van der Waals attraction (5) [N].

    ``gap`` d is that of the equivalent spheres. Real outlines can touch while these overlap: then
    d < 0, and either force keeps its largest value.
    """
    attraction = HAMAKER * r_star / (6.0 * max(gap, LEAST_GAP) ** 2)
    layer = 4.0 * math.pi * PERMITTIVITY * KAPPA * POTENTIAL**2 * r_star
    return layer * math.exp(-KAPPA * max(gap, 0.0)) - attraction


def zone_distance(i, j):
    """Return D_0, the distance of the centres below which they touch inside the attraction zone.

    (5) and (6) balance where x² exp(−x) = S, x = κd. Of the two roots the outer one is taken.
    """
    s = HAMAKER * KAPPA / (24.0 * math.pi * PERMITTIVITY * POTENTIAL**2)
    return i.r_eq + j.r_eq - 2.0 * lambertw(-math.sqrt(s) / 2.0, -1).real / KAPPA


@njit
def contact(bodies, place, turn, pair):
    """Return the overlap Δ [m] of a vertex and an edge, its normal from i to j, and its middle.

    ``pair``: (body of the vertex, vertex, edge of the other body); ``turn``: exp(iθ) of both.
    """
    one, vertex, edge = pair
    other = 1 - one
    core, following = bodies[other].vertices, (edge + 1) % len(bodies[other].vertices)
    point = place[one] + turn[one] * bodies[one].vertices[vertex]
    start, end = place[other] + turn[other] * core[edge], place[other] + turn[other] * core[following]
    foot = nearest_on_edge(point, start, end)
    distance = abs(point - foot)
    normal = (point - foot) / distance
    overlap = bodies[0].radius + bodies[1].radius - distance
    middle = foot + normal * (bodies[other].radius - 0.5 * overlap)
    return overlap, (normal if one == 1 else -normal), middle


@njit
def near_pairs(bodies, place, turn, reach):
    """Return the vertex–edge pairs nearer than ``reach``, and the least gap of all pairs [m].

    All pairs, both ways round, are counted: the elastic energy is then smooth, wherever a contact
    rolls. (At a corner up to four act at once.) A sphere has no edge, but is one for a sphere.
    """
    pairs, least = [(0, 0, 0) for _ in range(0)], np.inf
    for one in range(2):
        vertices, edges = len(bodies[one].vertices), len(bodies[1 - one].vertices)
        if edges == 1 and (vertices > 1 or one == 1):
            continue
        for vertex in range(vertices):
            for edge in range(edges):
                gap = -contact(bodies, place, turn, (one, vertex, edge))[0]
                least = min(least, gap)
                if gap < reach:
                    pairs.append((one, vertex, edge))
    return pairs, least


@njit
def hand_on(bodies, place, turn, pairs, slip, opened):
    """Hand the tangential displacement of a pair that has opened on to the closed one beside it.

    As flocs roll, the pair that carries a contact changes, and the tangential force must not jump.
    The elastic energy must not grow, either. With no closed pair within r_i + r_j it is lost.
    """
    here = contact(bodies, place, turn, opened)[2]
    heir, nearest = opened, bodies[0].radius + bodies[1].radius
    for pair in pairs:
        overlap, _, middle = contact(bodies, place, turn, pair)
        if overlap > 0.0 and abs(middle - here) < nearest:
            heir, nearest = pair, abs(middle - here)
    most = math.hypot(slip[opened], slip[heir])
    slip[heir] = min(max(slip[opened] + slip[heir], -most), most)
    slip[opened] = 0.0


@njit
def forces(bodies, place, turn, velocity, spin, pairs, slip, h):
    """Return forces and torques on both bodies, and the largest overlap of their outlines.

    ``slip``: the tangential displacement ξ of every pair [m], carried on here by a time h.
    """
    i, j = bodies
    force, torque, deepest = np.zeros(2, np.complex128), np.zeros(2), -np.inf
    for k in range(2):
        force[k], torque[k] = body_force(bodies[k], velocity[k], spin[k])

    # (5) and (6) act along the line of centres, and fade within 1 nm of coinciding centres.
    apart = place[1] - place[0]
    distance = math.hypot(abs(apart), 1e-9)
    push = repulsion(distance - i.r_eq - j.r_eq, reduced(i.r_eq, j.r_eq)) * apart / distance
    force[0], force[1] = force[0] - push, force[1] + push

    # (7) and (8) at every contact. Critical damping: λ_n = 2 √(k_n/M), and λ_t/λ_n = k_t/k_n.
    damping_n = 2.0 * math.sqrt(K_N * reduced(i.mass, j.mass))  # M λ_n [kg/s]
    damping_t = damping_n * K_T / K_N
    for pair in pairs:
        overlap, normal, middle = contact(bodies, place, turn, pair)
        deepest = max(deepest, overlap)
        if overlap <= 0.0:
            if slip[pair] != 0.0:
                hand_on(bodies, place, turn, pairs, slip, pair)
            continue
        arm_i, arm_j, tangent = middle - place[0], middle - place[1], 1j * normal
        sliding = velocity[1] + 1j * spin[1] * arm_j - velocity[0] - 1j * spin[0] * arm_i
        v_n, v_t = dot(sliding, normal), dot(sliding, tangent)
        slip[pair] += h * v_t  # no sliding: ξ is the integral of v_t while the contact lasts
        push = (K_N * overlap - damping_n * v_n) * normal
        push -= (K_T * slip[pair] + damping_t * v_t) * tangent
        force[0], force[1] = force[0] - push, force[1] + push
        torque[0], torque[1] = torque[0] - cross(arm_i, push), torque[1] + cross(arm_j, push)
    return force, torque, deepest


# --- Motion and outcome -----------------------------------------------------------------------


@njit
def settling_speed(body):
    """Return the speed at which (3) and (4) balance [m/s]."""
    return body.mass * GRAVITY / (6.0 * math.pi * VISCOSITY * body.r_eq)


@njit
def encounter(bodies, place, angle, velocity, spin, fineness=0.02):
    """Follow two bodies until their fate is known; return (fate, d_c at the touch or NaN).

    Places, angles, velocities and spins are arrays of two, and are changed. Steps are leapfrog,
    which is velocity Verlet with velocities half a step behind; ``fineness`` is the step in contact,
    over 1/ω_0 = √(M/k_n), and must be well below 1.
    """
    i, j = bodies
    size, least_outer = i.r_eq + j.r_eq, min(i.outer, j.outer)
    mass = reduced(i.mass, j.mass)
    fine = fineness * math.sqrt(mass / K_N)
    # Velocities relax within m/(6πγ r_eq) = v/g. A doublet turns within about size/drift.
    relaxation, drift = settling_speed(j) / GRAVITY, settling_speed(j) - settling_speed(i)
    rest_time = 3.0 * max(size / drift, relaxation)
    limit = 100.0 * rest_time

    most = max(len(i.vertices), len(j.vertices))
    slip = np.zeros((2, most, most))  # ξ of every vertex–edge pair [m]
    skin = 1e-6  # pairs nearer than this are listed, until the bodies have moved so far
    pairs, gap = near_pairs(bodies, place, np.exp(1j * angle), skin)
    time, path, touch = 0.0, 0.0, math.nan
    rest_pose, rest_angle, rest_since = 0j, 0.0, 0.0
    while time < limit:
        speed = abs(velocity[1] - velocity[0]) + i.outer * abs(spin[0]) + j.outer * abs(spin[1])
        # Far from each other steps are long, but cover half of the gap at most.
        h = fine if len(pairs) > 0 else min(0.5 * gap / speed, 0.01 * relaxation)
        place += h * velocity
        angle += h * spin
        time, path = time + h, path + h * speed
        turn = np.exp(1j * angle)
        if len(pairs) == 0 or path > skin:
            pairs, gap = near_pairs(bodies, place, turn, skin)
            path = 0.0
        force, torque, overlap = forces(bodies, place, turn, velocity, spin, pairs, slip, h)
        for k in range(2):
            velocity[k] += h * force[k] / bodies[k].mass
            spin[k] += h * torque[k] / bodies[k].inertia
        if overlap > 0.5 * (i.radius + j.radius):
            return "failed", touch  # they overlap too deeply for the contact law

        # Collision: the outlines touch for the first time.
        apart = place[1] - place[0]
        distance = abs(apart)
        if overlap > 0.0 and math.isnan(touch):
            touch = distance
        # Departure, or a miss: j is below i, beyond reach at any angle, and gets away.
        gone = distance > i.outer + j.outer + 2e-6 and apart.imag < 0.0
        if gone and dot(apart, velocity[1] - velocity[0]) > 0.0:
            return ("missed" if math.isnan(touch) else "departed"), touch
        # Aggregation: they rest in contact like one rigid body, the faster one hanging below the
        # slower one, so that its weight pulls at the contact as strongly as it ever will.
        pose, bend = apart / turn[0], angle[1] - angle[0]
        if abs(pose - rest_pose) + abs(bend - rest_angle) * least_outer > 1e-3 * size:
            rest_pose, rest_angle, rest_since = pose, bend, time
        hangs = -apart.imag > 0.99 * distance
        if overlap > 0.0 and hangs and time - rest_since > rest_time:
            return "aggregated", touch
    return "undecided", touch


def outcome(i, j, place, angle, **options):
    """Return the class A to D (or missed, undecided, failed) and d_c at the touch [m].

    Both start at their settling velocities, without spin.
    """
    velocity = np.array([-1j * settling_speed(i), -1j * settling_speed(j)])
    place, angle = np.array(place, complex), np.array(angle, float)
    fate, touch = encounter((i, j), place, angle, velocity, np.zeros(2), **options)
    if fate not in ("aggregated", "departed"):
        return fate, touch
    inside = touch < zone_distance(i, j)
    return {"aggregated": "AC", "departed": "BD"}[fate][0 if inside else 1], touch
