"""A sweep: its joined file, how it goes on, what it refuses."""

import shlex

import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.commands.sweep import values_of
from flocsim.ensembles.sweep import planned, swept_keys
from flocsim.errors import FileError, UsageError
from flocsim.io.results.file import read_results
from tests.helpers import parts_here
from tests.helpers.small_study import write_small

HAMAKER = "forces.van_der_waals.hamaker"
ONE = {"shapes.vertices": [1], "scene.types": ["I"], "scene.delta": [0.0], "replicates": 2}


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """(study, path) of a sweep over one value, extended by a second with --resume."""
    folder = tmp_path_factory.mktemp("sweep")
    study = flocsim.Study(write_small(folder)).with_(ONE)
    flocsim.sweep(study, {HAMAKER: [1e-18]}, folder / "all.h5")
    words = [f"--set={k}={str(v).replace(chr(39), chr(34))}" for k, v in ONE.items()]
    code = main(["sweep", str(study.path), *words, "--over", f"{HAMAKER}=1e-18,'1 aJ'",
                 "-o", str(folder / "same.h5"), "--dry-run"])  # fmt: skip
    assert code == 0
    before = (folder / "all.parts" / "0000.h5").stat()
    with parts_here.used():
        code = main(["sweep", str(study.path), *words, "--over", f"{HAMAKER}=1e-18,'10 zJ'",
                     "-o", str(folder / "all.h5"), "--resume"])  # fmt: skip
    assert code == 0
    assert (folder / "all.parts" / "0000.h5").stat().st_mtime_ns == before.st_mtime_ns
    return study, folder / "all.h5"


def test_the_joined_file_has_the_key_as_a_dimension(swept):
    xarray = pytest.importorskip("xarray")
    _, path = swept
    with xarray.open_dataset(path, group="probabilities", engine="h5netcdf") as table:
        assert table["pr_a"].dims == ("hamaker", "type", "vertices", "delta")
        assert table["hamaker"].values.tolist() == [1e-18, 1e-20]
        assert table["hamaker"].attrs == {"units": "J", "long_name": HAMAKER}
        assert table["n_class"].dims[-1] == "class"
        assert table.coords["r_i"].dims == ("hamaker", "type")
        assert table["r_i"].values.tolist() == [[16.41e-6], [16.41e-6]]
        for place in range(2):
            part = read_results(path.parent / "all.parts" / f"000{place}.h5")
            np.testing.assert_array_equal(
                table["n_class"].values[place], part.probabilities["n_class"]
            )
    opened = flocsim.open(path)
    assert opened.to_xarray().equals(xarray.open_dataset(path, group="probabilities"))
    assert opened.to_pandas("pooled").index.names == ["hamaker", "type", "vertices"]
    assert repr(opened) == "SweepResults(probabilities, pooled)"


def test_files_in_the_way_are_left_alone(swept, tmp_path):
    study, path = swept
    before = path.read_bytes()
    with pytest.raises(UsageError, match=r"already exists .* extend it with --resume .in Python"):
        flocsim.sweep(study, {HAMAKER: [1e-18]}, path)
    other = tmp_path / "other.h5"
    other.write_bytes(b"mine")
    with pytest.raises(FileError, match="is not an HDF5 file"):
        flocsim.sweep(study, {HAMAKER: [1e-18]}, other, mode="resume")
    assert path.read_bytes() == before and other.read_bytes() == b"mine"


def test_a_damaged_sweep_is_refused_in_a_line(swept, tmp_path):
    _, path = swept
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "bad.h5").write_bytes(bytes(data))
    with pytest.raises(FileError, match="checksum is wrong"):
        flocsim.open(tmp_path / "bad.h5")


def test_a_grid_has_an_axis_for_each_key(tmp_path):
    study = flocsim.Study(write_small(tmp_path)).with_(ONE)
    over = {HAMAKER: ["10 zJ", 1e-19], "forces.contact.friction": [0.1, 0.2, 0.3]}
    parts = planned(study, over, tmp_path / "x.h5")
    assert len(parts) == 6 and list(parts)[5].name == "0005.h5"
    found = swept_keys(over, [part.config for part in parts.values()])
    assert found["hamaker"].values == [1e-20, 1e-19] and found["hamaker"].unit == "J"
    assert found["friction"].values == [0.1, 0.2, 0.3]
    words = {"fluid.buoyancy": [False], "scene.receiver": ["free", "fixed"]}
    parts = planned(study, words, tmp_path / "y.h5").values()
    found = swept_keys(words, [part.config for part in parts])
    assert found["receiver"].values == ["free", "fixed"]


@pytest.mark.parametrize(
    ("over", "text"),
    [
        ({}, "at least one key"),
        ({HAMAKER: []}, "at least one key"),
        ({"seed": [1, 2]}, "cannot be swept"),
        ({"output.file": ["a"]}, "cannot be swept"),
        ({HAMAKER: ["5 kg"]}, "hamaker must be"),
        ({HAMAKER: [1e-20, "1e-20 J"]}, "same value twice"),
    ],
)
def test_what_cannot_be_swept_is_told(tmp_path, over, text):
    study = flocsim.Study(write_small(tmp_path)).with_(ONE)
    with pytest.raises(UsageError, match=text):
        parts = planned(study, over, tmp_path / "x.h5")
        swept_keys(over, [part.config for part in parts.values()])


def test_values_are_parted_by_commas_outside_quotes_and_brackets():
    assert values_of("a.b=1e-20,2") == ("a.b", [1e-20, 2])
    assert values_of("a='1, 2',[3, 4]") == ("a", ["1, 2", [3, 4]])
    assert values_of("a=10 N/m,20 N/m") == ("a", ["10 N/m", "20 N/m"])
    with pytest.raises(UsageError, match="write KEY=VALUE"):
        values_of("a=")


def test_a_dry_run_prints_commands_for_a_cluster(tmp_path, capsys):
    path = write_small(tmp_path)
    assert main(["sweep", str(path), "--over", f"{HAMAKER}='5 zJ',1e-19", "--dry-run"]) == 0
    first, second = map(shlex.split, capsys.readouterr().out.splitlines())
    assert first[:3] == ["flocsim", "ensemble", str(path)]
    assert first[3:5] == ["--set", f'{HAMAKER}="5 zJ"']
    assert second[-2:] == ["-o", "small-sweep.parts/0001.h5"]


def test_info_and_plot_know_the_joined_file(swept, capsys, tmp_path):
    _, path = swept
    assert main(["info", str(path)]) == 0
    told = capsys.readouterr().out
    assert f"{HAMAKER} (as hamaker)  1e-18, 1e-20 J" in told
    assert [line.split()[:5] for line in told.splitlines()[-2:]] == [
        [value, "I", "1", "0", "2"] for value in ("1e-18", "1e-20")
    ]
    assert main(["plot", str(path), "--output-dir", str(tmp_path)]) == 0
    assert (tmp_path / "all-sweep.png").stat().st_size > 1000
