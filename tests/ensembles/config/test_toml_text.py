"""Texts that would keep a TOML parser for minutes are refused at once, with their line."""

import pytest

from flocsim.ensembles.config.loader import load_config, parse_setting
from flocsim.ensembles.config.toml_text import text_problem
from flocsim.errors import ConfigError
from tests.helpers.small_study import VALID


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a." * 300_000 + "a = 1", "larger than 100 kB"),
        ("a." * 4000 + "a = 1", ":1: a key of more than 6 parts"),
        ('"a".' * 2000 + "a = 1", ":1: a key of more than 6 parts"),
        ("x = 1\n[" + "a . " * 1000 + "a]", ":2: a key of more than 6 parts"),
        ("x = " + "[" * 4000, "nested more than 6 deep"),
        ("x = " + "{a = " * 1000, "nested more than 6 deep"),
        ("x = '" + "y" * 20_000 + "'", ":1: a line of more than 10000 letters"),
        ("\n" * 6000, "more than 5000 lines"),
        ("\n".join(f"k{n} = 1" for n in range(2500)), "more than 2000 keys"),
        ("k" * 5000 + " = 1", "a key of more than 100 letters"),
        ('preset = "si"\n[shapes]\nradius = "1 ' + "m " * 4000 + '"', "more than 100 letters"),
        ("\n".join(f"k{n} = 1" for n in range(100)), "more unknown or wrong keys"),
    ],
)
def test_texts_beyond_the_limits_are_refused(tmp_path, text, said):
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(ConfigError, match=said) as caught:
        load_config(tmp_path / "c.toml")
    assert len(str(caught.value).split("\n")) <= 52


@pytest.mark.parametrize(
    "text",
    [VALID, 'file = "a.b.c.d.e.f.g.h.i.j.h5"', "file = 'a.b.c.d.e.f.g.h.i'", "# a.b.c.d.e.f.g.h.i",
     '"""\na.b.c.d.e.f.g.h.i"[[[[[[[[[[\n"""', "d = [1.5, 2.5]\ne = 1.5"],
)  # fmt: skip
def test_what_stands_in_strings_and_comments_does_not_count(text):
    assert text_problem(text) is None


@pytest.mark.parametrize("quote", ['"', "'", '"""', "'''", '\\"', '"" '])
def test_many_quotes_take_no_time(quote):
    assert text_problem("a = " + (quote * 2000 + "\n") * 12) in (None, (1, "x"))


@pytest.mark.parametrize("setting", ["a=" + "[" * 5000, "a." * 20 + "b=1", "a=" + "b." * 3000])
def test_settings_have_the_same_limits(setting):
    with pytest.raises(ConfigError, match="a config never needs that") as caught:
        parse_setting(setting)
    assert len(str(caught.value)) < 200


def test_control_letters_of_keys_and_names_are_written_out(tmp_path):
    path = tmp_path / "c\x1b[31m\n.toml"
    path.write_text('"\\u001b[31m\\nx" = 1\n"\\u202ey" = 2')
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    lines = str(caught.value).split("\n")
    assert all(line.isprintable() for line in lines)
    assert all(r"c\x1b[31m\n.toml" in line for line in lines)
