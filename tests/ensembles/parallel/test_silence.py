"""A rank that falls silent ends the job in a stated time."""

import contextlib
import os
import signal
import subprocess

import pytest

from flocsim.ensembles.parallel import communicator
from flocsim.ensembles.parallel.communicator import SILENCE_LIMIT, Silence, SilentRank
from tests.helpers.jobs import alive, descendants, is_python
from tests.helpers.journals import rows_in
from tests.helpers.small_study import command, mpirun, write_small
from tests.helpers.waiting import PATIENCE, wait_until


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands until it is set."""
    now = [100.0]
    monkeypatch.setattr(communicator.time, "monotonic", lambda: now[0])
    return now


def test_the_silent_rank_is_named(clock):
    silence = Silence([1, 2])
    while silence.seconds[2] < SILENCE_LIMIT:
        clock[0] += 5.0
        silence.seconds[1] = 0.0
        silence.look()
    clock[0] += 1.0
    said = rf"rank 2 has been silent for {SILENCE_LIMIT:g} s .* with --resume"
    with pytest.raises(SilentRank, match=said):
        silence.look()


def test_time_in_which_rank_0_was_suspended_itself_does_not_count(clock):
    silence = Silence([1])
    for _ in range(5):
        clock[0] += 3600.0
        silence.look()
    assert silence.seconds[1] == 50.0


@pytest.mark.slow
@pytest.mark.parametrize(("ranks", "words"), [(3, []), (None, ["--jobs", "2"])])
def test_a_frozen_rank_ends_the_job_which_keeps_its_rows(tmp_path, ranks, words):
    if ranks:
        mpirun()
    write_small(tmp_path, vertices="[1]", replicates="200000")
    journal = tmp_path / "small.h5.journal"
    with open(tmp_path / "errors.txt", "w") as errors:
        job = subprocess.Popen(
            command("small.toml", *words, ranks=ranks), cwd=tmp_path, stdout=subprocess.DEVNULL,
            stderr=errors, start_new_session=True,
            env=os.environ | {"FLOCSIM_SILENCE_LIMIT": "20"},
        )  # fmt: skip
    try:
        assert wait_until(lambda: rows_in(journal) > 0 or job.poll() is not None)
        assert job.poll() is None
        pids = sorted(pid for pid in descendants(job.pid) if is_python(pid))
        os.kill(pids[1], signal.SIGSTOP)
        kept = rows_in(journal)
        assert job.wait(timeout=PATIENCE) == 75
        assert wait_until(lambda: not list(alive(pids)))
        said = (tmp_path / "errors.txt").read_text()
        assert "rank 1 has been silent for 20 s" in said
        assert "Traceback" not in said
        assert rows_in(journal) >= kept > 0
    finally:
        for pid in alive(descendants(job.pid)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        job.wait()
