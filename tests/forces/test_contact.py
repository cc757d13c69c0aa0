"""Springs and dashpots of contacts from what is measured of a material."""

import math

import pytest

from flocsim.errors import RangeError
from flocsim.forces import Contact
from flocsim.forces.contact import damping_ratio_for
from flocsim.integrators import Implicit
from tests.helpers.trial_scenes import PolygonSystem, Spring, head_on, watched

SPEED, GAP = 1e-3, 1e-7


def collide(law):
    """(restitution, deepest overlap [m], M [kg], r_eq [m]) of two spheres without drag."""
    bodies = head_on(SPEED, GAP)
    mass, radius = 0.5 * bodies[0].mass, bodies[0].shape.equivalent_radius
    stiffness = law.law.normal_stiffness + law.law.normal_modulus * radius
    omega = math.sqrt(stiffness / mass)
    system = PolygonSystem(bodies, [law, Spring()], Implicit(1e-15))
    until = GAP / SPEED + 12.0 / omega
    end = watched(system, until)
    deepest = watched(system, until, largest_step=0.02 / omega).deepest
    return (end.velocity[1, 0] - end.velocity[0, 0]) / SPEED, deepest, mass, radius


@pytest.mark.parametrize("tension", [True, False])
@pytest.mark.parametrize("e", [1.0, 0.9, 0.5, 0.2])
def test_spheres_part_with_the_restitution_that_is_given(e, tension):
    found, *_ = collide(Contact(restitution=e, tension=tension))
    assert found == pytest.approx(e, rel=1e-4)


@pytest.mark.parametrize("e", [1e-3, 1e-9])
def test_without_tension_any_restitution_is_reached(e):
    z = damping_ratio_for(e, False)
    assert z > 1.0
    assert math.exp(-2.0 * z * math.acosh(z) / math.sqrt(z * z - 1.0)) == pytest.approx(e)


def test_the_deepest_overlap_shows_the_stiffness_of_the_modulus():
    _, deepest, mass, radius = collide(Contact(young="1 MPa", restitution=1.0))
    stiffness = 0.5 * math.pi * 1e6 * radius
    assert deepest == pytest.approx(SPEED * math.sqrt(mass / stiffness), rel=3e-3)


def test_a_modulus_of_one_megapascal_is_the_stiffness_of_the_paper():
    law = Contact(young="1 MPa", poisson=0.28).law
    assert law.normal_modulus * 12.7e-6 == pytest.approx(20.0, rel=5e-3)
    assert law.tangential_ratio == pytest.approx(0.125)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"young": 1e6, "k_n": 20.0}, "give one of young and k_n"),
        ({"poisson": 0.2, "k_t": 2.0}, "give one of poisson and k_t"),
        ({"restitution": 0.5, "damping_n": "critical"}, "give one of restitution and damping_n"),
        ({"poisson": 1 / 3}, "poisson must be a finite number at least 0 and below 0.333333"),
        ({"poisson": -0.1}, "poisson must be"),
        ({"restitution": 0.0}, "restitution must be a finite number above 0 and at most 1"),
        ({"restitution": 1.1}, "restitution must be"),
        ({"young": "5 m"}, "young must be an elastic modulus such as"),
    ],
)
def test_what_no_material_has_is_refused(given, said):
    with pytest.raises(RangeError, match=said):
        Contact(**given)
