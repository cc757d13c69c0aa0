"""Whatever happens to a study and its files, in whatever order: no row of another physics, no wrong
label, no finished task lost, no traceback, nobody left, nothing that hangs.

The number of an interleaving is its seed. When things happen is a matter of time, so that one that
failed may not fail again: what it did is in the message.
"""

import os
import random
import time

import pytest

from flocsim.ensembles.storage import resume
from tests.helpers import interleavings
from tests.helpers.interleavings import STEPS, Asked, Child, Truths, World, Wrong, write

COUNT = int(os.environ.get("FLOCSIM_INTERLEAVINGS", "25"))
"""Interleavings of each kind of study."""

LENGTH = 8


@pytest.fixture(scope="module", params=["pairs", "rates", "swarms"])
def truths(request, tmp_path_factory):
    """The rows of fresh runs of a kind of study."""
    return Truths(request.param, tmp_path_factory.mktemp(f"truths-{request.param}"))


def interleaved(truths, number, folder):
    """What is wrong with an interleaving, "" for nothing."""
    folder.mkdir()
    rng = random.Random(f"{truths.kind} {number}")
    try:
        # Other ranks are processes that start anew, which takes seconds: once in a while.
        steps = rng.choices([*STEPS, World.resume_on_other_ranks], [3] * len(STEPS) + [1], k=LENGTH)
        World(truths.kind, folder, truths, rng).go(steps)
    except Wrong as error:
        return f"{number}: {error}"
    return ""


@pytest.mark.slow
def test_nothing_that_happens_mixes_or_loses_rows(truths, tmp_path):
    found = [interleaved(truths, number, tmp_path / str(number)) for number in range(COUNT)]
    assert not any(found), "\n".join(filter(None, found))


@pytest.mark.slow
def test_rows_that_are_mixed_are_seen(truths, tmp_path, monkeypatch):
    """The same where the rows of another study are taken."""
    monkeypatch.setattr(resume, "refuse_other", lambda *_: None)
    with pytest.raises(Wrong, match="of another physics"):
        World(truths.kind, tmp_path, truths, random.Random(1)).go(
            [World.resume, World.edit_module, World.resume]
        )


@pytest.mark.slow
@pytest.mark.parametrize("truths", ["pairs"], indirect=True)
def test_rows_that_are_lost_are_seen(truths, tmp_path, monkeypatch):
    """The same where results may take the place of others that have more rows."""

    def ask(world):
        world.asked = Asked(2, (0.5,))
        write(world.folder, world.kind, world.physics, world.asked)

    monkeypatch.setattr(resume, "refuse_fewer", lambda *_: None)
    with pytest.raises(Wrong, match="tasks are lost"):
        World(truths.kind, tmp_path, truths, random.Random(1)).go([World.resume, ask, World.resume])


def test_what_hangs_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(interleavings, "LONGEST", 0.2)
    monkeypatch.setattr(interleavings, "main", lambda words: time.sleep(60.0))
    with pytest.raises(Wrong, match="hangs"):
        Child(tmp_path, ["x"]).end()
