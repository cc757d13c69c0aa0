"""What a config file means: units, presets, overrides."""

from pathlib import Path

import pytest

from flocsim import Sphere
from flocsim.__main__ import main
from flocsim.ensembles.config.loader import nested, parse_setting
from flocsim.ensembles.config.schema import FORCES
from flocsim.errors import ConfigError
from tests.helpers.small_study import VALID, load_text, problem_lines, small_config, write_small


def test_every_value_arrives_in_si_units(tmp_path):
    config = load_text(tmp_path, VALID)
    assert (config.preset, config.seed, config.replicates) == ("tang2014", 3, 20)
    assert config.scene.given == (("I", (16.41e-6, 23.02e-6)), ("III", (4.62e-6, 4.95e-6)))
    assert (config.scene.delta, config.scene.start_gap) == ((0.0, 0.5), 2e-6)
    assert (config.scene.escape_gap, config.scene.time_limit) == (4e-6, 5.0)
    assert (config.shapes.vertices, config.shapes.radius, config.shapes.pool) == ((1, 4), 1e-6, 5)
    assert config.body_options(Sphere(1e-5)) == {"density": 2650.0, "depth": 10e-6}
    assert (config.fluid.viscosity, config.fluid.velocity) == (8.9e-4, (0.0, 1e-4))
    assert type(config.fluid.density) is float
    assert config.force_names == tuple(FORCES)[:5]
    gravity, drag, attraction, repulsion, contact = config.forces
    assert (gravity.g, drag.rotational, attraction.hamaker) == (9.81, False, 1e-20)
    assert (attraction.gap, repulsion.gap) == ("surface", "equivalent_spheres")
    assert (contact.k_n, contact.k_t, contact.friction) == (10.0, 2.0, 0.3)
    assert (config.zone.distance, config.zone.root) == (5e-6, None)
    assert (config.integrator.tolerance, config.integrator.step) == (1e-9, 1e-6)
    assert config.output.file == "out.h5"
    assert config.text == VALID


def test_quantities_and_numbers_are_the_same(tmp_path):
    in_units = load_text(tmp_path, 'preset = "si"\n[scene]\npairs = [["16.41 um", "23.02 µm"]]\n')
    in_metres = load_text(tmp_path, 'preset = "si"\n[scene]\npairs = [[16.41e-6, 23.02e-6]]\n')
    assert in_units.scene == in_metres.scene
    assert in_units.scene.given == (("16.41um-23.02um", (16.41e-6, 23.02e-6)),)


@pytest.mark.parametrize(
    ("over", "bodies"),
    [
        ("density = 2000", {"density": 2000.0, "depth": "sphere"}),
        ("density = 2000\ndepth = 1e-5", {"density": 2000.0, "depth": 1e-5}),
        ("surface_density = 3", {"surface_density": 3.0}),
    ],
)
def test_keys_that_exclude_each_other_replace_the_presets(tmp_path, over, bodies):
    for preset in ("tang2014", "si"):
        text = f'preset = "{preset}"\n[fluid]\nbuoyancy = false\n[bodies]\n{over}\n'
        assert load_text(tmp_path, text).body_options(Sphere(1e-5)) == bodies


def test_a_preset_keeps_what_the_file_leaves_alone(tmp_path):
    text = 'preset = "si"\n[bodies]\ndepth = "5 um"\n[forces.van_der_waals]\nd_min = "2 nm"\n'
    config = load_text(tmp_path, text)
    assert config.body_options(Sphere(1e-5)) == {"density": 2650.0, "depth": 5e-6}
    attraction = config.forces[2]
    assert (attraction.d_min, attraction.hamaker, attraction.gap) == (2e-9, 4.7e-20, "surface")


def test_false_leaves_out_a_presets_force(tmp_path):
    config = load_text(tmp_path, 'preset = "tang2014"\n[forces]\ndouble_layer = false\n')
    assert config.force_names == ("gravity", "drag", "van_der_waals", "contact")


def test_without_a_preset_only_tables_count(tmp_path):
    config = load_text(
        tmp_path, "[bodies]\nsurface_density = 2\n[forces.drag]\n[forces.gravity]\ng = 9.8\n"
    )
    assert config.force_names == ("gravity", "drag")
    assert config.zone.root == "outer"


def test_overrides_lie_over_the_file(tmp_path):
    over = {"seed": 9, "replicates": None, "zone": {"root": "inner"}, "output": {"file": None}}
    config = load_text(tmp_path, VALID, over)
    assert (config.seed, config.replicates) == (9, 20)
    assert (config.zone.root, config.zone.distance) == ("inner", None)
    assert config.output.file == "out.h5"
    assert load_text(tmp_path, VALID, {"preset": "si"}).preset == "si"


def test_wrong_overrides_are_told_apart(tmp_path):
    assert problem_lines(tmp_path, VALID, {"seed": -1}) == [
        "override of study.toml: seed must be an integer from 0 to 9223372036854775807, found -1"
    ]


def test_a_library_is_found_beside_the_config(tmp_path):
    text = 'preset = "si"\n[shapes]\nsource = "library"\nfile = "shapes.h5"\n'
    assert problem_lines(tmp_path, text) == [
        "study.toml:4: shapes.file: shapes.h5 is not a file: name a library "
        'written by `flocsim fit`, or "synthetic", the one included in flocsim'
    ]
    (tmp_path / "shapes.h5").touch()
    assert Path(load_text(tmp_path, text).shapes.file) == tmp_path / "shapes.h5"


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


def test_later_settings_win():
    assert nested([(["a", "b"], 1), (["a", "c"], 2), (["a", "b"], 3)]) == {"a": {"b": 3, "c": 2}}
    assert nested([(["a"], 1), (["a", "c"], 2)]) == {"a": {"c": 2}}


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
def test_a_wrong_setting_is_one_line(in_tmp, capsys, setting, said):
    write_small(in_tmp)
    assert main(["ensemble", "small.toml", "--set", setting]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert said in line
