"""A pilot: replicates spread over all conditions, their times scaled to the study."""

from collections import Counter
from itertools import islice

import pytest

from flocsim.ensembles.diagnose.pilot import (
    AT_ONCE,
    LEAST,
    expected_replicates,
    forecast_of,
    pairs_made,
    sample_of,
)
from tests.helpers.small_study import small_config, small_study

SPHERES = {"shapes": {"vertices": [1]}, "replicates": 40}
DELTA = {"scene": {"delta": [0.0, 0.25, 0.5, 0.75, 1.0]}}


def test_a_stop_rule_limits_the_expected_replicates(tmp_path):
    stop = {"stop": {"half_width": 0.05, "least": 100}}
    counts = [
        expected_replicates(small_config(tmp_path, {"replicates": count} | more))
        for count, more in ((10_000, stop), (200, stop), (10_000, {}))
    ]
    assert counts == [385, 200, 10_000]


@pytest.mark.parametrize("replicates", [5, 60, 1000])
def test_conditions_take_turns_and_no_replicate_comes_twice(tmp_path, replicates):
    study = small_study(tmp_path, {"replicates": replicates} | DELTA)
    tasks = list(islice(sample_of(study.config, study.conditions), 150))
    assert len(set(tasks)) == len(tasks) == 150
    assert all(0 <= replicate < replicates for _, replicate in tasks)
    for begin in range(0, 150, 30):
        places = Counter(place for place, _ in tasks[begin : begin + 30])
        assert set(places) == set(study.conditions) and set(places.values()) == {1}


def test_times_are_scaled_to_the_study(tmp_path):
    """The least number of replicates is run; a study of ten times as many takes as much more."""
    once = SPHERES | {"integrator": {"check_share": 0.0}}  # re-runs fall on few of these
    studies = [small_study(tmp_path, once | {"replicates": count}) for count in (400, 4000)]
    forecast_of(studies[0], 1, seconds=0.0)  # loads the engine
    found = [forecast_of(study, 1, seconds=0.0) for study in studies]
    for each in found:
        assert set(each.ended) == {"A"}
        assert LEAST <= each.ended["A"] < LEAST + AT_ONCE
        assert 0.0 < each.low < each.cpu < each.high
    assert found[0].replicates == 400
    assert found[1].cpu > 2.0 * found[0].cpu


def test_every_rank_prepares_its_own_pairs(tmp_path):
    study = small_study(tmp_path, {"replicates": 400, "shapes": {"vertices": [1, 4]}})
    # Spheres are one pair for each type, and of two flocs there are four pairs.
    assert pairs_made(study, 400, 1) == pytest.approx(2 * (1 + 4))
    assert pairs_made(study, 400, 3) == pytest.approx(3 * 2 * (1 + 4))
    assert pairs_made(study, 1, 1) < 2 * (1 + 2)
