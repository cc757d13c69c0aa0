"""Fewer replicates, types, N or δ than a file or a journal holds: what is there stays there."""

import os
import shutil
import threading
import time

import pytest

from flocsim.ensembles.parallel.communicator import SharedError
from flocsim.ensembles.storage.resume import NEW, RESTART, RESUME, claim
from flocsim.errors import FileError, UsageError
from flocsim.io import journal as locked_file
from flocsim.io.journal import SESSION, Journal
from flocsim.io.results.file import read_results
from flocsim.process import INTERRUPTION, STOPPED
from tests.ensembles.storage.test_resume import go_on
from tests.helpers.journals import leave, records_in, rows_in
from tests.helpers.results_files import same_data
from tests.helpers.small_study import problems
from tests.helpers.study_state import after_chunks
from tests.helpers.tiers import rest_slow

FEWER = [
    {"replicates": 12},
    {"scene": {"delta": [1.0]}},
    {"scene": {"types": ["III"], "delta": [1.0, 0.0]}, "replicates": 3},
]


@pytest.fixture
def finished(tmp_path, whole):
    """A folder with these results."""
    (tmp_path / "r.h5").write_bytes(whole.read_bytes())
    return tmp_path


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """The journal of a study that was stopped after 50 of its 80 replicates."""
    folder = tmp_path_factory.mktemp("left")
    with after_chunks(50):
        assert go_on(folder, NEW).code == STOPPED
    return folder / "r.h5.journal"


@pytest.fixture
def stopped(tmp_path, left):
    """A folder with that journal."""
    shutil.copy(left, tmp_path)
    return tmp_path


def names(folder):
    """The files of a study."""
    return sorted(path.name for path in folder.glob("r.h5*"))


@pytest.mark.slow
@pytest.mark.parametrize("fewer", rest_slow(FEWER, lambda fewer: fewer == FEWER[0]))
def test_results_with_more_than_is_asked_for_stay_and_are_reported(finished, whole, fewer):
    ended = go_on(finished, **fewer)
    assert (ended.code, ended.computed) == (0, 0)
    assert (finished / "r.h5").read_bytes() == whole.read_bytes()
    assert names(finished) == ["r.h5"]
    expected = read_results(whole).probabilities
    assert ended.results.probabilities.keys() == expected.keys()
    for name, values in expected.items():
        assert ended.results.probabilities[name].tobytes() == values.tobytes()


@pytest.mark.parametrize(
    ("mixed", "said"),
    [
        ({"scene": {"delta": [1.0, 0.5]}}, "2 more conditions"),
        ({"scene": {"delta": [1.0]}, "replicates": 30}, "2 more conditions"),
        ({"scene": {"delta": [0.0, 0.5, 1.0]}, "replicates": 10}, "20 replicates of each"),
        (
            {"scene": {"types": ["I", "III", "II"], "delta": [0.0]}, "replicates": 3},
            "2 more conditions",
        ),
    ],
)
def test_results_that_have_more_of_one_thing_and_less_of_another_are_refused(
    finished, whole, mixed, said
):
    with pytest.raises(SharedError, match="has rows that this run does not ask for") as caught:
        go_on(finished, **mixed)
    assert isinstance(caught.value.args[0], UsageError)
    assert said in str(caught.value)
    assert (finished / "r.h5").read_bytes() == whole.read_bytes()
    assert names(finished) == ["r.h5"]


@pytest.mark.parametrize("fewer", rest_slow(FEWER, lambda fewer: fewer == FEWER[-1]))
def test_a_journal_with_more_than_is_asked_for_stays(
    stopped, whole, fewer, tmp_path_factory, capsys
):
    before = rows_in(stopped / "r.h5.journal")
    ended = go_on(stopped, **fewer)
    assert ended.code == 0
    assert "r.h5.journal has more rows than this run needs, and is kept" in capsys.readouterr().err
    assert rows_in(stopped / "r.h5.journal") == before + ended.computed
    alone = tmp_path_factory.mktemp("alone")
    go_on(alone, NEW, **fewer)
    assert same_data(stopped / "r.h5", alone / "r.h5") == []
    # Asked for all again, nothing is computed twice, and the journal has done its work.
    assert ended.computed + go_on(stopped).computed == 30
    assert same_data(stopped / "r.h5", whole) == []
    assert names(stopped) == ["r.h5"]


RULE = {"half_width": 0.5, "least": 4}


def test_a_rule_that_would_have_ended_sooner_takes_no_rows_away(finished, whole):
    ended = go_on(finished, replicates=100, stop=RULE)
    assert (ended.computed, ended.results.count) == (0, 20)
    assert (finished / "r.h5").read_bytes() == whole.read_bytes()


def test_a_rule_that_ends_an_extended_study_keeps_the_replicates_that_are_there(finished):
    ended = go_on(finished, replicates=100, stop=RULE, scene={"delta": [0.0, 0.5, 1.0]})
    assert (ended.computed, ended.results.count) == (40, 20)


def test_a_journal_that_was_begun_without_the_rule_stays(stopped):
    before = rows_in(stopped / "r.h5.journal")
    ended = go_on(stopped, replicates=100, stop=RULE)
    assert ended.results.count < 20
    assert rows_in(stopped / "r.h5.journal") == before + ended.computed


def test_what_was_computed_beyond_the_end_of_the_same_rule_goes_with_the_journal(tmp_path):
    config = {"replicates": 100, "stop": RULE}
    with after_chunks(10):
        go_on(tmp_path, NEW, **config)
    ended = go_on(tmp_path, **config)
    assert ended.results.count < 20
    assert names(tmp_path) == ["r.h5"]


def test_a_journal_beside_results_of_another_study_replaces_them_not(stopped, whole):
    go_on(stopped.parent / stopped.name, RESTART, seed=9)
    others = (stopped / "r.h5").read_bytes()
    (stopped / "r.h5.1.journal").rename(stopped / "r.h5.journal")
    with pytest.raises(SharedError, match=r"r.h5 belongs to another study: seed is 9"):
        go_on(stopped)
    assert (stopped / "r.h5").read_bytes() == others
    assert rows_in(stopped / "r.h5.journal") == 50


@pytest.mark.parametrize("mode", rest_slow([NEW, RESUME, RESTART], lambda mode: mode == RESUME))
def test_a_journal_without_rows_is_in_nobodys_way(tmp_path, left, whole, mode):
    # As a kill leaves it while the kernels are compiled, of another study even.
    journal = Journal(tmp_path / "r.h5.journal")
    about = records_in(left, SESSION)[0]["about"]
    journal.add(SESSION, about.replace('"seed": 1', '"seed": 7'))
    leave(journal)
    assert "r.h5.journal" in names(tmp_path)
    assert go_on(tmp_path, mode).computed == 80
    assert same_data(tmp_path / "r.h5", whole) == []
    assert names(tmp_path) == ["r.h5"]


def test_a_run_stopped_before_its_first_replicate_promises_none(tmp_path, stopping):
    ended = go_on(tmp_path, NEW)
    assert (ended.code, INTERRUPTION.kept()) == (STOPPED, "no replicate was finished")
    assert names(tmp_path) == []


def test_what_is_promised_counts_the_journal_and_not_the_results(finished):
    with after_chunks(5):
        ended = go_on(finished, replicates=30)
    journal = finished / "r.h5.journal"
    kept = f"5 finished replicates saved in {journal}"
    assert (ended.code, INTERRUPTION.kept()) == (STOPPED, kept)
    assert rows_in(journal) == 5


@pytest.mark.parametrize("mode", [NEW, RESUME, RESTART])
def test_a_job_that_waited_for_another_looks_at_its_results_anew(finished, whole, mode):
    path = finished / "r.h5"
    path.rename(finished / "ready.h5")
    first = Journal(finished / "r.h5.journal")

    def finish():
        time.sleep(0.3)
        os.rename(finished / "ready.h5", path)
        first.remove()

    ending = threading.Thread(target=finish)
    ending.start()
    try:
        if mode == RESUME:
            assert go_on(finished, mode).computed == 0
        else:
            with pytest.raises(SharedError, match="already exists and is left as it is") as caught:
                go_on(finished, mode)
            assert caught.value.args[0].exit_code == 2
    finally:
        ending.join()
    assert path.read_bytes() == whole.read_bytes()
    assert names(finished) == ["r.h5"]


@pytest.mark.parametrize("mode", [NEW, RESUME, RESTART])
def test_a_running_job_is_not_disturbed(stopped, at_once, mode):
    path = stopped / "r.h5.journal"
    before = records_in(path)
    running = Journal(path)
    with pytest.raises(SharedError, match="is being written by another job"):
        go_on(stopped, mode)
    running.release()
    assert records_in(path) == before


def test_the_lock_is_held_to_the_end(tmp_path, at_once):
    busy = []

    def probe(state):
        with pytest.raises(FileError, match="another job"):
            claim(tmp_path / "r.h5", RESUME)
        busy.append(True)

    with after_chunks(80, probe):
        go_on(tmp_path, NEW)
    assert busy


def test_a_file_system_without_locks_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(locked_file, "lock", lambda *words: None)
    assert go_on(tmp_path, NEW).code == 0
    [line] = problems(capsys.readouterr().err)
    assert "has no locks: make sure that no two jobs write there" in line
