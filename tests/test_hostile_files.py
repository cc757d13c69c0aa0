"""Hostile files of every kind are read or refused in one line: a fast part of the fuzzing that
benchmarks/faults/fuzz_readers.py does, in this process."""

import random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.faults.fuzz_readers import KINDS, made, outcome, reader

EXAMPLES = 40


@pytest.fixture(scope="module")
def readers(tmp_path_factory):
    """{kind: (folder, maker, reader)}."""
    found = {}
    for kind in KINDS:
        folder = tmp_path_factory.mktemp(kind)
        found[kind] = (folder, *reader(kind, folder))
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_any_file_is_read_or_refused_in_one_line(readers, kind):
    folder, make, read = readers[kind]

    @settings(
        max_examples=EXAMPLES, deadline=None, database=None,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(st.integers(0, 10**6))
    def throw(number):
        what, why = outcome(read, made(make, kind, number, folder))
        assert what in ("read", "refused"), why

    throw()


@pytest.mark.parametrize("kind", KINDS)
def test_some_are_read_and_some_are_refused(readers, kind):
    """Else the files would be so wrong, or so right, that they test nothing."""
    folder, make, read = readers[kind]
    ends = {
        outcome(read, made(make, kind, number, folder))[0]
        for number in random.Random(kind).sample(range(10**6), 60)
    }
    assert ends <= {"read", "refused"}
    assert "refused" in ends
