"""Stopped, damaged, extended: what exists is used, what is missing is run, nothing else is."""

import contextlib
import json
import shutil

import numpy as np
import pytest

from flocsim.ensembles.parallel.communicator import Communicator, SharedError
from flocsim.ensembles.parallel.schedule import TooManyFailures
from flocsim.ensembles.runner import run_to_file
from flocsim.ensembles.storage import identity
from flocsim.ensembles.storage.resume import NEW, RESTART, RESUME
from flocsim.ensembles.study import Study
from flocsim.errors import FileError, UsageError
from flocsim.io.journal import DAMAGED, ROWS, SESSION
from flocsim.io.results.file import read_results
from flocsim.process import INTERRUPTION, STOPPED
from tests.helpers.journals import change, records_in
from tests.helpers.results_files import same_data
from tests.helpers.small_study import small_config, write_star_library
from tests.helpers.study_state import after_chunks
from tests.helpers.tiers import rest_slow

SPHERES = {"shapes": {"vertices": [1]}, "replicates": 20}


def go_on(folder, mode=RESUME, overrides=None, **more):
    """Run the study of spheres in the folder; how it Ended."""
    config = small_config(folder, SPHERES | (overrides or {}) | more)
    return run_to_file(config, Communicator(), folder / "r.h5", mode)


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """The journal of a study that was stopped after 30 of its 80 replicates."""
    folder = tmp_path_factory.mktemp("left")
    with after_chunks(30):
        ended = go_on(folder, NEW)
    kept = f"30 finished replicates saved in {folder / 'r.h5.journal'}"
    assert (ended.code, INTERRUPTION.kept()) == (STOPPED, kept)
    assert [path.name for path in folder.glob("r.h5*")] == ["r.h5.journal"]
    return folder / "r.h5.journal"


@pytest.fixture
def stopped(tmp_path, left):
    """A folder with that journal."""
    shutil.copy(left, tmp_path)
    return tmp_path


def test_a_stopped_run_goes_on_to_the_same_bytes(stopped, whole):
    ended = go_on(stopped)
    assert (ended.code, ended.computed) == (0, 50)
    assert same_data(stopped / "r.h5", whole) == []
    assert not (stopped / "r.h5.journal").exists()
    run = read_results(stopped / "r.h5").run
    assert (run["sessions"], run["computed"]) == (2, 50)


def test_it_may_be_stopped_as_often_as_one_likes(tmp_path, whole):
    for _ in range(3):
        with after_chunks(26):
            go_on(tmp_path)
    assert go_on(tmp_path).computed == 2
    assert same_data(tmp_path / "r.h5", whole) == []


def test_an_unfinished_run_is_in_the_way_of_a_new_one(stopped, whole):
    with pytest.raises(
        SharedError, match=r"r.h5.journal holds an unfinished run: continue it with --resume"
    ):
        go_on(stopped, NEW)
    before = (stopped / "r.h5.journal").read_bytes()
    assert go_on(stopped, RESTART).computed == 80
    assert same_data(stopped / "r.h5", whole) == []
    # It is put aside, not thrown away.
    assert (stopped / "r.h5.1.journal").read_bytes() == before
    (stopped / "r.h5").unlink()
    (stopped / "r.h5.1.journal").rename(stopped / "r.h5.journal")
    assert go_on(stopped).computed == 50


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seed": 2}, "seed is 1 in the file, 2 now"),
        ({"forces": {"contact": {"k_n": 30.0}}}, "forces.contact.k_n is 20.0 in the file, 30.0"),
        ({"forces": {"gravity": {"g": 9.8}}}, "forces.gravity.g is 9.81 in the file, 9.8 now"),
        ({"integrator": {"tolerance": 1e-8}}, "integrator.tolerance is 1e-09 in the file, 1e-08"),
        ({"scene": {"receiver": "fixed"}}, 'scene.receiver is "free" in the file, "fixed" now'),
        ({"shapes": {"vertices": [1], "radius": 5e-7}}, "shapes.radius is 1e-06 in the file"),
    ],
)
@pytest.mark.parametrize("finished", [False, True])
def test_another_study_is_refused(request, tmp_path, whole, change, said, finished):
    folder = tmp_path if finished else request.getfixturevalue("stopped")
    if finished:
        (folder / "r.h5").write_bytes(whole.read_bytes())
    before = {path: path.read_bytes() for path in folder.glob("r.h5*")}
    with pytest.raises(SharedError, match="belongs to another study") as caught:
        go_on(folder, overrides=change)
    assert isinstance(caught.value.args[0], UsageError)
    assert said in str(caught.value)
    assert {path: path.read_bytes() for path in folder.glob("r.h5*")} == before


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("code", "flocsim's own code has changed"),
        ("arithmetic", "rounds sin, exp and similar functions differently"),
        ("kernels", "the compiled code for .* has changed"),
    ],
)
def test_rows_of_other_physics_or_another_processor_are_refused(stopped, name, said):
    path = stopped / "r.h5.journal"
    about = json.loads(records_in(path, SESSION)[0]["about"])
    changed = {each: "other" for each in about["identity"] if each.startswith(name)}
    about["identity"].update(changed)
    change(path, SESSION, 1, about=json.dumps(about))
    with pytest.raises(SharedError, match=said):
        go_on(stopped)


def test_what_the_user_has_changed_is_said_before_what_follows_from_it():
    here, there = ({"arithmetic": each, "flocs.4": each, "seed": 1} for each in "ab")
    assert "another kind of processor" in identity.differences(here, there)[0]
    assert identity.differences(here, there | {"seed": 2}) == ["seed is 1 in the file, 2 now"]


def test_the_digest_of_the_arithmetic_sees_last_digits(monkeypatch):
    digest = identity.arithmetic_digest.__wrapped__  # a process looks once
    before = digest()
    assert digest() == before
    monkeypatch.setattr(np, "exp", lambda x, exp=np.exp: np.nextafter(exp(x), np.inf))
    assert digest() != before


def test_other_flocs_are_refused(tmp_path):
    shapes = {"vertices": [4], "source": "library", "file": "stars.h5"}
    for mode, ratio in ((NEW, 8.0), (RESUME, 8.1)):
        (tmp_path / "stars.h5").unlink(missing_ok=True)
        write_star_library(tmp_path / "stars.h5", ratios=(ratio, 16.0, 24.0))
        config = small_config(tmp_path, {"shapes": shapes, "replicates": 1})
        if mode == NEW:
            run_to_file(config, Communicator(), tmp_path / "r.h5", mode)
    with pytest.raises(SharedError, match=r"the flocs with .* have changed"):
        run_to_file(config, Communicator(), tmp_path / "r.h5", mode)


def test_a_damaged_chunk_is_told_and_run_again(stopped, whole, capsys):
    path = stopped / "r.h5.journal"
    chunk = records_in(path)[-1]
    data = bytearray(path.read_bytes())
    data[data.index(chunk["data"][:200]) + 100] ^= 4
    path.write_bytes(data)
    assert go_on(stopped).computed == 51
    said = capsys.readouterr().err
    assert "r.h5.journal: 1 damaged or missing record (" in said
    assert "29 intact replicates will be used" in said
    assert same_data(stopped / "r.h5", whole) == []


@pytest.mark.parametrize("share", rest_slow([0.0, 0.3, 0.5, 0.99], lambda share: share == 0.5))
def test_a_journal_that_was_cut_is_kept_and_the_study_begins_anew(stopped, whole, share, capsys):
    path = stopped / "r.h5.journal"
    data = path.read_bytes()[: int(share * path.stat().st_size)]
    path.write_bytes(data)
    if share > 0.0:
        with pytest.raises(SharedError, match=DAMAGED):
            go_on(stopped)
        assert path.read_bytes() == data
    assert go_on(stopped, RESTART).computed == 80
    assert same_data(stopped / "r.h5", whole) == []
    kept = stopped / "r.h5.1.journal"
    assert (kept.read_bytes() == data) if share > 0.0 else not kept.exists()


def test_a_lost_log_is_reported_and_what_it_had_is_run_again(tmp_path, whole, capsys):
    running, killed = tmp_path / "running", tmp_path / "killed"
    running.mkdir()
    with after_chunks(30, lambda state: shutil.copytree(running, killed)):
        go_on(running, NEW)
    (killed / "r.h5.journal-wal").unlink()
    assert go_on(killed).computed > 50
    assert "missing record" in capsys.readouterr().err
    assert same_data(killed / "r.h5", whole) == []


def test_rows_of_another_study_in_the_journal_are_computed_again(stopped, whole, capsys):
    path = stopped / "r.h5.journal"
    for each in records_in(path):
        change(path, ROWS, each["id"], identity="other")
    assert go_on(stopped).computed == 80
    assert "30 damaged or missing records" in capsys.readouterr().err
    assert same_data(stopped / "r.h5", whole) == []


def test_what_is_no_journal_is_not_written_over(tmp_path):
    (tmp_path / "r.h5.journal").write_text("Dear diary,\n")
    with pytest.raises(SharedError, match="no journal of flocsim") as caught:
        go_on(tmp_path)
    assert isinstance(caught.value.args[0], FileError)
    assert (tmp_path / "r.h5.journal").read_text() == "Dear diary,\n"


def test_a_refused_start_leaves_no_journal_behind(tmp_path, whole):
    (tmp_path / "r.h5").write_bytes(whole.read_bytes())
    with pytest.raises(SharedError):
        go_on(tmp_path, seed=9)
    assert not (tmp_path / "r.h5.journal").exists()


def extended(tmp_path, whole, **more):
    """(how many were run, results) of a finished study that is extended, against a fresh one."""
    (tmp_path / "r.h5").write_bytes(whole.read_bytes())
    ended = go_on(tmp_path, overrides=more)
    fresh = tmp_path / "fresh"
    fresh.mkdir()
    go_on(fresh, NEW, overrides=more)
    assert same_data(tmp_path / "r.h5", fresh / "r.h5") == []
    return ended.computed


@pytest.mark.parametrize(
    ("more", "computed"),
    rest_slow(
        [
            ({"replicates": 25}, 20),
            ({"scene": {"types": ["I", "III"], "delta": [0.0, 0.5, 1.0]}}, 40),
            ({"shapes": {"vertices": [1, 4]}}, 80),
        ],
        lambda more, computed: computed == 40,
    ),
)
def test_a_finished_study_is_extended(tmp_path, whole, more, computed):
    assert extended(tmp_path, whole, **more) == computed


def test_a_finished_study_stays_as_it_is(tmp_path, whole):
    (tmp_path / "r.h5").write_bytes(whole.read_bytes())
    ended = go_on(tmp_path)
    assert (ended.computed, ended.results.count) == (0, 20)
    assert (tmp_path / "r.h5").read_bytes() == whole.read_bytes()
    assert not (tmp_path / "r.h5.journal").exists()


def test_a_results_file_tells_of_all_runs_that_it_took(tmp_path, whole):
    (tmp_path / "r.h5").write_bytes(whole.read_bytes())
    go_on(tmp_path, replicates=21)
    go_on(tmp_path, replicates=22)
    run = read_results(tmp_path / "r.h5").run
    assert run["sessions"] == 3
    first, before = json.loads(run["history"])[0], read_results(whole).run
    assert first == {name: before[name] for name in ("date", "command", "processor")}


@contextlib.contextmanager
def failing(*replicates):
    """Let these replicates raise."""
    original = Study.draw

    def draw(study, condition, vertices, share, replicate, *more):
        if replicate in replicates:
            raise ZeroDivisionError("in a force of one's own")
        return original(study, condition, vertices, share, replicate, *more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Study, "draw", draw)
        yield


def test_an_exception_costs_one_replicate_and_says_how_to_run_it_again(tmp_path, whole):
    with failing(7):
        go_on(tmp_path, NEW)
    results = read_results(tmp_path / "r.h5")
    assert np.all(results.probabilities["n_failed"] == 1)
    assert np.all(results.replicates["outcome"][..., 7] == 6)
    assert results.failures[results.replicates["failure"][0, 0, 0, 7]] == "exception"
    for name in ("angle_i", "outcome", "t_end"):
        others = np.delete(results.replicates[name], 7, axis=-1)
        expected = np.delete(read_results(whole).replicates[name], 7, axis=-1)
        np.testing.assert_array_equal(others, expected)
    assert '"why": "ZeroDivisionError: in a force of one\'s own"' in results.run["failed"]


def test_too_many_failures_end_the_study_with_a_command_to_look_at_one(tmp_path):
    with failing(*range(3, 20)), pytest.raises(SharedError, match="ZeroDiv") as caught:
        go_on(tmp_path, NEW)
    assert isinstance(caught.value.args[0], TooManyFailures)
    assert "flocsim trajectory CONFIG --type I --vertices 1 --delta 0.0 --replicate 3" in str(
        caught.value
    )
    assert caught.value.args[0].exit_code == 70
    # What was computed is still there, and a larger share may be allowed.
    assert go_on(tmp_path, overrides={"stop": {"failed": 0.5}}).computed < 77
