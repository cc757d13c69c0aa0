"""The equations of motion between two events, and what an event changes."""

from itertools import combinations

import numpy as np
from scipy.integrate import solve_ivp

from tests.reference.contacts import all_pairs, check_overlaps, measure
from tests.reference.forces import Contact, loads, refuse_strangers
from tests.reference.shapes import Scene

AT_CONTACT = 1e-15
"""An overlap [m] this small after an event is read as zero: its rate decides on or off."""

HYSTERESIS = 1e-18
"""A pair switches this far [m] past zero, so that it cannot switch back in the same instant."""

MISSED = 1e-12
"""An overlap [m] of this size on the wrong side of the on-off record: an event was missed."""

SCALES = np.array([1e-6, 1e-6, 1e-1, 1e-4, 1e-4, 10.0])
"""x, y [m], θ [rad], vx, vy [m/s], ω [rad/s]: rtol times these are the absolute tolerances."""

DISPLACEMENT_SCALE = 1e-8

LONGEST_TRAVEL = 0.25
"""Relative motion of two bodies in one step, as a share of the least radius of a scene."""


def ends_leg(direction):
    """Mark an event function of solve_ivp: stop where it rises (1) or falls (−1) through 0."""

    def mark(function):
        function.terminal, function.direction = True, direction
        return function

    return mark


class Motion:
    """The state y = positions, velocities, ξ of the active pairs, and its derivative."""

    def __init__(self, scene, laws, displacement):
        self.bodies, self.count = scene.bodies, len(scene.bodies)
        self.contact = next((law for law in laws if isinstance(law, Contact)), None)
        self.others = [law for law in laws if not isinstance(law, Contact)]
        self.pairs = all_pairs(scene.bodies) if self.contact else np.empty((0, 4), dtype=int)
        every = measure(scene, self.pairs)
        self.active = every.overlap > 0
        refuse_strangers(displacement, every.select(self.active).pair_keys())
        self.xi = np.array([displacement.get(key, 0.0) for key in every.pair_keys()])
        self.least_radius = min(body.radius for body in self.bodies)
        self.inverse_mass = np.array([inverse_mass(body) for body in self.bodies])

    def pack(self, scene):
        """y of a scene, with the ξ of the active pairs."""
        state = [scene.positions.ravel(), scene.velocities.ravel(), self.xi[self.active]]
        return np.concatenate(state)

    def scene(self, y):
        """The scene of a state y."""
        positions, velocities = y[: 6 * self.count].reshape(2, self.count, 3)
        return Scene(self.bodies, positions, velocities)

    def rate(self, t, y):
        """dy/dt: v, F/m and τ/I, and ξ̇ = v_t of each active pair."""
        scene = self.scene(y)
        total = loads(scene, self.others)
        pairs = measure(scene, self.pairs[self.active])
        if self.contact:
            total += self.contact.loads_at(scene, pairs, y[6 * self.count :])
        acceleration = total * self.inverse_mass
        return np.concatenate(
            [scene.velocities.ravel(), acceleration.ravel(), pairs.tangential_velocity]
        )

    def tolerances(self, rtol):
        """Absolute tolerances of y."""
        state = np.concatenate([np.tile(SCALES[:3], self.count), np.tile(SCALES[3:], self.count)])
        return rtol * np.append(state, np.full(self.active.sum(), DISPLACEMENT_SCALE))

    @ends_leg(direction=1)
    def closing(self, t, y):
        """Largest overlap among the pairs that are off; it rises through 0 when one closes."""
        off = measure(self.scene(y), self.pairs[~self.active])
        return off.overlap.max(initial=-1.0) - HYSTERESIS

    @ends_leg(direction=-1)
    def opening(self, t, y):
        """Least overlap among the pairs that are on; it falls through 0 when one opens."""
        on = measure(self.scene(y), self.pairs[self.active])
        return on.overlap.min(initial=1.0) + HYSTERESIS

    def switch(self, y):
        """Turn pairs on and off after an event; returns the keys that closed and that opened."""
        every = measure(self.scene(y), self.pairs)
        at_contact = np.abs(every.overlap) < AT_CONTACT
        touching = np.where(at_contact, every.normal_velocity < 0, every.overlap > 0)
        closed, opened = touching & ~self.active, self.active & ~touching
        for row in np.flatnonzero(opened):
            hand_over(self.bodies, every, row, np.flatnonzero(touching), self.xi)
        self.xi[~touching] = 0.0
        self.active = touching
        return every.select(closed).pair_keys(), every.select(opened).pair_keys()

    def leg(self, start, y, end, rtol, max_step):
        """The solution of solve_ivp up to the next event or the end."""
        solution = solve_ivp(
            self.rate,
            (start, end),
            y,
            method="DOP853",
            events=[self.closing, self.opening],
            rtol=rtol,
            atol=self.tolerances(rtol),
            max_step=max_step or self.longest_step(y),
        )
        if solution.status < 0:
            raise RuntimeError(f"the solver stopped at {solution.t[-1]} s: {solution.message}")
        self.xi[self.active] = solution.y[6 * self.count :, -1]
        if self.contact:
            self.refuse_missed_events(solution.y)
            for state in solution.y.T:
                check_overlaps(self.scene(state))
        return solution

    def longest_step(self, y):
        """The step in which, at its present velocity, no body moves far against another."""
        speed = relative_motion(self.bodies, self.scene(y).velocities)
        free = self.contact is None or speed == 0
        return np.inf if free else LONGEST_TRAVEL * self.least_radius / speed

    def refuse_missed_events(self, states):
        """RuntimeError if a contact may have come and gone unseen within one of the steps."""
        places = states[: 3 * self.count].T.reshape(-1, self.count, 3)
        travel = max(relative_motion(self.bodies, step) for step in np.diff(places, axis=0))
        overlap = measure(self.scene(states[:, -1]), self.pairs).overlap
        contradicted = np.any(np.where(self.active, -overlap, overlap) > MISSED)
        if contradicted or travel > self.least_radius:
            raise RuntimeError("a contact may have passed unseen: give a smaller max_step")


def inverse_mass(body):
    """1/m, 1/m, 1/I of a body; zeros for a fixed one, which keeps the velocity it was given."""
    return [0.0] * 3 if body.fixed else [1 / body.mass, 1 / body.mass, 1 / body.inertia]


def relative_motion(bodies, change):
    """Greatest relative motion of the outlines of two bodies, of changes (or rates) x, y, θ."""
    turn = [
        abs(angle) * (np.hypot(*body.vertices.T).max() + body.radius)
        for body, angle in zip(bodies, change[:, 2], strict=True)
    ]
    pairs = combinations(range(len(bodies)), 2)
    motions = [np.hypot(*(change[i] - change[j])[:2]) + turn[i] + turn[j] for i, j in pairs]
    return max(motions, default=0.0)


def corners(bodies, body, edge):
    """The vertices at the ends of an edge."""
    return {edge, (edge + 1) % len(bodies[body].vertices)}


def neighbours(bodies, one, other):
    """Whether two pairs (vertex's body, vertex, edge's body, edge) are of neighbouring features."""
    (a, vertex, b, edge), (c, vertex_2, _, edge_2) = one, other
    if a != c:
        return vertex_2 in corners(bodies, b, edge) and vertex in corners(bodies, a, edge_2)
    count = len(bodies[a].vertices)
    beside = {vertex, (vertex + 1) % count, (vertex - 1) % count}
    return vertex_2 in beside and bool(corners(bodies, b, edge) & corners(bodies, b, edge_2))


def hand_over(bodies, every, row, receivers, xi):
    """Give the ξ of an opening pair to the pair of the same bodies that the contact rolls on to.

    The nearest that stays closed, if it is of neighbouring features or within r_i + r_j; of pairs
    at one point that with the least displacement. As a
    vector ξ t on the vertex's body, projected on the receiver's tangent, and no more than leaves
    Σ ξ² as it was; without a receiver it vanishes.
    """
    apart = np.hypot(*(every.point - every.point[row]).T)
    reach = every.overlap[row] + every.distance[row]
    same = [
        r for r in receivers
        if set(every.pair[r, ::2]) == set(every.pair[row, ::2])
        and (apart[r] <= reach or neighbours(bodies, every.pair[row], every.pair[r]))
    ]  # fmt: skip
    if same:
        as_near = [r for r in same if apart[r] <= apart[same].min() + 1e-6 * reach]
        nearest = min(as_near, key=lambda r: abs(xi[r]))
        side = 1.0 if every.pair[nearest, 0] == every.pair[row, 0] else -1.0
        most = np.hypot(xi[row], xi[nearest])
        total = xi[nearest] + side * (every.tangent[row] @ every.tangent[nearest]) * xi[row]
        xi[nearest] = np.clip(total, -most, most)
    xi[row] = 0.0
