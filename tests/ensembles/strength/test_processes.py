"""Doublets dealt to processes: every answer comes, every error does, and no process stays."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from flocsim.ensembles.strength.processes import LostProcess, dealt
from flocsim.errors import UsageError
from flocsim.io.results.strength_file import read_strengths
from tests.helpers.dealt_tasks import adding, dying, refusing, sleeping


def is_there(pid):
    """Whether a process of this number runs."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_every_task_is_answered_whoever_does_it():
    found = dealt(adding, (100,), range(7), 2)
    assert sorted(found) == [(task, 100 + task) for task in range(7)]


def test_no_more_processes_than_tasks():
    assert list(dealt(adding, (1,), [5], 8)) == [(5, 6)]


def test_an_error_there_is_an_error_here():
    with pytest.raises(UsageError, match="it is gone"):
        list(dealt(refusing, ("it is gone",), range(3), 2))


def test_a_process_that_dies_is_told():
    with pytest.raises(LostProcess, match=r"exit code 3.*--resume"):
        list(dealt(dying, (), [3], 2))


def test_no_process_outlives_what_asks_for_it():
    answers = dealt(sleeping, (), [0, 1, 2, 3], 2)
    pids = {next(answers)[1], next(answers)[1]}
    began = time.monotonic()
    answers.close()
    assert time.monotonic() - began < 5.0
    assert not any(map(is_there, pids))


STUDY = """\
preset = "si"
seed = 3
replicates = 6
[scene]
types = ["III"]
delta = [0.25]
[shapes]
vertices = [1]
pool = 2
[output]
file = "study.h5"
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A folder with a finished study of spheres, and the strengths of its six doublets."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(STUDY, "utf-8")
    for words in (["ensemble", "study.toml", "--quiet"], strength("whole.h5")):
        subprocess.run([sys.executable, "-m", "flocsim", *words], cwd=folder, env=ENV, check=True)
    return folder


ENV = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[3])}


def strength(output, *words):
    """The words of a command that tests all doublets of the study."""
    return ["strength", "study.h5", "--precision", "0.05", "-o", output, *words]


def begun(study, output, jobs):
    """The command, its first doublet done, in a group of processes of its own."""
    words = strength(output, "--jobs", str(jobs))
    running = subprocess.Popen(
        [sys.executable, "-u", "-m", "flocsim", *words], cwd=study, env=ENV, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    assert running.stdout.readline().startswith("1 of 6: type III")
    return running


def nobody_left(group):
    """Whether a group of processes is empty, or becomes so within some seconds."""
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "jobs", "everybody"),
    [(signal.SIGINT, 2, True), (signal.SIGTERM, 2, False), (signal.SIGTERM, 1, False),
     (signal.SIGKILL, 2, False)],
)  # fmt: skip
def test_a_survey_that_is_stopped_leaves_nobody_and_goes_on_to_the_same(
    study, number, jobs, everybody
):
    output = f"{number.name}-{jobs}.h5"
    running = begun(study, output, jobs)
    (os.killpg if everybody else os.kill)(running.pid, number)
    code = running.wait(20)
    assert nobody_left(running.pid)
    if number == signal.SIGKILL:
        assert not (study / output).exists()  # it took no 20 s
    else:
        told = running.stderr.read()
        assert code == 130 and told.count("\n") == 1, told
        part = read_strengths(study / output)
        assert f"stopped by {number.name}: {part.progress} are in {output}; go on with" in told
        assert not part.complete and 1 <= part.table("n_tested").sum() < 6
    # Gone on with by another number of processes.
    words = strength(output, "--resume", "--jobs", str(3 - jobs))
    subprocess.run([sys.executable, "-m", "flocsim", *words], cwd=study, env=ENV, check=True)
    found, whole = (read_strengths(study / name) for name in (output, "whole.h5"))
    assert found.complete
    for group in ("doublets", "conditions"):
        for name, column in getattr(found, group).columns.items():
            other = getattr(whole, group).columns[name].values
            np.testing.assert_array_equal(column.values, other)
