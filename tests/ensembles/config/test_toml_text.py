"""What the text of a config may be: all that is valid TOML, up to a size that is told."""

import pytest

from flocsim.ensembles.config.loader import load_config, parse_setting
from flocsim.errors import ConfigError


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("#" * 99 + "\n" * 100_000, "larger than 100 kB"),
        ("x = " + "[" * 4000, "nested too deeply"),
        ("k" * 2000 + " = 1", "k: unknown key"),
        ('preset = "si"\n[shapes]\nradius = "1 ' + "m " * 4000 + '"', "more than 100 letters"),
        ("\n".join(f"k{n} = 1" for n in range(100)), "k49: unknown key"),
    ],
)
def test_texts_beyond_the_limits_are_refused(tmp_path, text, said):
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(ConfigError, match=said) as caught:
        load_config(tmp_path / "c.toml")
    assert len(str(caught.value).split("\n")) <= 52
    assert all(len(line) < 3000 for line in str(caught.value).split("\n"))


@pytest.mark.parametrize("value", ["[" * 5000, "b." * 3000, "10 N/m", '"open'])
def test_a_setting_that_is_no_toml_is_a_word(value):
    assert parse_setting(f"a.b={value}") == (["a", "b"], value)


def test_control_letters_of_keys_and_names_are_written_out(tmp_path):
    path = tmp_path / "c\x1b[31m\n.toml"
    path.write_text('"\\u001b[31m\\nx" = 1\n"\\u202ey" = 2')
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    lines = str(caught.value).split("\n")
    assert all(line.isprintable() for line in lines)
    assert all(r"c\x1b[31m\n.toml" in line for line in lines)
