"""A rank that gives no sign of life ends the job in a stated time; one that is busy does not."""

import contextlib
import os
import signal
import subprocess

import attrs
import pytest

from benchmarks.faults.job import alive, descendants, is_python
from flocsim.ensembles.cli import main
from flocsim.ensembles.parallel.communicator import (
    FIRST_SIGN,
    SECONDS,
    WITHOUT_THREADS,
    Communicator,
    Heartbeat,
)
from tests.helpers.journals import rows_in
from tests.helpers.small_study import command, mpirun, problems, run_command, write_small
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE, wait_until


class Wire(Communicator):
    """Notes what is given; signs are put there by the test."""

    def __init__(self, rank, size, concurrent=True):
        super().__init__()
        self.rank, self.size, self.concurrent = rank, size, concurrent
        self.given, self.coming, self.ended_with = 0, [], None

    def beat(self, sign):
        self.given += 1

    def signs(self):
        coming, self.coming = self.coming, []
        return coming

    def abort(self, code):
        self.ended_with = code


@attrs.define
class Clock:
    now: float = 0.0

    def __call__(self):
        return self.now


def heartbeat(rank=0, size=3, seconds=6.0, **more):
    """(Heartbeat, its wire, its clock), every peer heard of."""
    wire, clock = Wire(rank, size, **more), Clock(100.0)
    beat = Heartbeat(wire, seconds, clock)
    wire.coming = [(peer, f"node{peer}, process 7".encode()) for peer in beat.silence]
    beat.turn()
    return beat, wire, clock


def pass_time(beat, clock, seconds, step=0.1, signs=()):
    """Turn after turn for so long, the named ranks giving signs."""
    until = clock.now + seconds
    while clock.now < until and beat.comm.ended_with is None:
        clock.now += step
        beat.comm.coming = [(rank, f"node{rank}, process 7".encode()) for rank in signs]
        beat.turn()


def test_a_rank_that_falls_silent_ends_the_job_and_is_named(capsys):
    beat, wire, clock = heartbeat()
    pass_time(beat, clock, 60.0, signs=(1, 2))
    assert wire.ended_with is None
    pass_time(beat, clock, 5.0, signs=(1,))
    assert wire.ended_with is None
    pass_time(beat, clock, 2.5, signs=(1,))
    assert wire.ended_with == 75
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("flocsim: rank 2 (node2, process 7) has been silent for 6 s")
    assert "continue with --resume" in line
    beat.turn()
    assert capsys.readouterr().err == ""


def test_the_others_leave_a_rank_0_that_is_silent():
    beat, wire, clock = heartbeat(rank=1)
    pass_time(beat, clock, 8.0)
    assert wire.ended_with == 75
    assert beat.words([0]).startswith("rank 0 (node0, process 7) has been silent")


def test_time_in_which_this_rank_was_stopped_itself_does_not_count():
    beat, wire, clock = heartbeat()
    for _ in range(3):
        pass_time(beat, clock, 1.0, signs=(1, 2))
        clock.now += 3600.0  # the whole job is suspended, or the machine sleeps
        beat.turn()
    assert wire.ended_with is None


def test_before_its_first_sign_a_rank_has_time_to_start():
    wire, clock = Wire(0, 2), Clock()
    beat = Heartbeat(wire, 6.0, clock)
    pass_time(beat, clock, FIRST_SIGN)
    assert wire.ended_with is None
    pass_time(beat, clock, 8.0)
    assert wire.ended_with == 75
    assert "rank 1 (of which there was no sign at all)" in beat.words([1])


def test_signs_are_given_some_times_in_the_time_and_no_more():
    beat, wire, clock = heartbeat()
    before = wire.given
    pass_time(beat, clock, 60.0, step=0.01, signs=(1, 2))
    assert 50 <= wire.given - before <= 61


def test_without_threads_in_mpi_silence_may_last_longer():
    beat, wire, clock = heartbeat(concurrent=False)
    pass_time(beat, clock, WITHOUT_THREADS * 6.0 - 1.0)
    assert wire.ended_with is None
    pass_time(beat, clock, 3.0)
    assert wire.ended_with == 75


def test_a_call_of_mpi_that_does_not_come_back_is_seen_by_the_thread():
    wire = Wire(0, 3, concurrent=False)
    beat = Heartbeat(wire, 0.05)
    beat.silence = {1: 0.0, 2: 0.0}
    wire.called, wire.calls = 2, 17
    beat.start()
    wait_until(lambda: wire.ended_with is not None)
    beat.stop()
    assert wire.ended_with == 75
    assert beat.silence[1] == 0.0


def test_a_job_of_one_and_one_without_a_time_are_not_watched():
    for wire, seconds in ((Wire(0, 1), 5.0), (Wire(0, 2), 0.0)):
        wire.watch(seconds)
        assert wire.heartbeat is None
        wire.close()


@pytest.mark.parametrize("seconds", ["-1", "nan", "inf"])
def test_the_time_is_a_number_of_seconds(seconds, capsys):
    assert main(["small.toml", f"--heartbeat={seconds}"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "--heartbeat must be 0 s or more" in line
    assert SECONDS == 300.0  # as docs/cluster.md says


@pytest.mark.parametrize(
    ("ranks", "words", "frozen"),
    rest_slow(
        [(3, [], 1), (2, [], 0), (None, ["--jobs", "2"], 1), (None, ["--jobs", "2"], 0)],
        lambda ranks, words, frozen: not ranks and frozen == 1,
    ),
)
def test_a_frozen_rank_ends_the_job_which_keeps_its_rows(tmp_path, ranks, words, frozen):
    if ranks:
        mpirun()
    write_small(tmp_path, vertices="[1]", replicates="20000")
    journal = tmp_path / "small.h5.journal"
    words = command("small.toml", "--heartbeat", "8", *words, ranks=ranks)
    with open(tmp_path / "errors.txt", "w") as errors:
        job = subprocess.Popen(
            words, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=errors, start_new_session=True
        )
    try:
        assert wait_until(lambda: (journal.exists() and journal.stat().st_size > 20_000)
                          or job.poll() is not None)  # fmt: skip
        assert job.poll() is None
        pids = sorted(pid for pid in descendants(job.pid) if is_python(pid))
        os.kill(pids[frozen], signal.SIGSTOP)
        kept = rows_in(journal)
        left = [pid for pid in pids if pid != pids[frozen]]
        assert wait_until(lambda: not list(alive(left)))
        if pids[frozen] == job.pid:
            os.kill(job.pid, signal.SIGCONT)
        assert job.wait(timeout=PATIENCE) == 75
        lines = (tmp_path / "errors.txt").read_text().splitlines()
        told = [line for line in lines if "has been silent for 8 s" in line]
        assert f"flocsim: rank {frozen} (" in told[0] and f"process {pids[frozen]})" in told[0]
        assert not any("Traceback" in line for line in lines)
        assert rows_in(journal) >= kept > 0
    finally:
        for pid in alive(descendants(job.pid)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        job.wait()


BUSY = """\
import os
import time

import attrs
from flocsim.forces import CentreForce

if "1" in map(os.environ.get, ("PMI_RANK", "OMPI_COMM_WORLD_RANK")):
    time.sleep(4.0)


@attrs.frozen
class Busy(CentreForce):
    absent = "it only costs time"

    @staticmethod
    def kernel(pair):
        return 0.0
"""


@pytest.mark.slow
def test_a_rank_that_is_busy_for_longer_is_not_taken_for_frozen(tmp_path):
    (tmp_path / "busy.py").write_text(BUSY)
    text = '[forces.busy]\nclass = "busy:Busy"\n'
    path = write_small(tmp_path, vertices="[1]")
    path.write_text(path.read_text() + text)
    done = run_command(tmp_path, "small.toml", "--heartbeat", 1, "--quiet", ranks=2)
    assert (done.returncode, problems(done.stderr)) == (0, [])
