"""Texts with units where objects are made in Python: the values of numbers, the same errors."""

import attrs
import pytest

from flocsim import Body, Fluid, Sphere, SpheroPolygon, System
from flocsim.errors import RangeError, ShapeError, UsageError
from flocsim.fields import quantity, word_or_quantity
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import VelocityVerlet


@attrs.frozen
class Own:
    """A class of a user's own with a unit of fractional exponent."""

    toughness: float = quantity("Pa m^0.5", above=0.0, default=1.0)
    size: float | str = word_or_quantity("auto", "m", at_least=0.0, default="auto")


SAME = [
    (VanDerWaals(hamaker="5 zJ", d_min="0.2 nm"), VanDerWaals(5e-21, 2e-10)),
    (VanDerWaals("1 kT@300K"), VanDerWaals(300 * 1.380649e-23)),
    (DoubleLayer("15 mV", "0.98 nm"), DoubleLayer(15e-3, 0.98e-9)),
    (Contact("10 mN/mm", damping_n="1e3 1/s"), Contact(10.0, damping_n=1e3)),
    (VelocityVerlet("10 ns"), VelocityVerlet(1e-8)),
    (Own("2 MPa um^0.5", "3 um"), Own(2e3, 3e-6)),
]


@pytest.mark.parametrize(("texts", "numbers"), SAME)
def test_texts_are_the_numbers(texts, numbers):
    assert texts == numbers
    assert [type(value) for value in attrs.astuple(texts)] == [
        type(value) for value in attrs.astuple(numbers)
    ]
    assert attrs.evolve(texts) == numbers


def test_bodies_shapes_and_fluids():
    body = Body(
        Sphere("5 um"), ("1 um", -2e-6), "90 deg", ("1 mm/s", 0.0), density="2.65 g/cm^3",
        depth="10 um",
    )  # fmt: skip
    assert (body.shape.radius, body.position, body.velocity) == (5e-6, (1e-6, -2e-6), (1e-3, 0.0))
    assert (body.density, body.depth) == (2650.0, 1e-5)
    assert Body(Sphere(1e-6), surface_density="2 g/m^2").surface_density == 2e-3
    assert SpheroPolygon([(0, 0), (1e-6, 0)], "500 nm").radius == 5e-7
    fluid = Fluid("0.89 mPa s", "1 g/cm^3", velocity=("1 um/s", 0.0))
    assert (fluid.viscosity, fluid.density, fluid.velocity) == (0.89e-3, 1000.0, (1e-6, 0.0))
    assert Fluid(gradient=(0.0, "2 1/min", 0.0, 0.0)).gradient[1] == pytest.approx(1.0 / 30.0)


def test_a_time_to_run():
    system = System([Body(Sphere("5 um"), density=2650.0)], [Gravity(), StokesDrag()])
    assert system.run("20 us", jit=False).t[-1] == 2e-5
    with pytest.raises(RangeError, match="until must be a time such as '5 s', found '20 um'"):
        system.run("20 um")


WRONG = [
    (lambda: VanDerWaals("5 zN"), RangeError, "hamaker must be an energy such as '1e-18 J', found"),
    (lambda: VanDerWaals("4 kT"), RangeError, "kT needs its temperature, as in 'kT@298.15K'"),
    (lambda: Contact(damping_n="critcal"), RangeError, "damping_n must be 'critical' or"),
    (lambda: Own("2 MPa um"), RangeError, "toughness must be a quantity in Pa m^0.5"),
    (lambda: Sphere("5 kg"), ShapeError, "the radius must be a length such as '16.41 um'"),
    (lambda: Body(Sphere(1e-6), ("1 s", 0.0), density=1.0), UsageError, "position must be a len"),
    (lambda: Body(Sphere(1e-6), "1 um", density=1.0), UsageError, "position must be 2 finite"),
]


@pytest.mark.parametrize(("make", "error", "words"), WRONG)
def test_what_is_no_such_quantity_is_refused_in_one_line(make, error, words):
    with pytest.raises(error) as caught:
        make()
    assert words in str(caught.value) and "\n" not in str(caught.value)
