"""What holds the bodies of a swarm together: the proofs of flocsim.bonds, for all pairs that touch.

What a swarm knows is what loads a bond. A cluster that settles at V = Σ D v/Σ D, v and D the
settling velocity and the resistance of each body alone, pulls at its bodies with D (v − V), which
add up to nothing: no part of it pulls at the rest with more than half the sum of their sizes, in
any form and orientation of the cluster. That of two is |v_i − v_j|/(1/D_i + 1/D_j). What rests on a
wall does not settle: there the load is all the weight. Two that are a cluster by themselves are
judged as a pair of a study is: the load is along their drift, and the doublet turns to hang. In a
larger cluster it may come from anywhere, with an arm as long as the cluster.

A pair rests where it has kept its pose since the time before, if that is a rest time ago at least.
What is not known of a swarm at one instant is the tangential displacements of its contacts.
"""

import math
from typing import Any

import attrs
import numpy as np

from flocsim.bonds.certificate import (
    CERTIFICATE,
    NO_BOND,
    Load,
    bond_between,
    doublet_pose,
    is_certain,
    is_certain_in_kicks,
    pose_change,
)
from flocsim.bonds.escape import radii_of
from flocsim.bonds.rest import REST_TURNS, STABLE_POSE, is_swinging, kind_at_rest
from flocsim.compiler.composer import compose
from flocsim.errors import UsageError
from flocsim.forces.body_forces import thermal_forces
from flocsim.forces.drag import follows_shape
from flocsim.forces.settling import free_mobilities, least_mobility, terminal_motion
from flocsim.geometry.contact.near_pairs import list_polygons
from flocsim.geometry.contact.points import locate_polygons, update_rotation
from flocsim.integrators.rhs.surface_gap import share_reach
from flocsim.state.work import NEW, NOW, put_motion, with_room, work_of
from flocsim.swarms.together.clusters import Neighbours, placed_together

KINDS = ("touching", "certificate", "hook", "rest")
"""Kinds of bonds: those of pairs, and none that is proved."""

FORCE, DRIFT, DRIFT_X, DRIFT_Y, LEVER, ALONE, GAP, LOAD_COLUMNS = range(8)
"""Columns of what is known of a pair: its Load, the direction of which is (0, 0) where it may be
any, and the gap of its outlines [m]."""


def list_pair(scene, work, pair, gap):
    """List and locate the features of one pair, at a gap of the outlines [m], that any force knows;
    False without room."""
    work.tally.candidates = 0
    cut = 0.0
    if scene.surface_reach > 0.0:
        cut = share_reach(scene, max(gap, 0.0))
    if not list_polygons(scene, work, pair, cut):
        return False
    update_rotation(work, NOW, work.pairs[pair].later)
    update_rotation(work, NOW, work.pairs[pair].earlier)
    for row in range(work.tally.candidates):
        locate_polygons(scene, work, NOW, row)
    return True


def kind_of(scene, work, time, elapsed, bond, load):
    """The kind of bond of two bodies whose places were in NEW a time ``elapsed`` [s] ago."""
    if load.kicks > 0.0:
        if is_certain_in_kicks(scene, work, time, bond, load):
            return CERTIFICATE
    elif is_certain(scene, work, time, bond, load):
        return CERTIFICATE
    i, j = bond.i, bond.j
    now, before = doublet_pose(scene, work, NOW, i, j), doublet_pose(scene, work, NEW, i, j)
    moved = pose_change(scene, i, j, now, before)
    if not moved < STABLE_POSE * load.drift * elapsed or is_swinging(scene, work, i, j, load):
        return NO_BOND
    rested = elapsed * load.drift / (REST_TURNS * radii_of(scene, bond))
    return kind_at_rest(scene, work, time, bond, load, rested)


def judge_bonds(scene, work, time, elapsed, kicks, loads, kinds):
    """The ``kinds`` of the listed pairs under their ``loads``, see FORCE; False without room for
    their features. ``elapsed``: how long ago places were those in NEW [s], 0 where none is known;
    ``kicks``: k_B T [J]."""
    for pair in range(work.tally.pairs):
        if not list_pair(scene, work, pair, loads[pair, GAP]):
            return False
        load = Load(
            loads[pair, FORCE], loads[pair, DRIFT], loads[pair, DRIFT_X], loads[pair, DRIFT_Y],
            loads[pair, LEVER], loads[pair, ALONE], kicks,
        )  # fmt: skip
        bond = bond_between(scene, work, time, work.pairs[pair].earlier, work.pairs[pair].later)
        kinds[pair] = kind_of(scene, work, time, elapsed, bond, load)
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
        self.judge = compose(
            judge_bonds,
            {**swarm.system.compiled_calls, **swarm.fillings()},
            what="the proofs of bonds",
        )
        self.free = np.array([not body.fixed for body in swarm.bodies])
        self.work = self.work_for(64, 1)
        self.settling, self.resistance, self.aslant = alone(swarm)
        self.shear = math.hypot(*swarm.fluid.gradient)
        self.kicks = max((each.energy for each in thermal_forces(swarm.forces)), default=0.0)

    def work_for(self, capacity: int, pairs: int) -> Any:
        """Work arrays with room for so many features and pairs."""
        nothing = np.zeros((len(self.bodies), 3))
        return work_of(self.scene, nothing, nothing, capacity, pairs, 0, False)

    def bonds(
        self, time: float, motion: np.ndarray, touching: Neighbours,
        before: tuple[float, np.ndarray] | None = None,
    ) -> Bonds:  # fmt: skip
        """The Bonds of the pairs that touch at ``motion`` (n, 6), or are handed over as near;
        ``before``: an earlier time and the motion then."""
        held = touching.among(self.free)
        on_wall = np.zeros(len(self.free), bool)
        on_wall[touching.pairs[~self.free[touching.pairs].all(axis=1)]] = True
        kinds = np.zeros(len(held.pairs), dtype=np.int64)
        if not len(held.pairs):
            return Bonds(held.pairs, kinds)
        loads = self.loads_on(held, on_wall)
        if len(self.work.pairs) < len(held.pairs):
            self.work = self.work_for(len(self.work.candidates), 2 * len(held.pairs))
        since, earlier = (time, motion) if before is None else before
        while True:
            work = self.work
            put_motion(work, NOW, motion)
            put_motion(work, NEW, earlier)
            known = work.pairs[: len(held.pairs)]
            known["later"], known["earlier"] = held.pairs.T
            work.tally.pairs = len(held.pairs)
            if self.judge(self.scene, work, time, time - since, self.kicks, loads, kinds):
                return Bonds(held.pairs, kinds)
            self.work = with_room(work)

    def loads_on(self, held: Neighbours, on_wall: np.ndarray) -> np.ndarray:
        """What loads the bonds of pairs (m, LOAD_COLUMNS)."""
        labels, places = placed_together(len(self.free), held)
        load, drift, extent = self.loads(labels, places, on_wall)
        later, earlier = held.pairs.T
        label = labels[later]
        two = (np.bincount(labels)[label] == 2) & ~on_wall[later] & ~on_wall[earlier]
        against = self.settling[later] - self.settling[earlier]
        speed = np.hypot(*against.T)
        known = two & (speed > 0.0) & (self.shear == 0.0) & (self.aslant[later] == 0.0)
        known &= self.aslant[earlier] == 0.0
        toward = np.where(known, 1.0 / np.where(known, speed, 1.0), 0.0)[:, None] * against
        lever = np.where(two, 0.0, extent[label])
        return np.column_stack([load[label], drift[label], toward, lever, two, held.gap])

    def loads(
        self, labels: np.ndarray, places: np.ndarray, on_wall: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of every cluster the largest load on a bond [N], the largest drift of two of its bodies
        against each other [m/s], and its extent [m]."""
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
        # By how much those of other angles may differ: of the body, and of the mean.
        widest = np.zeros(count)
        np.maximum.at(widest, labels, self.aslant)
        slip += self.aslant + np.where(rests, 0.0, widest)[labels]
        # What settles against nothing but itself pulls as much up as down.
        load = summed(self.resistance * slip) * np.where(rests, 1.0, 0.5)
        # The fastest two: on a wall they may go the same way, else against each other.
        order = np.lexsort((slip, labels))
        ends = np.cumsum(np.bincount(labels, minlength=count)) - 1
        drift = slip[order[ends]]
        several = bodies > 1.0
        drift[several] += slip[order[ends[several] - 1]]
        fastest = np.zeros(count)
        np.maximum.at(fastest, labels, np.hypot(*self.settling.T))
        return load, np.maximum(drift, STABLE_POSE * fastest), 2.0 * extent


def alone(swarm: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(velocity (n, 2) [m/s], resistance (n,) [kg/s], aslant (n,) [m/s]) at which every body
    settles alone; nothing where no drag lets it. ``aslant``: by how much the velocity may differ at
    another angle, where the drag is of shapes."""
    known: dict[tuple, tuple[np.ndarray, float, float]] = {}
    rows = []
    for body in swarm.bodies:
        key = id(body.shape), body.surface_density, body.density, body.depth, body.fixed, body.angle
        if key not in known:
            known[key] = settling(swarm, body)
        rows.append(known[key])
    velocity, resistance, aslant = zip(*rows, strict=True)
    return np.array(velocity), np.array(resistance), np.array(aslant)


def settling(swarm, body):
    """(velocity, resistance, aslant) of a body alone."""
    try:
        velocity, mobility = terminal_motion(swarm.system, body)
    except UsageError:
        return np.zeros(2), 0.0, 0.0
    against = velocity - swarm.fluid.velocity
    least = least_mobility(swarm.system, body, math.hypot(*velocity), mobility)
    aslant = 0.0
    if follows_shape(swarm.system.forces) and not body.fixed:
        smallest, largest = free_mobilities(swarm.system, body)
        # Velocities of one force at all angles lie on a circle of this diameter.
        aslant = (largest / smallest - 1.0) * math.hypot(*against)
    return velocity, 1.0 / least if least > 0.0 else 0.0, aslant
