"""Thermal motion: diffusion coefficients, lengths of kicks, keys, and velocities at equilibrium."""

import math

import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, System
from flocsim.errors import RangeError, UsageError
from flocsim.forces import Contact, Lubrication, StokesDrag, Thermal
from flocsim.forces.body_forces import kick_parameters
from flocsim.forces.check import SAMPLE_BODIES
from flocsim.integrators import Implicit
from flocsim.plausibility import plausibility_warnings

WATER = Fluid(viscosity="0.89 mPa s")
ROOM = Thermal("298.15 K")


def test_diffusion_of_a_sphere_of_a_micrometre():
    assert ROOM.diffusion(WATER, 1e-6) == pytest.approx(2.4537e-13, rel=2e-5)
    assert ROOM.rotational_diffusion(WATER, 1e-6) == pytest.approx(0.18403, rel=1e-5)


def test_the_kernel_makes_these_coefficients():
    """Var(F) τ/(2 ζ²) = D of a mean noise of variance 1/τ."""
    view = SAMPLE_BODIES[0]._replace(radius=1e-6, kick_x=1.0, kick_y=-2.0, kick_turn=3.0)
    fx, fy, torque = Thermal.kernel(view, WATER.viscosity, ROOM.energy, 1.0)
    friction = 6.0 * math.pi * WATER.viscosity * 1e-6
    assert 0.5 * (fx / friction) ** 2 == pytest.approx(ROOM.diffusion(WATER, 1e-6), rel=1e-12)
    assert fy == -2.0 * fx
    turning = 8.0 * math.pi * WATER.viscosity * 1e-18
    found = 0.5 * (torque / 3.0 / turning) ** 2
    assert found == pytest.approx(ROOM.rotational_diffusion(WATER, 1e-6), rel=1e-12)
    assert Thermal.kernel(view, WATER.viscosity, ROOM.energy, 0.0)[2] == 0.0


def spheres(*radii, **more):
    return [Body(Sphere(radius), (1e-4 * place, 0.0), density=2650.0, **more)
            for place, radius in enumerate(radii)]  # fmt: skip


def test_automatic_kicks_go_by_the_smallest_radius():
    bodies = spheres(1e-6, 2e-6)
    kick, halvings, spread, least = kick_parameters([ROOM, Contact()], bodies, WATER)
    assert spread == pytest.approx(3.0 * ROOM.diffusion(WATER, 1e-6), abs=0.0, rel=1e-12)
    assert math.sqrt(spread * kick) == pytest.approx(1e-7, abs=0.0, rel=1e-9)
    assert least == 1e-9
    assert 0.5 * least < math.sqrt(spread * kick / 2.0**halvings) <= least


def test_kicks_are_halved_where_asked_and_where_bodies_act_on_each_other():
    bodies = spheres(1e-6, 1e-6)
    assert kick_parameters([Thermal(kick="1 ms"), Contact()], bodies, WATER)[1] == 0.0
    assert kick_parameters([Thermal(kick="1 ms", finest="2 nm"), Contact()], bodies, WATER)[1] > 0.0
    assert kick_parameters([ROOM, StokesDrag()], bodies, WATER)[1] == 0.0
    assert kick_parameters([ROOM, Contact()], bodies[:1], WATER)[1] == 0.0
    assert kick_parameters([ROOM, Contact()], spheres(1e-6, fixed=True), WATER)[0] == 0.0


def test_a_scene_has_one_temperature():
    with pytest.raises(UsageError, match="one temperature"):
        System(spheres(1e-6), [ROOM, Thermal(310.0)], fluid=WATER).scene(jit=False)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("temperature", -1.0, "temperature must be a finite number at least 0"),
        ("temperature", "77 degF", "does not count from zero: give kelvins, or degC"),
        ("kick", 0.0, "kick must be 'auto' or a finite number above 0"),
        ("finest", "1 s", "finest must be"),
    ],
)
def test_keys_are_checked(key, value, words):
    with pytest.raises(RangeError, match=words):
        Thermal(**{key: value})


@pytest.mark.parametrize("seed", [-1, 1.5, "a", (), (1, -2), None])
def test_seeds_are_whole_numbers(seed):
    with pytest.raises(UsageError, match="seed"):
        System(spheres(1e-6), [ROOM], fluid=WATER, seed=seed)


def kicked(*forces):
    return " ".join(
        plausibility_warnings([System(spheres(1e-6, 1e-6), [*forces, Contact()], fluid=WATER)])
    )


def test_what_does_not_balance_is_said():
    assert "no StokesDrag takes up the energy" in kicked(ROOM)
    assert "treat rotation differently" in kicked(ROOM, StokesDrag(rotational=False))
    assert "as if it were colder" in kicked(ROOM, StokesDrag(), Lubrication())
    assert "Thermal" not in kicked(ROOM, StokesDrag())
    assert "Thermal" not in kicked(Thermal(0.0), Lubrication())


def test_explain_says_how_long_kicks_are():
    text = System(spheres(1e-6), [StokesDrag(), Thermal(kick="1 ms")], fluid=WATER).explain()
    assert "a kick lasts 0.001 s" in text
    text = System(spheres(1e-6, 1e-6), [StokesDrag(), ROOM], fluid=WATER).explain()
    assert "near contact, down to displacements of 1e-09 m" in text


def squares(kick_over_relaxation, kicks, seed):
    """m v²/k_B T of both components at the ends of so many kicks of a free sphere."""
    body = spheres(1e-6)[0]
    relaxation = body.mass / (6.0 * math.pi * WATER.viscosity * 1e-6)
    kick = kick_over_relaxation * relaxation
    forces = [StokesDrag(), Thermal(kick=kick)]
    run = System([body], forces, Implicit(1e-12), WATER, seed=seed).run((kicks + 0.5) * kick)
    ends = np.searchsorted(run.t, np.arange(20, kicks + 1) * kick * (1.0 - 1e-12))
    return body.mass * run.velocity[ends, 0, :2] ** 2 / ROOM.energy


@pytest.mark.slow
@pytest.mark.parametrize(("x", "share"), [(1.0, 0.92423), (0.3, None), (3.0, None)])
def test_mean_square_velocity(x, share):
    """⟨v²⟩ = (k_B T/m) tanh(x/2)/(x/2) with x = ζτ/m, within 4 standard errors."""
    wanted = math.tanh(0.5 * x) / (0.5 * x)
    assert share is None or wanted == pytest.approx(share, abs=5e-6)
    found = squares(x, 40_000, 7)
    # v is a chain with the correlation e^(−x): v² has e^(−2x).
    correlated = (1.0 + math.exp(-2.0 * x)) / (1.0 - math.exp(-2.0 * x))
    error = wanted * math.sqrt(2.0 * correlated / found.size)
    assert abs(found.mean() - wanted) < 4.0 * error
    assert error < 0.02


@pytest.mark.slow
def test_mean_square_displacement_in_both_regimes():
    """⟨Δx²⟩ = 2 D t (1 − …) over many relaxations: 2 D t, and D_r likewise, within 4 errors."""
    body = spheres(1e-6)[0]
    kick, kicks = 1e-3, 20_000
    run = System([body], [StokesDrag(), Thermal(kick=kick)], Implicit(1e-10), WATER, seed=11)
    run = run.run(kicks * kick)
    places = run.position[
        np.searchsorted(run.t, np.arange(0, kicks + 1, 10) * kick * (1 - 1e-12)), 0
    ]
    steps = np.diff(places, axis=0) ** 2 / (2.0 * 10 * kick)
    wanted = [ROOM.diffusion(WATER, 1e-6)] * 2 + [ROOM.rotational_diffusion(WATER, 1e-6)]
    for found, rate in zip(steps.T, wanted, strict=True):
        assert abs(found.mean() / rate - 1.0) < 4.0 * math.sqrt(2.0 / len(found))
