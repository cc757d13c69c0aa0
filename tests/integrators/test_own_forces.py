"""A user's own force of every kind at once, compiled and not, in scenes of one to five bodies."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flocsim import Body, Sphere, SpheroPolygon, run
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.methods import METHODS, name_of
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import (
    ELASTIC,
    WATER_VISCOSITY,
    Hertz,
    Lubrication,
    PolygonSystem,
    Spring,
    Trap,
    encounter,
    head_on,
    hook,
    momenta,
    star,
)


def own(trap=0.02, upright=1e-13, spring=5e-3, film=2e-6, modulus=1e4, loss=20.0, k_t=2.0):
    """All four kinds; a film of no reach to speak of and a zero strength switch one off."""
    return [Trap(trap, upright), Spring(spring, -2e-6), Lubrication(film=film),
            Hertz(modulus, loss, k_t)]  # fmt: skip


def crowd(n):
    """Up to five bodies of every shape that fall towards each other."""
    shapes = [star(), hook(), Sphere(4e-6), SpheroPolygon([[-4e-6, 0], [4e-6, 0]], 1e-6),
              star(5, 4e-6, 0.8e-6)]  # fmt: skip
    places = [(0, 0), (18e-6, -4e-6), (-15e-6, 3e-6), (0, 16e-6), (3e-6, -19e-6)]
    speeds = [(0.02, 0.0), (-0.05, 0.01), (0.04, 0), (0, -0.04), (0, 0.05)]
    return [
        Body(shapes[k], places[k], 0.3 * k, speeds[k], 200.0 * (k - 1), surface_density=2.0)
        for k in range(n)
    ]


def is_quick(integrator, *_):
    """One method: with forces that read the numbers of shapes, each is an engine of its own."""
    return isinstance(integrator, Implicit)


by_method = pytest.mark.parametrize("integrator", rest_slow(METHODS, is_quick), ids=name_of)


@pytest.mark.slow
@by_method
@pytest.mark.parametrize(
    ("n", "until"),
    rest_slow([(1, 4e-5), (3, 1e-5), (3, 4e-5), (5, 4e-5)], lambda n, until: until < 4e-5),
)
def test_compiled_and_uncompiled_runs_agree(n, until, integrator):
    scene = PolygonSystem(crowd(n), own(), integrator)
    compiled, plain = scene.run(until), scene.run(until, jit=False)
    # The last bits differ, and the size of an adaptive step follows them: five bodies that start
    # 1e-15 rad apart end up to 7 tolerances apart, in compiled runs alone.
    fixed = np.isinf(integrator.tolerance)
    grain = 1e-16 if fixed else integrator.tolerance * (10.0 if n == 5 else 1.0)
    apart = compiled.position[-1] - plain.position[-1]
    assert np.abs(apart * [1.0, 1.0, 1e-5]).max() <= grain
    assert compiled.steps == pytest.approx(plain.steps, abs=0 if fixed else 20)
    assert compiled.evaluations == pytest.approx(plain.evaluations, rel=0.0 if fixed else 0.3)


@pytest.mark.slow
@by_method
@pytest.mark.parametrize("n", rest_slow([1, 3, 5], lambda n: n > 1))
def test_crowds_reach_the_end_with_few_steps(n, integrator):
    """Bodies that come within the reach of a surface force do not creep up to it."""
    few = 50_000 if np.isinf(integrator.tolerance) else 5_000
    found = PolygonSystem(crowd(n), own(), integrator).run(4e-4, max_steps=few)
    assert found.status.name == "FINISHED"
    assert found.position.shape == (len(found.t), n, 3)
    assert np.isfinite(found.position).all()


@pytest.mark.slow
@by_method
def test_crowd_keeps_its_momenta_without_the_trap(integrator):
    """All pair forces and contacts obey the third law; drift is that of the method alone."""
    bodies = crowd(5)
    found = PolygonSystem(bodies, own(trap=0.0, upright=0.0), integrator).run(4e-4)
    first, last = (momenta(bodies, found.position[k], found.velocity[k]) for k in (0, -1))
    unit = bodies[0].mass * 0.05 * np.array([1.0, 1.0, 1e-5])
    allowed = [1e-11, 1e-11, 1e-11 if np.isinf(integrator.tolerance) else 1e-3]
    assert np.all(np.abs(last - first) / unit < allowed)


def test_trap_and_its_torque_against_closed_forms():
    body = Body(hook(), (3e-6, 0.0), 1e-3, (0.0, 2e-3), surface_density=2.0)
    linear, turning = math.sqrt(0.02 / body.mass), math.sqrt(1e-13 / body.inertia)
    system_ = PolygonSystem([body], own(), Implicit(1e-12))
    t = 2.0 / linear
    found = system_.run(t, jit=False)
    assert found.position[-1, 0, 0] == pytest.approx(3e-6 * math.cos(linear * t), abs=1e-9)
    assert found.position[-1, 0, 1] == pytest.approx(2e-3 / linear * math.sin(linear * t), abs=1e-9)
    # Small angles: sin is straight to 2e-7.
    assert found.position[-1, 0, 2] == pytest.approx(1e-3 * math.cos(turning * t), abs=1e-6)


def film_and_contact(t, state, mass, reduced, film):
    """Two spheres on one line: gap and its rate under lubrication and Hertz's contact."""
    gap, rate = state
    force = 0.0
    if gap < film:
        force -= 6.0 * math.pi * WATER_VISCOSITY * reduced**2 * rate / max(gap, 1e-8)
    if gap < 0.0:
        force += 1e4 * (-gap) ** 1.5 * (1.0 - 20.0 * rate)
    return [rate, force / mass]


@pytest.mark.parametrize(
    ("integrator", "allowed"),
    rest_slow(
        [(VelocityVerlet(2e-9), 1e-9), (DormandPrince54(1e-12), 1e-11), (Implicit(1e-12), 1e-11)],
        is_quick,
    ),
)
def test_film_and_hertzian_contact_against_an_independent_solver(integrator, allowed):
    speed, gap, until = 0.5, 1e-6, 6e-5
    bodies = head_on(speed, gap)
    mass, reduced, film = bodies[0].mass / 2.0, 2.5e-6, 0.3e-6
    exact = solve_ivp(
        film_and_contact, (0.0, until), [gap, -speed], args=(mass, reduced, film),
        method="LSODA", rtol=1e-10, atol=1e-15, max_step=1e-8,
    )  # fmt: skip
    assert exact.y[0].min() < -1e-7
    forces = own(trap=0.0, upright=0.0, spring=0.0, film=film)
    # Of two bodies it is an engine of its own.
    jit = not isinstance(integrator, Implicit)
    found = PolygonSystem(bodies, forces, integrator).run(until, jit=jit)
    ended = found.position[-1, 1, 0] - found.position[-1, 0, 0] - 1e-5
    assert ended == pytest.approx(exact.y[0, -1], abs=allowed)


def colliding(integrator):
    """Two ragged bodies that collide by flocsim's own forces, whose engine other tests have."""
    return PolygonSystem(encounter(), [ELASTIC, Spring()], integrator)


@by_method
def test_a_record_in_pieces_equals_one_in_one_piece(integrator, monkeypatch):
    scene = colliding(integrator)
    whole = scene.run(3e-4)
    monkeypatch.setattr(run, "STEPS_AT_A_TIME", 7)
    pieces = scene.run(3e-4)
    assert len(whole.t) > 3 * 7
    for name in ("t", "position", "velocity"):
        assert np.array_equal(getattr(whole, name), getattr(pieces, name))
    assert (whole.steps, whole.evaluations) == (pieces.steps, pieces.evaluations)


@pytest.mark.slow
def test_more_rows_than_the_record_holds():
    found = PolygonSystem(crowd(3), own(), VelocityVerlet(5e-8)).run(5e-4)
    assert found.steps > 2 * run.STEPS_AT_A_TIME
    assert len(found.t) == found.steps + 1
    assert np.all(np.diff(found.t) > 0.0)
    assert np.allclose(np.diff(found.t)[:-1], 5e-8, rtol=1e-6)


@by_method
def test_without_a_record_only_start_and_end_are_kept(integrator):
    scene = colliding(integrator)
    full, short = scene.run(1e-4), scene.run(1e-4, record=False)
    assert short.position.shape == (2, 2, 3)
    for name in ("t", "position", "velocity"):
        assert np.array_equal(getattr(short, name), getattr(full, name)[[0, -1]])


@by_method
def test_runs_repeat_to_the_last_bit(integrator):
    scene = colliding(integrator)
    first, again = scene.run(2e-4), scene.run(2e-4)
    assert np.array_equal(first.position, again.position)
    assert np.array_equal(first.velocity, again.velocity)
