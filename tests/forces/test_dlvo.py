"""The double layer between unlike bodies."""

import pytest

from flocsim import Body, Sphere, System
from flocsim.errors import RangeError, UsageError
from flocsim.forces import DoubleLayer


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
