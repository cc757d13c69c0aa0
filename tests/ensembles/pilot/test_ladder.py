"""The rate of flips at a tolerance: what is believed before any, few and many were seen."""

import numpy as np
import pytest

from flocsim.ensembles.pilot.ladder import (
    EXPONENT,
    EXPONENT_SPREAD,
    EXPONENTS,
    FLIPS,
    Seen,
    beliefs,
    falls,
    sampling_half_width,
)
from flocsim.io.confidence import wilson


def test_before_anything_is_seen_the_mean_is_that_of_other_scenes():
    [blank] = beliefs([[]])
    assert blank.expected(1.0) == pytest.approx(FLIPS)
    # An exponential distribution: its median is ln 2 of its mean.
    assert blank.bound(1.0, 0.5) == pytest.approx(FLIPS * np.log(2.0), rel=1e-6)


def test_rates_fall_with_the_tolerance_and_bounds_with_what_was_run():
    few, many = (beliefs([[Seen(1.0, 1e-3, runs, runs // 50)]])[0] for runs in (100, 10_000))
    for belief in (few, many):
        rates = [belief.expected(rung) for rung in (1.0, 0.1, 0.01)]
        assert rates == sorted(rates, reverse=True)
        assert belief.bound(0.1, 0.7) < belief.bound(0.1, 0.9)
    assert many.bound(1.0, 0.9) / many.expected(1.0) < few.bound(1.0, 0.9) / few.expected(1.0)


def test_no_flips_of_few_runs_are_no_proof_and_of_many_they_are():
    few, many = (beliefs([[Seen(1.0, 1e-3, runs, 0)]])[0] for runs in (10, 10_000))
    assert few.bound(1.0, 0.7) > 0.01
    assert many.bound(1.0, 0.7) < 5e-4


@pytest.mark.parametrize("place", [4, 16])
def test_rate_and_exponent_come_out_where_there_is_enough_to_see(place):
    runs, reference, rungs = 400_000, 1e-4, (1.0, 0.1, 0.01)
    seen = [
        Seen(s, reference, runs, round(0.03 * runs * (falls(s) + falls(reference))[place]))
        for s in rungs
    ]
    [belief] = beliefs([seen])
    for rung in (*rungs, 0.3):
        assert belief.expected(rung) == pytest.approx(0.03 * falls(rung)[place], rel=0.08)


def test_a_type_with_more_flips_is_told_from_one_with_fewer():
    calm, wild = beliefs([[Seen(1.0, 1e-3, 300, 1)], [Seen(1.0, 1e-3, 300, 15)]])
    assert 4.0 < wild.expected(0.1) / calm.expected(0.1) < 15.0


def test_a_bound_is_kept_as_often_as_it_says():
    """Rates drawn from what is believed before: 70 % bounds hold in 70 % of the draws."""
    rng = np.random.default_rng(3)
    kept, draws = 0, 400
    for _ in range(draws):
        rate = rng.exponential(FLIPS)
        place = np.argmin(np.abs(EXPONENTS - rng.normal(EXPONENT, EXPONENT_SPREAD)))
        powers = [(s, (falls(s) + falls(1e-3))[place]) for s in (1.0, 0.1)]
        seen = [Seen(s, 1e-3, 150, rng.poisson(150 * rate * power)) for s, power in powers]
        kept += rate * falls(0.1)[place] <= beliefs([seen])[0].bound(0.1, 0.7)
    assert abs(kept / draws - 0.7) < 0.07


@pytest.mark.parametrize("count", [3, 100, 10_000])
def test_the_sampling_error_is_that_of_wilsons_interval(count):
    low, high = wilson(count, 2 * count)
    assert sampling_half_width(2 * count) == pytest.approx(0.5 * float(high - low), rel=1e-9)
