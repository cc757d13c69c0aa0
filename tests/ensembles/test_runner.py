"""A study run by several ranks: the same arrays whoever ran what."""

import numpy as np
import pytest

from flocsim.ensembles.estimates.statistics import EXACT_RUNS
from flocsim.ensembles.parallel import coordinator
from flocsim.ensembles.parallel.schedule import Phase
from flocsim.ensembles.runner import make_state, run
from flocsim.ensembles.storage.resume import Beginning
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.io.results.file import read_results
from tests.helpers.results_files import same_data, write_results
from tests.helpers.small_study import small_config, small_study
from tests.helpers.study_state import scratch_journal
from tests.helpers.tabulate import tabulate
from tests.helpers.tiers import rest_slow


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The small study."""
    return small_study(tmp_path_factory.mktemp("study"))


def same_arrays(table, other):
    """Whether two tables agree byte for byte."""
    return all(table[name].tobytes() == other[name].tobytes() for name in other)


@pytest.fixture(scope="module")
def alone(study):
    """The table of one rank."""
    return run(study.config).replicates


@pytest.mark.parametrize("size", rest_slow([2, 5, 40], lambda size: size == 5))
def test_whoever_runs_what_in_whatever_order_the_table_is_the_same(study, alone, size):
    from flocsim.ensembles.estimates.summary import Reader

    start = Beginning(RowStore(scratch_journal(), study.conditions), {})
    state = make_state(study, start, size)
    held = [state.next_chunk() for _ in range(size)]
    rng = np.random.default_rng(size)
    while any(held):
        rank = rng.choice([rank for rank in range(size) if held[rank]])
        state.take_in(coordinator.run_chunk(study, held[rank], lambda: False, 1e-9, "key"))
        held[rank] = None
        held = [chunk or state.next_chunk() for chunk in held]
    assert state.schedule.remaining == 0
    assert state.phase is Phase.FINISHED
    assert state.computed == study.size
    assert same_arrays(Reader(start.store, study.shape).part(0, 3), alone)


def test_angles_are_the_same_in_all_conditions(alone):
    for name in ("angle_i", "angle_j"):
        assert np.all(alone[name] == alone[name][:1, :1, :1])
        assert len(set(alone[name][0, 0, 0])) == 3


def test_more_replicates_leave_the_first_ones_as_they_are(tmp_path, alone):
    fewer = run(small_config(tmp_path, {"replicates": 2})).replicates
    assert same_arrays(fewer, {name: array[..., :2] for name, array in alone.items()})


def test_fewer_conditions_leave_the_others_as_they_are(tmp_path, alone):
    fewer = {"scene": {"types": ["III"], "delta": [1.0]}}
    part = run(small_config(tmp_path, fewer)).replicates
    assert same_arrays(part, {name: array[1:, :, 1:] for name, array in alone.items()})


def test_another_seed_draws_other_collisions(tmp_path, alone):
    other = run(small_config(tmp_path, {"seed": 2, "shapes": {"vertices": [1]}}))
    assert not np.any(other.replicates["angle_i"] == alone["angle_i"][:, :1])


def test_results_hold_what_was_run(study, alone, tmp_path):
    results = run(study.config)
    assert (results.types, list(results.vertices)) == (("I", "III"), [1, 4, 16])
    table = tabulate(*(alone[name] for name in EXACT_RUNS))
    for name in table:
        np.testing.assert_array_equal(results.probabilities[name], table[name])
    assert table["n_total"].sum() == 36
    assert results.flocs == tuple(floc.name for floc in study.flocs)
    write_results(tmp_path / "a.h5", results)
    again = read_results(tmp_path / "a.h5")
    assert same_arrays(again.replicates, alone)
    assert again.flocs == results.flocs
    assert same_arrays(again.differences, results.differences)
    assert same_arrays(again.pooled, results.pooled)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_xarray_opens_every_group_that_a_study_makes(study, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    results = run(study.config)
    path = tmp_path / "a.h5"
    write_results(path, results)
    with xarray.open_dataset(path, group="differences", engine="h5netcdf") as table:
        assert table["difference"].dims == ("against", "event", "type", "vertices", "delta")
        own = table["difference"].sel(
            against="delta", event="inside", type="I", vertices=4, delta=0
        )
        assert own == 0.0
    with xarray.open_dataset(path, group="pooled", engine="h5netcdf") as table:
        assert table["pr_a"].sel(type="I", vertices=1) == results.pooled["pr_a"][0, 0]
    with xarray.open_dataset(path, group="flocs", engine="h5netcdf") as table:
        assert list(table["floc"].values) == list(results.flocs)


def test_run_is_the_whole_way(tmp_path, capsys):
    spheres = {"shapes": {"vertices": [1]}}
    config = small_config(tmp_path, spheres)
    results = run(config)
    assert capsys.readouterr().out == ""
    assert (results.run["ranks"], results.run["preset"]) == (1, "tang2014")
    assert results.run["wall_time"] > 0.0
    for name, part in (("a.h5", results), ("b.h5", run(config))):
        write_results(tmp_path / name, part)
    assert same_data(tmp_path / "a.h5", tmp_path / "b.h5") == []
