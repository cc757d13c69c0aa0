"""Progress: whole lines where nobody watches, one line that renews itself where somebody does."""

import io

import pytest

from flocsim.io import terminal
from flocsim.io.terminal import Progress, duration


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self):
        """Yes."""
        return True


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets, in seconds."""
    now = [0.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now[0])
    return now


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "0 s"), (42, "42 s"), (190, "3 min 10 s"), (5999, "99 min 59 s"), (7500, "2 h 05 min")],
)
def test_durations(seconds, words):
    assert duration(seconds) == words


def test_lines_come_every_few_seconds(clock):
    stream = io.StringIO()
    report = Progress(200, False, stream)
    for now in (1.0, 4.9, 5.0, 9.0, 10.0):
        clock[0] = now
        report.report(200 - int(10 * now))
    assert stream.getvalue().splitlines() == [
        " 25%  50 of 200 replicates, 15 s left",
        " 50%  100 of 200 replicates, 10 s left",
    ]
    assert report.finish() == 10.0
    assert "\r" not in stream.getvalue()


def test_a_terminal_has_one_line_that_is_cleared_at_the_end(clock):
    stream = Terminal()
    report = Progress(200, False, stream)
    for now in (0.1, 0.3, 0.6):
        clock[0] = now
        report.report(200 - int(200 * now))
    report.finish()
    text = stream.getvalue()
    assert "\n" not in text
    assert [part.strip() for part in text.split("\r") if part.strip()] == [
        "30%  60 of 200 replicates, 1 s left",
        "60%  120 of 200 replicates, 0 s left",
    ]
    assert text.endswith("\r")
    assert {len(part) for part in text.split("\r") if part} == {70}


def test_quiet_is_quiet(clock):
    stream = Terminal()
    report = Progress(10, True, stream)
    report.say("hello")
    clock[0] = 100.0
    report.report(5)
    assert report.finish() == 100.0
    assert stream.getvalue() == ""


def test_nothing_done_yet_divides_by_nothing(clock):
    stream = io.StringIO()
    report = Progress(10, False, stream)
    clock[0] = 6.0
    report.report(10)
    assert stream.getvalue() == "  0%  0 of 10 replicates, 0 s left\n"


def test_other_things_than_replicates_are_counted(clock):
    stream = io.StringIO()
    report = Progress(4, False, stream, "flocs")
    clock[0] = 6.0
    report.report(3)
    assert stream.getvalue() == " 25%  1 of 4 flocs, 18 s left\n"
