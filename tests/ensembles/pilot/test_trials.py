"""The replicates that a pilot runs: spread over all conditions, the same on every machine."""

from collections import Counter

import pytest

from flocsim.ensembles.pilot.trials import expected_replicates, sample_of, stride_through
from tests.helpers.small_study import small_config


def config(tmp_path, replicates, delta=(0.0, 0.25, 0.5, 0.75, 1.0), stop=None):
    """The small study of two types and three N."""
    over = {"replicates": replicates, "scene": {"delta": list(delta)}}
    return small_config(tmp_path, over | ({"stop": stop} if stop else {}))


def test_a_stop_rule_limits_the_expected_replicates(tmp_path):
    stop = {"half_width": 0.05, "least": 100}
    assert expected_replicates(config(tmp_path, 10_000, stop=stop)) == 385
    assert expected_replicates(config(tmp_path, 200, stop=stop)) == 200
    assert expected_replicates(config(tmp_path, 10_000)) == 10_000


@pytest.mark.parametrize("replicates", [60, 77, 100, 1000])
def test_no_replicate_comes_twice_and_every_condition_comes_as_often(tmp_path, replicates):
    made = config(tmp_path, replicates)
    for place, tasks in enumerate(sample_of(made, 150)):
        assert len(set(tasks)) == len(tasks) == 150
        assert {task.condition for task in tasks} == {place}
        assert all(0 <= task.replicate < replicates for task in tasks)
        for begin in range(0, len(tasks), 15):
            cells = Counter((t.vertices, t.delta) for t in tasks[begin : begin + 15])
            assert set(cells.values()) == {1}


def test_the_first_tasks_are_spread_over_n_and_delta(tmp_path):
    first = sample_of(config(tmp_path, 1000), 150)[0][:6]
    assert {task.vertices for task in first} == {1, 4, 16}
    assert len({task.delta for task in first}) >= 4


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6, 12, 15, 30, 97])
def test_a_stride_comes_everywhere(count):
    stride = stride_through(count)
    assert sorted(place * stride % count for place in range(count)) == list(range(count))
