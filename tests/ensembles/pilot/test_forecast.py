"""What a study takes, foretold from replicates whose times are known, and its file."""

import math

import numpy as np
import pytest

from flocsim.ensembles.collision.draw import expected_checks
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.pilot.forecast import (
    CLOCK,
    LEAST,
    Spent,
    Timed,
    estimated,
    file_size,
    forecast_of,
    in_turn,
    pairs_made,
    second_runs,
    setting_up,
    time_replicates,
    timed,
)
from flocsim.ensembles.pilot.trials import Trial
from flocsim.ensembles.runner import run_to_file
from flocsim.ensembles.study import Study
from flocsim.io.results.events import CERTIFICATE, HOOK
from tests.helpers.small_study import small_config, small_study

SPHERES = {"shapes": {"vertices": [1]}, "replicates": 40}


def never():
    """Nothing asks for an end."""


def test_known_times_are_added_up():
    first = np.array([1.0, 3.0, 1.0, 3.0])
    second = np.array([2.0, 6.0, math.nan, math.nan])
    found, share = estimated([Spent(first, second)] * 2, 1000, [100, 100], 50.0, seed=1)
    assert found.value == pytest.approx(50.0 + 2 * (1000 * 2.0 + 100 * 4.0))
    assert share == pytest.approx(2 * 100 * 4.0 / found.value)
    assert found.low < found.value < found.high


def test_what_was_run_whole_is_as_sure_as_the_clock():
    times = np.random.default_rng(1).lognormal(0.0, 1.0, 300)
    none = np.full(300, math.nan)
    all_of_it, _ = estimated([Spent(times, none)], 300, [0], 0.0, seed=1)
    part_of_it, _ = estimated([Spent(times, none)], 30_000, [0], 0.0, seed=1)
    assert all_of_it.high / all_of_it.value == pytest.approx(math.exp(1.97 * CLOCK), rel=0.01)
    assert part_of_it.high / part_of_it.value > 1.01 * all_of_it.high / all_of_it.value


@pytest.mark.parametrize("count", [12, 200])
def test_the_interval_holds_the_truth_of_heavy_tails_mostly(count):
    """Times of which the hundredth is ten times the median: σ = 1 of the logarithm."""
    random, covered = np.random.default_rng(5), 0
    for seed in range(200):
        times = random.lognormal(0.0, 1.0, count)
        found, _ = estimated([Spent(times, np.full(count, math.nan))], 10**6, [0], 0.0, seed)
        covered += found.low <= 10**6 * math.exp(0.5) <= found.high
    assert covered >= 0.85 * 200


def test_replicates_are_run_in_turn_until_the_time_is_up(tmp_path):
    study = small_study(tmp_path, SPHERES)
    tasks = in_turn(study.config)
    assert [task.condition for task in tasks[:4]] == [0, 1, 0, 1]
    asked = []
    runs = time_replicates(study, tasks, lambda: asked.append(1), seconds=0.0)
    assert len(runs) == 2 * LEAST and len(asked) == 2 * LEAST + 1
    assert all(run.first.cpu > 0.0 for run in runs)
    assert [run.second is not None for run in runs[:8]] == [True] * 2 + [False] * 4 + [True] * 2
    assert [run.first.setup > 0.0 for run in runs[:4]] == [True, True, False, False]
    for run in runs[:4]:
        row = study.run(*run.task[:3], run.task.replicate)
        assert run.first[:2] == (row["outcome"], row["inside"])


def test_a_second_run_that_ends_otherwise_is_a_flip(tmp_path):
    study = small_study(tmp_path, SPHERES)
    task = in_turn(study.config)[0]
    found = timed(study, task, True)
    assert found.second and found.second.time > 0.0 and not found.flipped
    assert timed(study, task, False).second is None
    other = found.second._replace(outcome=3, inside=0)
    assert found._replace(second=other).flipped
    assert not found._replace(second=None).flipped


def test_no_second_runs_where_the_study_has_none(tmp_path):
    study = small_study(tmp_path, SPHERES | {"integrator": {"check_share": 0.0}})
    runs = time_replicates(study, in_turn(study.config), never, seconds=0.0)
    assert not any(run.second for run in runs)
    assert forecast_of(study, runs, 1, 0.0).again == 0.0


def test_every_rank_makes_its_own_pairs(tmp_path):
    study = small_study(tmp_path, {"replicates": 40, "shapes": {"vertices": [1, 4]}})
    # Spheres are one pair for each type, and of two flocs there are two orders.
    assert pairs_made(study, 1) == 2 * (1 + 2)
    assert pairs_made(study, 3) == 3 * 2 * (1 + 2)


def test_pairs_that_were_not_seen_are_made_like_the_later_ones(tmp_path):
    study = small_study(tmp_path, {"replicates": 40, "shapes": {"vertices": [1, 4]}})
    task = in_turn(study.config)[0]
    blank = Timed(task, Trial(0, 1, cpu=1.0))
    runs = [
        Timed(task, Trial(0, 1, cpu=1.0, setup=setup)) for setup in (9.0, 0.0, 7.0, 1.0, 0.0, 3.0)
    ]
    assert setting_up(study, runs, 1) == pytest.approx(20.0 + (6 - 4) * 2.0)
    assert setting_up(study, [blank], 1) == 0.0


@pytest.mark.slow
def test_the_size_is_that_of_the_file(tmp_path):
    short = {"scene": {"types": ["I"], "delta": [0.0]}, "integrator": {"check_share": 0.0}}
    for count in (3, 300):
        config = small_config(tmp_path, SPHERES | short | {"replicates": count})
        path = tmp_path / f"{count}.h5"
        run_to_file(config, Communicator(), path, "new")
        study = Study(config)
        assert file_size(study, count) == pytest.approx(path.stat().st_size, rel=0.05)


def test_a_rule_that_may_end_the_study_widens_the_file(tmp_path):
    stop = {"half_width": 0.1, "least": 10}
    study = small_study(tmp_path, SPHERES | {"replicates": 1000, "stop": stop})
    runs = time_replicates(study, in_turn(study.config), never, seconds=0.0)
    found = forecast_of(study, runs, 1, 0.0)
    assert found.replicates == 97
    assert found.size.low < 0.8 * found.size.value < 3.0 * found.size.value < found.size.high


def test_second_runs_are_more_of_those_that_flip_easily():
    hook, sure = (Timed(None, Trial(outcome=0, bond=bond)) for bond in (HOOK, CERTIFICATE))
    few, some, all_of_them = (
        second_runs(runs, 1000, "auto") for runs in ([sure], [sure, sure, hook, hook], [hook])
    )
    assert few == expected_checks(1000, "auto")
    assert all_of_them == 3 * few and some == 2 * few
    assert second_runs([hook], 1000, 0.1) == 100.0
