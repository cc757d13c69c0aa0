"""accuracy = "auto" from config to file: the same bytes on any ranks, and after a kill."""

import json

import numpy as np
import pytest

from flocsim.ensembles import runner
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.kind import COLUMNS
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import SharedError, run_to_file
from flocsim.ensembles.storage.resume import NEW, RESUME
from flocsim.errors import ConfigError
from flocsim.io.results.file import read_results
from tests.helpers.small_study import problem_lines, run_command, small_config, write_small

SPHERES = {
    "integrator": {"accuracy": "auto", "check_share": 0.0},
    "shapes": {"vertices": [1]},
    "scene": {"types": ["III"], "delta": [0.0, 1.0]},
    "replicates": 450,
}


def same_rows(a, b):
    return all(
        np.array_equal(a.replicates[name], b.replicates[name], equal_nan=True) for name in COLUMNS
    )


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """(the folder, Results of the study of spheres)."""
    folder = tmp_path_factory.mktemp("auto")
    config = small_config(folder, SPHERES)
    run_to_file(config, Communicator(), folder / "one.h5", NEW)
    return folder, read_results(folder / "one.h5")


def test_the_file_has_the_choice_and_its_rows_are_of_it(first):
    folder, found = first
    record = json.loads(found.run["accuracy"])
    [chosen] = record["types"]
    assert (chosen["name"], chosen["method"], chosen["replicates"]) == ("III", "implicit", 15)
    fixed = {"integrator": {"tolerance": chosen["tolerance"], "check_share": 0.0}}
    config = small_config(folder, SPHERES | fixed)
    run_to_file(config, Communicator(), folder / "fixed.h5", NEW)
    assert same_rows(found, read_results(folder / "fixed.h5"))


@pytest.mark.slow
def test_two_ranks_choose_and_compute_the_same(first):
    folder, found = first
    text = "\n".join([
        'preset = "tang2014"', "seed = 1", "replicates = 450", "[scene]", 'types = ["III"]',
        "delta = [0.0, 1.0]", "[shapes]", "vertices = [1]", "pool = 2", "[integrator]",
        'accuracy = "auto"', "check_share = 0",
    ])  # fmt: skip
    write_small(folder, text, "two.toml")
    done = run_command(folder, "two.toml", "--jobs", "2")
    assert done.returncode == 0, done.stderr
    assert "III: implicit" in done.stdout
    other = read_results(folder / "two.h5")
    assert same_rows(found, other)
    assert json.loads(other.run["accuracy"]) == json.loads(found.run["accuracy"])


@pytest.mark.slow
def test_what_was_stopped_goes_on_with_the_choice_it_had(first, monkeypatch):
    folder, found = first
    config = small_config(folder, SPHERES)
    output = folder / "stopped.h5"

    def stopped(*words):
        raise RuntimeError("stopped")

    with monkeypatch.context() as patch:
        patch.setattr(runner, "make_results", stopped)
        with pytest.raises(RuntimeError):
            run_to_file(config, Communicator(), output, NEW)
    monkeypatch.setattr(runner, "choose", stopped)
    run_to_file(config, Communicator(), output, RESUME)
    again = read_results(output)
    assert same_rows(found, again)
    assert again.run["accuracy"] == found.run["accuracy"]


@pytest.mark.slow
def test_a_file_of_another_choice_is_not_extended(first):
    folder, _ = first
    before = (folder / "one.h5").read_bytes()
    more = small_config(folder, SPHERES | {"replicates": 60_000})
    with pytest.raises(SharedError, match=r"types\.III\.integrator is .* in the file"):
        run_to_file(more, Communicator(), folder / "one.h5", RESUME)
    assert (folder / "one.h5").read_bytes() == before


@pytest.mark.parametrize("line", ['name = "implicit"', "tolerance = 1e-9", "step = 1e-6"])
def test_a_setting_beside_auto_is_refused(tmp_path, line):
    text = f'preset = "tang2014"\n[integrator]\naccuracy = "auto"\n{line}\n'
    [said] = problem_lines(tmp_path, text)
    assert "excludes" in said and "accuracy" in said and said.startswith("study.toml:")


def test_the_last_one_counts(tmp_path):
    auto = small_config(tmp_path, {"integrator": {"accuracy": "auto"}})
    assert auto.integrator.is_chosen
    text = 'preset = "tang2014"\n[integrator]\naccuracy = "auto"\n'
    path = tmp_path / "auto.toml"
    path.write_text(text)
    assert not load_config(path, {"integrator": {"tolerance": 1e-8}}).integrator.is_chosen
    path.write_text(text.replace('accuracy = "auto"', 'name = "overdamped"\ntolerance = 1e-7'))
    assert load_config(path, {"integrator": {"accuracy": "auto"}}).integrator.is_chosen
    with pytest.raises(ConfigError, match="must be 'auto', found 'high'"):
        load_config(path, {"integrator": {"accuracy": "high"}})
