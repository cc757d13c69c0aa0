"""Progress: whole lines where nobody watches, one line that renews itself where somebody does."""

import contextlib
import errno
import io
import os
import sys

import pytest

from flocsim.io import terminal
from flocsim.io.terminal import Progress, duration, markdown_table


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
    assert {len(part) for part in text.split("\r") if part} == {78}


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
    assert stream.getvalue() == "  0%  0 of 10 replicates\n"


def test_what_runs_is_said_and_a_line_on_a_terminal_stays_one(clock):
    lines, bar = io.StringIO(), Terminal()
    going = "swarm 3 at 0.5 s, 1000000 steps on"
    for stream in (lines, bar):
        clock[0] = 0.0
        report = Progress(1000, False, stream, "snapshots")
        clock[0] = 60.0
        report.report(500, going)
        clock[0] = 70.0
        report.report(500, going * 3)
    assert lines.getvalue().splitlines() == [
        f" 50%  500 of 1000 snapshots, 60 s left; {going}",
        f" 50%  500 of 1000 snapshots, 70 s left; {going * 3}",
    ]
    assert {len(part) for part in bar.getvalue().split("\r") if part} == {78}
    assert bar.getvalue().startswith(f"\r 50%  500 of 1000 snapshots, 60 s left; {going}")


@contextlib.contextmanager
def streams(out, err):
    """Standard output and error, made plain."""
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        with terminal.plain_streams():
            yield
        assert sys.stdout is out or None in (out, err)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x07", "\\x1b[31mred\\x07"),
        ("a\tb\nκ µ –", "a\tb\nκ µ –"),
        ("over\x08\x7f", "over\\x08\\x7f"),
        ("\x9b31m", "\\x9b31m"),
        ("right\u202eleft\u2066\u200f", "right\\u202eleft\\u2066\\u200f"),
        ("line\u2028more\udcff", "line\\u2028more\\udcff"),
    ],
)
def test_letters_that_steer_a_terminal_are_written_out(text, shown):
    out, err = io.StringIO(), io.StringIO()
    with streams(out, err):
        print(text)
        print(text, file=sys.stderr)
    assert out.getvalue() == shown + "\n"
    assert err.getvalue() == shown + "\n"


def test_progress_still_renews_its_line(clock):
    out = Terminal()
    with streams(out, io.StringIO()):
        report = Progress(10, False)
        clock[0] = 1.0
        report.report(5)
    assert out.getvalue().startswith("\r 50%  5 of 10")


class Broken(io.StringIO):
    """A stream whose other end fails."""

    def __init__(self, number):
        super().__init__()
        self.number = number

    def write(self, text):
        """Never works."""
        raise OSError(self.number, os.strerror(self.number))


@pytest.mark.parametrize("number", [errno.EIO, errno.ENOSPC, errno.EBADF])
def test_an_output_that_fails_is_noted_once(number):
    with streams(Broken(number), io.StringIO()):
        print("lost")
        print("lost too")
        assert os.strerror(number) in terminal.output_problem()


def test_a_reader_that_has_gone_is_no_problem():
    with streams(Broken(errno.EPIPE), io.StringIO()):
        print("lost")
        assert terminal.output_problem() == ""


@pytest.mark.parametrize("name", ["stdout", "stderr"])
def test_a_closed_stream_takes_what_it_is_given(name):
    open_one = io.StringIO()
    with streams(*((None, open_one) if name == "stdout" else (open_one, None))):
        print("hello")
        Progress(3, False).warn("careful")
        assert bool(terminal.output_problem()) == (name == "stdout")
    shown = open_one.getvalue()
    assert ("hello" in shown) == (name == "stderr")
    assert ("careful" in shown) == (name == "stdout")


def test_a_bar_in_a_cell_does_not_end_it():
    assert markdown_table(("a", "b"), [("x|y", 1)]) == "| a | b |\n| --- | --- |\n| x\\|y | 1 |"
