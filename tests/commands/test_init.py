"""`flocsim init` of each kind: what it writes can be run as it is."""

import pytest

from flocsim.__main__ import main
from flocsim.commands.init import COMMANDS, KINDS, TEMPLATES
from tests.helpers.tiers import rest_slow


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_can_be_run(kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["init", f"1-{kind}.toml", "--kind", kind]) == 0
    told = capsys.readouterr().out
    command = COMMANDS.get(kind, "ensemble")
    assert told.endswith(f"run it with: flocsim {command} 1-{kind}.toml\n")
    assert main([command, f"1-{kind}.toml", "--dry-run"]) == 0
    assert "nothing was run" in capsys.readouterr().out
    assert main(["init", f"1-{kind}.toml", "--kind", kind]) == 2


def test_the_sweep_that_is_written_is_one(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["init", "s.toml", "--kind", "sweep"]) == 0
    over = ["--over", 'forces.van_der_waals.hamaker="1 zJ","10 zJ","100 zJ"']
    assert f"""'{'"1 zJ"'}'""" in (tmp_path / "s.toml").read_text()
    capsys.readouterr()
    assert main(["sweep", "s.toml", *over, "--dry-run"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 3


@pytest.mark.slow
@pytest.mark.parametrize("kind", rest_slow(["kernel", "brownian"], lambda kind: kind == "kernel"))
def test_few_spheres_of_it_come_to_results(kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["init", "s.toml", "--kind", kind]) == 0
    few = ["--replicates", "8", "--set", "shapes.vertices=[1]"]
    assert main([COMMANDS.get(kind, "ensemble"), "s.toml", *few]) == 0
    told = capsys.readouterr().out
    assert ("capture widths" if kind == "kernel" else "touched before they escaped") in told


def test_each_kind_has_its_file():
    assert {path.stem for path in TEMPLATES.glob("*.toml")} == set(KINDS)


def test_the_study_of_measured_flocs_is_the_other_one_but_for_who_meets_whom():
    study, measured = (
        (TEMPLATES / f"{kind}.toml").read_text("utf-8").split("\n[")
        for kind in ("study", "measured")
    )
    differing = {a.partition("]")[0] for a, b in zip(study, measured, strict=True) if a != b}
    assert {name for name in differing if "#" not in name} == {"scene", "shapes"}
