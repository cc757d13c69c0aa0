"""Permeable spheres: closed forms, limits, and what a drag makes of them."""

import math

import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, Swarm, System
from flocsim.errors import RangeError, UsageError
from flocsim.forces import Contact, Gravity, PairResistance, StokesDrag, Thermal
from flocsim.forces.settling import terminal_motion
from flocsim.hydrodynamics.rigid_bodies import drag_factor, happel_permeability, turning_factor

R = 5e-6
WATER = Fluid(buoyancy=True)


# Worked out by hand: tanh 1 = .761594, tanh 10 = 1 − 4e-9, tanh 2 = .964028, tanh .1 = .0996680.
@pytest.mark.parametrize(
    ("beta", "drag", "turning"),
    [
        (1.0, 0.1756, 0.06089),
        (10.0, 0.8885, 0.73),
        (0.1, 0.002215, 0.0006660),
        (2.0, 0.4337, 0.1940),
    ],
)
def test_factors_of_brinkman(beta, drag, turning):
    assert drag_factor(beta, 1.0) == pytest.approx(drag, rel=1e-3)
    assert turning_factor(beta, 1.0) == pytest.approx(turning, rel=1e-3)


def test_limits():
    assert drag_factor(1.0, 1e-12) == pytest.approx(1.0, abs=2e-6)
    assert turning_factor(1.0, 1e-12) == pytest.approx(1.0, abs=4e-6)
    # What passes freely resists by its own: 2 β²/9 of a solid sphere, and β²/15.
    assert drag_factor(1.0, 1e8) == pytest.approx(2.0e-8 / 9.0, rel=1e-6)
    assert turning_factor(1.0, 1e8) == pytest.approx(1.0e-8 / 15.0, rel=1e-6)
    for factor in (drag_factor, turning_factor):
        below, above = factor(0.9999e-2, 1.0), factor(1.0001e-2, 1.0)
        assert above / below == pytest.approx(1.0004, rel=1e-4)
        assert np.all(np.diff([factor(beta, 1.0) for beta in np.geomspace(1e-4, 1e4, 50)]) > 0.0)


def test_happel():
    # Grains far from each other resist as Stokes says: n 6πµa = µ/k.
    assert happel_permeability(1e-6, 1e-9) == pytest.approx(2e-12 / 9e-9, rel=2e-3)
    assert happel_permeability(2e-6, 0.3) == pytest.approx(4.0 * happel_permeability(1e-6, 0.3))
    values = [happel_permeability(1e-6, solid) for solid in np.linspace(0.01, 0.99, 40)]
    assert np.all(np.diff(values) < 0.0) and values[-1] > 0.0
    with pytest.raises(UsageError, match="between 0 and 1, found 1e-06 m and 1"):
        happel_permeability(1e-6, 1.0)


@pytest.mark.parametrize("law", ["stokes", "schiller_naumann"])
def test_permeable_bodies_fall_faster_and_turn_more_easily(law):
    body = Body(Sphere(R), density=1100.0)
    k = (R / 3.0) ** 2
    speeds = [
        terminal_motion(System([body], [Gravity(), drag], fluid=WATER), body)[0][1]
        for drag in (StokesDrag(law=law), StokesDrag(law=law, permeability=k))
    ]
    assert speeds[1] == pytest.approx(speeds[0] / drag_factor(R, k), rel=2e-3)
    spun = Body(Sphere(R), density=1100.0, spin=100.0)
    span = 1e-6
    ends = [
        System([spun], [drag], fluid=WATER).run(span, jit=False).velocity[-1, 0, 2]
        for drag in (StokesDrag(law=law), StokesDrag(law=law, permeability=k))
    ]
    rates = np.log(np.array(ends) / 100.0)
    assert rates[1] / rates[0] == pytest.approx(turning_factor(R, k), rel=1e-3)


@pytest.mark.slow
def test_a_permeable_doublet_is_one_of_smaller_spheres():
    k = (R / 3.0) ** 2
    forces = [Gravity(), StokesDrag(clusters=True, permeability=k), Contact()]
    bodies = [Body(Sphere(R), (1.9999 * R * each, 0.0), density=1100.0) for each in range(2)]
    speeds = [
        Swarm(some, forces, fluid=WATER).run("1 ms").velocity[-1, 0, 1]
        for some in (bodies, bodies[:1])
    ]
    share = drag_factor(R, k)
    near = 0.75 * 0.5 * share * (1.0 + share**2 / 6.0) * (1.0 - 0.1315 * share**3)
    assert speeds[0] / speeds[1] == pytest.approx(1.0 + near, rel=2e-3)


def test_refusals():
    with pytest.raises(RangeError, match='permeability must be 0 if law is "shape"'):
        StokesDrag(law="shape", permeability=1e-12)
    drag, bodies = StokesDrag(permeability=1e-12), [
        Body(Sphere(R), (3.0 * R * each, 0.0), density=1100.0) for each in range(2)
    ]  # fmt: skip
    with pytest.raises(UsageError, match="no permeability"):
        System(bodies, [Gravity(), drag, PairResistance()], fluid=WATER)
    with pytest.raises(UsageError, match="would get too hot"):
        System(bodies, [drag, Thermal(kick="1 ms")], fluid=WATER).run(1e-3)
    assert math.isfinite(drag_factor(R, 1e-12))
