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
from tests.helpers.interleavings import EVENTS, Child, Truths, World, Wrong

FIRST, COUNT = (
    int(os.environ.get("FLOCSIM_FIRST", "0")),
    int(os.environ.get("FLOCSIM_INTERLEAVINGS", "25")),
)
"""Interleavings of each kind of study, and the number of the first."""

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
        weights = [weight for weight, _ in EVENTS.values()]
        names = rng.choices(list(EVENTS), weights, k=LENGTH)
        World(truths.kind, folder, truths, rng).go(names)
    except Wrong as error:
        return f"{number}: {error}"
    return ""


@pytest.mark.slow
def test_nothing_that_happens_mixes_or_loses_rows(truths, tmp_path):
    numbers = range(FIRST, FIRST + COUNT)
    found = [interleaved(truths, number, tmp_path / str(number)) for number in numbers]
    assert not any(found), "\n".join(filter(None, found))


@pytest.mark.slow
def test_rows_that_are_mixed_are_seen(truths, tmp_path, monkeypatch):
    """The same where the rows of another study are taken."""
    monkeypatch.setattr(resume, "refuse_other", lambda *_: None)
    with pytest.raises(Wrong, match="of another physics"):
        World(truths.kind, tmp_path, truths, random.Random(1)).go(
            ["resume", "edit module", "resume"]
        )


@pytest.mark.slow
@pytest.mark.parametrize("truths", ["pairs"], indirect=True)
def test_rows_that_are_lost_are_seen(truths, tmp_path, monkeypatch):
    """The same where results may take the place of others that have more rows."""

    def ask(world):
        world.delta = (0.5,)
        world.write()

    monkeypatch.setitem(EVENTS, "ask", (1, ask))
    monkeypatch.setattr(resume, "refuse_fewer", lambda *_: None)
    with pytest.raises(Wrong, match="tasks are lost"):
        World(truths.kind, tmp_path, truths, random.Random(1)).go(["resume", "ask", "resume"])


def test_what_hangs_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(interleavings, "LONGEST", 0.2)
    monkeypatch.setattr(interleavings, "main", lambda words: time.sleep(60.0))
    with pytest.raises(Wrong, match="hangs"):
        Child(tmp_path, ["x"]).end()
