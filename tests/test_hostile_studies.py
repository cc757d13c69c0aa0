"""Files that an enemy made of studies of every kind, through every command that reads one: each
takes seconds and a GiB at most, runs no code of the file's, and says what is wrong in one line."""

import os
import random

import pytest

from tests.helpers.hostile_studies import KINDS, Hostile, commands, judged

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
