"""The drag law "shape": spheres as by Stokes, ellipses in closed form, hooks that fall aslant."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, SpheroPolygon, System
from flocsim.errors import RangeError, UsageError
from flocsim.forces import Gravity, StokesDrag, Thermal
from flocsim.forces.check import SAMPLE_BODIES
from flocsim.forces.codegen import laws_of
from flocsim.forces.drag import (
    body_resistance,
    resistance_matrices,
)
from flocsim.forces.settling import free_mobilities, terminal_motion
from flocsim.hydrodynamics import prism_drag
from flocsim.integrators import DormandPrince54, Implicit, Overdamped, VelocityVerlet
from flocsim.plausibility import all_settled
from tests.forces.test_strain import SHEAR, ellipse
from tests.helpers.tiers import rest_slow

DRAG = StokesDrag(law="shape")
WATER = Fluid(viscosity=1e-3, buoyancy=True)
STRAINED = Fluid(viscosity=1e-3, velocity=(1e-5, -2e-5), gradient=(1.0, 3.0, -0.5, -1.0))
TWO_TO_ONE = ellipse(2e-6, 1e-6)
HOOK = SpheroPolygon(
    1e-6 * np.array([(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)], dtype=float), 2e-7
)


def body_of(shape, angle=0.0, **more):
    return Body(shape, angle=angle, density=1100.0, **more)


def system_of(*bodies, fluid=WATER, method=None, drag=DRAG):
    return System(bodies, [Gravity(), drag], method or Implicit(1e-10), fluid)


def view_of(body, **motion):
    names = [each for each in SAMPLE_BODIES[0]._fields if each.startswith(("resist", "strain"))]
    numbers = dict(zip(names, body_resistance(body), strict=True))
    motion = {"angle": body.angle, "radius": body.shape.equivalent_radius} | motion
    return SAMPLE_BODIES[0]._replace(**motion, **numbers)


def load(body, fluid=WATER, drag=DRAG, law="body_force", **motion):
    pieces = laws_of([drag], fluid)
    return np.array(pieces.laws[law](view_of(body, **motion), pieces.parameters))


def turned_by(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


@pytest.mark.parametrize("fluid", [WATER, STRAINED, Fluid(gradient=(0.0, -2.0, 2.0, 0.0))])
def test_a_sphere_has_the_drag_of_stokes(fluid):
    body = body_of(Sphere(3e-6), 0.4)
    motion = {"x": 1e-5, "y": 2e-5, "vx": 1e-4, "vy": -3e-4, "spin": 5.0}
    wanted = load(body, fluid, StokesDrag(), **motion)
    assert load(body, fluid, **motion) == pytest.approx(wanted, rel=1e-12)


def test_a_disc_of_a_depth_is_a_prism():
    disc = body_of(Sphere(3e-6), depth=4e-6)
    resistance, strain = resistance_matrices(body_resistance(disc))
    least, largest = free_mobilities(system_of(disc), disc)
    stokes = 1.0 / (6.0 * math.pi * 1e-3 * 3e-6)
    assert [least / stokes, largest / stokes] == pytest.approx([0.9615, 0.9615], rel=2e-3)
    assert 8.0 * math.pi * (3e-6) ** 3 / resistance[2, 2] == pytest.approx(0.811, rel=5e-3)
    assert np.abs(strain).max() < 0.01 * 8.0 * math.pi * (3e-6) ** 2
    # Of a disc of no depth 32/3 µ r edgewise, and 32/3 µ r³.
    flat = resistance_matrices(body_resistance(body_of(Sphere(3e-6), depth=1e-9)))[0]
    sizes = np.array([3e-6, 3e-6, 2.7e-17])
    assert np.diag(flat) / sizes == pytest.approx([32.0 / 3.0] * 3, rel=0.02)


@pytest.mark.parametrize("angle", [0.0, 0.6, 2.5])
@pytest.mark.parametrize("shape", [TWO_TO_ONE, HOOK], ids=["ellipse", "hook"])
def test_it_settles_and_drifts_as_its_resistance_says(shape, angle):
    body = body_of(shape, angle)
    velocity, mobility = terminal_motion(system_of(body), body)
    resistance, _ = resistance_matrices(body_resistance(body))
    weight = np.array([0.0, -9.81 * body.buoyant_mass(WATER), 0.0])
    frame = np.eye(3)
    frame[:2, :2] = turned_by(angle)
    wanted = frame @ np.linalg.solve(1e-3 * resistance, frame.T @ weight)
    assert velocity == pytest.approx(wanted[:2], rel=1e-6)
    assert mobility == pytest.approx(wanted[1] / weight[1], rel=1e-6)
    run = system_of(body, method=Implicit(1e-12)).run(1e-5, jit=False)
    speed = np.hypot(*velocity)
    assert run.velocity[-1, 0, :2] == pytest.approx(velocity, rel=2e-3, abs=1e-9 * speed)
    assert run.velocity[-1, 0, 2] == pytest.approx(wanted[2], rel=0.02, abs=1e-4)


def test_an_oblique_ellipse_drifts_along_its_axis_in_closed_form():
    body = body_of(TWO_TO_ONE, 0.6)
    (vx, vy), _ = terminal_motion(system_of(body), body)
    stokes = 9.81 * body.buoyant_mass(WATER)
    stokes /= 6.0 * math.pi * 1e-3 * TWO_TO_ONE.equivalent_radius
    ahead, across = 1.007 * math.sin(0.6), 0.886 * math.cos(0.6)
    assert vy / stokes == pytest.approx(-(ahead * math.sin(0.6) + across * math.cos(0.6)), rel=0.02)
    assert vx / stokes == pytest.approx(across * math.sin(0.6) - ahead * math.cos(0.6), rel=0.15)


@pytest.mark.parametrize("turn", [0.8, 2.9])
def test_all_turns_together(turn):
    matrix, rotation = np.array(STRAINED.gradient).reshape(2, 2), turned_by(turn)
    turned = attrs.evolve(
        STRAINED,
        gradient=(rotation @ matrix @ rotation.T).ravel(),
        velocity=rotation @ STRAINED.velocity,
    )
    place, velocity = np.array([3e-6, -1e-6]), np.array([1e-4, 2e-4])
    before, after = {}, {}
    for found, (p, v) in (
        (before, (place, velocity)),
        (after, (rotation @ place, rotation @ velocity)),
    ):
        found |= {"x": p[0], "y": p[1], "vx": v[0], "vy": v[1], "spin": 4.0}
    wanted = load(body_of(HOOK, 0.3), STRAINED, **before)
    found = load(body_of(HOOK, 0.3 + turn), turned, **after)
    assert found[:2] == pytest.approx(rotation @ wanted[:2], rel=1e-9)
    assert found[2] == pytest.approx(wanted[2], rel=1e-9)


@pytest.mark.parametrize(
    "shape", [Sphere(2e-6), TWO_TO_ONE, HOOK], ids=["sphere", "ellipse", "hook"]
)
def test_still_water_takes_energy_from_every_motion(shape):
    body, rng = body_of(shape), np.random.default_rng(3)
    assert np.linalg.eigvalsh(resistance_matrices(body_resistance(body))[0]).min() > 0.0
    size = shape.equivalent_radius
    for vx, vy, turn, angle in rng.normal(size=(200, 4)).tolist():
        fx, fy, torque = load(body, vx=vx, vy=vy, spin=turn / size, angle=angle)
        assert fx * vx + fy * vy + torque * turn / size < 0.0


def test_its_derivatives_are_laws_of_the_scene():
    body = body_of(HOOK, 0.4)
    motion = {"x": 2e-6, "y": 1e-6, "vx": 3e-4, "vy": -1e-4, "spin": 20.0, "angle": 0.4}
    for law, axes, size in (
        ("position_derivatives", ("x", "y", "angle"), (1e-9, 1e-9, 1e-5)),
        ("velocity_derivatives", ("vx", "vy", "spin"), (1e-6, 1e-6, 1e-2)),
    ):
        found = load(body, STRAINED, law=law, **motion).reshape(3, 3)
        for axis, step, slope in zip(axes, size, found, strict=True):
            ends = [
                load(body, STRAINED, **motion | {axis: motion[axis] + by}) for by in (step, -step)
            ]
            wanted = (ends[0] - ends[1]) / (2.0 * step)
            assert slope == pytest.approx(wanted, rel=1e-3, abs=1e-5 * np.abs(wanted).max())


@pytest.mark.parametrize(
    "method",
    rest_slow([Implicit(1e-9), Overdamped(1e-9)], lambda method: isinstance(method, Overdamped)),
    ids=["inertia", "none"],
)
def test_an_ellipse_goes_round_as_jeffery_with_the_elongation_of_its_prism(method):
    flow = Fluid(viscosity=1e-3, gradient=(0.0, SHEAR, 0.0, 0.0))
    body = Body(TWO_TO_ONE, angle=0.2, spin=-1.0, surface_density=1e-3)
    run = System([body], [DRAG], method, flow).run(2.0, jit=False)
    times = np.linspace(0.1, 2.0, 400)
    turned = 0.2 - run.at(times).position[:, 0, 2]
    begin, end = np.interp([turned[0], turned[0] + math.pi], turned, times)
    drag = prism_drag(TWO_TO_ONE.outline())
    wanted = 4.0 * math.pi / (SHEAR * math.sqrt(1.0 - drag.elongation**2))
    assert 2.0 * (end - begin) == pytest.approx(wanted, rel=5e-3)


def test_all_methods_let_a_hook_fall_and_turn_alike():
    ends = []
    for method in (
        Implicit(1e-11),
        DormandPrince54(1e-11),
        Overdamped(1e-11),
        VelocityVerlet(1e-7),
    ):
        run = system_of(body_of(HOOK, 0.3), method=method).run(2e-4, jit=False)
        assert run.status.name == "FINISHED"
        ends.append(run.position[-1, 0] - (0.0, 0.0, 0.3))
    for other in ends[1:]:
        assert other == pytest.approx(ends[0], rel=0.03)


def test_sizes_alike_but_of_other_shapes_settle_apart():
    radius = HOOK.equivalent_radius / TWO_TO_ONE.equivalent_radius
    bodies = [body_of(HOOK), body_of(TWO_TO_ONE.scaled(radius), position=(1e-4, 0.0))]
    speeds = [each.speed for each in all_settled(system_of(*bodies))]
    assert len(speeds) == 2 and abs(speeds[0] / speeds[1] - 1.0) > 0.005
    assert "depends on the outline of each body" in system_of(*bodies).explain()


def test_what_cannot_be_is_refused():
    with pytest.raises(RangeError, match='rotational must be true if law is "shape"'):
        StokesDrag(law="shape", rotational=False)
    system = System([body_of(HOOK)], [DRAG, Thermal()], fluid=WATER)
    with pytest.raises(UsageError, match='Thermal cannot be combined with the drag law "shape"'):
        system.scene(jit=False)
