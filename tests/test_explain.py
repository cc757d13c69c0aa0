"""System.explain(): which forces act, which do not, and what is stiff, compared with the facts."""

import math
import re

import attrs
import pytest

from flocsim import Body, Fluid, Sphere, System
from flocsim.explain import all_scales
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import VelocityVerlet
from tests.helpers.trial_scenes import Lubrication, Spring, head_on

BALL = Body(Sphere(5e-6), density=2650.0)
WATER = Fluid(buoyancy=True)
FAR = [BALL, attrs.evolve(BALL, position=(0.0, 40e-6))]


def lines_of(tag, *system, **options):
    """The lines of a System's report that start with a tag, the tag left out."""
    text = System(*system, **options).explain()
    return [line[len(tag) :].strip() for line in text.splitlines() if line.startswith(tag)]


def has(lines, start):
    return any(line.startswith(start) for line in lines)


def test_every_force_object_gets_its_line():
    forces = [
        VanDerWaals(1e-18), VanDerWaals(1e-19, gap="surface"), VanDerWaals(0.0), Gravity(),
        DoubleLayer(0.0), Gravity(g=0.0),
    ]  # fmt: skip
    inside, outside = lines_of("in:", FAR, forces), lines_of("out:", FAR, forces)
    assert sum(line.startswith("VanDerWaals(") for line in inside) == 2
    assert sum(line.startswith("Gravity(") for line in inside) == 1
    for name, why in (
        ("VanDerWaals (3)", "hamaker"),
        ("DoubleLayer", "potential"),
        ("Gravity (2)", "g is"),
    ):
        assert has(outside, f"{name}: {why}")


def test_where_forces_act():
    forces = [Gravity(), VanDerWaals(), Lubrication()]
    gravity, attraction, film = lines_of("in:", FAR, forces)[:3]
    assert gravity.endswith("on every body")
    assert "line of centres" in attraction and "between the outlines" in film


def test_sliding():
    for friction, words in ((0.3, "slides at its limit"), ("none", "no sliding")):
        (line,) = lines_of("in:  Contact", FAR, [Contact(friction=friction)])
        assert words in line


def scales_of(*system, **options):
    """{name: time} of a System."""
    return all_scales(System(*system, **options))


def test_time_scales_are_those_of_closed_forms():
    law, repulsion = Contact(k_n=20.0), DoubleLayer(15e-3, 1e-8)
    forces = [Gravity(), StokesDrag(), repulsion, law]
    found = scales_of(FAR, forces, fluid=WATER)
    pair, r = 0.5 * BALL.mass, BALL.shape.radius
    drag = 6.0 * math.pi * WATER.viscosity * r
    fall = BALL.buoyant_mass(WATER) * 9.81 / drag
    omega = math.sqrt(20.0 / pair)
    steepest = repulsion.strength * 0.5 * r * repulsion.kappa
    assert found["contact 1/omega0"] == pytest.approx(1.0 / omega, rel=1e-6)
    assert found["contact damping 1/lambda"] == pytest.approx(0.5 / omega, rel=1e-6)
    assert found["Stokes relaxation"] == pytest.approx(BALL.mass / drag, rel=1e-6)
    assert found["settling by a radius"] == pytest.approx(r / fall, rel=1e-6)
    wanted = math.sqrt(pair / steepest)
    assert found["centre forces at their steepest"] == pytest.approx(wanted, rel=0.02)


def test_nothing_to_scale():
    assert System([BALL]).explain().splitlines()[-1].startswith("time scales: none")


@pytest.mark.parametrize(("share", "grows"), [(0.5, False), (2.0, True)])
def test_the_step_that_an_explicit_method_needs(share, grows):
    """Below the named step a vibrating pair stays as it is, above it it explodes."""
    bodies, force = head_on(1e-6, 1e-9), Spring(stiffness=20.0)
    text = System(bodies, [force]).explain()
    step = share * float(re.search(r"steps above about (\S+) s", text)[1])
    end = System(bodies, [force], VelocityVerlet(step)).run(30.0 * step, jit=False)
    assert (not abs(end.velocity[:, :, 0]).max() < 1e-2) == grows
