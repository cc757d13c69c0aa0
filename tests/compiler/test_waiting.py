"""What is said while something is compiled."""

from flocsim.compiler import units
from flocsim.io import terminal


def said(capsys):
    """Return what is said of something that is compiled."""
    units.say("a product")
    return capsys.readouterr().err


def test_what_is_compiled_is_said_once(speaking, capsys):
    assert said(capsys) == "flocsim: first run: compiling a product, once (up to a minute)\n"
    assert said(capsys) == ""


def test_nothing_is_said_of_what_has_no_name(speaking, capsys):
    units.say("")
    assert capsys.readouterr().err == ""


def test_quiet_commands_and_other_ranks_say_nothing(speaking, capsys):
    for silent, lines in ((True, 0), (False, 1)):
        terminal.plain_warnings(silent)
        assert said(capsys).count("\n") == lines
