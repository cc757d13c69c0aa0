"""`--dry-run`: with a pilot, without one, and where there can be none."""

import re

import pytest

from flocsim.__main__ import main
from flocsim.ensembles import cli
from flocsim.ensembles.diagnose import dry_run, pilot
from flocsim.errors import FlocsimError
from tests.helpers.small_study import run_command, small_config, write_small
from tests.helpers.tiers import rest_slow


def spheres(folder, **over):
    return small_config(folder, {"shapes": {"vertices": [1]}, "replicates": 30} | over)


def test_the_pilot_says_what_the_study_takes(tmp_path, monkeypatch):
    monkeypatch.setattr(pilot.forecast_of, "__defaults__", (0.0,))
    text = dry_run.dry_run(spheres(tmp_path), 2, pilot=True)
    assert "ran 12 replicates; they ended 12 A" in text
    [hours] = re.findall(r"core-hours: (\S+) \((\S+) to (\S+)\); on 2 ranks \d", text)
    value, low, high = map(float, hours)
    assert 0.0 < low < value < high
    assert text.endswith("only the pilot was run (--dry-run)")


def test_without_a_pilot_nothing_is_run(tmp_path, monkeypatch):
    monkeypatch.setattr(dry_run, "pilot_lines", None)
    text = dry_run.dry_run(spheres(tmp_path), 1)
    assert "pilot:" not in text
    assert "nothing was run (--dry-run); --pilot runs some replicates" in text


def test_a_pilot_that_fails_is_one_line_among_the_others(tmp_path, monkeypatch):
    def fail(*arguments):
        raise FlocsimError("no compiler")

    monkeypatch.setattr(dry_run, "forecast_of", fail)
    lines = dry_run.dry_run(spheres(tmp_path), 1, pilot=True).splitlines()
    assert lines[-2] == "  none could be run: no compiler"
    assert any(line.startswith("stiffness:") for line in lines)


@pytest.mark.slow
def test_a_machine_without_a_compiler_is_told_the_rest(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    write_small(tmp_path, vertices="[1]")
    done = run_command(tmp_path, "small.toml", "--dry-run", "--pilot")
    assert (done.returncode, done.stderr) == (0, "")
    assert re.search("none could be run: .*NUMBA_DISABLE_JIT is set", done.stdout)


def test_a_signal_ends_the_pilot(tmp_path, monkeypatch, capsys):
    write_small(tmp_path, vertices="[1]")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pilot, "stop_requested", lambda: True)
    monkeypatch.setattr(cli, "stop_requested", lambda: True)
    assert main(["ensemble", "small.toml", "--dry-run", "--pilot"]) == 75
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    "kind", rest_slow(["study", "swarm", "kernel", "brownian"], lambda kind: kind == "brownian")
)
def test_a_dry_run_compiles_nothing(tmp_path, monkeypatch, kind):
    cache = tmp_path / "cache"
    monkeypatch.setenv("FLOCSIM_CACHE", str(cache))
    monkeypatch.chdir(tmp_path)
    assert main(["init", "study.toml", "--kind", kind]) == 0
    done = run_command(tmp_path, "study.toml", "--dry-run")
    assert done.returncode == 0 and "nothing was run" in done.stdout
    assert not cache.exists()


def test_a_pilot_is_for_dry_runs(in_tmp, capsys):
    write_small(in_tmp, vertices="[1]")
    assert main(["ensemble", "small.toml", "--pilot"]) == 2
    assert capsys.readouterr().err == "flocsim: --pilot is for --dry-run: leave it out\n"
    assert [path.name for path in in_tmp.iterdir()] == ["small.toml"]
