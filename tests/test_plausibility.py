"""What of a scene is doubted, in which words, and that what is usual is not."""

import warnings

import attrs
import pytest

from flocsim import Body, Fluid, Sphere, SpheroPolygon, Swarm, System
from flocsim.errors import PlausibilityWarning
from flocsim.forces import (
    Contact,
    ContactForce,
    DoubleLayer,
    Gravity,
    StokesDrag,
    Thermal,
    VanDerWaals,
)
from flocsim.plausibility import USUAL, plausibility_warnings
from tests.helpers.trial_scenes import hook

WATER = Fluid(buoyancy=True)
QUARTZ = Body(Sphere(5e-6), density=2650.0)
PAIR = [QUARTZ, attrs.evolve(QUARTZ, position=(0.0, 40e-6))]
USUAL_FORCES = [Gravity(), StokesDrag(), VanDerWaals(4.7e-20), DoubleLayer(), Contact()]


def doubts(bodies=PAIR, forces=USUAL_FORCES, fluid=WATER):
    return plausibility_warnings([System(bodies, forces, fluid=fluid)])


def test_what_is_usual_is_not_doubted():
    assert doubts() == []


@pytest.mark.parametrize(
    ("kind", "field"), [(kind, name) for kind, names in USUAL.items() for name in names]
)
def test_every_range_has_its_ends_and_says_value_range_source_and_remedy(kind, field):
    usual = USUAL[kind][field]
    inside = [usual.low, usual.high] if usual.low > 0.0 else [0.0, usual.high, -usual.high]
    beyond = [1.01 * usual.high] + [0.99 * usual.low] * (usual.low > 0.0)
    assert [usual.warning("x", value) for value in inside] == [""] * len(inside)
    for value in beyond:
        line = usual.warning("x", value)
        assert line.startswith(f"x = {value:g}") and f"{usual.high:g}" in line
        assert usual.source in line and line.endswith(usual.advice) and "\n" not in line
        scene = {"bodies": PAIR, "forces": USUAL_FORCES, "fluid": WATER}
        if kind is Fluid:
            scene["fluid"] = attrs.evolve(WATER, **{field: value})
        elif kind is Body:
            scene["bodies"] = [attrs.evolve(each, **{field: value}) for each in PAIR]
        else:
            scene["forces"] = [kind(**{field: value}), Gravity(), StokesDrag(), Contact()]
        assert usual.warning(f"{kind.__name__}.{field}", value) in doubts(**scene)


def test_a_force_that_subclasses_is_held_to_the_same_range():
    @attrs.frozen
    class Retarded(VanDerWaals):
        pass

    [line] = doubts(forces=[Gravity(), StokesDrag(), Contact(), Retarded(5.0)])
    assert line.startswith("Retarded.hamaker = 5 J is implausible")


def test_absent_forces_are_not_doubted():
    assert doubts(forces=[Gravity(), StokesDrag(), Contact(), DoubleLayer(0.0, 1.0)]) == []


def test_sizes():
    tiny = [attrs.evolve(body, shape=Sphere(2e-7)) for body in PAIR]
    [line] = doubts(tiny)
    assert "equivalent radius = 2e-07 m" in line and "Brownian" in line
    assert not doubts([Body(hook(), density=2650.0)])
    round_square = SpheroPolygon([(0, 0), (4e-6, 0), (4e-6, 4e-6), (0, 4e-6)], 6e-6)
    share = round_square.radius / round_square.equivalent_radius
    [line] = doubts([Body(round_square, density=2650.0)])
    assert line.startswith(f"spheroradius / equivalent radius = {share:g} is implausible")


def test_small_bodies_are_usual_where_they_diffuse():
    small = [attrs.evolve(body, shape=Sphere(2e-7)) for body in PAIR]
    assert "Brownian motion, which is left out here" in doubts(small)[0]
    assert doubts(small, [*USUAL_FORCES, Thermal()]) == []
    assert doubts(small, [*USUAL_FORCES, Thermal(temperature=0.0)]) == doubts(small)


def test_weight_without_buoyancy():
    [line] = doubts(fluid=Fluid())
    assert "2650 kg/m^3: it weighs 1.6 times as much" in line and "Fluid(buoyancy=True)" in line
    floats = [attrs.evolve(body, density=900.0) for body in PAIR]
    assert any("it would float" in line for line in doubts(floats, fluid=Fluid()))
    by_area = [Body(Sphere(5e-6), surface_density=2e-3)]
    assert doubts(by_area, fluid=Fluid()) == []
    assert doubts(forces=USUAL_FORCES[1:], fluid=Fluid()) == []


@attrs.frozen
class Hertz(ContactForce):
    """A contact law of one's own."""

    @staticmethod
    def kernel(contact):
        return 1e3 * max(contact.overlap, 0.0) ** 1.5, 0.0


def test_contacts():
    [line] = doubts(forces=[Gravity(), StokesDrag()])
    assert line.startswith("2 bodies and no contact force") and "Contact()" in line
    assert doubts([QUARTZ], forces=[Gravity(), StokesDrag()]) == []
    [line] = doubts(forces=[*USUAL_FORCES, Hertz()])
    assert line.startswith("Contact and Hertz both act") and line.endswith("leave Contact out")
    [line] = doubts(forces=[*USUAL_FORCES, Contact()])
    assert line.startswith("Contact and Contact (2) both act")
    assert doubts(forces=[Gravity(), StokesDrag(), Hertz()]) == []
    assert doubts([QUARTZ], forces=[*USUAL_FORCES, Hertz()]) == []


def big(radius, law):
    """Lines on a quartz sphere in water."""
    body = Body(Sphere(radius), density=2650.0)
    return doubts([body], [Gravity(), StokesDrag(law=law)])


def test_reynolds_numbers_against_the_drag_law():
    assert big(3e-5, "stokes") == []
    [line] = big(5e-4, "stokes")
    assert "Re = 1.1e+03" in line and "only up to Re = 1 " in line and "schiller_naumann" in line
    assert big(5e-4, "schiller_naumann") == []
    [line] = big(2e-3, "schiller_naumann")
    assert "only up to Re = 800 " in line and "smaller or lighter" in line


def test_explain_tells_numbers_and_doubts():
    lines = System(PAIR, [Gravity(), StokesDrag()], fluid=WATER).explain().splitlines()
    [settling] = [line for line in lines if line.startswith("settling: ")]
    assert settling.startswith(
        "settling: a body of r_eq = 5 um settles at 0.1012 mm/s: Re = 0.0011"
    )
    assert lines[-1].startswith("warning: 2 bodies and no contact force")


def test_a_run_warns_once_of_each_where_it_is_called():
    system = System([QUARTZ], [Gravity(), StokesDrag()])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default", PlausibilityWarning)
        for _ in range(2):
            system.run(1e-5, jit=False)
    [warning] = caught
    assert str(warning.message).startswith("buoyancy is off") and warning.filename == __file__
    with pytest.warns(PlausibilityWarning, match="no contact force"):
        System(PAIR, [StokesDrag()]).run(1e-6, jit=False)


@pytest.mark.parametrize("kind", [System, Swarm])
def test_bodies_that_start_deep_in_each_other_are_doubted(kind):
    for apart, doubted in ((1.0, True), (1.85, True), (1.995, False)):
        bodies = [QUARTZ, attrs.evolve(QUARTZ, position=(apart * 5e-6, 0.0))]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            kind(bodies, [StokesDrag(), Contact()]).run(1e-9)
        said = [str(each.message) for each in caught if "overlapping" in str(each.message)]
        assert len(said) == doubted
        assert all("more than 5 % of r_i + r_j" in line for line in said)
        assert all(each.filename == __file__ for each in caught)
