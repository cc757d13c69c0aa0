"""The double layer between unlike bodies, and how far attraction reaches."""

import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.errors import RangeError, UsageError
from flocsim.forces import DoubleLayer, VanDerWaals


def test_unlike_bodies_have_the_product_of_their_potentials():
    alike, halved = DoubleLayer(potential=20e-3), DoubleLayer(potential=(40e-3, 10e-3))
    assert halved.strength == pytest.approx(alike.strength)
    swapped = DoubleLayer(potential=("10 mV", "40 mV"))
    assert swapped.strength == pytest.approx(halved.strength)
    assert DoubleLayer(potential=(-40e-3, 10e-3)).strength == pytest.approx(-alike.strength)
    assert DoubleLayer(potential=(0.0, 0.1)).absent == "potential is zero"


@pytest.mark.parametrize("wrong", [(1.0,), (1.0, 2.0, 3.0), (1.0, "3 m"), True, (1.0, None)])
def test_what_is_no_potential_is_refused(wrong):
    with pytest.raises(RangeError, match=r"potential(\[1\])? must be"):
        DoubleLayer(potential=wrong)


def test_more_than_two_bodies_have_one_potential():
    bodies = [Body(Sphere(1e-6), (4e-6 * i, 0.0), density=2650.0) for i in range(3)]
    force = DoubleLayer(potential=(0.01, 0.02))
    System(bodies[:2], [force])
    with pytest.raises(UsageError, match="is for two bodies, found 3 bodies"):
        System(bodies, [force])


@pytest.mark.parametrize("law", ["spheres", "outline"])
def test_attraction_ends_where_it_does_whatever_its_least_gap(law):
    """The law beyond d_min does not depend on it; neither does what is left out of it."""
    reaches = [VanDerWaals(d_min=each, law=law).reach for each in (1e-11, 3e-10, 1e-9, 2e-9)]
    assert reaches[0] == reaches[1] == reaches[2] < reaches[3]


def test_the_attraction_left_out_is_little_beside_weight_and_thermal_energy():
    for radius, hamaker in ((1e-6, 4.7e-20), (1e-5, 4.7e-20), (1e-5, 1e-18)):
        force = VanDerWaals(hamaker, d_min=1e-10)
        gap, reduced = force.reach, 0.5 * radius
        rest = hamaker * reduced / (6.0 * gap**2)
        weight = 4.0 / 3.0 * np.pi * radius**3 * 1650.0 * 9.81
        assert rest < 1e-4 * weight
