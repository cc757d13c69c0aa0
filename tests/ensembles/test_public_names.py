"""The names that scripts of users depend on."""

import ast
import subprocess
import sys
from pathlib import Path

import flocsim
from flocsim.ensembles import load_config, run
from tests.helpers.small_study import write_small


def test_a_study_runs_as_a_library(tmp_path):
    results = run(load_config(write_small(tmp_path), {"replicates": 2}))
    assert results.replicates["outcome"].shape[-1] == 2
    assert set(results.probabilities) >= {"pr_inside", "pr_a", "pr_class", "n_total"}


def test_import_reaches_every_public_name():
    code = (
        "import sys, flocsim; light = 'numba' not in sys.modules\n"
        "found = [getattr(flocsim, n) for n in (*flocsim.__all__, *flocsim.ROOMS)]\n"
        "assert set(flocsim.HOMES) < set(flocsim.__all__) | {'__version__'}\n"
        "assert set(flocsim.__all__) <= set(dir(flocsim))\n"
        "print(light, flocsim.forces.Gravity().g, flocsim.Status.FINISHED)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "True 9.81 FINISHED: the end time was reached\n", done.stderr


def test_editors_see_what_is_loaded_late():
    tree = ast.parse(Path(flocsim.__file__).read_text("utf-8"))
    [block] = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {alias.asname or alias.name for node in block.body for alias in node.names}
    assert seen == {*flocsim.HOMES, *flocsim.ROOMS}


def test_reprs_are_short():
    body = flocsim.Body(flocsim.Sphere(1e-6), density=2650.0)
    system = flocsim.System([body], [flocsim.forces.Gravity()])
    assert repr(system) == "System(1 body, Gravity, Implicit)"


def test_top_level_names():
    assert {"Body", "Fluid", "Sphere", "SpheroPolygon", "System", "Trajectory"} <= set(
        flocsim.__all__
    )
