"""Every config in examples/ loads, can be run, and means what its comments say."""

import os
import shutil

import pytest

from flocsim.__main__ import main
from flocsim.ensembles.config.loader import load_any_config, load_config
from flocsim.ensembles.diagnose.preflight import check_study
from flocsim.ensembles.swarms.study import SwarmStudy
from flocsim.io.results import swarm_file
from flocsim.io.results.file import read_results
from tests.helpers.small_study import ROOT, problems, run_command, write_star_library
from tests.helpers.tiers import rest_slow

SWARM = ROOT / "examples" / "swarm.toml"
SWARMS = {
    SWARM: "2 swarms of 60 bodies",
    SWARM.with_name("settling_swarm.toml"): "30 swarms of 400",
}
"""Path → how its dry run begins."""
EXAMPLES = sorted(path for path in (ROOT / "examples").glob("*.toml") if path not in SWARMS)


def test_there_are_examples():
    assert EXAMPLES


@pytest.fixture
def examples(tmp_path):
    """A copy of the folder, with a library of stars where the user's real flocs would be."""
    leave_out = shutil.ignore_patterns("*.h5")
    folder = shutil.copytree(ROOT / "examples", tmp_path / "examples", ignore=leave_out)
    sizes = (7.0, 8.0, 9.0, 11.0, 13.0, 15.0, 16.0, 18.0, 24.0)
    write_star_library(folder / "real_flocs_shapes.h5", (4, 16, 32, 64), sizes)
    return folder


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_loads_and_describes_itself(path, examples, capsys):
    check_study(load_config(examples / path.name))
    assert main(["ensemble", str(examples / path.name), "--dry-run"]) == 0
    said = capsys.readouterr()
    assert problems(said.err) == [] and "nothing was run" in said.out


REDUCED = {
    "own_force": ("vertices = [1, 16]", "vertices = [16]"),
    "kernel": ('"5 um", "8 um", "12 um", "20 um", "30 um"', '"8 um", "20 um"'),
}
"""Name → (text, its replacement) where that saves compiling a scene of its own for spheres, or many
conditions."""

LEAST = {"kernel": 8, "settling_kernel": 8}
"""Name → replicates, where there may not be two."""


@pytest.mark.parametrize(
    "path",
    rest_slow(EXAMPLES, lambda path: path.stem == "quickstart"),
    ids=lambda path: path.stem,
)
def test_a_reduced_example_runs(path, examples, in_tmp, capsys):
    whole, reduced = REDUCED.get(path.stem, ("", ""))
    assert whole in path.read_text("utf-8")
    text = path.read_text("utf-8").replace(whole, reduced)
    (examples / path.name).write_text(text, "utf-8")
    count = LEAST.get(path.stem, 2)
    words = ["--replicates", str(count), "--output", "out.h5", "--quiet"]
    os.chdir(examples)
    assert main(["ensemble", path.name, *words]) == 0
    said = capsys.readouterr()
    assert (said.out, problems(said.err)) == ("", [])
    table = read_results(examples / "out.h5").probabilities
    assert table["n_total"].min() == count
    assert table["n_failed"].sum() == 0
    assert table["n_undecided"].sum() == 0
    assert table["n_collided"].sum() > 0


@pytest.mark.parametrize(
    "path", rest_slow(SWARMS, lambda path: path.stem == "swarm"), ids=lambda path: path.stem
)
def test_a_swarm_describes_itself(path, examples, capsys):
    SwarmStudy.check(load_any_config(examples / path.name))
    assert main(["swarm", str(examples / path.name), "--dry-run"]) == 0
    said = capsys.readouterr()
    assert said.err == "" and "nothing was run" in said.out
    assert SWARMS[path] in said.out and "N = 16" in said.out


@pytest.mark.slow
def test_a_reduced_swarm_runs(examples):
    words = ["--set", "scene.number=24", "--set", "scene.duration=0.2", "--quiet"]
    done = run_command(examples, SWARM.name, *words)
    assert (done.returncode, done.stdout, problems(done.stderr)) == (0, "", [])
    ends = swarm_file.SWARMS.read(examples / "swarm.h5").groups["ends"]
    assert ends["finished"].tolist() == [1, 1]
