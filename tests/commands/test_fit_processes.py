"""A picture that takes its process with it, or the memory, costs itself and not the batch."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from PIL import Image

from flocsim.__main__ import main
from flocsim.commands import fit_pictures
from flocsim.errors import UsageError
from flocsim.io.shape_library import read_library
from flocsim.tasks import Lost, workers
from tests.helpers.small_study import ROOT
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE, wait_until

needs_fork = pytest.mark.skipif(sys.platform != "linux", reason="needs fork")
JOBS = [1, pytest.param(2, marks=needs_fork)]


@pytest.fixture
def folder(in_tmp):
    """The current folder with three pictures of one floc each."""
    (in_tmp / "frames").mkdir()
    for number, name in enumerate("abc"):
        grey = np.full((120, 120), 200, np.uint8)
        grey[20 : 40 + number, 15:45] = 40
        Image.fromarray(grey).save(in_tmp / f"frames/{name}.png")
    return in_tmp


def fit(jobs=1, *more):
    words = ["--pixel-size", "1e-6", "--vertices", "4", "-o", "s.h5"]
    return main(["fit", "frames", *words, "--jobs", str(jobs), *more])


def ids(path="s.h5"):
    return [entry.floc_id for entry in read_library(path)]


@pytest.fixture
def spoil(monkeypatch):
    """``spoil(name, harm, function)`` lets a task of this picture come to harm."""

    def spoil(name, harm, function="find_flocs"):
        original = getattr(fit_pictures, function)

        def run(task):
            if name in str(task[0]):
                harm()
            return original(task)

        # Processes that are forked have it too; it is found by its name where it is unpickled.
        run.__module__, run.__qualname__ = original.__module__, original.__qualname__
        monkeypatch.setattr(fit_pictures, function, run)

    return spoil


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def use_up_memory():
    raise MemoryError


@needs_fork
@pytest.mark.parametrize(
    "function", rest_slow(["find_flocs", "fit_region"], lambda name: name == "fit_region")
)
def test_a_picture_that_kills_its_process_is_lost_and_no_other(folder, spoil, capsys, function):
    spoil("b.png", die, function)
    assert fit(2) == 70
    assert ids() == ["a.png#1", "c.png#1"]
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 2 and "b.png was not fitted: its process was killed" in errors[0]
    assert errors[1] == "flocsim: not fitted: b.png; everything else was written"
    assert "b.png" not in (folder / "s.csv").read_text()
    assert multiprocessing.active_children() == []


@needs_fork
def test_a_process_that_is_killed_once_costs_nothing(folder, spoil, capsys):
    def die_once():
        if not (folder / "died").exists():
            (folder / "died").touch()
            die()

    spoil("b.png", die_once)
    assert fit(2) == 0
    assert ids() == ["a.png#1", "b.png#1", "c.png#1"]
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("jobs", JOBS)
@pytest.mark.parametrize(
    "function", rest_slow(["find_flocs", "fit_region"], lambda name: name == "fit_region")
)
def test_a_picture_too_large_for_the_memory_is_lost_and_no_other(
    folder, spoil, capsys, jobs, function
):
    spoil("b.png", use_up_memory, function)
    assert fit(jobs) == 70
    assert ids() == ["a.png#1", "c.png#1"]
    assert "b.png was not fitted: not enough memory" in capsys.readouterr().err


def test_where_all_are_lost_there_is_no_library(folder, spoil):
    spoil(".png", use_up_memory)
    assert fit() == 70
    assert not (folder / "s.h5").exists()


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=[needs_fork, pytest.mark.slow])])
def test_names_that_are_no_text_are_written_with_their_bytes(folder, capsys, jobs):
    strange = os.fsencode(folder / "frames") + b"/caf\xe9.png"
    try:
        os.rename(folder / "frames/b.png", strange)
    except OSError:
        pytest.skip("this file system takes text only")
    assert fit(jobs, "--masks-out", "masks") == 0
    assert ids() == ["a.png#1", "c.png#1", r"caf\xe9.png#1"]
    assert r"caf\xe9.png" in (folder / "s.csv").read_text("utf-8")
    assert (folder / r"masks/caf\xe9.png").exists()


def doubled(number):
    if number == 3:
        raise ValueError("three")
    if number == 5:
        raise UsageError("five")
    return 2 * number


@pytest.mark.parametrize("jobs", JOBS)
def test_results_come_in_order_and_errors_for_the_user_are_raised(jobs):
    with workers(jobs, lambda: None) as mapped:
        assert list(mapped(doubled, range(3))) == [0, 2, 4]
        lost = list(mapped(doubled, [3, 4]))
        assert isinstance(lost[0], Lost) and "ValueError: three" in lost[0].reason
        assert lost[1] == 8
    with pytest.raises(UsageError, match="five"), workers(jobs, lambda: None) as mapped:
        list(mapped(doubled, [4, 5]))


def slow(_):
    time.sleep(2 * PATIENCE)


@needs_fork
def test_an_interrupt_ends_the_processes_at_once(interruptible):
    with pytest.raises(KeyboardInterrupt), workers(2, lambda: None) as mapped:
        found = mapped(slow, range(2))
        threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
        next(found)
    assert wait_until(lambda: multiprocessing.active_children() == [])


@needs_fork
def test_processes_end_with_their_parent(tmp_path):
    code = (
        "import os, time\n"
        "from flocsim.tasks import workers\n"
        "def where(number):\n"
        "    if number < 2:\n"
        "        os.write(1, b'%d\\n' % os.getpid())  # at once, unlike print\n"
        "    time.sleep(1200)\n"
        "with workers(2, lambda: None) as mapped:\n"
        "    list(mapped(where, range(2)))\n"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    children = [int(parent.stdout.readline()) for _ in range(2)]
    parent.kill()
    parent.communicate(timeout=PATIENCE)  # ends once nobody holds its output
    assert wait_until(lambda: not any(alive(child) for child in children))


def alive(process):
    try:
        with open(f"/proc/{process}/stat") as file:
            return file.read().split()[2] != "Z"
    except OSError:
        return False
