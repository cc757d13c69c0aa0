"""`flocsim init` of each kind: what it writes can be run as it is."""

import tomllib

import pytest

from flocsim.__main__ import main
from flocsim.commands.init import COMMANDS, KINDS
from flocsim.ensembles.config.loader import lay_over, load_any_config
from flocsim.ensembles.config.schema import PRESETS
from flocsim.ensembles.pairs.answer import PHYSICS
from flocsim.io.shape_library import SHIPPED
from tests.helpers.tiers import rest_slow

TAKES_SHAPES = [kind for kind in KINDS if kind != "spheres"]


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_can_be_run(kind, in_tmp, capsys):
    own = ["--shapes", str(SHIPPED)] if kind == "pictures" else []
    assert main(["init", f"1-{kind}.toml", "--kind", kind, *own]) == 0
    told = capsys.readouterr().out
    command = COMMANDS.get(kind, "ensemble")
    assert told.endswith(f"run it with: flocsim {command} 1-{kind}.toml\n")
    assert main([command, f"1-{kind}.toml", "--dry-run"]) == 0
    assert "nothing was run" in capsys.readouterr().out
    assert main(["init", f"1-{kind}.toml", "--kind", kind, *own]) == 2


@pytest.mark.parametrize("kind", ["study", "clay", "measured"])
def test_physics_that_is_written_is_that_of_the_preset(kind, in_tmp):
    assert main(["init", "s.toml", "--kind", kind]) == 0
    given = tomllib.loads((in_tmp / "s.toml").read_text("utf-8"))
    preset = PRESETS[given["preset"]]
    assert len(given["forces"]) >= 2
    assert {name: lay_over(preset, given)[name] for name in PHYSICS} == {
        name: preset[name] for name in PHYSICS
    }


def test_a_value_that_is_edited_counts(in_tmp):
    assert main(["init", "s.toml", "--kind", "clay"]) == 0
    text = (in_tmp / "s.toml").read_text("utf-8").replace('potential = "15 mV"', "potential = 0.03")
    (in_tmp / "s.toml").write_text(text, "utf-8")
    config = load_any_config("s.toml")
    forces = dict(zip(config.force_names, config.forces, strict=True))
    assert forces["double_layer"].potential == 0.03


@pytest.mark.parametrize("kind", TAKES_SHAPES)
def test_a_library_is_written_in(kind, in_tmp, capsys):
    (in_tmp / "mine.h5").write_bytes(SHIPPED.read_bytes())
    (in_tmp / "studies").mkdir()
    line = ["init", "studies/s.toml", "--kind", kind, "--shapes", "mine.h5"]
    assert main(line) == 0
    assert "24 flocs of mine.h5" in capsys.readouterr().out
    shapes = load_any_config("studies/s.toml").shapes
    assert (in_tmp / str(shapes.file)).resolve() == in_tmp / "mine.h5"
    assert set(shapes.vertices) <= {1, 4, 8, 16, 32, 64, 128}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("init --kind pictures", "flocsim: --kind pictures needs --shapes FILE, your flocs"),
        ("init --shapes none.h5", "none.h5"),
        ("init --shapes damaged.h5", "damaged.h5 does not end in flocsim's checksum"),
        (
            "init --kind spheres --shapes mine.h5",
            "this study, or this library, has spheres",
        ),
    ],
)
def test_what_has_no_flocs_is_refused_in_a_line(line, said, in_tmp, capsys):
    (in_tmp / "mine.h5").write_bytes(SHIPPED.read_bytes())
    (in_tmp / "damaged.h5").write_bytes(SHIPPED.read_bytes()[:-100])
    assert main(line.split()) != 0
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not (in_tmp / "study.toml").exists()


def test_the_sweep_that_is_written_is_one(in_tmp, capsys):
    assert main(["init", "s.toml", "--kind", "sweep"]) == 0
    over = ["--over", 'forces.van_der_waals.hamaker="1 zJ","10 zJ","100 zJ"']
    assert f"""'{'"1 zJ"'}'""" in (in_tmp / "s.toml").read_text()
    capsys.readouterr()
    assert main(["sweep", "s.toml", *over, "--dry-run"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 3


@pytest.mark.slow
@pytest.mark.parametrize("kind", rest_slow(["kernel", "brownian"], lambda kind: kind == "kernel"))
def test_few_spheres_of_it_come_to_results(kind, in_tmp, capsys):
    assert main(["init", "s.toml", "--kind", kind]) == 0
    few = ["--replicates", "8", "--set", "shapes.vertices=[1]"]
    assert main([COMMANDS.get(kind, "ensemble"), "s.toml", *few]) == 0
    told = capsys.readouterr().out
    assert ("capture widths" if kind == "kernel" else "touched before they escaped") in told
