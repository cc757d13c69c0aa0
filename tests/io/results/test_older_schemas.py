"""Results files that earlier versions wrote are opened, described, drawn and compared.

tests/data has one of each schema version, of one study, written by the flocsim of its time.
"""

import gzip
import re
from pathlib import Path

import h5py
import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.ensembles.pairs import contents
from flocsim.errors import FileError, UsageError
from flocsim.io.results import file as results_file
from flocsim.io.results.file import read_overview, read_results, read_row
from flocsim.io.results.layout import SCHEMA_VERSION
from flocsim.io.results.schema import REPLICATES, TABLE
from flocsim.io.seals import seal
from tests.helpers.results_files import write_results
from tests.helpers.sealed import read_sealed
from tests.helpers.synthetic_results import make_results
from tests.helpers.tiers import rest_slow

STORED = Path(__file__).parents[2] / "data"
EVERY = (*results_file.VERSIONS, SCHEMA_VERSION)
ENDS = EVERY[0], EVERY[-1]


@pytest.fixture
def stored(tmp_path, monkeypatch):
    """Unpack the file of a version, as r2.h5; the current folder."""
    monkeypatch.chdir(tmp_path)

    def unpack(version):
        path = tmp_path / f"r{version}.h5"
        path.write_bytes(gzip.decompress((STORED / f"results_{version}.h5.gz").read_bytes()))
        return path

    return unpack


def test_every_version_has_its_migration_and_its_file():
    """Whoever changes the schema says what came with it, and stores a file of before."""
    assert list(results_file.ADDED) == list(range(3, SCHEMA_VERSION + 1))
    for version in EVERY:
        assert (STORED / f"results_{version}.h5.gz").stat().st_size < 50_000


def test_what_is_written_now_is_what_the_file_of_this_version_has(stored, tmp_path):
    """A column more, or another type, is another version."""
    write_results(tmp_path / "now.h5", make_results())
    found = []
    for path in (stored(SCHEMA_VERSION), tmp_path / "now.h5"):
        with h5py.File(path, "r") as file:
            found.append({
                f"{group}/{name}": (each.dtype.str, each.ndim, each.attrs["units"])
                for group in file if group != "run" for name, each in file[group].items()
            })  # fmt: skip
    assert {k: v for k, v in found[0].items() if k in found[1]} == {
        k: v for k, v in found[1].items() if not k.startswith("flocs/")
    }
    assert found[0].keys() - found[1].keys() <= {
        each
        for each in found[0]
        if each.startswith(("pooled/", "differences/", "numerics/", "flocs/"))
    }


@pytest.mark.parametrize("version", rest_slow(EVERY, lambda version: version in ENDS))
def test_its_numbers_are_those_that_it_holds_and_the_rest_is_blank(stored, version):
    path = stored(version)
    found = read_results(path)
    again = read_overview(path)
    assert again.totals.count == 64 and again.count == 8
    with h5py.File(path, "r") as file:
        assert file.attrs["schema_version"] == version
        groups = {
            "replicates": (found.replicates, REPLICATES),
            "probabilities": (found.probabilities, TABLE),
        }
        for group, (arrays, schema) in groups.items():
            held = set(file[group]) & set(schema)
            assert set(schema) - held == set(schema) & results_file.lacking(version, group)
            for name in held:
                np.testing.assert_array_equal(arrays[name], file[group][name][()])
    assert found.probabilities["n_bond"].sum() == (found.replicates["bond"] != 255).sum()
    if version < 4:
        assert np.isnan(found.replicates["D_0"]).all() and np.isnan(found.radii["r_i"]).all()
    if version < 3:
        assert np.isnan(found.probabilities["pr_sticks"]).all()
        assert not found.probabilities["n_checked"].any()
    assert read_row(path, (1, 1, 0, 3))["steps"] == found.replicates["steps"][1, 1, 0, 3]


@pytest.mark.parametrize("version", rest_slow(EVERY, lambda version: version == ENDS[0]))
def test_commands_read_it(stored, version, monkeypatch, capsys):
    stored(version)
    few = {name: contents.FIGURES[name] for name in ("4",)}
    monkeypatch.setattr(contents, "FIGURES", few)
    name = f"r{version}.h5"
    for command in (
        ["info", name],
        ["info", name, "--config"],
        ["plot", name],
        ["report", name],
    ):
        assert main(command) == 0, command
    said = capsys.readouterr()
    assert "Traceback" not in said.err
    opened = flocsim.open(name)
    assert opened.types == ("I", "III") and "Pr[inside]" in opened.table()
    with pytest.raises(UsageError, match="cannot be reproduced: "):
        opened.replicate(0)


@pytest.mark.parametrize("version", rest_slow(results_file.VERSIONS, lambda version: False))
def test_it_is_compared_with_a_file_of_now_by_its_rows(stored, version, capsys):
    stored(version), stored(SCHEMA_VERSION)
    assert main(["compare", f"r{version}.h5", f"r{SCHEMA_VERSION}.h5"]) == 0
    assert "paired" in capsys.readouterr().out
    pytest.importorskip("xarray")
    assert flocsim.open(f"r{version}.h5").to_xarray("replicates").sizes["replicate"] == 8


@pytest.mark.parametrize("version", rest_slow(EVERY, lambda version: version in ENDS))
def test_it_is_not_extended_and_one_line_says_what_differs(stored, version, capsys, tmp_path):
    path = stored(version)
    before = path.read_bytes()
    Path("study.toml").write_text(str(flocsim.open(path).run["config"]), "utf-8")
    assert main(["ensemble", "study.toml", "-o", path.name, "--resume", "--quiet"]) == 2
    [line] = [each for each in capsys.readouterr().err.splitlines() if "warning: " not in each]
    said = (
        "belongs to another study: "
        if version == SCHEMA_VERSION
        else f"of schema version {version}: "
    )
    assert re.search(said, line), line
    assert path.read_bytes() == before and not Path(f"{path.name}.journal").exists()


@pytest.mark.parametrize(
    "version", rest_slow(results_file.VERSIONS, lambda version: version == ENDS[0])
)
def test_a_damaged_one_is_refused(stored, version):
    path = stored(version)
    with h5py.File(path, "r") as file:
        offset = file["replicates/outcome"].id.get_offset()
    data = bytearray(path.read_bytes())
    data[offset] ^= 1
    path.write_bytes(data)
    with pytest.raises(FileError, match="is damaged"):
        read_results(path)
    path.write_bytes(gzip.decompress((STORED / f"results_{version}.h5.gz").read_bytes()))
    image = path.with_name("image.h5")
    image.write_bytes(read_sealed(path))
    with h5py.File(image, "r+") as file:
        file["replicates/outcome"][0, 0, 0, 0] = 77
    path.write_bytes(seal(image.read_bytes()))
    with pytest.raises(FileError, match="replicates/outcome are impossible"):
        read_results(path)
    with h5py.File(image, "r+") as file:
        file["replicates/extra"] = 1
    path.write_bytes(seal(image.read_bytes()))
    with pytest.raises(FileError, match="unknown dataset replicates/extra"):
        read_results(path)


def test_no_file_says_itself_that_it_was_older(tmp_path):
    """It would get out of the checks of columns that older ones lack."""
    write_results(tmp_path / "r.h5", make_results())
    image = tmp_path / "image.h5"
    image.write_bytes(read_sealed(tmp_path / "r.h5"))
    with h5py.File(image, "r+") as file:
        file.attrs[results_file.WRITTEN_AS] = 2
    (tmp_path / "r.h5").write_bytes(seal(image.read_bytes()))
    with pytest.raises(FileError, match="which no file of flocsim has"):
        read_results(tmp_path / "r.h5")
