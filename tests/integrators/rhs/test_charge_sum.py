"""Double layers along outlines: forces of charges and pressures of plates."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import k0, k1

from flocsim import Body, Sphere, System
from flocsim.compiler.composer import compose
from flocsim.constants import VACUUM_PERMITTIVITY
from flocsim.errors import RangeError, ShapeError, UsageError
from flocsim.forces import DoubleLayer, VanDerWaals
from flocsim.forces.check import samples_of
from flocsim.geometry.contact.charges import layer_energy
from flocsim.integrators.rhs.outline_sum import outline_forces_at
from flocsim.state.work import work_of
from tests.helpers.tiers import rest_slow
from tests.integrators.rhs.test_outline_sum import (
    SIZE,
    Pair,
    at_gap,
    balanced,
    rough,
    slab,
    slopes,
)

DEBYE = 0.98e-6
PERMITTIVITY = 78.5 * VACUUM_PERMITTIVITY


def layer(**given):
    return DoubleLayer(15e-3, DEBYE, law="outline", **given)


@pytest.mark.parametrize(
    ("radius", "allowed"), [(1.0, 2e-3), (5.0, 2e-3), (50.0, 2e-3), (100.0, 0.015)]
)
@pytest.mark.parametrize("gap", [0.0, 0.1, 1.0])
def test_two_cylinders(radius, allowed, gap):
    """F = 2πε κ φ² K₁(κD)/K₀(κR)² a metre."""
    sphere, away = Sphere(radius * DEBYE), (2.0 * radius + gap) * DEBYE
    found = Pair(sphere, sphere, (away, 0.0, 0.0), layer(depth=1.0)).loads(away, 0.0, 0.0)
    exact = k1(2.0 * radius + gap) / k0(radius) ** 2
    exact *= 2.0 * math.pi * PERMITTIVITY * 15e-3**2 / DEBYE
    assert found[0] == pytest.approx(exact, rel=allowed)


@pytest.mark.parametrize("seed", rest_slow(range(12), lambda seed: seed < 4))
def test_force_and_torque_are_the_slopes_of_the_energy(seed):
    random = np.random.default_rng(seed)
    one, other = rough(8, SIZE, seed), rough(8 + seed, 1.7 * SIZE, 50 + seed)
    pose = at_gap(one, other, 1e-9 * 10.0 ** random.uniform(0.0, 3.0), *random.uniform(0, 6.28, 2))
    force = layer(depth=1.0)
    found = Pair(other, one, pose, force).loads(*pose)

    def energy(each):
        return force.between_charges * layer_energy(one, other, tuple(each), force.kappa)

    wanted = slopes(energy, pose, 2e-3 * DEBYE, SIZE)
    strength = math.hypot(*wanted[:2])
    # Of the charges themselves, not of their tables.
    np.testing.assert_allclose(found[:2], wanted[:2], atol=1e-3 * strength)
    assert abs(found[2] - wanted[2]) < 1e-3 * strength * SIZE


@pytest.mark.parametrize("swapped", [False, True])
def test_third_law_with_torque_and_turned_together(swapped):
    pair, (x, y, angle), found = balanced(swapped, layer())
    c, s = math.cos(0.7), math.sin(0.7)
    there = pair.loads(c * x - s * y, s * x + c * y, angle + 0.7, 0.7)
    turned = [c * there[0] + s * there[1], c * there[1] - s * there[0], there[2], there[3]]
    np.testing.assert_allclose(turned, found, atol=1e-9 * SIZE * abs(found[0]))


PLATES = {
    "superposition": (2.0 * math.exp(-0.3), 2.0 * math.exp(-1.0)),
    "potential": (0.8511150, 0.5378828),
    "charge": (5.7165916, 1.1639534),
}


@pytest.mark.parametrize("boundary", PLATES)
def test_energies_of_plates(boundary):
    """Over ε κ φ², at gaps of 0.3 and 1 Debye lengths, from their pressures."""
    force = layer(boundary=boundary, d_min=1e-12)
    view, unit = samples_of(force)[0], PERMITTIVITY * 15e-3**2 / DEBYE
    for gap, energy in zip((0.3, 1.0), PLATES[boundary], strict=True):

        def pressure(x):
            seen = view._replace(parted_gap=x * DEBYE)
            return force.pressure(seen, force.parts, force.kappa, force.closest) * DEBYE / unit

        assert quad(pressure, gap, 60.0)[0] == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize("boundary", ["potential", "charge"])
def test_unlike_plates(boundary):
    """Hogg, Healy and Fuerstenau's energies at h = 1/κ; where one has no potential as well."""
    for given in ((15e-3, -40e-3), (15e-3, 0.0)):
        force = DoubleLayer(given, DEBYE, law="outline", boundary=boundary, d_min=1e-12)
        view, unit = samples_of(force)[0], 0.5 * PERMITTIVITY / DEBYE

        def pressure(x, force=force, view=view, unit=unit):
            seen = view._replace(parted_gap=x * DEBYE)
            return force.pressure(seen, force.parts, force.kappa, force.closest) * DEBYE / unit

        squares, sign = given[0] ** 2 + given[1] ** 2, -1.0 if boundary == "potential" else 1.0
        rest = 1.0 / math.tanh(1.0) - 1.0
        energy = sign * squares * rest + 2.0 * given[0] * given[1] / math.sinh(1.0)
        assert quad(pressure, 1.0, 60.0)[0] == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize("boundary", rest_slow(PLATES, lambda boundary: boundary == "potential"))
@pytest.mark.parametrize(("debye", "allowed"), [(1.5e-9, 0.02), (2e-8, 0.05)])
def test_a_face_of_five_micrometres(boundary, debye, allowed):
    """Thin, by the pressure of plates, and thick, between charges and what is beside them."""
    length = 2.5e-6
    plate, gap = slab(length), debye
    y = 0.2 * length + 2e-7 + gap
    force = DoubleLayer(15e-3, debye, law="outline", boundary=boundary, d_min=1e-10, depth="5 um")
    pair = Pair(plate, plate, (0.0, y, 0.0), force)
    assert pair.system.reached["charges"] == (debye > 1e-8)
    pressure = force.pressure(
        samples_of(force)[0]._replace(parted_gap=gap), force.parts, force.kappa, force.closest
    )
    assert pair.loads(0.0, y, 0.0)[1] == pytest.approx(pressure * 25e-12, rel=allowed)


def test_three_bodies_have_a_field_each():
    bodies = [Body(Sphere(r), position=(x, 0.0), density=1100.0)
              for r, x in ((2e-6, 0.0), (1e-6, 3.5e-6), (1.5e-6, 6.5e-6))]  # fmt: skip
    system = System(bodies, [layer(depth=1.0)])
    scene, found = system.scene(), []
    work = work_of(scene, *system.motion())
    entry = compose(outline_forces_at, system.compiled_calls)
    for a, b in ((1, 0), (2, 1)):
        x = bodies[a].position[0] - bodies[b].position[0]
        found.append(entry(scene, work, 0.0, a, b, x, 0.0, 0.0, 0.0)[0])
        pair = Pair(bodies[b].shape, bodies[a].shape, (x, 0.0, 0.0), layer(depth=1.0))
        assert found[-1] == pytest.approx(pair.loads(x, 0.0, 0.0)[0], rel=1e-9)


def test_a_field_of_too_many_nodes_is_refused():
    sphere = Sphere(2e-3)
    with pytest.raises(ShapeError, match=r"too long for a double layer.*give gap"):
        Pair(sphere, Sphere(5e-6), (1e-2, 0.0, 0.0), layer())


@pytest.mark.parametrize("gap", [0.0, -1e-9, 0.2e-9])
def test_nearer_than_d_min_the_pressure_is_that_at_it(gap):
    pull, push = VanDerWaals(1e-20, 0.3e-9, law="outline"), DoubleLayer(15e-3, 3e-9, law="outline")
    pair = Pair(Sphere(3e-6), Sphere(1e-6), (5e-6, 0.0, 0.0), pull, push)
    there, here = (pair.loads(4e-6 + each, 0.0, 0.0)[0] for each in (0.3e-9, gap))
    assert here == pytest.approx(there, rel=3e-3)


def test_opposite_potentials_attract():
    sphere, away = Sphere(DEBYE), 2.5 * DEBYE
    unlike = DoubleLayer((15e-3, -30e-3), DEBYE, law="outline")
    like = layer()
    found = [Pair(sphere, sphere, (away, 0, 0), each).loads(away, 0, 0)[0]
             for each in (unlike, like)]  # fmt: skip
    assert found[0] == pytest.approx(-2.0 * found[1])


def test_what_has_no_bound_takes_a_least_gap():
    with pytest.raises(RangeError, match=r'"charge" has an infinite pressure.*give d_min'):
        layer(boundary="charge")
    with pytest.raises(RangeError, match="between unlike potentials"):
        DoubleLayer((15e-3, 30e-3), law="outline", boundary="potential")
    layer(boundary="potential")
    with pytest.raises(RangeError, match='needs law = "outline", found law = "spheres"'):
        DoubleLayer(boundary="potential")


def test_two_double_layers_and_a_cut_of_a_thick_one_are_refused():
    sphere = Sphere(DEBYE)
    with pytest.raises(UsageError, match="ends 12 Debye lengths from an outline, found a cut"):
        Pair(sphere, sphere, (5e-6, 0.0, 0.0), layer(cut=1e-6))
    with pytest.raises(UsageError, match="only one double layer can act along outlines"):
        Pair(sphere, sphere, (5e-6, 0.0, 0.0), layer(), layer())
