"""`flocsim init` of each kind: what it writes can be run as it is."""

import pytest

from flocsim.__main__ import main
from flocsim.commands.init import KINDS


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_can_be_run(kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["init", f"1-{kind}.toml", "--kind", kind]) == 0
    told = capsys.readouterr().out
    command = "swarm" if kind == "swarm" else "ensemble"
    assert told.endswith(f"run it with: flocsim {command} 1-{kind}.toml\n")
    assert main([command, f"1-{kind}.toml", "--dry-run", "--no-pilot"]) == 0
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
