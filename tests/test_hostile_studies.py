"""Files that an enemy made of studies of every kind, through every command that reads one: each
takes seconds and a GiB at most, runs no code of the file's, and says what is wrong in one line."""

import os
import random
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.helpers import hostile_studies
from tests.helpers.hostile_studies import KINDS, MARK, Hostile, commands, judged
from tests.helpers.tiers import rest_slow

COUNT = int(os.environ.get("FLOCSIM_HOSTILE", "154"))
"""Files of each kind; the number of a file is its seed."""


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """A folder of tiny studies and of traps; the current one."""
    folder, here = tmp_path_factory.mktemp("hostile"), os.getcwd()
    os.chdir(folder)
    try:
        found = Hostile(folder)
        found.make_studies()
        yield found
    finally:
        os.chdir(here)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_any_study_is_read_or_refused_in_one_line(hostile, kind):
    wrong = {}
    for number in range(COUNT):
        rng = random.Random(f"{kind} {number}")
        found = judged(commands(hostile.file(kind, rng), rng))
        if found:
            wrong[number] = found
    assert not wrong, "\n".join(f"{number}: {line}" for number in wrong for line in wrong[number])


def slow(words):
    until = time.process_time() + 0.3
    while time.process_time() < until:
        pass
    return 0


def crash(words):
    os.kill(os.getpid(), signal.SIGKILL)


def said(text, code):
    def command(words):
        print(text, file=sys.stderr)
        return code

    return command


WRONG = {
    "raise": (lambda words: 1 / 0, "ZeroDivisionError"),
    "slow": (slow, "takes 0"),
    "crash": (crash, "ends with status 9"),
    "hang": (lambda words: time.sleep(60.0), "hangs"),
    "memory": (lambda words: 0 * len(np.ones(2**27)), "MiB"),
    "two lines": (said("one\ntwo", 2), "2 lines"),
    "silent": (lambda words: 74, "0 lines"),
    "escape": (said("\x1b[31m", 2), "no plain line"),
    "internal": (said("flocsim: internal error", 70), "exit code 70"),
    "foreign": (lambda words: Path(MARK).touch() or 0, "runs foreign code"),
}


@pytest.mark.parametrize("wrong", rest_slow(WRONG, lambda wrong: wrong != "memory"))
def test_whatever_a_command_does_wrong_is_seen(tmp_path, monkeypatch, wrong):
    """Or no file could fail."""
    monkeypatch.chdir(tmp_path)
    command, word = WRONG[wrong]
    monkeypatch.setattr(hostile_studies, "main", command)
    monkeypatch.setattr(hostile_studies, "LONGEST", 0.2 if wrong == "slow" else 30.0)
    monkeypatch.setattr(hostile_studies, "LONGEST_WAIT", 1.0 if wrong == "hang" else 30.0)
    [line] = judged([["info", tmp_path / "a file.h5"]])
    assert word in line


def test_a_command_that_does_what_it_should_is_not_blamed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert judged([["info", "nothing.h5"], ["compare", "a.h5", "b.h5"]]) == []
