"""`--dry-run`: with a pilot, without one, and where there can be none."""

import re

import pytest

from flocsim.__main__ import main
from flocsim.ensembles.diagnose import dry_run
from tests.helpers.small_study import run_command, small_config, write_small
from tests.helpers.tiers import rest_slow


def spheres(folder, **over):
    return small_config(folder, {"shapes": {"vertices": [1]}, "replicates": 30} | over)


def test_the_pilot_says_what_the_study_takes(tmp_path):
    text = dry_run.dry_run(spheres(tmp_path), 2, pilot=True)
    assert re.search(r"time: \d+.* on 2 ranks", text)
    assert re.search(r"estimated from (\d+) replicates, which ended: \1 A", text)
    [hours] = re.findall(r"core-hours: (\S+) \((\S+) to (\S+)\), estimated", text)
    value, low, high = map(float, hours)
    assert 0.0 < low < value < high
    assert text.splitlines()[-1].startswith("only the pilot was run (--dry-run)")


def test_without_a_pilot_nothing_is_run(tmp_path):
    text = dry_run.dry_run(spheres(tmp_path), 1)
    assert "time: not known; --pilot runs replicates" in text
    assert "nothing was run (--dry-run); --verbose shows" in text
    # What is asked first: what would run, how long it takes, what is doubtful.
    assert text.splitlines()[0].startswith("120 pairs: 4 conditions of 30 replicates")
    assert "time scales:" not in text


def test_the_engine_is_shown_when_asked(tmp_path):
    text = dry_run.dry_run(spheres(tmp_path), 1, verbose=True)
    for head in ("collisions:", "forces:", "time scales:"):
        assert head in text.splitlines()
    assert text.endswith("nothing was run (--dry-run)")


def test_a_machine_without_a_compiler_is_told_the_rest(folder, environment, capsys):
    environment["NUMBA_DISABLE_JIT"] = "1"
    assert main(["ensemble", "small.toml", "--dry-run", "--pilot"]) == 0
    printed = capsys.readouterr()
    assert re.search("time: not known, because the pilot failed: .*NUMBA_DISABLE_JIT", printed.out)
    assert printed.err == ""


def test_a_signal_ends_the_pilot(folder, stopping, capsys):
    assert main(["ensemble", "small.toml", "--dry-run", "--pilot"]) == 75
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    "kind", rest_slow(["study", "swarm", "kernel", "brownian"], lambda kind: kind == "brownian")
)
def test_a_dry_run_compiles_nothing(in_tmp, own_cache, kind):
    assert main(["init", "study.toml", "--kind", kind]) == 0
    done = run_command(in_tmp, "study.toml", "--dry-run")
    assert done.returncode == 0 and "nothing was run" in done.stdout
    assert not own_cache.exists()


def test_a_pilot_is_for_dry_runs(in_tmp, capsys):
    write_small(in_tmp, vertices="[1]")
    assert main(["ensemble", "small.toml", "--pilot"]) == 2
    assert capsys.readouterr().err == "flocsim: --pilot is for --dry-run: leave it out\n"
    assert [path.name for path in in_tmp.iterdir()] == ["small.toml"]
