"""Processes that a script or a command starts end with it, and leave what can be gone on with."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import flocsim
from tests.helpers.small_study import command, run_command, write_small

ENV = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[3])}
SCRIPT = """\
import flocsim
if __name__ == "__main__":
    flocsim.Study("small.toml").run({jobs}, output="run.h5", mode="resume")
"""
SWEEP = ["small.toml", "--over", "forces.van_der_waals.hamaker=1e-20,1e-19", "-o", "sweep.h5"]


def members(group):
    """Numbers of the processes of a group that still run."""
    said = subprocess.run(["ps", "-eo", "pid,pgid,stat"], capture_output=True, text=True).stdout
    rows = [line.split() for line in said.splitlines()[1:]]
    return [int(pid) for pid, of, state in rows if int(of) == group and state[0] != "Z"]


def until(condition, seconds):
    """Whether a condition comes to hold within so long."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return condition()


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("what", ["script", "sweep"])
def test_nobody_outlives_a_kill_and_the_run_goes_on(tmp_path, what, jobs):
    write_small(tmp_path, replicates=30_000, vertices="[1]")
    (tmp_path / "run.py").write_text(SCRIPT.format(jobs=jobs))
    words, journal = [sys.executable, "run.py"], tmp_path / "run.h5.journal"
    if what == "sweep":
        words = command("sweep", *SWEEP, "--jobs", jobs, "--resume", module="flocsim")
        journal = tmp_path / "sweep.parts" / "0000.h5.journal"
    killed_after(words, tmp_path, journal)
    killed_after(words, tmp_path, journal)  # where the first has stopped


def killed_after(words, folder, journal):
    """Start a command, kill it once it has written to its journal; nobody is left soon after."""
    size = journal.stat().st_size if journal.exists() else 0
    running = subprocess.Popen(words, cwd=folder, env=ENV, start_new_session=True)
    try:
        grown = until(lambda: journal.exists() and journal.stat().st_size > size + 5000, 120)
        assert grown and running.poll() is None
        running.kill()
        running.wait()
        assert until(lambda: not members(running.pid), 3.0)
    finally:
        for pid in members(running.pid):
            os.kill(pid, signal.SIGKILL)


@pytest.mark.slow
def test_what_is_no_study_is_done_by_one_rank(tmp_path):
    study = flocsim.Study(write_small(tmp_path, vertices="[1]", replicates=4))
    study.run(output=tmp_path / "r.h5")
    words = ["info", "r.h5"]
    done = subprocess.run(
        command(*words, ranks=2, module="flocsim"), cwd=tmp_path, env=ENV, capture_output=True,
        text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    alone = run_command(tmp_path, *words, module="flocsim")
    assert done.stdout == alone.stdout
    assert done.stderr.count("is the work of one rank") == 1
