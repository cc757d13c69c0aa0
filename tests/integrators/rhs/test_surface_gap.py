"""The smooth gap of two outlines: near the least gap, and of one potential with all its forces."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.speed.swarms import lone_pair
from flocsim import Body, Fluid, SpheroPolygon, System
from flocsim.constants import LARGEST_BIAS
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag, VanDerWaals
from flocsim.geometry.contact.near_pairs import gap_between
from flocsim.integrators import Implicit
from flocsim.integrators.rhs.surface_gap import (
    evaluate_smooth_gap,
    smoothing_length,
)
from flocsim.integrators.rhs.views import pair_view
from flocsim.state.work import NOW
from tests.helpers.fast_scene import FastScene
from tests.helpers.trial_scenes import hook, star

ATTRACTION = VanDerWaals(1e-18, d_min=2e-7, gap="surface")
REPULSION = DoubleLayer(15e-3, 0.98e-6, gap="surface")
FORCES = pytest.mark.parametrize("force", [ATTRACTION, REPULSION], ids=["attraction", "repulsion"])


def jagged(rng):
    """A polygon of some random rays around its centre, most often not convex."""
    count = int(rng.integers(3, 18))
    angles = 2.0 * math.pi * (np.arange(count) + 0.6 * rng.random(count)) / count
    rays = 6e-6 * rng.uniform(0.4, 1.2, count)
    return SpheroPolygon((rays * [np.cos(angles), np.sin(angles)]).T, 10.0 ** rng.uniform(-6.5, -6))


class Pair:
    """Two bodies with one surface force, the first of them at the origin."""

    def __init__(self, shapes, force):
        """The shapes, and where they are has yet to be told."""
        self.shapes = shapes
        bodies = [Body(shape, surface_density=2.0) for shape in shapes]
        bodies[1] = Body(shapes[1], (1e-4, 0.0), surface_density=2.0)
        self.fast = FastScene(System(bodies, [force]))
        self.scene, self.work = self.fast.scene, self.fast.work

    def place(self, x, y, angle):
        self.work.place[NOW, 1] = x, y, angle

    def loads(self, x, y, angle):
        """Forces and torques (2, 3) with the second body there."""
        self.place(x, y, angle)
        return self.fast.loads()

    def approach(self, rng, gap):
        """Place the second body in a random direction, so far from the outline of the first."""
        way, turn = rng.uniform(0.0, 2.0 * math.pi, 2)
        distance = sum(shape.bounding_radius for shape in self.shapes) + gap
        while True:
            place = (distance * math.cos(way), distance * math.sin(way), turn)
            self.place(*place)
            further = gap_between(self.scene, self.work, 1, 0) - gap
            if further < 0.1 * gap:
                return place
            distance -= further

    def gaps(self):
        """(g̃, gaps of all pairs that have a share) where the forces were last asked for."""
        end = int(self.work.tally.candidates)
        near = self.work.candidates[:end]["surface_active"] == 1
        return evaluate_smooth_gap(self.scene, self.work, NOW, 0, end)[0], self.work.geometry[
            NOW, :end
        ]["gap"][near]

    def closest(self):
        """Vertex and edge that have the largest share in g̃."""
        end = int(self.work.tally.candidates)
        row = np.argmax(self.work.geometry[NOW, :end]["force_share"])
        return self.work.candidates[row].tolist()[:4]

    def strength(self, gap):
        """What the force's kernel gives for a gap [N]."""
        force = self.fast.system.forces[0]
        if isinstance(force, VanDerWaals):
            known = (force.hamaker, force.d_min)
        else:
            known = (force.strength, force.kappa)
        return force.kernel(pair_view(self.scene, 0.0, 1, 0, gap, 0.0, 1e-5), *known)


def random_pairs(force, count=30):
    """(Pair, place of its second body) at gaps of ten nanometres to two micrometres."""
    for seed in range(count):
        rng = np.random.default_rng([seed, 13])
        pair = Pair([jagged(rng), jagged(rng)], force)
        yield pair, pair.approach(rng, 10.0 ** rng.uniform(-8.0, -5.7))


@FORCES
def test_the_smooth_gap_and_its_force_are_close_to_those_of_the_least(force):
    several, worst = 0, 0.0
    for pair, place in random_pairs(force):
        pair.loads(*place)
        soft, gaps = pair.gaps()
        least, room = gaps.min(), 1e-15
        assert least == pytest.approx(gap_between(pair.scene, pair.work, 1, 0), abs=room)
        several += len(gaps) > 1
        lowest = least - smoothing_length(pair.scene, least) * math.log(len(gaps))
        assert lowest - room <= soft <= least + room
        worst = max(worst, abs(pair.strength(soft) / pair.strength(least) - 1.0))
    assert several >= 8
    assert 0.0 < worst <= LARGEST_BIAS == 0.03


@FORCES
def test_action_is_reaction(force):
    for pair, place in random_pairs(force):
        (fx, fy, torque), (gx, gy, other) = pair.loads(*place)
        size = math.hypot(fx, fy)
        assert size > 0.0
        assert (fx + gx, fy + gy) == pytest.approx((0.0, 0.0), abs=1e-15 * size)
        arm = math.hypot(*place[:2])
        moment = torque + other + place[0] * gy - place[1] * gx
        assert moment == pytest.approx(0.0, abs=1e-14 * size * arm)


@FORCES
@pytest.mark.parametrize("seed", range(3))
def test_no_work_is_done_around_a_closed_loop(force, seed):
    """In x, y and angle at once, past corners and into notches."""
    shapes = [star(), hook()] if seed == 0 else [jagged(np.random.default_rng([seed, k]))
                                                for k in range(2)]  # fmt: skip
    pair, rng = Pair(shapes, force), np.random.default_rng([seed, 5])
    centre = pair.approach(rng, 6e-7)
    reach, turn, closest = 3e-7, 0.04, set()

    def power(t):
        x, y, angle = reach * math.cos(t), reach * math.sin(t), turn * math.cos(t + 1.0)
        load = pair.loads(centre[0] + x, centre[1] + y, centre[2] + angle)[1]
        closest.add(pair.closest())
        return load @ (-y, x, -turn * math.sin(t + 1.0))

    # The rates of nearest features change where a vertex passes the end of an edge.
    found = [quad(power, a, a + math.pi / 8, epsabs=0.0, epsrel=1e-12, limit=200)[0]
             for a in np.arange(16) * math.pi / 8]  # fmt: skip
    scale = np.sum(np.abs(found))
    assert scale > 0.0
    assert abs(sum(found)) <= 1e-9 * scale
    assert len(closest) > 1 or seed == 0


def over_floor(force):
    """A box over a broad floor."""
    floor = SpheroPolygon([(-2e-4, 0.0), (2e-4, 0.0)], 1e-6)
    box = SpheroPolygon([(-1e-5, -5e-6), (1e-5, -5e-6), (1e-5, 5e-6), (-1e-5, 5e-6)], 1e-6)
    return Pair([floor, box], force)


@FORCES
def test_forces_are_continuous_where_the_closest_pair_changes(force):
    """As a box over a floor rocks, one of its lower corners comes nearest, then the other."""
    pair, half = over_floor(force), 1e-5
    left, level, right = (pair.loads(0.0, 8e-6, angle)[1] for angle in (-1e-11, 0.0, 1e-11))
    size = abs(level[1])
    assert level[2] == pytest.approx(0.0, abs=1e-9 * size * half)
    assert left[2] == pytest.approx(right[2], abs=1e-6 * size * half)
    assert left[1] == pytest.approx(right[1], rel=1e-9)
    # Further on one corner has all of it.
    tilted = pair.loads(0.0, 8e-6, 0.05)[1]
    assert abs(tilted[2]) == pytest.approx(abs(tilted[1]) * half, rel=0.05)
    torques = np.array(
        [pair.loads(0.0, 8e-6, angle)[1, 2] for angle in np.linspace(-0.05, 0.05, 801)]
    )
    assert np.abs(np.diff(torques)).max() < 0.15 * np.ptp(torques)


def test_a_block_that_lies_flat_in_a_well_takes_few_steps():
    """Two corners share the force within some picometres of each other: what Newton's method leaves
    of the gap would rock the block for ever."""
    block = SpheroPolygon([(-5e-6, -3e-6), (5e-6, -3e-6), (5e-6, 3e-6), (-5e-6, 3e-6)], 5e-7)
    bodies = [
        Body(block, density=1050.0),
        Body(block, (1e-6, 7e-6 + 1.6e-10), 2e-7, density=1100.0),
    ]
    laws = [
        Gravity(), StokesDrag(), Contact(k_n=20.0, k_t=2.0),
        VanDerWaals(2e-20, d_min=1e-9, gap="surface"),
        DoubleLayer(15e-3, 3.35e-10, permittivity=70.6, gap="surface"),
    ]  # fmt: skip
    found = System(bodies, laws, fluid=Fluid(buoyancy=True)).run(until=1.0, max_steps=20_000)
    assert found.status.name == "FINISHED"
    assert found.steps < 1000  # 141; without that, more than 100,000
    x, y, angle = found.position[-1, 1] - found.position[-1, 0]
    turned = found.position[-1, 0, 2]
    assert abs(angle) < 1e-6
    assert y * math.cos(turned) - x * math.sin(turned) == pytest.approx(7e-6 + 1.5e-10, rel=2e-5)


def test_no_step_passes_through_the_reach_of_a_force_unnoticed():
    """Two spheres come within reach for a part of a step that free flight would take in one."""
    forces = [Gravity(), StokesDrag(), VanDerWaals(1e-19, gap="surface", cut=1e-6), Contact()]
    fluid = Fluid(viscosity=8.9e-4, density=997.0, buoyancy=True)
    found, exact = (
        System(lone_pair(886, 1000), forces, Implicit(tolerance), fluid=fluid).run(0.3)
        for tolerance in (1e-9, 1e-12)
    )
    gap = np.hypot(*(exact.position[:, 1] - exact.position[:, 0])[:, :2].T)
    gap = gap - sum(body.shape.radius for body in lone_pair(886, 1000))
    assert gap[0] > 5e-6 and gap[-1] > 5e-6 and 0.8e-6 < gap.min() < 1e-6
    assert found.position[-1] == pytest.approx(exact.position[-1], abs=1e-10)
