"""What is said while something is compiled."""

import time

import pytest

from flocsim.compiler import units
from flocsim.io import terminal


@pytest.fixture
def speaking(monkeypatch):
    """What is said is not changed for other tests."""
    monkeypatch.setattr(units, "quiet", False)
    units._said.clear()


@pytest.fixture
def at_once(speaking, monkeypatch):
    """All compiling is worth a line."""
    monkeypatch.setattr(units, "WORTH_SAYING", 0.0)


def said(capsys):
    """Return what is said of half a second of compiling."""
    with units.announced("a product"):
        time.sleep(0.5)
    return capsys.readouterr().err


def test_what_is_compiled_is_said_once(at_once, capsys):
    assert said(capsys) == "flocsim: first run: compiling a product, once (up to a minute)\n"
    assert said(capsys) == ""


def test_short_work_is_not_worth_a_line(speaking, capsys):
    with units.announced("a product"):
        pass
    assert capsys.readouterr().err == ""


def test_quiet_commands_and_other_ranks_say_nothing(at_once, capsys):
    for silent, lines in ((True, 0), (False, 1)):
        terminal.plain_warnings(silent)
        assert said(capsys).count("\n") == lines
