"""The rate at which a doublet opens: of two spheres in closed form, and the search for it."""

import math
from itertools import product

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, SpheroPolygon, System
from flocsim.ensembles.strength.opening import (
    FAILED,
    HOLDS,
    OPENED,
    OPENS_AT_LEAST,
    Doublet,
    first_opening,
    gap_of,
    sphere_rate,
)
from flocsim.forces import (
    Contact,
    DoubleLayer,
    Gravity,
    PairResistance,
    StokesDrag,
    Thermal,
    VanDerWaals,
)
from flocsim.integrators import Overdamped
from tests.helpers.tiers import rest_slow

WATER = Fluid(viscosity=8.9e-4)
RADII = (5e-6, 5e-6)
CRITICAL = 9.339e4
"""H_A/(18πγ d_min² R) [1/s] of H_A = 4.7e-20 J, d_min = 1 nm, r = 5 µm both."""

IN_WATER = 4.58e4
"""The same where the two push water at each other: at touch it pulls with 6.116 πµa²G, not 3."""


def bond(gap="surface"):
    return [StokesDrag(), VanDerWaals(4.7e-20, 1e-9, gap), Contact(k_n=10.0, k_t=1.0)]


def test_rate_of_two_spheres():
    found = sphere_rate(bond(), RADII, WATER)
    by_hand = 4.7e-20 / (18.0 * math.pi * 8.9e-4 * 1e-18 * 1e-5)
    assert found == pytest.approx(by_hand, rel=1e-12)
    assert found == pytest.approx(CRITICAL, rel=1e-4)
    # Of unequal ones r* cancels as well.
    other = sphere_rate(bond(), (2e-6, 8e-6), WATER)
    assert other == pytest.approx(found, rel=1e-12)
    assert sphere_rate([StokesDrag()], RADII, WATER) == 0.0
    assert 0.0 < sphere_rate([*bond(), DoubleLayer(15e-3, 1e-8)], RADII, WATER) < found
    in_water = sphere_rate([*bond(), PairResistance()], RADII, WATER)
    assert in_water == pytest.approx(found * 3.0 / 6.116, rel=1e-3)
    assert in_water == pytest.approx(IN_WATER, rel=1e-3)


def test_gap_of_placed_outlines():
    bodies = [
        Body(Sphere(1e-6), density=1e3),
        Body(SpheroPolygon([(0, 0), (4e-6, 0)], 1e-7), density=1e3),
    ]
    places = np.array([[0.0, 0.0, 0.3], [0.0, 3e-6, 0.0]])
    assert gap_of(bodies, places) == pytest.approx(1.9e-6, abs=1e-15)


def opens_from(*limits):
    """Opens in every second of the ranges between these rates, as shapes may that hold again."""
    return lambda rate: bool(np.searchsorted(limits, rate) % 2)


def test_the_search_finds_the_rate_within_the_precision():
    found = first_opening(opens_from(123.4), 1000.0, 1e-3)
    assert found.status == OPENED
    assert found.holds < 123.4 <= found.opens <= 1.001 * found.holds
    assert found.runs < 30


def test_the_first_opening_counts_where_it_holds_again():
    found = first_opening(opens_from(10.0, 40.0, 300.0), 1000.0, 1e-3)
    assert found.opens == pytest.approx(10.0, rel=1e-3)


def test_ends_of_the_ladder_are_told():
    always = first_opening(lambda _: True, 1.0, 1e-3)
    assert (always.status, always.runs) == (OPENS_AT_LEAST, 1) and math.isnan(always.holds)
    never = first_opening(lambda _: False, 1.0, 1e-3)
    assert never.status == HOLDS and never.holds == 256.0 and math.isnan(never.opens)


def test_a_run_that_fails_is_no_opening():
    found = first_opening(lambda rate: None if rate > 1.0 else False, 1.0, 1e-3)
    assert found.status == FAILED and found.holds == 1.0 and math.isnan(found.opens)
    answers = iter([*[False] * 12, True, None])
    assert first_opening(lambda _: next(answers), 1.0, 1e-3).status == FAILED


def doublet(forces, flow="shear", jit=False, angle=1.0, held=False):
    """Two spheres that have come to rest together, seen from anywhere."""
    x, y = 1e-4, -3e-4
    along = math.cos(angle), math.sin(angle)
    bodies = [
        Body(Sphere(5e-6), (x, y), density=2650.0, fixed=held),
        Body(Sphere(5e-6), (x + 1e-5 * along[0], y + 1e-5 * along[1]), density=2650.0),
    ]
    start = System(bodies, forces, Overdamped(1e-11), WATER).run(1e-3, jit=jit)
    return Doublet(start, flow, jit=jit)


@pytest.mark.parametrize("flow", rest_slow(["shear", "extension"], lambda flow: flow == "shear"))
def test_two_spheres_hold_below_their_rate_and_open_above(flow):
    pair = doublet(bond(), flow)
    assert pair.answer(0.98 * CRITICAL)[0] is False
    assert pair.answer(1.02 * CRITICAL)[0] is True


@pytest.mark.slow
@pytest.mark.parametrize(
    ("h_min", "flow", "jit"),
    rest_slow(
        [(5e-8, "shear", False), *product([1e-9, 5e-8], ["shear", "extension"], [True])],
        lambda h_min, flow, jit: not jit,
    ),
)
def test_the_pull_of_the_water_between_opens_two_spheres_in_either_flow(h_min, flow, jit):
    pair = doublet([*bond(), PairResistance(h_min=h_min)], flow, jit=jit)
    assert pair.rate_of_spheres() == pytest.approx(IN_WATER, rel=4e-3)
    assert pair.answer(0.98 * IN_WATER)[0] is False
    assert pair.answer(1.02 * IN_WATER)[0] is True


def test_weight_and_warmth_are_left_out_and_none_is_held():
    pair = doublet([*bond(), Gravity(), Thermal(kick=1e-3)], held=True)
    assert [type(force).__name__ for force in pair.forces] == [
        "StokesDrag",
        "VanDerWaals",
        "Contact",
    ]
    assert not any(body.fixed for body in pair.bodies)
    assert pair.rate_of_spheres() == pytest.approx(CRITICAL, rel=1e-4)


def test_no_run_tries_more_steps_than_it_may():
    pair = doublet(bond())
    first, second = Overdamped(1e-11), Overdamped(1e-9)
    assert pair.opened_by(first, 5, 1.02 * CRITICAL) is None
    few = attrs.evolve(pair, tries=((first, 5), (second, 20_000)))
    assert few.answer(1.02 * CRITICAL) == (True, 1e-9)
    failed = attrs.evolve(pair, tries=((first, 5),)).opening()
    assert (failed.status, failed.tolerance) == (FAILED, 1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("gap", ["surface", "equivalent_spheres"])
def test_the_critical_rate_is_found_within_a_percent(gap):
    found = doublet(bond(gap), jit=True).opening()
    assert found.status == OPENED
    assert found.opens == pytest.approx(CRITICAL, rel=0.01)
    assert found.holds == pytest.approx(CRITICAL, rel=0.01)


@pytest.mark.slow
def test_the_rate_does_not_go_by_where_or_how_the_doublet_lies():
    rates = [
        doublet(bond(), jit=True, angle=angle).opening(1e-3).opens for angle in (0.1, 2.0, -1.2)
    ]
    np.testing.assert_allclose(rates, rates[0], rtol=3e-3)
