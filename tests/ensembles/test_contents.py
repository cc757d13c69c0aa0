"""StudyResults: tables, Datasets and DataFrames hold the file's numbers; replicates come again."""

import json

import numpy as np
import pytest

import flocsim
from flocsim.errors import FileError, UsageError
from flocsim.io.results.file import read_results
from flocsim.io.results.schema import OUTCOMES
from tests.helpers.results_files import write_results
from tests.helpers.synthetic_results import make_results


@pytest.fixture
def synthetic(tmp_path):
    """(path, Results) of numbers that were made up."""
    write_results(tmp_path / "r.h5", make_results(vertices=(1, 4), delta=(0.0, 1.0), count=12))
    return tmp_path / "r.h5", read_results(tmp_path / "r.h5")


def test_xarray_has_what_the_file_has(synthetic):
    xarray = pytest.importorskip("xarray")
    path, _ = synthetic
    for group in ("probabilities", "replicates"):
        mine = flocsim.open(path).to_xarray(group)
        with xarray.open_dataset(path, group=group, engine="h5netcdf", mask_and_scale=False) as his:
            assert set(mine.variables) == set(his.variables)
            for name, values in his.variables.items():
                assert mine[name].dims == values.dims
                np.testing.assert_array_equal(mine[name].values, values.values)
                assert mine[name].attrs["units"] == values.attrs["units"]


def test_pandas_has_a_row_for_each_condition(synthetic):
    pytest.importorskip("pandas")
    path, results = synthetic
    frame = flocsim.open(path).to_pandas()
    assert frame.index.names == ["type", "vertices", "delta"]
    assert len(frame) == np.prod(results.shape)
    for place in np.ndindex(*results.shape):
        at = tuple(axis[i] for axis, i in zip(
            (results.types, results.vertices, results.delta), place, strict=True))  # fmt: skip
        assert frame.loc[at, "n_total"] == results.probabilities["n_total"][place]
        assert frame.loc[at, "n_class_C"] == results.probabilities["n_class"][place][2]
    rows = flocsim.open(path).to_pandas("replicates")
    codes = results.replicates["outcome"].ravel()
    assert rows["outcome"].tolist() == [OUTCOMES[code] for code in codes]


def test_the_table_and_figures_are_the_commands(synthetic, tmp_path):
    path, _ = synthetic
    opened = flocsim.open(path)
    assert "Pr[inside]" in opened.table()
    figure = opened.plot("4", file=tmp_path / "figure.png")
    assert figure.axes and (tmp_path / "figure.png").stat().st_size > 1000
    assert repr(opened).startswith("StudyResults(probabilities, ")


@pytest.mark.parametrize("library", ["xarray", "pandas"])
def test_what_is_not_installed_is_told_in_a_line(synthetic, uninstalled, library):
    uninstalled(library)
    with pytest.raises(UsageError, match=rf"{library} is not installed: pip install 'flocsim\["):
        getattr(flocsim.open(synthetic[0]), f"to_{library}")()


def test_wrong_words_are_refused(synthetic, tmp_path):
    opened = flocsim.open(synthetic[0])
    with pytest.raises(UsageError, match="group must be one of"):
        opened.labelled("tables")
    with pytest.raises(UsageError, match="figure must be one of"):
        opened.plot("99")
    with pytest.raises(FileError, match="has no config"):
        opened.replicate(0)
    with pytest.raises(FileError, match="could not be read"):
        flocsim.open(tmp_path / "nothing.h5")


def test_every_group_has_its_axes(finished):
    pytest.importorskip("xarray")
    assert dict(finished.to_xarray("pooled").sizes) == {"type": 2, "vertices": 1}
    apart = finished.to_xarray("differences")["difference"]
    assert apart.dims == ("against", "event", "type", "vertices", "delta")
    assert float(apart.sel(against="delta", event="aggregated", type="I", delta=0.0)[0]) == 0.0


def test_a_replicate_comes_again_as_it_was(finished):
    motion = flocsim.open(finished.path).replicate(2, "III", 1, 1.0)
    place = (1, 0, 1, 2)
    for name, column in finished.replicates.items():
        found = motion.row[name]
        if not isinstance(found, str) and not name.startswith("checked"):
            np.testing.assert_array_equal(found, column[place], name)
    assert motion.row["outcome"] == OUTCOMES[finished.replicates["outcome"][place]]
    assert motion.t[-1] == motion.row["t_end"] and len(motion.t) == motion.steps + 1
    with pytest.raises(UsageError, match="from 0 to 2, found 3"):
        finished.replicate(3)
    with pytest.raises(UsageError, match="vertices must be one of 1, found 4"):
        finished.replicate(0, vertices=4)


def test_what_would_come_otherwise_is_not_run(finished):
    opened = flocsim.open(finished.path)
    identity = json.loads(opened.run["identity"]) | {"forces.contact.k_n": 1.0}
    opened.run["identity"] = json.dumps(identity)
    with pytest.raises(UsageError, match=r"forces.contact.k_n is 1.0 in the file, 20.0 now"):
        opened.replicate(0)
