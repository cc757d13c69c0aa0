"""The model of a pair in one short file, without flocsim: two flocs settle, meet, stick or part.

This is the pair of Tang, Alonso-Marroquín and Maggi (2014), "Stochastic collision and aggregation
analysis of kaolinite in water"; numbers in brackets are its equations. Read from top to bottom:
parameters, shapes, forces, motion and outcome, a small study. flocsim computes the same with
controlled errors and much faster. Run it with

    python examples/minimal_flocsim.py

A floc i settles in still water. A heavier floc j starts above it, catches up and touches it. Their
centres attract and repel each other, their outlines are stiff and damped springs, and their shapes
decide whether they lock or roll off each other. The collision is of class

    A  if they touch inside the attraction zone and stay together,    B  inside, and depart,
    C  if they touch outside the attraction zone and stay together,   D  outside, and depart.

Units are SI, gravity points to −y, angles are counter-clockwise [rad]. Points and vectors of the
plane are complex numbers x + iy: a product with exp(iθ) turns them by θ. With a* the conjugate of
a, the real part of a*b is the scalar product of a and b, the imaginary part their vector product.
The real part of b/n is the component of b along a unit vector n, the imaginary part that across.
"""

from math import exp, hypot, pi, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.special import lambertw

# --- Parameters -------------------------------------------------------------------------------

# Table 1 and section 2.4 of the paper, with two gaps closed so that its findings appear. It prints
# a Debye length 1/κ of 0.98 nm, at which attraction wins everywhere and nothing bounds a zone;
# 0.98 µm is that of the distilled water used. It prints no mass per area; the damping in Table 1
# implies about 2 kg/m², a hundred times as heavy as solid spheres of these sizes.
GRAVITY = 9.81  # g [m/s²]
VISCOSITY = 8.9e-4  # γ [Pa s]
SURFACE_DENSITY = 2.0  # ρ_s [kg/m²]
HAMAKER = 1.0e-18  # H_A [J]
LEAST_GAP = 1.0e-9  # d below which (5) is held constant, as it diverges at contact [m]
POTENTIAL = 15e-3  # φ [V]
PERMITTIVITY = 78.5 * 8.854e-12  # ε_r ε_0 [F/m]
KAPPA = 1.0 / 0.98e-6  # κ [1/m]
K_N, K_T = 20.0, 2.0  # stiffness of a contact, normal and tangential [N/m]

# Attraction (5) and repulsion (6) balance where x² exp(−x) = S, x = κd. Of the two roots the outer
# one, 5.92 µm, bounds the zone: two flocs touch inside it if d_c < D_0 = r_i + r_j + d_0.
S = HAMAKER * KAPPA / (24.0 * pi * PERMITTIVITY * POTENTIAL**2)
BALANCE_GAP = -2.0 * lambertw(-sqrt(S) / 2.0, -1).real / KAPPA  # d_0 [m]

# --- Shapes -----------------------------------------------------------------------------------


class Body(NamedTuple):
    """A spheropolygon (1): what a disk covers as its centre moves all over a polygon, the core.

    One vertex makes a sphere. The core may have bays but must not cross itself.
    """

    vertices: np.ndarray  # corners of the core, in order, from the centroid of the body [m]
    radius: float  # spheroradius, that of the disk [m]
    mass: float  # m = ρ_s A [kg]
    inertia: float  # ρ_s J, J the second moment of area [kg m²]
    r_eq: float  # equivalent radius, √(A/π) [m]
    outer: float  # R, the largest distance from the centroid to the outline [m]


@njit
def nearest_on_edge(point, start, end):
    """Return the point of an edge, ends included, that is nearest to a point."""
    edge = end - start
    along = ((point - start) * edge.conjugate()).real / (abs(edge) ** 2 or 1.0)
    return start + edge * min(max(along, 0.0), 1.0)


@njit
def core_distance(point, vertices):
    """Return the distance of a point to the core, 0 inside."""
    nearest, winding = np.inf, 0.0
    for k in range(len(vertices)):
        nearest = min(nearest, abs(point - nearest_on_edge(point, vertices[k - 1], vertices[k])))
        # Seen from inside, the outline goes round by 2π in all; from outside, by 0.
        winding += np.angle((vertices[k] - point) * (vertices[k - 1] - point).conjugate())
    return 0.0 if abs(winding) > 1.0 else nearest


def make_body(vertices, radius, cells=200):
    """Return the Body with this core and spheroradius; area and moments are sums over a grid."""
    vertices = np.array(vertices, complex) - np.mean(vertices)
    reach = abs(vertices).max() + 1.1 * radius
    x, size = np.linspace(-reach, reach, cells, retstep=True)
    points = (x + 1j * x[:, None]).ravel()
    distance = np.array([core_distance(point, vertices) for point in points])
    # Cells that the outline passes through, where the core is a radius away, are covered in part.
    covered = np.clip(0.5 + (radius - distance) / size, 0.0, 1.0)
    area = size**2 * covered.sum()
    centroid = np.average(points, weights=covered)
    second_moment = area * np.average(abs(points - centroid) ** 2, weights=covered)
    mass, inertia = SURFACE_DENSITY * area, SURFACE_DENSITY * second_moment
    outer = abs(vertices - centroid).max() + radius
    # Of a sphere exactly: its attraction at contact falls off within nanometres.
    r_eq = radius if len(vertices) == 1 else sqrt(area / pi)
    return Body(vertices - centroid, radius, mass, inertia, r_eq, outer)


# --- Forces between the two -------------------------------------------------------------------


@njit
def contact(bodies, cores, pair):
    """Return the overlap Δ of a vertex and an edge, its normal from i to j, and its middle.

    ``cores``: the vertices of both bodies where they are now. ``pair``: (body of the vertex, its
    index, index of the edge of the other body).
    """
    one, vertex, edge = pair
    point, core = cores[one][vertex], cores[1 - one]
    foot = nearest_on_edge(point, core[edge - 1], core[edge])
    normal = (point - foot) / abs(point - foot)
    overlap = bodies[0].radius + bodies[1].radius - abs(point - foot)
    middle = foot + (bodies[1 - one].radius - 0.5 * overlap) * normal
    return overlap, (normal if one == 1 else -normal), middle


@njit
def interaction(bodies, cores, place, velocity, spin, pairs, slip, h):
    """Return the force on j (on i its opposite acts), both torques, and the largest overlap.

    ``pairs``: the pairs of a vertex and an edge that may touch. ``slip``: the tangential elastic
    displacement ξ of every pair [m], which this function advances by a step h.
    """
    i, j = bodies
    # Van der Waals attraction (5) and double-layer repulsion (6) along the line of centres. Their d
    # is the gap of the equivalent spheres; r* = r_i r_j/(r_i + r_j). These spheres overlap where
    # outlines interlock: then d < 0, and both forces keep their values at contact.
    apart, r_star = place[1] - place[0], i.r_eq * j.r_eq / (i.r_eq + j.r_eq)
    d = abs(apart) - i.r_eq - j.r_eq
    attraction = HAMAKER * r_star / (6.0 * max(d, LEAST_GAP) ** 2)
    strength = 4.0 * pi * PERMITTIVITY * KAPPA * POTENTIAL**2 * r_star
    repulsion = strength * exp(-KAPPA * max(d, 0.0))
    force, torque = (repulsion - attraction) * apart / abs(apart), np.zeros(2)

    # Damping M λ_n is critical, λ_n = 2 √(k_n/M), M = m_i m_j/(m_i + m_j); λ_t/λ_n = k_t/k_n.
    deepest, damping = -np.inf, 2.0 * sqrt(K_N * i.mass * j.mass / (i.mass + j.mass))
    for pair in pairs:
        overlap, normal, middle = contact(bodies, cores, pair)
        deepest = max(deepest, overlap)
        if overlap > 0.0:
            # Velocity of j relative to i at the contact, as v_n + i v_t.
            arms = middle - place
            velocities = velocity + 1j * spin * arms
            v = (velocities[1] - velocities[0]) / normal
            # No sliding: ξ is the integral of v_t for as long as the contact lasts.
            slip[pair] += h * v.imag
            # Elastic (7) and viscous (8) forces. In separation their sum may pull, as in the paper.
            push = K_N * overlap - damping * v.real
            shear = -K_T * slip[pair] - damping * K_T / K_N * v.imag
            on_j = (push + 1j * shear) * normal
            force += on_j
            torque += np.array([-1.0, 1.0]) * (np.conj(arms) * on_j).imag
        elif slip[pair] != 0.0:
            # The pair has opened. As bodies roll, a contact passes from pair to pair, and its
            # tangential force must not jump: the nearest closed pair within r_i + r_j takes over
            # ξ, as far as the elastic energy does not grow. Without an heir ξ is lost.
            heir, nearest = pair, i.radius + j.radius
            for other in pairs:
                closed, _, there = contact(bodies, cores, other)
                if closed > 0.0 and abs(there - middle) < nearest:
                    heir, nearest = other, abs(there - middle)
            most = hypot(slip[pair], slip[heir])
            slip[heir] = min(max(slip[pair] + slip[heir], -most), most)
            slip[pair] = 0.0
    return force, torque, deepest


# --- Motion and outcome -----------------------------------------------------------------------


@njit
def encounter(i, j, place, angle, fineness=0.05):
    """Return the class A to D, or missed, undecided or failed, and d_c at the first touch [m].

    Both start at their settling velocities, without spin. The integrator is leapfrog: velocity
    Verlet, with velocities half a step behind. Its step is ``fineness``/ω_0, ω_0 = √(k_n/M); it
    has to resolve contacts, so that ``fineness`` must be well below 1.
    """
    bodies, place, angle = (i, j), place.copy(), angle.copy()
    mass, inertia = np.array([i.mass, j.mass]), np.array([i.inertia, j.inertia])
    r_eq, outer = np.array([i.r_eq, j.r_eq]), np.array([i.outer, j.outer])
    # Stokes drag (4) of the equivalent spheres, and its torque, which the paper leaves out.
    drag, spin_drag = 6.0 * pi * VISCOSITY * r_eq, 8.0 * pi * VISCOSITY * r_eq**3
    velocity, spin = -1j * mass * GRAVITY / drag, np.zeros(2)
    # A doublet turns within about size/drift, and stops swinging within m/(6πγ r_eq).
    size, relaxation, drift = r_eq.sum(), (mass / drag).max(), abs(velocity[1] - velocity[0])
    rest_time, zone = 3.0 * max(size / drift, relaxation), size + BALANCE_GAP

    # Each vertex of one with each edge of the other, both ways round. So the elastic energy is
    # smooth wherever a contact rolls; at a corner up to four pairs act at once. A sphere has a
    # vertex and no edge; the one pair of two spheres are their vertices.
    n, m = (len(i.vertices), len(j.vertices)), (len(j.vertices), len(i.vertices))
    pairs = [(k, v, e) for k in (0, 1) for v in range(n[k]) for e in range(m[k]) if m[k] > 1]
    if len(pairs) == 0:
        pairs.append((0, 0, 0))
    slip = np.zeros((2, max(n), max(n)))
    h = fineness * sqrt(i.mass * j.mass / (i.mass + j.mass) / K_N)
    # Pairs nearer than a skin are listed until the bodies have moved by as much.
    near, skin, path = pairs, 0.02 * size, np.inf
    touch, rest, rest_pose = 0.0, 0.0, 0j
    for _ in range(int(100.0 * rest_time / h)):
        place += h * velocity
        angle += h * spin
        turn = np.exp(1j * angle)
        cores = (place[0] + turn[0] * i.vertices, place[1] + turn[1] * j.vertices)
        path += h * (abs(velocity[1] - velocity[0]) + (outer * np.abs(spin)).sum())
        if path > skin:
            near, path = [p for p in pairs if -contact(bodies, cores, p)[0] < skin], 0.0

        # Newton's and Euler's equations: weight (3), drag (4), and the forces between the two.
        force, torque, overlap = interaction(bodies, cores, place, velocity, spin, near, slip, h)
        velocity += h * (-1j * GRAVITY + (np.array([-force, force]) - drag * velocity) / mass)
        spin += h * (torque - spin_drag * spin) / inertia

        apart = place[1] - place[0]
        if overlap > 0.5 * (i.radius + j.radius):
            return "failed", touch  # too deep for the contact law
        if touch == 0.0 and overlap > 0.0:
            touch = abs(apart)
        # Departure: j is below i and moves away, too far for outlines to meet at any angle.
        parts = ((velocity[1] - velocity[0]) / apart).real > 0.0
        if parts and apart.imag < 0.0 and abs(apart) > outer.sum() + 2e-6:
            return ("missed" if touch == 0.0 else "B" if touch < zone else "D"), touch
        # Aggregation: both are in contact and have moved like one rigid body for the rest time. j
        # hangs below i, as every doublet turns that way, and the pull on the contact is largest
        # there. The pose of j is the position of a point of its rim, seen from i.
        pose, rest = (apart + j.outer * turn[1]) / turn[0], rest + h
        if abs(pose - rest_pose) > 1e-3 * size:
            rest_pose, rest = pose, 0.0
        if overlap > 0.0 and rest > rest_time and -apart.imag > 0.99 * abs(apart):
            return ("A" if touch < zone else "C"), touch
    return "undecided", touch


# --- A small study ----------------------------------------------------------------------------

TYPES = {"I": (16.41e-6, 23.02e-6), "II": (4.95e-6, 23.02e-6), "III": (4.62e-6, 4.95e-6)}


def random_floc(rng, corners, r_eq):
    """Return a ragged Body of this equivalent radius; with one corner, a sphere."""
    core = rng.uniform(0.5, 1.5, corners) * np.exp(2j * pi * np.arange(corners) / corners)
    scale = r_eq / make_body(core, 0.1).r_eq
    return make_body(scale * core, scale * 0.1)


def main(pairs=10, corners=16, share=0.4):
    """Run pairs of random shapes and orientations of each type of the paper, and count."""
    print(f"{corners} corners, δ/δ_max = {share}; Pr[A]: of those that touch, how many stay")
    for name, radii in TYPES.items():
        rng, classes = np.random.default_rng(1), []
        for _ in range(pairs):
            i, j = [random_floc(rng, corners, r_eq) for r_eq in radii]
            # j starts above, aside by a share of δ_max = R_i + R_j, at any orientations.
            place = np.array([0j, (share + 1.1j) * (i.outer + j.outer)])
            classes.append(encounter(i, j, place, 2.0 * pi * rng.random(2))[0])
        stay, depart = (sum(map(classes.count, letters)) for letters in ("AC", "BD"))
        print(f"type {name:3}: {' '.join(classes)}   Pr[A] = {stay}/{stay + depart}")


if __name__ == "__main__":
    main()
