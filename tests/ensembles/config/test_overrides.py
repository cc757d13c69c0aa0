"""--set: any entry of the config from the command line."""

import pytest

from flocsim.ensembles.cli import main
from flocsim.ensembles.config.overrides import nested, parse_setting
from flocsim.errors import ConfigError
from tests.helpers.small_study import small_config, write_small


@pytest.mark.parametrize(
    ("text", "keys", "value"),
    [
        ("replicates=50", ["replicates"], 50),
        ("scene.delta=[0.0, 0.5]", ["scene", "delta"], [0.0, 0.5]),
        ("forces.contact.k_n=10 N/m", ["forces", "contact", "k_n"], "10 N/m"),
        ("forces.contact.k_n='10 N/m'", ["forces", "contact", "k_n"], "10 N/m"),
        ("forces.gravity=false", ["forces", "gravity"], False),
        ("output.file=a=b.h5", ["output", "file"], "a=b.h5"),
        ("preset=si\nseed = 3", ["preset"], "si\nseed = 3"),
        ("seed=", ["seed"], ""),
    ],
)
def test_a_setting_is_read_as_toml_or_text(text, keys, value):
    assert parse_setting(text) == (keys, value)


@pytest.mark.parametrize("text", ["seed", "=3", "scene.=3", ".seed=3"])
def test_a_setting_without_key_or_value_is_refused(text):
    with pytest.raises(ConfigError, match="write KEY=VALUE"):
        parse_setting(text)


def test_later_settings_win_and_contradictions_are_refused():
    assert nested([(["a", "b"], 1), (["a", "c"], 2), (["a", "b"], 3)]) == {"a": {"b": 3, "c": 2}}
    with pytest.raises(ConfigError, match="a has been set to a value already"):
        nested([(["a"], 1), (["a", "c"], 2)])


def test_settings_lie_over_the_file_and_are_kept(tmp_path):
    settings = nested(
        map(parse_setting, ["seed=7", "shapes.vertices=[1]", "forces.contact.k_n=10 N/m"])
    )
    config = small_config(tmp_path, settings)
    assert (config.seed, config.shapes.vertices) == (7, (1,))
    assert config.overrides == settings


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("seed=x", "override of small.toml: seed must be an integer"),
        ("scene.detla=[0.0]", "scene.detla: unknown key (did you mean 'delta'?)"),
        ("bogus", "write KEY=VALUE"),
        ("stop.half_width=0.7", "stop.half_width must be a finite number above 0 and at most 0.5"),
    ],
)
def test_a_wrong_setting_is_one_line(tmp_path, monkeypatch, capsys, setting, said):
    monkeypatch.chdir(tmp_path)
    write_small(tmp_path)
    assert main(["small.toml", "--set", setting]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert said in line
