"""Work that a copy of the process does beside it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flocsim.compiler import composer
from flocsim.ensembles.kinds import flocs_of, study_of
from flocsim.ensembles.parallel import processes
from flocsim.ensembles.parallel.processes import beside
from tests.helpers.small_study import small_config

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux")


@pytest.fixture
def several(monkeypatch):
    """Two processors, whatever there are."""
    monkeypatch.setattr(processes.os, "sched_getaffinity", lambda number: {0, 1})


def has_ended(number):
    """Whether a process is gone, or soon is; nobody may have asked for its exit code."""
    path = Path(f"/proc/{number}/stat")
    for _ in range(400):
        if not path.exists() or path.read_text().split()[2] == "Z":
            return True
        time.sleep(0.05)
    return False


def test_the_work_is_done_in_another_process_by_the_end(tmp_path, several):
    path = tmp_path / "left"
    with beside(lambda: (time.sleep(0.2), path.write_text(str(os.getpid())))):
        assert not path.exists()
    assert path.read_text() != str(os.getpid())


def test_what_the_work_prints_and_how_it_fails_is_not_told(capfd, several):
    with beside(lambda: 1 / 0):
        pass
    assert capfd.readouterr() == ("", "")


def test_it_ends_with_what_goes_wrong_here(tmp_path, several):
    path = tmp_path / "number"

    def work():
        path.write_text(str(os.getpid()))
        time.sleep(60.0)

    with pytest.raises(ValueError), beside(work):
        while not (path.exists() and path.read_text()):
            time.sleep(0.01)
        raise ValueError
    assert has_ended(int(path.read_text()))


KILLED = """
import os, sys, time
from flocsim.ensembles.parallel import processes
processes.os.sched_getaffinity = lambda number: {0, 1}
with processes.beside(lambda: (print(os.getpid(), file=open("number", "w"), flush=True),
                               time.sleep(60.0))):
    while not (os.path.exists("number") and open("number").read()):
        time.sleep(0.01)
    print("ready", flush=True)
    time.sleep(60.0)
"""


def test_it_ends_with_a_killed_parent(tmp_path):
    job = subprocess.Popen(
        [sys.executable, "-c", KILLED], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    )
    assert job.stdout.readline() == "ready\n"
    os.kill(job.pid, signal.SIGKILL)
    job.wait(timeout=20)
    assert has_ended(int((tmp_path / "number").read_text()))


def test_a_study_knows_which_engines_the_disk_has(tmp_path, monkeypatch):
    config = small_config(tmp_path, {"shapes": {"vertices": [1, 4]}})
    study = study_of(config, flocs_of(config))
    study.compile(study.kinds)
    assert study.uncompiled() == []
    monkeypatch.setenv("FLOCSIM_CACHE", str(tmp_path / "cache"))
    assert study.uncompiled() == study.kinds
    (tmp_path / "cache").mkdir()
    name = study.driver(study.draw(*study.kinds[0], 0.0, 0).encounter).name
    (tmp_path / "cache" / f"{name}-1234.code").touch()
    assert study.uncompiled() == study.kinds[1:]
    monkeypatch.setattr(composer.disk_cache, "is_writable", lambda folder: False)
    assert study.uncompiled() == []
