"""Shares of ranks put together again: the same arrays whoever ran what."""

import numpy as np
import pytest
from small_study import small_study

from flocsim.ensembles.progress import Progress
from flocsim.ensembles.runner import describe, in_order, own_places, results_of, run, run_share
from flocsim.ensembles.statistics import tabulate
from flocsim.ensembles.study import Study
from flocsim.ensembles.team import Alone
from flocsim.io.results import read_results, same_data, write_results


class Rank(Alone):
    """One rank of several, as far as the share of the work goes."""

    def __init__(self, rank, size):
        """Rank ``rank`` of ``size``."""
        self.rank, self.size = rank, size


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The small study."""
    return small_study(tmp_path_factory.mktemp("study"))


def table_of(study, size):
    """The table of replicates as ``size`` ranks make it."""
    quiet = Progress(study.size, True)
    shares = [run_share(study, Rank(rank, size), quiet) for rank in range(size)]
    # Ranks answer in their order, but nothing should hang on it.
    return in_order(study, shares[::-1])


def same_arrays(table, other):
    """Whether two tables agree byte for byte."""
    return all(table[name].tobytes() == other[name].tobytes() for name in other)


@pytest.fixture(scope="module")
def alone(study):
    """The table of one rank."""
    return table_of(study, 1)


@pytest.mark.parametrize("size", [2, 3, 7, 100])
def test_the_number_of_ranks_changes_nothing(study, alone, size):
    assert same_arrays(table_of(study, size), alone)


@pytest.mark.parametrize("size", [1, 2, 5, 36, 50])
def test_every_place_is_run_once(study, size):
    places = [place for rank in range(size) for place in own_places(study, Rank(rank, size))]
    assert sorted(places) == list(range(study.size))


def test_angles_are_the_same_in_all_conditions(alone):
    for name in ("angle_i", "angle_j"):
        assert np.all(alone[name] == alone[name][:1, :1, :1])
        assert len(set(alone[name][0, 0, 0])) == 3


def test_more_replicates_leave_the_first_ones_as_they_are(tmp_path, alone):
    fewer = table_of(small_study(tmp_path, {"replicates": 2}), 1)
    assert same_arrays(fewer, {name: array[..., :2] for name, array in alone.items()})


def test_fewer_conditions_leave_the_others_as_they_are(tmp_path, alone):
    fewer = {"scene": {"types": ["III"], "delta": [1.0]}}
    part = table_of(small_study(tmp_path, fewer), 1)
    assert same_arrays(part, {name: array[1:, :, 1:] for name, array in alone.items()})


def test_another_seed_draws_other_collisions(tmp_path, alone):
    other = table_of(small_study(tmp_path, {"seed": 2, "shapes": {"vertices": [1]}}), 1)
    assert not np.any(other["angle_i"] == alone["angle_i"][:, :1])


def test_results_hold_what_was_run(study, alone, tmp_path):
    results = results_of(study, alone, {"seed": 1})
    assert (results.types, list(results.vertices)) == (("I", "III"), [1, 4, 16])
    table = tabulate(alone["outcome"], alone["inside"])
    for name in table:
        np.testing.assert_array_equal(results.probabilities[name], table[name])
    assert table["n_total"].sum() == 36
    write_results(tmp_path / "a.h5", results)
    again = read_results(tmp_path / "a.h5")
    assert same_arrays(again.replicates, alone)


def test_run_is_the_whole_way(tmp_path, capsys):
    spheres = {"shapes": {"vertices": [1]}}
    config = small_study(tmp_path, spheres).config
    results = run(config)
    assert capsys.readouterr().out == ""
    assert same_arrays(results.replicates, table_of(Study(config), 1))
    assert (results.run["ranks"], results.run["preset"]) == (1, "tang2014")
    assert results.run["wall_time"] > 0.0
    for name, part in (("a.h5", results), ("b.h5", run(config))):
        write_results(tmp_path / name, part)
    assert same_data(tmp_path / "a.h5", tmp_path / "b.h5") == []


def test_the_run_is_announced_in_one_line(study):
    line = "36 replicates: 2 types x 3 numbers of vertices x 2 displacements x 3, on "
    assert describe(study, Alone()) == line + "1 rank"
    assert describe(study, Rank(0, 4)) == line + "4 ranks"
