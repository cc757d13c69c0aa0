"""What holds the bodies of a swarm together that touch, as ensembles/collision/bonds.py has it for
two.

Certificate: the two do not move against each other, and their attraction outweighs, by a safety
factor, the largest load that settling can put on the bond, in any form and orientation of their
cluster. A cluster that settles at V = Σ D v/Σ D, v and D the settling velocity and the resistance
of each body alone, pulls at its bodies with D (v − V), which add up to nothing: no part of it pulls
at the rest with more than half the sum of their sizes. That of two is |v_i − v_j|/(1/D_i + 1/D_j).
Where the attraction acts between centres it must also hold against prying about each of the two
outermost contact points, with a lever as long as the cluster; a surface force follows the contact.

Rest: since the time before, the two have kept their pose. Where attraction alone could not carry
the load, their shapes do, and such a rest is a hook. All others touch, and roll or part. What rests
on a wall does not settle: there the load is all the weight. Where bodies are kicked, other proofs
take the place of these (kicked.py).
"""

import math
from typing import Any

import attrs
import numpy as np

from flocsim.arrays import (
    ANGLE,
    CANDIDATES,
    EARLIER,
    GAP,
    INERTIA,
    LATER,
    NOW,
    PAIRS,
    SPIN,
    VX,
    VY,
    with_room,
    work_of,
)
from flocsim.compiler.composer import compose
from flocsim.errors import UsageError
from flocsim.forces.thermal import thermal_in
from flocsim.geometry.contact.near_pairs import list_polygons
from flocsim.geometry.contact.points import locate_polygons, turn_body
from flocsim.geometry.contact.slip_transfer import contact_point
from flocsim.integrators.rhs.surface_gap import RANGE, flag_near, gap_of, surface_view
from flocsim.integrators.rhs.views import (
    centre_line,
    centre_view,
    contact_view,
    pressed_view,
)
from flocsim.laws import (
    CENTRE_FORCE,
    CONTACT_FORCE,
    centre_force,
    compiled_calls,
    contact_force,
    has,
    surface_force,
)
from flocsim.plausibility.settling import least_mobility, terminal_motion
from flocsim.swarms.together.clusters import placed_together
from flocsim.swarms.together.contacts import Neighbours
from flocsim.swarms.together.kicked import KickedBonds

TOUCHING, CERTIFICATE, HOOK, REST = range(4)
KINDS = ("touching", "certificate", "hook", "rest")
"""Kinds of bonds: those of pairs, and none that is proved."""

SAFETY = 3.0
"""Factor by which attraction must outweigh the load in a certificate."""

CALM, STILL = 0.02, 1e-3
"""A pair that moves at less than this share of the drift is calm enough for a certificate, and one
that has moved by less than this share of the drift's way rests."""

CENTRES, SURFACES, LEFT, RIGHT, NORMAL_OF, DISTANCE, APART, SPRINGS, PULL_COLUMNS = (
    0, 1, 2, 3, 4, 6, 7, 8, 9,
)  # fmt: skip
"""Columns of what holds a pair: attraction between centres and between surfaces [N]; the levers of
the contact points outermost on either side of the line of centres [m]; that line's direction and
length [m]; the gap by which attraction goes at the outlines [m]; twice the energy of the contacts'
normal springs [J]."""


def stored(scene, work, row):
    """Twice the energy of the normal spring of a contact [J]."""
    if not has(scene, CONTACT_FORCE):
        return 0.0
    view = contact_view(scene, work, NOW, row)
    normal, _ = contact_force(scene, pressed_view(view, view.overlap, 0.0))
    return abs(normal * view.overlap)


def measure_pulls(scene, work, time, pulls):
    """What holds the listed pairs, see CENTRES; False without room for their features."""
    for pair in range(work.tally[PAIRS]):
        a, b = work.pairs[pair, LATER], work.pairs[pair, EARLIER]
        work.tally[CANDIDATES] = 0
        cut = gap_of(scene, RANGE) if scene.surface_reach > 0.0 else 0.0
        if not list_polygons(scene, work, pair, cut):
            return False
        turn_body(work, NOW, a)
        turn_body(work, NOW, b)
        nx, ny, distance = centre_line(scene, work, NOW, a, b)
        left, right, apart, springs = 0.0, 0.0, math.inf, 0.0
        for row in range(work.tally[CANDIDATES]):
            locate_polygons(scene, work, NOW, row)
            apart = min(apart, work.geometry[NOW, row, GAP])
            if work.geometry[NOW, row, GAP] < 0.0:
                springs += stored(scene, work, row)
                x, y = contact_point(work, row, b)
                left = max(left, nx * y - ny * x)
                right = max(right, ny * x - nx * y)
        pulls[pair, LEFT], pulls[pair, RIGHT] = left, right
        pulls[pair, NORMAL_OF], pulls[pair, NORMAL_OF + 1] = nx, ny
        pulls[pair, CENTRES] = pulls[pair, SURFACES] = 0.0
        if has(scene, CENTRE_FORCE):
            pulls[pair, CENTRES] = -centre_force(scene, centre_view(scene, work, time, NOW, a, b))
        if scene.surface_reach > 0.0 and work.tally[CANDIDATES] > 0:
            flag_near(scene, work, NOW, 0.0)
            view = surface_view(scene, work, time, NOW, 0, work.tally[CANDIDATES])
            pulls[pair, SURFACES] = -surface_force(scene, view)
            apart = view.gap
        pulls[pair, DISTANCE], pulls[pair, APART], pulls[pair, SPRINGS] = distance, apart, springs
    return True


@attrs.frozen(eq=False, repr=False)
class Bonds:
    """The pairs of bodies that touch at one time: ``pairs`` (m, 2), the later one first, and
    ``kind`` (m,) of each, a place in KINDS."""

    pairs: np.ndarray
    kind: np.ndarray

    def __repr__(self) -> str:
        found = ", ".join(f"{count} {name}" for name, count in self.counts.items() if count)
        return f"Bonds({found or 'none'})"

    @property
    def counts(self) -> dict[str, int]:
        """{kind: how many there are}."""
        return dict(zip(KINDS, np.bincount(self.kind, minlength=len(KINDS)).tolist(), strict=True))


class BondGauge:
    """Tells the kinds of bonds of the bodies of a ``swarm`` (flocsim.Swarm), wherever they are."""

    def __init__(self, swarm: Any) -> None:
        self.bodies = swarm.bodies
        self.scene = swarm.system.scene()._replace(box=swarm.box)
        self.pulls = compose(measure_pulls, {**compiled_calls(), **swarm.fillings()})
        self.free = np.array([not body.fixed for body in swarm.bodies])
        n = len(swarm.bodies)
        self.work = work_of(self.scene, np.zeros((n, 3)), np.zeros((n, 3)), 64, 1, 0, False)
        self.settling, self.resistance = alone(swarm)
        self.shear = math.hypot(*swarm.fluid.gradient)
        self.spheres = swarm.system.spheres_only
        found = thermal_in(swarm.forces)
        self.kicked = KickedBonds(swarm, self.scene, found[0].energy) if found else None

    def bonds(
        self, time: float, motion: np.ndarray, touching: Neighbours,
        before: tuple[float, np.ndarray] | None = None,
    ) -> Bonds:  # fmt: skip
        """The Bonds of the pairs that touch at ``motion`` (n, 6); ``before``: an earlier time and
        the motion then."""
        both = self.free[touching.pairs].all(axis=1)
        on_wall = np.zeros(len(self.free), bool)
        on_wall[touching.pairs[~both].ravel()] = True
        held = Neighbours(touching.pairs[both], touching.gap[both], touching.vector[both])
        if not len(held.pairs):
            return Bonds(held.pairs, np.zeros(0, dtype=np.int64))
        labels, places = placed_together(len(self.free), held)
        load, drift, extent = self.loads(labels, places, on_wall)
        label = labels[held.pairs[:, 0]]
        load, drift, extent = load[label], drift[label], extent[label]
        pulls = self.pulls_of(time, motion, held.pairs)
        still = np.zeros(len(held.pairs), bool)
        if before is not None:
            still = self.kept_pose(time, motion, held, before) < STILL * drift * (time - before[0])
        if self.kicked is None:
            along, shear, spin = relative(motion, held, pulls, self.sizes(held.pairs))
            distance = np.hypot(*held.vector.T)
            load = load + self.effective_masses(held.pairs) * spin**2 * distance
            certified = self.outweighs(pulls, load, extent, shear < CALM * drift)
            certified &= along < CALM * drift
        else:
            certified, lasting = self.outlasts(
                self.kicked, time, motion, held.pairs, pulls, load, extent
            )
            still &= lasting
        carried = pulls[:, CENTRES] + pulls[:, SURFACES] > load
        kind = np.where(still, np.where(carried, REST, HOOK), TOUCHING)
        kind[certified] = CERTIFICATE
        return Bonds(held.pairs, kind)

    def outweighs(
        self, pulls: np.ndarray, load: np.ndarray, extent: np.ndarray, calm: np.ndarray
    ) -> np.ndarray:
        """Where attraction outweighs a load by the safety factor, also where it pries."""
        straight = pulls[:, CENTRES] + pulls[:, SURFACES] > SAFETY * load
        if self.spheres:
            return straight
        lever = np.minimum(pulls[:, LEFT], pulls[:, RIGHT])
        pried = (pulls[:, CENTRES] * lever > SAFETY * load * extent) & calm
        return straight & (pried | self.follows(pulls, load))

    def follows(self, pulls: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Where the surface force, which follows the contact, outweighs a load by itself."""
        return pulls[:, SURFACES] > SAFETY * load - np.minimum(pulls[:, CENTRES], 0.0)

    def outlasts(
        self, kicked: KickedBonds, time: float, motion: np.ndarray, pairs: np.ndarray,
        pulls: np.ndarray, load: np.ndarray, extent: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Where kicks have a bond certified, and where they let a pair rest."""
        pull = SAFETY * load
        if not self.spheres:
            lever = np.minimum(pulls[:, LEFT], pulls[:, RIGHT])
            pries = ~self.follows(pulls, load) & (load > 0.0)
            with np.errstate(divide="ignore"):
                pull = np.where(pries, pull * extent / lever, pull)
        ways = pulls[:, [DISTANCE, APART]]
        energy = pulls[:, SPRINGS] + self.moving(motion, pairs)
        certified = kicked.certified(time, pairs, ways, pull, energy)
        attracted = (pulls[:, CENTRES] != 0.0) | (pulls[:, SURFACES] != 0.0)
        return certified & attracted, kicked.resting(time, pairs, ways, load)

    def loads(
        self, labels: np.ndarray, places: np.ndarray, on_wall: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of every cluster the largest load on a bond [N], the drift of its bodies against it
        [m/s], and its extent [m]."""
        count = labels.max() + 1

        def summed(values: np.ndarray) -> np.ndarray:
            return np.bincount(labels, values, count).astype(float)

        total = np.maximum(summed(self.resistance), np.finfo(float).tiny)
        pulled = self.resistance[:, None] * self.settling
        mean = np.column_stack([summed(axis) for axis in pulled.T]) / total[:, None]
        rests = summed(on_wall) > 0.0
        mean[rests] = 0.0
        bodies = summed(np.ones(len(labels)))
        middle = np.column_stack([summed(axis) for axis in places.T]) / bodies[:, None]
        reach = np.array([body.shape.bounding_radius for body in self.bodies])
        extent = np.zeros(count)
        np.maximum.at(extent, labels, np.hypot(*(places - middle[labels]).T) + reach)
        slip = np.hypot(*(self.settling - mean[labels]).T) + self.shear * extent[labels]
        # What settles against nothing but itself pulls as much up as down.
        load = summed(self.resistance * slip) * np.where(rests, 1.0, 0.5)
        drift = np.zeros(count)
        np.maximum.at(drift, labels, np.maximum(slip, STILL * np.hypot(*self.settling.T)))
        return load, drift, 2.0 * extent

    def pulls_of(self, time: float, motion: np.ndarray, pairs: np.ndarray) -> np.ndarray:
        """What holds the pairs (m, PULL_COLUMNS)."""
        if len(self.work.pairs) < len(pairs):
            n = len(self.bodies)
            self.work = work_of(
                self.scene, np.zeros((n, 3)), np.zeros((n, 3)), len(self.work.candidates),
                2 * len(pairs), 0, False,
            )  # fmt: skip
        pulls = np.zeros((len(pairs), PULL_COLUMNS))
        while True:
            self.work.motion[NOW] = motion
            self.work.pairs[: len(pairs), [LATER, EARLIER]] = pairs
            self.work.tally[PAIRS] = len(pairs)
            if self.pulls(self.scene, self.work, time, pulls):
                return pulls
            self.work = with_room(self.work)

    def effective_masses(self, pairs: np.ndarray) -> np.ndarray:
        mass = np.array([body.mass for body in self.bodies])[pairs]
        return mass.prod(axis=1) / mass.sum(axis=1)

    def moving(self, motion: np.ndarray, pairs: np.ndarray) -> np.ndarray:
        """The energy [J] of two bodies' motion against each other, and of their spins."""
        a, b = pairs.T
        against = motion[a][:, [VX, VY]] - motion[b][:, [VX, VY]]
        turning = 0.5 * self.scene.bodies[:, INERTIA] * motion[:, SPIN] ** 2
        reduced = self.effective_masses(pairs)
        return 0.5 * reduced * (against**2).sum(axis=1) + turning[a] + turning[b]

    def sizes(self, pairs: np.ndarray) -> np.ndarray:
        """The smaller bounding radius of every pair [m]."""
        return np.array([body.shape.bounding_radius for body in self.bodies])[pairs].min(axis=1)

    def kept_pose(
        self, time: float, motion: np.ndarray, held: Neighbours, before: tuple[float, np.ndarray]
    ) -> np.ndarray:
        """How far the later body of every pair has moved as seen from the earlier one, which turns
        [m]."""
        _, earlier = before
        a, b = held.pairs.T
        change = (motion - earlier)[:, :2]
        vector = held.vector - (change[a] - change[b])
        turns = [turned(held.vector, -motion[b, ANGLE]), turned(vector, -earlier[b, ANGLE])]
        rolled = (motion[a, ANGLE] - motion[b, ANGLE]) - (earlier[a, ANGLE] - earlier[b, ANGLE])
        return np.hypot(*(turns[0] - turns[1]).T) + np.abs(rolled) * self.sizes(held.pairs)


def alone(swarm: Any) -> tuple[np.ndarray, np.ndarray]:
    """(velocity (n, 2) [m/s], resistance (n,) [kg/s]) at which every body settles alone; nothing
    where no drag lets it."""
    known: dict[tuple, tuple[np.ndarray, float]] = {}
    rows = []
    for body in swarm.bodies:
        key = id(body.shape), body.surface_density, body.density, body.depth, body.fixed, body.angle
        if key not in known:
            known[key] = settling(swarm, body)
        rows.append(known[key])
    return np.array([each[0] for each in rows]), np.array([each[1] for each in rows])


def settling(swarm, body):
    """(velocity, resistance) of a body alone."""
    try:
        velocity, mobility = terminal_motion(swarm.system, body)
    except UsageError:
        return np.zeros(2), 0.0
    least = least_mobility(swarm.system, body, math.hypot(*velocity), mobility)
    return velocity, 1.0 / least if least > 0.0 else 0.0


def turned(vectors: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Vectors (m, 2), each turned by its angle (m,) [rad]."""
    c, s = np.cos(angles), np.sin(angles)
    x, y = vectors.T
    return np.column_stack([c * x - s * y, s * x + c * y])


def relative(
    motion: np.ndarray, held: Neighbours, pulls: np.ndarray, sizes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of every pair as a rigid doublet the speed along its line of centres, of any kind [m/s], and
    its spin [rad/s]."""
    a, b = held.pairs.T
    ux, uy = (motion[a] - motion[b])[:, [VX, VY]].T
    rx, ry = held.vector.T
    spin = motion[b, SPIN]
    shear = np.hypot(ux + spin * ry, uy - spin * rx) + np.abs(motion[a, SPIN] - spin) * sizes
    along = ux * pulls[:, NORMAL_OF] + uy * pulls[:, NORMAL_OF + 1]
    return np.abs(along), shear, np.abs(spin)
