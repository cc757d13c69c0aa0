"""Every config in examples/ loads, can be run, and means what its comments say."""

import shutil

import pytest

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.preflight import check_study
from flocsim.io.results.file import read_results
from tests.helpers.small_study import ROOT, problems, run_command, write_star_library

EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))


def test_there_are_examples():
    assert EXAMPLES


@pytest.fixture
def examples(tmp_path):
    """A copy of the folder, with a library of stars where the user's real flocs would be."""
    leave_out = shutil.ignore_patterns("*.h5")
    folder = shutil.copytree(ROOT / "examples", tmp_path / "examples", ignore=leave_out)
    write_star_library(folder / "real_flocs_shapes.h5", vertices=(4, 16, 64))
    return folder


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_loads_and_describes_itself(path, examples):
    check_study(load_config(examples / path.name))
    done = run_command(examples.parent, f"examples/{path.name}", "--dry-run", "--no-pilot")
    assert (done.returncode, problems(done.stderr)) == (0, [])
    assert "nothing was run" in done.stdout


REDUCED = {"own_force": ("vertices = [1, 16]", "vertices = [16]")}
"""Name → (text, its replacement) where that saves compiling a scene of its own for spheres."""


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_a_reduced_example_runs(path, examples):
    whole, reduced = REDUCED.get(path.stem, ("", ""))
    assert whole in path.read_text("utf-8")
    text = path.read_text("utf-8").replace(whole, reduced)
    (examples / path.name).write_text(text, "utf-8")
    words = ["--replicates", 2, "--output", "out.h5", "--quiet"]
    done = run_command(examples, path.name, *words, timeout=300)
    assert (done.returncode, done.stdout, problems(done.stderr)) == (0, "", [])
    table = read_results(examples / "out.h5").probabilities
    assert table["n_total"].min() == 2
    assert table["n_failed"].sum() == 0
    assert table["n_undecided"].sum() == 0
    assert table["n_collided"].sum() > 0
