"""What is said while something is compiled."""

import pytest

from flocsim.compiler import units
from flocsim.compiler.composer import compose
from flocsim.io import terminal


def halved(x):
    return 0.5 * x


def doubled(x):
    return 2.0 * halved(4.0 * x)


@pytest.fixture
def cold(tmp_path, monkeypatch):
    """Nothing is compiled yet, and all compiling is worth a line."""
    monkeypatch.setenv("FLOCSIM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("flocsim.compiler.composer._composed", {})
    monkeypatch.setattr(units, "WORTH_SAYING", 0.0)
    monkeypatch.setattr(units, "shown", units.one_line)


def test_the_first_run_says_what_is_compiled_and_the_next_nothing(cold, capsys, monkeypatch):
    assert compose(doubled, {}, what="a product")(1.5) == 6.0
    assert capsys.readouterr() == ("", "flocsim: first run: compiling a product, about 5 s, once\n")
    monkeypatch.setattr("flocsim.compiler.composer._composed", {})
    assert compose(doubled, {}, what="a product")(1.5) == 6.0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("functions, seconds", [(60, 5), (215, 10), (430, 15), (600, 20)])
def test_the_time_grows_with_the_number_of_functions(cold, capsys, functions, seconds):
    with units.compiling("it", functions):
        pass
    assert f"about {seconds} s" in capsys.readouterr().err


def test_short_work_is_not_worth_a_line(capsys, monkeypatch):
    monkeypatch.setattr(units, "WORTH_SAYING", 2.0)
    with units.compiling("it", 40):
        pass
    assert capsys.readouterr() == ("", "")


def test_quiet_commands_and_other_ranks_say_nothing(cold, capsys):
    for silent, said in ((True, 0), (False, 1)):
        terminal.plain_warnings(silent)
        with units.compiling("it", 100):
            pass
        assert capsys.readouterr().err.count("\n") == said
