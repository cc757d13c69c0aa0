"""The names that scripts of users depend on."""

import flocsim
from flocsim.ensembles import load_config, run
from tests.helpers.small_study import write_small


def test_a_study_runs_as_a_library(tmp_path):
    results = run(load_config(write_small(tmp_path), {"replicates": 2}))
    assert results.replicates["outcome"].shape[-1] == 2
    assert set(results.probabilities) >= {"pr_inside", "pr_a", "pr_class", "n_total"}


def test_top_level_names():
    assert {"Body", "Fluid", "Sphere", "SpheroPolygon", "System", "Trajectory"} <= set(
        flocsim.__all__
    )
