"""Finished results are kept or extended, never replaced; and what else lies there is spared."""

import shutil

import pytest

from flocsim.__main__ import main
from flocsim.ensembles.parallel.communicator import Communicator, SharedError
from flocsim.ensembles.runner import run_to_file
from flocsim.ensembles.storage.resume import NEW, RESTART, RESUME
from flocsim.errors import UsageError
from flocsim.io.results.file import read_results
from tests.helpers.results_files import same_data
from tests.helpers.small_study import small_config, write_small
from tests.helpers.study_state import after_chunks
from tests.helpers.tiers import rest_slow

SPHERES = {"shapes": {"vertices": [1]}, "replicates": 4}


def go(folder, mode=NEW, overwrite=False, **more):
    """Run the study of spheres in the folder into r.h5; how it Ended."""
    config = small_config(folder, SPHERES | more)
    return run_to_file(config, Communicator(), folder / "r.h5", mode, overwrite=overwrite)


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    """Finished results."""
    folder = tmp_path_factory.mktemp("ready")
    go(folder)
    return folder / "r.h5"


@pytest.fixture
def finished(tmp_path, ready):
    """A folder with a copy of them."""
    shutil.copy(ready, tmp_path)
    return tmp_path


def results_in(folder):
    """{name: bytes} of results and journals."""
    return {path.name: path.read_bytes() for path in folder.glob("r.*")}


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("mode", [NEW, RESTART])
def test_finished_results_are_in_the_way(finished, mode, seed):
    before = results_in(finished)
    said = r"r\.h5 already exists.*--resume.*--overwrite"
    with pytest.raises(SharedError, match=said) as caught:
        go(finished, mode, seed=seed)
    assert isinstance(caught.value.args[0], UsageError)
    assert results_in(finished) == before


def test_restart_throws_no_journal_away_where_results_are_in_the_way(finished):
    (finished / "other").mkdir()
    with after_chunks(15):
        go(finished / "other")
    (finished / "other" / "r.h5.journal").rename(finished / "r.h5.journal")
    before = results_in(finished)
    assert len(before["r.h5.journal"]) > 1000
    with pytest.raises(SharedError, match="already exists"):
        go(finished, RESTART)
    assert results_in(finished) == before


def test_results_of_another_study_are_kept_under_another_name(finished, capsys):
    old = (finished / "r.h5").read_bytes()
    go(finished, overwrite=True, seed=2)
    assert (finished / "r.1.h5").read_bytes() == old
    assert read_results(finished / "r.h5").run["seed"] == 2
    assert "is kept as r.1.h5" in capsys.readouterr().err
    second = (finished / "r.h5").read_bytes()
    go(finished, RESTART, overwrite=True, seed=3)
    assert (finished / "r.2.h5").read_bytes() == second
    assert results_in(finished).keys() == {"r.h5", "r.1.h5", "r.2.h5"}


@pytest.mark.slow
def test_resume_and_overwrite_extends_what_is_of_this_study(finished):
    ended = go(finished, RESUME, overwrite=True, replicates=5)
    assert ended.computed == 4 and results_in(finished).keys() == {"r.h5"}
    # In a job that is requeued it sets the old ones aside once.
    for _ in range(2):
        go(finished, RESUME, overwrite=True, seed=2)
    assert results_in(finished).keys() == {"r.h5", "r.1.h5"}


def test_an_unfinished_run_does_not_replace_results_of_another_study(tmp_path):
    go(tmp_path, seed=2)
    other = (tmp_path / "r.h5").read_bytes()
    (tmp_path / "r.h5").unlink()
    with after_chunks(15):
        go(tmp_path)
    (tmp_path / "r.h5").write_bytes(other)
    with pytest.raises(SharedError, match=r"belongs to another study.*--overwrite"):
        go(tmp_path, RESUME)
    assert (tmp_path / "r.h5").read_bytes() == other
    assert go(tmp_path, RESUME, overwrite=True).computed == 1
    assert (tmp_path / "r.1.h5").read_bytes() == other


@pytest.mark.parametrize("mode", rest_slow([NEW, RESUME], lambda mode: mode == RESUME))
def test_what_appears_during_the_run_is_spared_and_nothing_computed_lost(ready, tmp_path, mode):
    if mode == RESUME:
        shutil.copy(ready, tmp_path)

    def appear(state):
        (tmp_path / "moving").write_bytes(b"of another program")
        (tmp_path / "moving").replace(tmp_path / "r.h5")

    said = r"r\.h5 .*(already exists|has meanwhile been written)"
    with after_chunks(1, appear), pytest.raises(SharedError, match=said):
        go(tmp_path, mode, replicates=5)
    assert (tmp_path / "r.h5").read_bytes() == b"of another program"
    (tmp_path / "r.h5").unlink()
    assert go(tmp_path, RESUME, replicates=5).computed == 0


def test_damaged_results_are_set_aside_on_request(finished, capsys):
    whole = (finished / "r.h5").read_bytes()
    damaged = bytearray(whole)
    damaged[len(whole) // 2] ^= 1
    (finished / "r.h5").write_bytes(damaged)
    with pytest.raises(SharedError, match=r"is damaged.*--overwrite keeps it"):
        go(finished, RESUME)
    assert go(finished, RESUME, overwrite=True).computed == 16
    assert (finished / "r.1.h5").read_bytes() == damaged
    (finished / "whole.h5").write_bytes(whole)
    assert same_data(finished / "r.h5", finished / "whole.h5") == []


def test_the_results_have_the_name_of_the_config(in_tmp, capsys):
    path = write_small(in_tmp, vertices="[1]", name="weather.toml")
    path.write_text(path.read_text().partition("[output]")[0])
    for folder in ("", "sub/"):
        (in_tmp / folder).mkdir(exist_ok=True)
        path = path.replace(in_tmp / folder / "weather.toml")
        assert main(["ensemble", f"{folder}weather.toml", "--quiet", "--overwrite"]) == 0
    assert {each.name for each in in_tmp.glob("*.h5")} == {"weather.h5", "weather.1.h5"}
    assert main(["ensemble", "sub/weather.toml", "-o", "sub/other.h5", "--quiet"]) == 0
    assert (in_tmp / "sub/other.h5").exists()
