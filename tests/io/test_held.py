"""What is read more than once is read of one file, whatever takes its place meanwhile."""

import os
import shutil

import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.ensembles.collision.flocs import read_flocs
from flocsim.errors import FileError
from flocsim.io import seals
from flocsim.io.results.file import read_results
from tests.helpers.results_files import write_results
from tests.helpers.small_study import SMALL, load_text, write_star_library
from tests.helpers.synthetic_results import make_results
from tests.helpers.tiers import rest_slow

CHANGED = "has changed since it was opened"
LATER = {
    "rows": lambda opened: opened.replicates,
    "xarray": lambda opened: opened.to_xarray("replicates"),
    "pandas": lambda opened: opened.to_pandas("replicates"),
    "compared": lambda opened: flocsim.compare(opened, opened),
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A results file r.h5 and another."""
    folder = tmp_path_factory.mktemp("held")
    few = {"vertices": (1, 4), "delta": (0.0, 1.0), "count": 12}
    write_results(folder / "r.h5", make_results(**few))
    write_results(folder / "other.h5", make_results(types=("I", "II"), seed=8, **few))
    return folder / "r.h5", folder / "other.h5"


@pytest.fixture
def two(written, in_tmp):
    """Copies of them in the current folder, of which the first is to be replaced by the other."""
    return tuple(shutil.copy(path, in_tmp / path.name) for path in written)


@pytest.mark.parametrize("name", LATER)
def test_an_opened_file_stays_what_was_opened(two, name):
    if name in ("xarray", "pandas"):
        pytest.importorskip(name)
    path, other = two
    opened, before = flocsim.open(path), flocsim.open(path).replicates
    shutil.copy(other, "new.h5")
    os.replace("new.h5", path)
    LATER[name](opened)
    np.testing.assert_array_equal(opened.replicates["t_end"], before["t_end"])
    assert list(flocsim.open(path).types) == ["I", "II"]


@pytest.mark.parametrize("name", LATER)
def test_a_file_that_is_copied_over_an_opened_one_is_told(two, name):
    if name in ("xarray", "pandas"):
        pytest.importorskip(name)
    opened = flocsim.open(two[0])
    shutil.copyfile(two[1], two[0])
    with pytest.raises(FileError, match=CHANGED) as caught:
        LATER[name](opened)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("look", [1, 2])
@pytest.mark.parametrize(
    "words",
    rest_slow(
        ["info r.h5", "plot r.h5 --figures 4 --overwrite", "report r.h5 --no-motion --overwrite"],
        lambda words: words.startswith("info"),
    ),
)
def test_a_command_reads_one_file(two, words, look, one_figure, monkeypatch, capsys):
    """Another takes its place between two looks: all is of the one, of the other, or refused."""
    path, other = two
    shutil.copyfile(path, "kept.h5")

    def outcome():
        code, said = main(words.split()), capsys.readouterr()
        return code, said.out, said.err, [each.read_bytes() for each in path.parent.glob("*.html")]

    one = outcome()
    shutil.copyfile(other, path)
    another = outcome()
    looks, checked = [], seals.seal_of

    def replaced(file, size):
        looks.append(file)
        if len(looks) == look:
            shutil.copyfile(other, "new.h5")
            os.replace("new.h5", path)
        return checked(file, size)

    monkeypatch.setattr(seals, "seal_of", replaced)
    shutil.copyfile("kept.h5", path)
    found = outcome()
    refused = found[0] == FileError.exit_code and CHANGED in found[2]
    assert refused or found in (one, another)


def test_a_library_is_that_of_the_config(tmp_path):
    """A config names it; when its flocs are read it may be another."""
    write_star_library(tmp_path / "shapes.h5")
    text = SMALL.replace("pool = 2", 'source = "library"\nfile = "shapes.h5"')
    text = text.replace("[1, 4, 16]", "[4]")
    config = load_text(tmp_path, text)
    assert len(read_flocs(config.shapes)) == 3
    write_star_library(tmp_path / "other.h5", ratios=(9.0, 17.0))
    os.replace(tmp_path / "other.h5", tmp_path / "shapes.h5")
    with pytest.raises(FileError, match=CHANGED):
        read_flocs(config.shapes)
    assert len(read_flocs(load_text(tmp_path, text).shapes)) == 2


def test_what_is_no_file_is_not_held(tmp_path):
    os.mkfifo(tmp_path / "pipe")  # would wait for ever
    for name in ("pipe", "nothing", "."):
        assert seals.held(tmp_path / name) == tmp_path / name
    with pytest.raises(FileError, match="could not be read"):
        read_results(seals.held(tmp_path / "nothing"))
