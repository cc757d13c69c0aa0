"""A value that makes the answer of a study known beforehand is doubted, and no other one."""

from pathlib import Path

import pytest

from flocsim.commands.init import KINDS
from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.diagnose.preflight import trivial_values
from flocsim.io.shape_library import SHIPPED
from tests.helpers.small_study import load_text

FOLDER = Path(__file__).parents[3] / "examples"
EXAMPLES = [path for path in sorted(FOLDER.glob("**/*.toml")) if path.stem != "readings"]

PAIRS = 'preset = "tang2014"\n[scene]\ntypes = ["I", "II"]\ndelta = [{delta}]\n[shapes]\n{shapes}\n'


def doubts(folder, delta="0.0, 0.5", shapes="vertices = [1]", more=""):
    return trivial_values(load_text(folder, PAIRS.format(delta=delta, shapes=shapes) + more))


@pytest.mark.parametrize("delta", ["0, 50", "0.0, 2.0", "100"])
def test_offsets_in_per_cent_are_doubted(tmp_path, delta):
    [line] = doubts(tmp_path, delta)
    assert line.startswith("scene.delta = ") and "write" not in line and "0.5 for 50 %" in line


@pytest.mark.parametrize("delta", ["0.0, 0.5, 1.0", "1.05", "1.1"])
def test_offsets_that_attraction_may_bridge_are_not(tmp_path, delta):
    assert doubts(tmp_path, delta) == []


def test_a_library_of_spheres_alone_is_doubted(tmp_path):
    library = 'source = "library"\nfile = "synthetic"\nvertices = '
    [line] = doubts(tmp_path, shapes=library + "[1]")
    assert line.startswith("shapes.vertices = [1] takes every floc")
    assert doubts(tmp_path, shapes=library + "[1, 16]") == []


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_no_example_is_doubted(path):
    fitted = "real_flocs_shapes.h5" in path.read_text("utf-8")  # made by another example
    config = load_any_config(path, {"shapes": {"file": str(SHIPPED)}} if fitted else {})
    assert config.scene.kind == "swarm" or trivial_values(config) == []


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "swarm"])
def test_no_template_is_doubted(kind, tmp_path, monkeypatch):
    from flocsim.__main__ import main

    monkeypatch.chdir(tmp_path)
    own = ["--shapes", str(SHIPPED)] if kind == "pictures" else []
    assert main(["init", "s.toml", "--kind", kind, *own]) == 0
    assert trivial_values(load_any_config("s.toml")) == []
