"""Pairs let go again and again: who is counted as what, and the probabilities of the integrals."""

import math

import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, SpheroPolygon, System
from flocsim.brownian import brownian_meetings, splitting_probability
from flocsim.errors import PlausibilityWarning, UsageError
from flocsim.forces import Contact, DoubleLayer, StokesDrag, Thermal, VanDerWaals
from flocsim.integrators import Overdamped

WATER = Fluid(viscosity=0.89e-3)
HALF = Body(Sphere(0.5e-6), density=1050.0)


def kick_of(way):
    """τ of which two of these spheres diffuse so far against each other, √(2 D τ)."""
    return way**2 / (4.0 * Thermal().diffusion(WATER, 0.5e-6))


def run(way, replicates, **more):
    forces = [StokesDrag(), Thermal(kick=kick_of(way))]
    return brownian_meetings([HALF, HALF], forces, "2 um", "4 um", replicates, fluid=WATER, **more)


@pytest.mark.slow
def test_each_replicate_goes_by_its_number_alone():
    some, more = run(5e-7, 4, seed=3, jit=False), run(5e-7, 7, seed=3, jit=False)
    assert some.touched + some.escaped == 4 and more.touched + more.escaped == 7
    np.testing.assert_array_equal(some.times, more.times[:4])
    assert run(5e-7, 4, seed=3, jit=False) == some
    assert not np.array_equal(run(5e-7, 4, seed=4, jit=False).times, some.times)


def test_what_does_not_end_is_undecided():
    found = run(1e-7, 2, max_steps=3, jit=False)
    assert (found.touched, found.escaped, found.undecided) == (0, 0, 2)
    assert math.isnan(found.probability)


def test_shapes_touch_with_their_outlines():
    rod = Body(SpheroPolygon([(-1e-6, 0.0), (1e-6, 0.0)], 1e-7), density=1050.0)
    forces = [StokesDrag(), Thermal(kick=2e-2), VanDerWaals(1e-21, gap="surface")]
    found = brownian_meetings([rod, rod], forces, 2.3e-6, 2.8e-6, 1, seed=1, jit=False, fluid=WATER)
    assert found.touched + found.escaped == 1


@pytest.mark.parametrize(
    ("bodies", "forces", "release", "words"),
    [
        ([HALF], [Thermal()], 2e-6, "needs two bodies, found 1"),
        ([HALF, HALF], [StokesDrag()], 2e-6, "needs a Thermal force"),
        ([HALF, HALF], [Thermal()], 0.9e-6, "release must be between 1e-06 m"),
        ([HALF, HALF], [Thermal()], 5e-6, "release must be between"),
    ],
)
def test_bad_input_is_refused(bodies, forces, release, words):
    with pytest.raises(UsageError, match=words):
        brownian_meetings(bodies, forces, release, 4e-6, 3, fluid=WATER)


@pytest.mark.slow
def test_a_colloid_of_100_nm_touches_as_often_as_its_potential_says():
    forces = [VanDerWaals(1e-20), DoubleLayer(14e-3, 3.04e-9)]
    body = Body(Sphere("100 nm"), density=1050.0)
    found = brownian_meetings(
        [body, body], [StokesDrag(), Thermal(), *forces], "300 nm", "600 nm", 1500, seed=1,
        fluid=WATER,
    )  # fmt: skip
    wanted = splitting_probability(forces, (1e-7, 1e-7), 3e-7, 6e-7)
    assert wanted == pytest.approx(0.7021, abs=5e-5)
    low, high = found.interval(0.999)
    assert low <= wanted <= high


def test_meetings_without_a_pair_force_touch_as_those_with_one_that_never_acts():
    """Kicks are cut near contact, whatever else acts: theory ln(e/b)/ln(e/R)."""
    alone = [Thermal(), StokesDrag()]
    first, second = (
        brownian_meetings([HALF, HALF], forces, 1.3e-6, 2.5e-6, 20, seed=3, fluid=WATER)
        for forces in (alone, [*alone, Contact()])
    )
    assert first.steps == second.steps and first.touched == second.touched
    np.testing.assert_allclose(first.times, second.times, rtol=1e-4)


@pytest.mark.slow
def test_paths_in_kicks_escape_where_brownian_paths_do():
    """Near the release, where what a path does within a kick counts most."""
    forces = [Thermal(), StokesDrag()]
    wanted = splitting_probability([], (0.5e-6, 0.5e-6), 1.25e-6, 1.45e-6, fluid=WATER)
    found = brownian_meetings([HALF, HALF], forces, 1.25e-6, 1.45e-6, 8000, seed=2, fluid=WATER)
    low, high = found.interval(0.999)
    assert low <= wanted <= high


def steps_of(**kicks):
    """The steps that two bodies take that diffuse at a gap of a twentieth of their radius, without
    any force between them."""
    other = Body(Sphere(0.5e-6), (1.025e-6, 0.0), density=1050.0)
    system = System([HALF, other], [StokesDrag(), Thermal(**kicks)], Overdamped(), WATER, seed=1)
    with pytest.warns(PlausibilityWarning, match="no contact force"):
        return len(system.run(2e-3, jit=False).position)


def test_kicks_are_cut_near_another_body_where_that_is_asked_for():
    kick = kick_of(5e-8)
    assert steps_of(kick=kick, finest=1e-8) > 3 * steps_of(kick=kick)
