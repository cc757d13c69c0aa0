"""Studies of pairs whose replicates are Sobol's points."""

import numpy as np
import pytest
from scipy.stats import qmc

from flocsim.ensembles.collision.draw import points_of
from flocsim.ensembles.estimates.statistics import scrambled_sums
from flocsim.ensembles.estimates.summary import added
from flocsim.ensembles.runner import run
from flocsim.ensembles.storage.identity import identity_of
from flocsim.errors import ConfigError
from flocsim.io.confidence import bounded_sums, clustered_proportion, proportion
from tests.helpers.small_study import small_config, small_study
from tests.helpers.synthetic_results import draw_codes

SOBOL = {"sampling": "sobol", "replicates": 32, "scene": {"types": ("I",), "delta": (0.0, 0.5)},
         "shapes": {"vertices": (1, 4), "pool": 2}}  # fmt: skip


def test_replicates_are_points_of_sixteen_scrambles_the_same_in_all_conditions(tmp_path):
    study = small_study(tmp_path, SOBOL)
    assert study.point_scrambles == 16
    numbers = np.array([study.numbers(k) for k in range(256)])
    np.testing.assert_array_equal(numbers, points_of(1, 16, 0, 256))
    for scramble in range(16):
        # Of 16 points one lies in each sixteenth of every dimension.
        assert np.all(range(16) == np.sort(16.0 * numbers[scramble::16], axis=0).astype(int).T)
    row = study.run(0, 4, 0.0, 7)
    assert row["angle_i"] == 2.0 * np.pi * numbers[7, 0]
    assert qmc.discrepancy(numbers) < qmc.discrepancy(np.random.default_rng(1).random((256, 5)))


def test_a_study_is_another_than_one_of_independent_replicates_and_can_be_extended(tmp_path):
    study, plain = (
        small_study(tmp_path, SOBOL),
        small_study(tmp_path, SOBOL | {"sampling": "random"}),
    )
    assert identity_of(study) != identity_of(plain)
    longer = small_study(tmp_path, SOBOL | {"replicates": 64})
    assert identity_of(longer) == identity_of(study)
    assert np.array_equal(longer.numbers(20), study.numbers(20))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"replicates": 100}, "must be 16 scrambles times a power of 2"),
        ({"replicates": 8}, "give 16 or 32"),
        ({"stop": {"half_width": 0.1}}, "not for Sobol points"),
        ({"sampling": "halton"}, "sampling must be .random. or .sobol., found .halton."),
    ],
)
def test_what_does_not_go_with_the_points_is_refused(tmp_path, changes, said):
    with pytest.raises(ConfigError, match=said):
        small_config(tmp_path, SOBOL | changes)


def test_sums_of_scrambles_add_up_whatever_the_blocks():
    codes = draw_codes(np.random.default_rng(1), (2, 2, 3, 64))
    whole = scrambled_sums(codes, 0, 16)
    parts = {}
    for first, stop in ((0, 5), (5, 40), (40, 64)):
        some = tuple(each[..., first:stop] for each in codes)
        parts = added(parts, scrambled_sums(some, first, 16))
    for name, sums in whole.items():
        np.testing.assert_array_equal(sums, parts[name])
    aggregated = np.isin(codes[0], (0, 2))
    np.testing.assert_array_equal(whole["pr_a"][1, ..., 3], aggregated[..., 3::16].sum(axis=-1))


def scrambled_proportion(*sums):
    """(low, high, n) of successes, trials, unknown (…, scramble)."""
    return clustered_proportion(bounded_sums(*sums), sums[0].shape[-1])[1:]


def test_the_interval_is_students_of_the_scrambles_and_wilsons_where_all_agree():
    rng = np.random.default_rng(2)
    trials = np.full((3000, 16), 32)
    none = np.zeros_like(trials)
    p = 0.4
    low, high, n = scrambled_proportion(rng.binomial(32, p, trials.shape), trials, none)
    assert 0.93 < np.mean((low <= p) & (p <= high)) < 0.97
    assert np.median(n) == pytest.approx(16 * 32, rel=0.1)
    # Points that are quite even are worth more than independent ones, though not without end.
    even = np.full(trials.shape, 13)
    low, high, n = scrambled_proportion(even, trials, none)
    assert 16 * 32 < n[0] < 1e5 and 0.0 < high[0] - low[0] < 0.02
    sure = scrambled_proportion(trials, trials, none)
    assert sure[1][0] == 1.0 and 0.98 < sure[0][0] < proportion(512, 512)[0]


def test_unknown_points_are_in_the_interval():
    trials, unknown = np.full((1, 16), 10), np.full((1, 16), 6)
    low, high, _ = scrambled_proportion(np.full((1, 16), 5), trials, unknown)
    assert low[0] < 5 / 16 and high[0] > 11 / 16


def test_a_study_has_intervals_of_its_scrambles(tmp_path):
    found = run(small_config(tmp_path, SOBOL))
    rows = found.replicates
    sums = scrambled_sums(tuple(rows[name] for name in ("outcome", "inside", "bond")), 0, 16)
    trials, successes, unknown = sums["pr_a"]
    low, high, _ = scrambled_proportion(successes, trials, unknown)
    np.testing.assert_array_equal(found.probabilities["pr_a_low"], low)
    np.testing.assert_array_equal(found.probabilities["pr_a_high"], high)
    assert np.all(found.pooled["pr_a_low"] <= found.pooled["pr_a"])
