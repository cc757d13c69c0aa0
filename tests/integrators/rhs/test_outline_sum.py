"""Forces between outlines, against the energy that they follow from and against plates."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, SpheroPolygon, System
from flocsim.compiler.composer import compose
from flocsim.errors import UsageError
from flocsim.fields import quantity
from flocsim.forces import Contact, Gravity, OutlineForce, StokesDrag, VanDerWaals
from flocsim.geometry.contact.attraction import attraction_energy
from flocsim.geometry.shapes.outline import core_gap
from flocsim.geometry.shapes.pieces import outline_pieces
from flocsim.integrators.rhs.forces import add_outline_forces
from flocsim.integrators.rhs.jacobian import assemble_jacobian
from flocsim.integrators.rhs.outline_sum import outline_forces_at
from flocsim.state.work import NOW, STIFFNESS, work_of
from flocsim.swarms.swarm import Swarm
from tests.helpers.matrices import whole_matrix
from tests.helpers.tiers import rest_slow

HAMAKER, SIZE = 1e-20, 5e-6


def rough(corners, size, seed):
    """A floc with reflex corners."""
    random = np.random.default_rng(seed)
    turn = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    turn = turn + random.uniform(-0.3, 0.3, corners) * 2.0 * np.pi / corners
    away = size * (1.0 + 0.3 * np.sin(2.0 * turn + 1.0) + 0.2 * random.uniform(-1, 1, corners))
    return SpheroPolygon(away[:, None] * np.column_stack([np.cos(turn), np.sin(turn)]), 1e-6)


def gap_of(one, other, pose):
    pairs = [(p, q) for p in one.placed_parts(*pose) for q in other.placed_parts(0.0, 0.0, 0.0)]
    gaps = [core_gap(p, q) for p, q in pairs]
    if min(gaps) == 0.0:
        return -math.inf
    return min(gap - p.radius - q.radius for gap, (p, q) in zip(gaps, pairs, strict=True))


def at_gap(one, other, gap, bearing, angle):
    """The pose of one beside the other in which they are this far apart."""
    low, high = 0.0, 2.0 * (one.bounding_radius + other.bounding_radius)
    for _ in range(60):
        middle = 0.5 * (low + high)
        pose = middle * math.cos(bearing), middle * math.sin(bearing), angle
        low, high = (middle, high) if gap_of(one, other, pose) < gap else (low, middle)
    return high * math.cos(bearing), high * math.sin(bearing), angle


class Pair:
    """Two bodies and what acts on the later one."""

    def __init__(self, other, one, pose, *forces):
        bodies = [Body(other, density=1100.0)]
        bodies.append(Body(one, position=pose[:2], angle=pose[2], density=1100.0))
        self.system, self.pose = System(bodies, forces), pose
        self.scene = self.system.scene()
        self.work = work_of(self.scene, *self.system.motion())

    def loads(self, x, y, angle, turn=0.0):
        """(fx, fy, torque on the later, on the earlier)."""
        entry = compose(outline_forces_at, self.system.compiled_calls)
        found = entry(self.scene, self.work, 0.0, 1, 0, float(x), float(y), float(angle), turn)
        return np.array(found)


def slopes(energy, pose, step, size):
    """Minus the derivatives of an energy by the pose."""
    found = []
    for axis, by in enumerate((step, step, step / size)):
        shift = np.zeros(3)
        values = []
        for times in (1, -1, 2, -2):
            shift[axis] = times * by
            values.append(energy(np.add(pose, shift)))
        found.append(-(8 * (values[0] - values[1]) - (values[2] - values[3])) / (12 * by))
    return np.array(found)


@pytest.mark.parametrize("seed", rest_slow(range(12), lambda seed: seed < 4))
@pytest.mark.parametrize(
    ("gap", "d_min", "allowed"), [(2e-9, 1e-9, 5e-5), (3e-8, 1e-9, 3e-3), (6e-8, 3e-10, 5e-3)]
)
def test_force_and_torque_are_the_slopes_of_the_energy(seed, gap, d_min, allowed):
    random = np.random.default_rng(seed)
    one, other = rough(8, SIZE, seed), rough(8 + seed, 1.7 * SIZE, 50 + seed)
    pose = at_gap(one, other, gap, *random.uniform(0.0, 6.28, 2))
    force = VanDerWaals(HAMAKER, d_min, law="outline", depth=1.0)
    found = Pair(other, one, pose, force).loads(*pose)
    pieces = outline_pieces(one.parts), outline_pieces(other.parts)
    wanted = slopes(lambda each: attraction_energy(*pieces, each, HAMAKER), pose, 2e-3 * gap, SIZE)
    strength = math.hypot(*wanted[:2])
    np.testing.assert_allclose(found[:2], wanted[:2], atol=allowed * strength)
    assert abs(found[2] - wanted[2]) < allowed * strength * SIZE


@pytest.mark.parametrize("seed", range(3))
def test_what_was_listed_before_changes_nothing(seed):
    """On a way in, along and out again, with lists that are kept."""
    random = np.random.default_rng(seed)
    one, other = rough(16, SIZE, seed), rough(64, 1.7 * SIZE, 50 + seed)
    force = VanDerWaals(HAMAKER, law="outline")
    x, y, angle = at_gap(one, other, 1e-9, *random.uniform(0.0, 6.28, 2))
    pair = Pair(other, one, (x, y, angle), force)
    for away in (1e-6, 3e-7, 1e-8, 0.0, 2e-9, 4e-8, 2e-7):
        far = 1.0 + away / math.hypot(x, y)
        pose = far * x, far * y, angle + random.normal() * 0.1 * away / SIZE
        found = pair.loads(*pose)
        alone = Pair(other, one, pose, force).loads(*pose)
        strength = math.hypot(*alone[:2])
        np.testing.assert_allclose(found[:2], alone[:2], atol=1e-9 * strength)
        np.testing.assert_allclose(found[2:], alone[2:], atol=1e-9 * strength * SIZE)


def balanced(swapped, force):
    """(a Pair of two rough bodies, its pose, its loads there), seen to obey the third law."""
    one, other = rough(8, SIZE, 1), rough(16, 1.7 * SIZE, 2)
    if swapped:
        one, other = other, one
    pose = x, y, _ = at_gap(one, other, 5e-9, 0.3, 1.0)
    pair = Pair(other, one, pose, force)
    found = pair.loads(*pose)
    moment = x * found[1] - y * found[0]
    assert found[2] + found[3] == pytest.approx(-moment, abs=1e-9 * abs(SIZE * found[0]))
    return pair, pose, found


@pytest.mark.parametrize("swapped", [False, True])
def test_third_law_with_torque(swapped):
    """Forces are opposite, and torques balance about any point, whichever body comes first."""
    balanced(swapped, VanDerWaals(HAMAKER, law="outline"))


def test_turned_and_shifted_together_nothing_changes():
    one, other = rough(8, SIZE, 3), rough(16, 1.7 * SIZE, 4)
    x, y, angle = at_gap(one, other, 5e-9, 0.3, 1.0)
    pair = Pair(other, one, (x, y, angle), VanDerWaals(HAMAKER, law="outline"))
    here, c, s = pair.loads(x, y, angle), math.cos(0.7), math.sin(0.7)
    there = pair.loads(c * x - s * y, s * x + c * y, angle + 0.7, 0.7)
    turned = [c * there[0] + s * there[1], c * there[1] - s * there[0], there[2], there[3]]
    np.testing.assert_allclose(turned, here, rtol=1e-5, atol=1e-6 * SIZE * abs(here[0]))


def slab(length):
    """A slab that faces up and down."""
    return SpheroPolygon(np.array([[-1, -0.1], [1, -0.1], [1, 0.1], [-1, 0.1]]) * length, 1e-7)


@pytest.mark.parametrize(
    ("wavelength", "share"), [(None, 1.0), ("100 nm", (1 + 1.5 * 0.266) / 1.266**2)]
)
def test_a_face_of_five_micrometres(wavelength, share):
    """H/(6πd³) for each square metre, over what retardation divides by."""
    gap, length = 5e-9, 2.5e-6
    plate = slab(length)
    y = 0.2 * length + 2e-7 + gap
    pull = VanDerWaals(HAMAKER, law="outline", depth="5 um", wavelength=wavelength)
    found = Pair(plate, plate, (0.0, y, 0.0), pull).loads(0.0, y, 0.0)
    plates = HAMAKER / (6.0 * math.pi * gap**3) * 5e-6 * 5e-6 * share
    assert -found[1] == pytest.approx(plates, rel=0.02)
    assert abs(found[0]) < 1e-6 * plates


@pytest.mark.parametrize("gap", [0.0, -2e-9, 0.5e-9])
def test_below_the_cut_off_the_force_is_that_at_it(gap):
    one, other = Sphere(1e-6), Sphere(3e-6)
    pair = Pair(other, one, (5e-6, 0.0, 0.0), VanDerWaals(HAMAKER, 1e-9, law="outline"))
    there, here = pair.loads(4e-6 + 1e-9, 0.0, 0.0), pair.loads(4e-6 + gap, 0.0, 0.0)
    assert here[0] == pytest.approx(there[0], rel=3e-3)


@attrs.frozen
class Hydration(OutlineForce):
    """A pressure P e^(−d/λ)."""

    strength: float = quantity("Pa", default=1e6)
    length: float = quantity("m", default=2e-9)

    @property
    def reach(self):
        return 20.0 * self.length

    @staticmethod
    def kernel(point, strength, length):
        return strength * math.exp(-max(point.gap, 0.0) / length)


def test_a_pressure_of_ones_own_acts_between_faces():
    gap, length = 5e-9, 2.5e-6
    plate, force = slab(length), Hydration(depth="5 um")
    y = 0.2 * length + 2e-7 + gap
    found = Pair(plate, plate, (0.0, y, 0.0), force).loads(0.0, y, 0.0)
    assert found[1] == pytest.approx(force.strength * math.exp(-2.5) * 25e-12, rel=0.03)


def test_forces_of_two_depths_are_refused():
    with pytest.raises(UsageError, match="one depth, found 5e-06, sphere"):
        Pair(Sphere(1e-6), Sphere(1e-6), (3e-6, 0, 0), VanDerWaals(law="outline"),
             Hydration(depth="5 um"))  # fmt: skip


def test_an_overlap_beyond_d_min_is_refused_at_the_start():
    one, other = Sphere(1e-6), Sphere(3e-6)
    force = VanDerWaals(1e-20, 1e-9, law="outline")
    Pair(other, one, (4e-6 - 0.9e-9, 0.0, 0.0), force).system.check_overlaps()
    with pytest.raises(UsageError, match=r"overlapping by 2e-09 m, more than d_min = 1e-09 m of"):
        Pair(other, one, (4e-6 - 2e-9, 0.0, 0.0), force).system.check_overlaps()


def test_a_swarm_refuses_them():
    bodies = [Body(Sphere(1e-6), density=2650.0)]
    with pytest.raises(UsageError, match="acts along outlines, but a swarm"):
        Swarm(bodies, [VanDerWaals(law="outline")])


def derivatives(scene, work):
    add_outline_forces(scene, work, 0.0, NOW)
    assemble_jacobian(scene, work, 0.0, 1.0)


def test_the_jacobian_has_their_derivatives():
    one, other = rough(8, SIZE, 5), rough(16, 1.7 * SIZE, 6)
    pose = at_gap(one, other, 5e-9, 2.0, 1.0)
    pair = Pair(other, one, pose, VanDerWaals(HAMAKER, law="outline"))
    compose_ = pair.system.compose(entry=derivatives)
    compose_(pair.scene, pair.work)
    stiffness = whole_matrix(pair.work, STIFFNESS)
    found, step = np.zeros((6, 6)), 1e-11

    def all_loads(moved):
        x, y, angle = moved[3:] - np.array([*moved[:2], 0.0])
        fx, fy, torque_a, torque_b = pair.loads(x, y, angle, float(moved[2]))
        return np.array([-fx, -fy, torque_b, fx, fy, torque_a])

    start = np.array([0.0, 0.0, 0.0, *pose])
    for column in range(6):
        by = step / SIZE if column % 3 == 2 else step
        shift = np.eye(6)[column] * by
        found[:, column] = -(all_loads(start + shift) - all_loads(start - shift)) / (2.0 * by)
    scale = np.outer([1, 1, SIZE] * 2, [1, 1, SIZE] * 2) * abs(found[:2, :2]).max()
    assert np.all(abs(stiffness - found) < 0.02 * scale)


@pytest.mark.slow
def test_two_flocs_fall_together_and_stay():
    one, other = rough(8, SIZE, 7), rough(8, SIZE, 8)
    forces = [Gravity(), StokesDrag(), VanDerWaals(4.7e-20, law="outline"), Contact(20.0, 2.0)]
    bodies = [
        Body(other, density=2650.0),
        Body(one, position=(1e-6, 1.01 * (one.bounding_radius + other.bounding_radius)),
             velocity=(0.0, -1e-3), density=2650.0),
    ]  # fmt: skip
    run = System(bodies, forces, fluid=Fluid(buoyancy=True)).run(until=0.5)
    assert run.status.name == "FINISHED"
    x, y, angle = run.position[-1, 1] - run.position[-1, 0]
    turn = run.position[-1, 0, 2]
    seen = math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x, angle
    assert -1e-7 < gap_of(one, other, seen) < 1e-9
