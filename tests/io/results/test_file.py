"""The results file: round trip, equal bytes, xarray, and every way in which a file can be wrong."""

import re
import shutil

import h5py
import numpy as np
import pytest

from flocsim.errors import FileError, visible
from flocsim.io.results.file import read_results
from flocsim.io.results.run_group import provenance
from flocsim.io.results.schema import OUTCOMES, REPLICATES, TABLE
from flocsim.io.seals import HDF5_SIGNATURE
from tests.helpers.results_files import same_data, write_results
from tests.helpers.sealed import seal
from tests.helpers.synthetic_results import FAILURES, make_results

SMALL = {"types": ("I", "16.41/4.95 µm"), "vertices": (1, 8), "delta": (0.0, 0.7), "count": 5}


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """A small results file."""
    path = tmp_path_factory.mktemp("once") / "results.h5"
    write_results(path, make_results(**SMALL))
    return path


@pytest.fixture
def written(once, tmp_path):
    """A copy of it and what is in it."""
    return shutil.copy(once, tmp_path / "results.h5"), make_results(**SMALL)


def test_what_is_written_is_read(written):
    path, results = written
    copy = read_results(path)
    assert copy.types == results.types
    assert copy.run == results.run
    assert copy.failures == FAILURES
    np.testing.assert_array_equal(copy.vertices, results.vertices)
    np.testing.assert_array_equal(copy.delta, results.delta)
    for group in ("replicates", "probabilities"):
        for name, array in getattr(results, group).items():
            stored = getattr(copy, group)[name]
            assert stored.dtype == array.dtype
            np.testing.assert_array_equal(stored, array)


def test_equal_results_give_equal_data_whatever_the_run(tmp_path, written):
    path, _ = written
    run = {"wall_time": 99.0, "config": "preset = 'si'\n" * 5000, "ranks": 4}
    write_results(tmp_path / "again.h5", make_results(**SMALL, run=run))
    assert same_data(path, tmp_path / "again.h5") == []
    assert path.read_bytes() != (tmp_path / "again.h5").read_bytes()


def test_same_results_and_run_give_the_same_file(tmp_path, written):
    path, results = written
    write_results(tmp_path / "again.h5", results)
    assert path.read_bytes() == (tmp_path / "again.h5").read_bytes()


@pytest.mark.parametrize("name", ["replicates/d_c_max", "replicates/outcome", "replicates/failure"])
def test_a_single_changed_bit_is_named(written, tmp_path, name):
    path, results = written
    group, variable = name.split("/")
    getattr(results, group)[variable].reshape(-1).view("u1")[0] ^= 1
    write_results(tmp_path / "other.h5", results)
    assert same_data(path, tmp_path / "other.h5") == [name]


@pytest.mark.filterwarnings("error")
def test_xarray_opens_each_group_with_named_coordinates(written):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path, results = written
    with xarray.open_dataset(path, group="probabilities", engine="h5netcdf") as table:
        assert table["pr_class"].dims == ("type", "vertices", "delta", "class")
        chosen = table["n_class"].sel(type="I", vertices=8, delta=0.7)
        assert chosen.sel({"class": "B"}) == results.probabilities["n_class"][0, 1, 1, 1]
        assert set(table.data_vars) == set(TABLE)
    with xarray.open_dataset(path, group="replicates", engine="h5netcdf") as replicates:
        outcome = replicates["outcome"]
        assert outcome.dims == ("type", "vertices", "delta", "replicate")
        assert outcome.dtype == np.uint8
        assert tuple(outcome.attrs["flag_meanings"].split()) == OUTCOMES
        assert outcome.attrs["flag_values"].tolist() == list(range(len(OUTCOMES)))
        assert replicates["t_end"].attrs["units"] == "s"
        assert replicates["t_end"].dtype == float
        assert set(replicates.data_vars) == set(REPLICATES)
    with xarray.open_dataset(path, group="run", engine="h5netcdf") as run:
        assert run["preset"] == "tang2014"


@pytest.mark.parametrize("place", ["missing/r.h5", "file/r.h5", "folder", "x" * 300, "nul\0.h5"])
def test_unwritable_places_are_told(tmp_path, place):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    before = sorted(tmp_path.iterdir())
    with pytest.raises(FileError, match=re.escape(visible(place))) as caught:
        write_results(tmp_path / place, make_results(**SMALL))
    assert caught.value.exit_code == 74
    assert "\n" not in str(caught.value)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("content", "finding"),
    [
        (b"", "not an HDF5 file"),
        (b"type,vertices\nI,4\n", "not an HDF5 file"),
        (HDF5_SIGNATURE, "checksum"),
        (seal(HDF5_SIGNATURE + b"junk"), "no readable results"),
    ],
)
def test_files_of_another_kind_are_refused(tmp_path, content, finding):
    path = tmp_path / "strange.h5"
    path.write_bytes(content)
    with pytest.raises(FileError, match=finding) as caught:
        read_results(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_foreign_hdf5_is_refused(tmp_path):
    path = tmp_path / "foreign.h5"
    with h5py.File(path, "w") as file:
        file["x"] = 1.0
    with pytest.raises(FileError, match="not from flocsim"):
        read_results(path)
    path.write_bytes(seal(path.read_bytes()))
    with pytest.raises(FileError, match="is a file of another kind: name a file with results"):
        read_results(path)


def test_provenance_can_be_stored_whatever_the_command_line(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["flocsim", "ensemble", "na\udcffme with blank.toml"])
    facts = provenance('preset = "tang2014"\n# κ', 3, "abc")
    write_results(tmp_path / "r.h5", make_results(**SMALL, run=facts))
    stored = read_results(tmp_path / "r.h5").run
    assert stored == facts
    assert stored["config"] == 'preset = "tang2014"\n# κ'
    assert (stored["seed"], stored["kernel_fingerprint"]) == (3, "abc")
    assert stored["numpy_version"] == np.__version__
    assert stored["h5py_version"] == h5py.__version__
    assert stored["command"] == "flocsim ensemble 'na?me with blank.toml'"
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", stored["date"])
