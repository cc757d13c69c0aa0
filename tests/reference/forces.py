"""The laws of MODEL section 2, one small class each, and their sum on all bodies."""

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from tests.reference.contacts import contacts, measure, pairs_of
from tests.reference.outline import second_moments
from tests.reference.shapes import rotation

VACUUM_PERMITTIVITY = 8.854e-12

CENTRE_SOFTENING = 1e-4
"""ε as a share of r_i + r_j."""


def loads(scene, laws, displacement=None):
    """Force and torque (n, 3) [N, N, N m] on every body: the sum over the laws.

    `displacement`: tangential displacement ξ [m] by pair (vertex's body, vertex, edge's body,
    edge); a touching pair that is not named has ξ = 0.
    """
    total = np.zeros((len(scene.bodies), 3))
    for law in laws:
        history = [displacement or {}] if isinstance(law, Contact) else []
        total += law.loads(scene, *history)
    return total


def add_force(total, scene, body, force, point):
    """Add a force (2,) that acts on a body at a point: torque = (point − centre) × force."""
    arm = point - scene.positions[body, :2]
    total[body] += [force[0], force[1], arm[0] * force[1] - arm[1] * force[0]]


def refuse_strangers(displacement, touching):
    """ValueError if a tangential displacement is given for a pair that does not touch."""
    strangers = set(displacement) - set(touching)
    if strangers:
        raise ValueError(f"displacement given for pairs that do not touch: {strangers}")


def reduced(a, b):
    """1/(1/a + 1/b): r* of two radii (5), M of two masses (8)."""
    return 1 / (1 / a + 1 / b)


def contact_mass(body):
    """The mass [kg] with which a body takes part in M; a fixed one never gives way."""
    return np.inf if body.fixed else body.mass


@dataclass(frozen=True)
class Gravity:
    """m g (1 − ρ_f/ρ) to −y (3); no buoyancy without a fluid density."""

    g: float = 9.81
    fluid_density: float = 0.0

    def loads(self, scene):
        total = np.zeros((len(scene.bodies), 3))
        for k, body in enumerate(scene.bodies):
            lift = self.fluid_density / body.density if self.fluid_density else 0.0
            total[k, 1] = -body.mass * self.g * (1.0 - lift)
        return total


@dataclass(frozen=True)
class Drag:
    """−6πγ r_eq (v − u(x)) (4), torque −8πγ r_eq³ (ω − Ω), in the flow u(x) = U + G x.

    Ω = ½(G_yx − G_xy), with `gradient[a, b]` = ∂u_a/∂x_b [1/s].
    """

    viscosity: float
    rotational: bool = True
    flow: np.ndarray = field(default_factory=lambda: np.zeros(2))
    gradient: np.ndarray = field(default_factory=lambda: np.zeros((2, 2)))
    strain: bool = False

    def loads(self, scene):
        total = np.zeros((len(scene.bodies), 3))
        turning = (self.gradient[1, 0] - self.gradient[0, 1]) / 2
        for k, body in enumerate(scene.bodies):
            position, velocity, r = scene.positions[k], scene.velocities[k], body.equivalent_radius
            fluid = self.flow + self.gradient @ position[:2]
            total[k, :2] = -6 * np.pi * self.viscosity * r * (velocity[:2] - fluid)
            if self.rotational:
                spin = turning + (self.jeffery(body, position[2]) if self.strain else 0.0)
                total[k, 2] = -8 * np.pi * self.viscosity * r**3 * (velocity[2] - spin)
        return total

    def jeffery(self, body, angle):
        """Spin that the strain adds [rad/s]: B p × (E p) along the long axis p.

        With the tensor T = M₂ + (M₁ − M₂) p pᵀ of the area's second moments that is twice the
        antisymmetric part of T E over the trace of T.
        """
        tensor = second_moments(body.vertices, body.radius)
        moments = rotation(angle) @ tensor @ rotation(angle).T
        strain = (self.gradient + self.gradient.T) / 2
        product = moments @ strain
        return (product[0, 1] - product[1, 0]) / np.trace(moments)


SHARP = (1e-12, 0.0, 0.0)


def length_at(gap, smoothing):
    """ℓ at a gap [m]."""
    shortest, growth, end = smoothing
    return shortest + growth * min(max(gap, 0.0), end)


def measure_of(gap, smoothing):
    """u(gap) = ∫ dg/ℓ(g) from 0."""
    shortest, growth, end = smoothing
    inner = min(gap, end)
    if gap <= 0.0 or growth == 0.0:
        return gap / shortest
    return np.log(1.0 + growth * inner / shortest) / growth + (gap - inner) / length_at(
        end, smoothing
    )


def gap_of(measure, smoothing):
    """The gap [m] of that u."""
    shortest, growth, end = smoothing
    if measure <= 0.0 or growth == 0.0:
        return measure * shortest
    last = measure_of(end, smoothing)
    inner = shortest / growth * (np.exp(growth * min(measure, last)) - 1.0)
    return inner + max(measure - last, 0.0) * length_at(end, smoothing)


class PairLaw:
    """A repulsion F(d, r*) between every two bodies, by one of the two meanings of the gap d.

    At gaps from `reach` on the force is left out. `smoothing`: (ℓ(0) [m], dℓ/dg, the gap from
    which on ℓ stays [m]) of the soft minimum u(g̃) = −ln Σ exp(−u(g_k)), du/dg = 1/ℓ, over all
    pairs, which is the gap of two outlines.
    """

    def loads(self, scene):
        total = np.zeros((len(scene.bodies), 3))
        apply = {"equivalent_spheres": self.along_centres, "surface": self.at_surfaces}[self.gap]
        for i, j in combinations(range(len(scene.bodies)), 2):
            radii = scene.bodies[i].equivalent_radius, scene.bodies[j].equivalent_radius
            apply(total, scene, i, j, radii)
        return total

    def within_reach(self, d, reduced_radius, rate=0.0):
        """The repulsion [N] at a gap and its rate of change, zero beyond the reach."""
        return self.repulsion(d, reduced_radius) if d < self.reach else 0.0

    def along_centres(self, total, scene, i, j, radii):
        """d = √(d_c² + ε²) − r_i − r_j with equivalent radii; along its gradient, no torque."""
        between = scene.positions[i, :2] - scene.positions[j, :2]
        centre_distance = np.hypot(np.hypot(*between), CENTRE_SOFTENING * sum(radii))
        force = self.within_reach(centre_distance - sum(radii), reduced(*radii))
        total[i, :2] += force * between / centre_distance
        total[j, :2] -= force * between / centre_distance

    def at_surfaces(self, total, scene, i, j, radii):
        """d = soft minimum of the gaps of all pairs k; each takes its share at its own points."""
        every = measure(scene, pairs_of(scene.bodies, i, j))
        gaps = -every.overlap
        measures = np.array([measure_of(gap, self.smoothing) for gap in gaps])
        weights = np.exp(measures.min() - measures)
        gap = gap_of(measures.min() - np.log(weights.sum()), self.smoothing)
        lengths = np.array([length_at(each, self.smoothing) for each in gaps])
        shares = length_at(gap, self.smoothing) / lengths * weights / weights.sum()
        repulsion = self.within_reach(gap, reduced(*radii), shares @ every.normal_velocity)
        for k in np.flatnonzero(weights):
            force = repulsion * shares[k] * every.normal[k]
            vertex_body, _, edge_body, _ = every.pair[k]
            add_force(total, scene, vertex_body, force, every.point[k])
            add_force(total, scene, edge_body, -force, every.point[k])


@dataclass(frozen=True)
class VanDerWaals(PairLaw):
    """Attraction H_A r*/(6 d²) (5), flat below the cut-off `d_min`."""

    hamaker: float
    d_min: float = 1e-9
    gap: str = "equivalent_spheres"
    reach: float = np.inf
    smoothing: tuple = SHARP

    def repulsion(self, d, reduced_radius):
        return -self.hamaker * reduced_radius / (6 * max(d, self.d_min) ** 2)


@dataclass(frozen=True)
class DoubleLayer(PairLaw):
    """Repulsion 4π ε0 ε_r κ φ² r* exp(−κ d) (6), with contact counting as d = 0.

    The law describes two charged surfaces that are apart; exp(−κ d) would explode as soon as an
    overlap, or the gap of equivalent spheres, is some Debye lengths below zero.
    """

    potential: float
    debye_length: float
    permittivity: float = 78.5
    gap: str = "equivalent_spheres"
    reach: float = np.inf
    smoothing: tuple = SHARP

    def repulsion(self, d, reduced_radius):
        permittivity = VACUUM_PERMITTIVITY * self.permittivity
        contact_value = 4 * np.pi * permittivity * self.potential**2 / self.debye_length
        decay = np.exp(-max(d, 0.0) / self.debye_length)
        return contact_value * reduced_radius * decay


@dataclass(frozen=True)
class Lubrication(PairLaw):
    """−6πγ r*² ḣ/h at the outlines, h no less than `h_min`, faded out from half the reach on."""

    viscosity: float
    h_min: float = 1e-9
    reach: float = 1e-5
    gap: str = "surface"
    smoothing: tuple = SHARP

    def within_reach(self, d, reduced_radius, rate=0.0):
        left = np.clip((self.reach - d) / (self.reach / 2), 0.0, 1.0)
        film = 6 * np.pi * self.viscosity * reduced_radius**2 / max(d, self.h_min)
        return -film * rate * (3 * left**2 - 2 * left**3)


@dataclass(frozen=True)
class Contact:
    """Normal k_n Δ − M λ_n v_n, tangential −k_t ξ − M λ_t v_t, at every touching pair (7)(8).

    `damping_n` [1/s] or "critical" = 2√(k_n/M); `damping_t` [1/s], by default λ_n k_t/k_n.
    `tension=False` clips the normal force at 0; `friction` µ limits the tangential force to
    ±µ max(normal, 0).
    """

    k_n: float
    k_t: float
    damping_n: float | str = "critical"
    damping_t: float | None = None
    friction: float | None = None
    tension: bool = True

    def damping(self, mass):
        """λ_n, λ_t [1/s] for a pair of effective mass M [kg]."""
        critical = self.damping_n == "critical"
        normal = 2 * np.sqrt(self.k_n / mass) if critical else self.damping_n
        return normal, normal * self.k_t / self.k_n if self.damping_t is None else self.damping_t

    def components(self, mass, overlap, displacement, normal_velocity, tangential_velocity):
        """Normal (repulsive positive) and tangential force [N] on the vertex's body."""
        damping_n, damping_t = self.damping(mass)
        normal = self.k_n * overlap - mass * damping_n * normal_velocity
        tangential = -self.k_t * displacement - mass * damping_t * tangential_velocity
        if not self.tension:
            normal = max(normal, 0.0)
        if self.friction is not None:
            limit = self.friction * max(normal, 0.0)
            tangential = min(max(tangential, -limit), limit)
        return normal, tangential

    def loads(self, scene, displacement):
        """Forces and torques (n, 3) of all touching pairs; ValueError for a ξ of another pair."""
        touching = contacts(scene)
        keys = touching.pair_keys()
        refuse_strangers(displacement, keys)
        return self.loads_at(scene, touching, [displacement.get(key, 0.0) for key in keys])

    def loads_at(self, scene, pairs, displacements):
        """Forces and torques (n, 3) of the given Contacts with their ξ (m,) [m]."""
        total = np.zeros((len(scene.bodies), 3))
        for row, displacement in enumerate(displacements):
            vertex_body, _, edge_body, _ = pairs.pair[row]
            mass = reduced(*(contact_mass(scene.bodies[k]) for k in (vertex_body, edge_body)))
            normal, tangential = self.components(
                mass,
                pairs.overlap[row],
                displacement,
                pairs.normal_velocity[row],
                pairs.tangential_velocity[row],
            )
            force = normal * pairs.normal[row] + tangential * pairs.tangent[row]
            add_force(total, scene, vertex_body, force, pairs.point[row])
            add_force(total, scene, edge_body, -force, pairs.point[row])
        return total

    def energy(self, scene, displacement=None):
        """Elastic energy Σ ½ k_n Δ² + ½ k_t ξ² [J] of the touching pairs."""
        normal = 0.5 * self.k_n * np.sum(contacts(scene).overlap ** 2)
        return normal + 0.5 * self.k_t * sum(xi**2 for xi in (displacement or {}).values())
