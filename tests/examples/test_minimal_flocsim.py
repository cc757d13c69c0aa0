"""The model in one short file: its laws, and its agreement with the package on fifty starts."""

import ast
import importlib.util
import itertools
import math

import numba
import numpy as np
import pytest

from flocsim import Sphere, SpheroPolygon, Study
from tests.helpers.small_study import ROOT

FILE = ROOT / "examples" / "minimal_flocsim.py"
RAGGED = np.array([-5, 5 - 1j, 2 + 3j, 4 + 8j, -1 + 3j, -4 + 6j]) * 1e-6
CELLS = 60
"""Of a grid on which bodies are made quickly."""


def loaded():
    """The example as a module."""
    spec = importlib.util.spec_from_file_location("minimal_flocsim", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def plain():
    """The example uncompiled: a few steps take less time than compiling it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(numba.config, "DISABLE_JIT", True)
        return loaded()


class Impact:
    """Two bodies that feel nothing but their contacts: an r_eq of nothing turns off (5) and (6)."""

    def __init__(self, plain, bodies, place, velocity, spin=(0.0, 0.0)):
        self.plain = plain
        self.bodies = tuple(body._replace(r_eq=1e-20) for body in bodies)
        self.place, self.velocity = np.array(place, complex), np.array(velocity, complex)
        self.angle, self.spin = np.array([0.2, 2.9]), np.array(spin)
        counts = [len(body.vertices) for body in bodies]
        self.pairs = [
            (k, v, e) for k in (0, 1) for v in range(counts[k]) for e in range(counts[1 - k])
        ][: None if max(counts) > 1 else 1]
        self.slip = np.zeros((2, max(counts), max(counts)))
        self.mass = np.array([body.mass for body in bodies])
        self.inertia = np.array([body.inertia for body in bodies])

    def cores(self):
        turn = np.exp(1j * self.angle)
        return [self.place[k] + turn[k] * body.vertices for k, body in enumerate(self.bodies)]

    def forces(self, h=0.0):
        motion = self.place, self.velocity, self.spin
        return self.plain.interaction(self.bodies, self.cores(), *motion, self.pairs, self.slip, h)

    def step(self, h):
        """Advance by a step of leapfrog; return the largest overlap."""
        self.place += h * self.velocity
        self.angle += h * self.spin
        force, torque, overlap = self.forces(h)
        self.velocity += h * np.array([-force, force]) / self.mass
        self.spin += h * torque / self.inertia
        return overlap

    def elastic_energy(self):
        """Energy of all contacts [J]."""
        overlaps = [self.plain.contact(self.bodies, self.cores(), pair)[0] for pair in self.pairs]
        normal = 0.5 * self.plain.K_N * sum(max(each, 0.0) ** 2 for each in overlaps)
        return normal + 0.5 * self.plain.K_T * (self.slip**2).sum()

    def kinetic_energy(self):
        moving = self.mass * np.abs(self.velocity) ** 2 + self.inertia * self.spin**2
        return 0.5 * moving.sum()

    def angular_momentum(self):
        orbital = self.mass * (np.conj(self.place) * self.velocity).imag
        return (orbital + self.inertia * self.spin).sum()


@pytest.fixture(scope="module")
def ragged_bodies(plain):
    return [plain.make_body(scale * RAGGED, 1e-6, CELLS) for scale in (1.0, 1.4)]


@pytest.fixture
def ragged_impact(plain, ragged_bodies):
    """Two ragged bodies that touch with two pairs, with velocities and spins."""
    place, velocity = [0.0, 1e-6 + 9.6e-6j], [0.01 + 0.02j, -0.03 - 0.01j]
    return Impact(plain, ragged_bodies, place, velocity, (300.0, -500.0))


def test_it_needs_no_package_and_is_no_longer_than_150_lines():
    source = FILE.read_text("utf-8")
    nodes = list(ast.walk(ast.parse(source)))
    texts = [node for node in nodes if isinstance(node, ast.Expr) and is_text(node.value)]
    documented = {line for node in texts for line in range(node.lineno, node.end_lineno + 1)}
    code = [
        line for number, line in enumerate(source.splitlines(), 1)
        if line.strip() and not line.strip().startswith("#") and number not in documented
    ]  # fmt: skip
    imported = {line.split()[1] for line in code if line.startswith(("import ", "from "))}
    assert len(code) <= 150
    assert imported == {"math", "typing", "numpy", "numba", "scipy.special"}


def is_text(node):
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


@pytest.mark.parametrize("core", [np.zeros(1, complex), RAGGED])
def test_its_moments_are_those_of_the_package(plain, core):
    body = plain.make_body(core, 1e-6, CELLS)
    points = np.column_stack([core.real, core.imag])
    shape = SpheroPolygon(points, 1e-6) if len(core) > 1 else Sphere(1e-6)
    assert body.mass == pytest.approx(2.0 * shape.area, rel=5e-3)
    assert body.inertia == pytest.approx(2.0 * shape.second_moment, rel=5e-3)
    assert body.outer == pytest.approx(shape.bounding_radius, rel=5e-3)


def test_attraction_and_repulsion_balance_at_the_border_of_the_zone(plain):
    assert abs(plain.BALANCE_GAP - 5924.98e-9) < 1e-11
    sphere = plain.make_body([0.0], 5e-6, CELLS)

    def force(gap):
        place = np.array([0j, 1j * (2.0 * sphere.r_eq + gap)])
        rest = np.zeros(2, complex), np.zeros(2), [], None, 0.0
        return plain.interaction((sphere, sphere), None, place, *rest)[0].imag

    assert force(0.9 * plain.BALANCE_GAP) > 0.0 > force(1.1 * plain.BALANCE_GAP)
    assert abs(force(plain.BALANCE_GAP)) < 1e-9 * abs(force(0.0))


def test_forces_of_contact_are_the_slope_of_the_elastic_energy(ragged_impact):
    impact, move = ragged_impact, 1e-11
    impact.velocity *= 0.0
    impact.spin *= 0.0
    force, torque, _ = impact.forces()
    for along in (1.0, 1j):
        energies = []
        for sign in (1.0, -1.0):
            impact.place[1] += sign * move * along
            energies.append(impact.elastic_energy())
            impact.place[1] -= sign * move * along
        slope = (energies[0] - energies[1]) / (2.0 * move)
        assert (force / along).real == pytest.approx(-slope, rel=1e-4)
    # The two torques and the couple of the two forces cancel.
    couple = (np.conj(impact.place[1] - impact.place[0]) * force).imag
    assert torque.sum() == pytest.approx(-couple, rel=1e-9)


def test_an_impact_keeps_momenta_and_loses_energy(ragged_impact):
    impact, h = ragged_impact, 5e-9
    momentum, turning = (impact.mass * impact.velocity).sum(), impact.angular_momentum()
    energies = [impact.kinetic_energy() + impact.elastic_energy()]
    for _ in range(300):
        impact.step(h)
        energies.append(impact.kinetic_energy() + impact.elastic_energy())
    assert (impact.mass * impact.velocity).sum() == pytest.approx(momentum, rel=1e-12)
    assert impact.angular_momentum() == pytest.approx(turning, rel=1e-6)
    assert energies[-1] < 0.9 * energies[0]
    assert np.diff(energies).max() < 1e-3 * energies[0]


def test_the_largest_overlap_of_a_critically_damped_impact(plain):
    spheres = [plain.make_body([0.0], radius, CELLS) for radius in (4e-6, 5e-6)]
    speed, rate = 0.05, math.sqrt(plain.K_N * sum(1.0 / sphere.mass for sphere in spheres))
    impact = Impact(plain, spheres, [0.0, 9e-6j], [0.0, -1j * speed])
    overlap = max(impact.step(0.005 / rate) for _ in range(400))
    assert overlap == pytest.approx(speed / (math.e * rate), rel=0.01)


@pytest.fixture(scope="module")
def minimal():
    """The example as it runs, compiled."""
    return loaded()


@pytest.mark.slow
def test_all_its_spheres_stick(minimal, capsys):
    minimal.main(pairs=2, corners=1)
    assert capsys.readouterr().out.count("A A   Pr[A] = 2/2") == 3


TYPES, VERTICES, DELTA = ("I", "II", "III"), (4, 16, 64), (0.0, 0.4, 0.8)
STARTS = 50
STUDY = {
    "preset": "tang2014", "seed": 1, "replicates": STARTS,
    "scene": {"types": TYPES, "delta": DELTA}, "shapes": {"vertices": VERTICES, "pool": 4},
}  # fmt: skip


@pytest.mark.slow
def test_it_agrees_with_the_package_on_fifty_starts(minimal):
    """Start n is replicate n of the study's seed, in one condition after the other.

    The example takes d_c at the end of a step, in which a pair that attraction draws together
    moves by up to 0.1 % of d_c.
    """
    study, classes = Study(STUDY), set()
    conditions = list(itertools.product(TYPES, VERTICES, DELTA))
    for replicate in range(STARTS):
        condition = conditions[replicate % len(conditions)]
        found = study.replicate(replicate, *condition)
        bodies = [
            minimal.make_body(shape.vertices @ [1.0, 1j], shape.radius) for shape in found.shapes
        ]
        place, angle = found.position[0, :, :2] @ [1.0, 1j], found.position[0, :, 2].copy()
        outcome, touch = minimal.encounter(*bodies, place, angle)
        assert outcome == found.row["outcome"], (replicate, condition)
        if outcome in "ABCD":
            assert touch == pytest.approx(found.row["d_c_collision"], rel=2e-3)
            classes.add(outcome)
    assert classes == set("ABCD")
