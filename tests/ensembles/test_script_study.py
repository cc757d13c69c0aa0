"""Study: from a file or a dict, changed, run as the command runs it, refused in one line."""

import os
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest

import flocsim
from flocsim.ensembles import run
from flocsim.ensembles.config.toml_text import settings_of
from flocsim.errors import ConfigError, PlausibilityWarning, UsageError
from tests.helpers.small_study import SMALL, command, run_command, write_small
from tests.helpers.waiting import PATIENCE

TABLES = {
    "preset": "tang2014", "seed": 1, "replicates": 3,
    "scene": {"types": ("I",), "delta": np.array([0.0, 1.0])},
    "shapes": {"vertices": [1]},
}  # fmt: skip


def test_a_dict_is_a_file_like_any_other(tmp_path):
    study = flocsim.Study(TABLES, folder=tmp_path)
    path = tmp_path / "same.toml"
    path.write_text(study.text, "utf-8")
    again = flocsim.Study(path)
    assert again.config.scene == study.config.scene
    assert again.config.output.file == "same.h5"
    assert study.config.output.file == "study.h5"
    assert study.config.scene.delta == (0.0, 1.0)


def test_every_kind_of_value_comes_back_from_toml(tmp_path):
    table = {
        "a": 1e-20, "b": True, "c": 'quoted "word"\n\x7fé\\', "d": [1, 2.5], "e": np.float64(0.1),
        "t": {"u": {"x": -0.0, "y": {}}, "v": tmp_path, "none": None}, "f": [{"g": [0.5]}],
    }  # fmt: skip
    found = tomllib.loads("\n".join(map(" = ".join, settings_of(table))))
    assert found == table | {"t": {"u": {"x": -0.0, "y": {}}, "v": str(tmp_path)}}
    with pytest.raises(ConfigError, match=r"forces\.x: a config holds finite.*found object"):
        list(settings_of({"forces": {"x": object()}}))


def test_with_takes_dotted_nested_and_named_keys_and_leaves_the_first_alone(tmp_path):
    study = flocsim.Study(write_small(tmp_path))
    other = study.with_(
        {"forces.contact.k_n": "10 N/m", "forces.double_layer": False}, seed=7,
        scene={"delta": [0.5]},
    )  # fmt: skip
    assert study.config.seed == 1 and other.config.seed == 7
    assert other.config.scene.delta == (0.5,) and other.config.scene.names[1] == "III"
    assert next(f for f in other.config.forces if hasattr(f, "k_n")).k_n == 10.0
    assert "double_layer" not in other.config.force_names
    third = other.with_({"forces": {"contact": {"k_t": 1.0}}})
    assert dict(settings_of(third.overrides)) == {
        "forces.contact.k_n": '"10 N/m"', "forces.contact.k_t": "1.0",
        "forces.double_layer": "false", "seed": "7", "scene.delta": "[0.5]",
    }  # fmt: skip
    assert repr(third).endswith("small.toml': 6 conditions × 3, 5 changed)")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"forces.contact.kn": 1.0}, r"unknown key \(did you mean 'k_n'\?\)"),
        ({"forces.van_der_waals.hamaker": "5 kg"}, "hamaker must be"),
        ({"sed": 1}, "did you mean 'seed'"),
        ({"a..b": 1}, "keys are words separated by dots"),
    ],
)
def test_what_is_wrong_is_told_as_of_a_file(tmp_path, changes, text):
    study = flocsim.Study(write_small(tmp_path))
    with pytest.raises(ConfigError, match=text) as caught:
        study.with_(changes)
    assert "\n" not in str(caught.value)


def test_a_file_changed_meanwhile_changes_no_study(tmp_path):
    path = write_small(tmp_path)
    study = flocsim.Study(path)
    path.write_text("nonsense", "utf-8")
    assert study.with_(seed=5).config.replicates == 3


def test_rows_are_those_of_the_config(finished):
    study, results = flocsim.Study(finished.folder / "small.toml"), finished
    study = study.with_({"shapes.vertices": [1]})
    here = run(study.config)
    for name, column in here.replicates.items():
        assert column.tobytes() == results.replicates[name].tobytes(), name
    assert results.config.text == study.text
    assert results.config.shapes.vertices == (1,)


def test_a_file_in_the_way_is_left_alone(finished, one_process):
    folder = finished.folder
    study = flocsim.Study(folder / "small.toml").with_({"shapes.vertices": [1]})
    before = (folder / "small.h5").read_bytes()
    for path in (folder / "small.h5", study.path):
        with pytest.raises(UsageError, match=r"already exists.*mode='resume'.*overwrite=True"):
            study.run(output=path)
    assert (folder / "small.h5").read_bytes() == before
    again = study.run(output=folder / "small.h5", mode="resume")
    assert (folder / "small.h5").read_bytes() == before
    assert again.count == 3


def test_without_an_output_results_are_in_memory(in_tmp, one_process):
    study = flocsim.Study(TABLES)
    first, second = study.run(), study.run()
    assert not list(in_tmp.iterdir())
    assert first.table() == second.table() and first.count == 3
    assert first.replicates["outcome"].shape == (1, 1, 2, 3)
    assert second.replicate(1).row["outcome"]
    assert "in memory" in str(first.path)
    study.with_({"output.file": "named.h5"}).run()
    study.run(mode="resume")
    assert {path.name for path in in_tmp.iterdir()} == {"named.h5", "study.h5"}
    with pytest.raises(UsageError, match=r"already exists.*overwrite=True"):
        study.run(output="study.h5")


def test_what_the_command_refuses_is_an_error_here(tmp_path):
    study = flocsim.Study(TABLES, folder=tmp_path).with_({"forces.contact": False})
    with pytest.raises(UsageError, match=r"need a contact force.*add \[forces.contact\]"):
        study.run(output=tmp_path / "x.h5")
    for words in ({"jobs": 0}, {"mode": "again"}):
        with pytest.raises(UsageError, match="must be"):
            study.run(**words)
    with pytest.raises(UsageError, match="not a folder"):
        flocsim.Study(TABLES, folder=tmp_path / "nowhere")


def test_ranks_are_told_to_use_the_command(tmp_path, environment):
    environment["PMI_SIZE"] = "2"
    with pytest.raises(UsageError, match="mpirun"):
        flocsim.Study(TABLES, folder=tmp_path).run(output=tmp_path / "x.h5")


def test_the_command_reads_its_standard_input(tmp_path):

    words = command("-", "--dry-run")
    done = subprocess.run(words, cwd=tmp_path, input=SMALL, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "small.h5" in done.stdout


def test_a_replicate_of_a_study_is_kept_as_motion(tmp_path):
    study = flocsim.Study(TABLES, folder=tmp_path)
    motion = study.replicate(2, "I", 1, 1.0)
    assert motion.row["outcome"] == "A" and motion.t[-1] == motion.row["t_end"]
    with pytest.raises(UsageError, match="type must be one of I, found V"):
        study.replicate(0, "V")
    with pytest.raises(UsageError, match="replicate must be"):
        study.replicate(-1)


def test_a_stopped_run_is_an_error_of_its_own():
    from flocsim.ensembles.parallel.communicator import StopRequested
    from flocsim.ensembles.script_study import error_of

    error = error_of(75, ["", "flocsim: stopped by SIGTERM: 3 replicates are there"])
    assert type(error) is StopRequested
    assert str(error) == ('stopped by SIGTERM: 3 replicates are there; continue with mode="resume"')
    assert "killed" in str(error_of(-9, []))


@pytest.mark.slow
def test_a_quiet_run_still_warns(in_tmp):
    study = flocsim.Study(write_small(in_tmp)).with_(
        {"shapes.vertices": [1], "fluid.viscosity": "0.5 Pa s", "replicates": 1}
    )
    with pytest.warns(PlausibilityWarning, match="viscosity") as found:
        study.run()
    assert found[0].filename == __file__


ENV = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[3])}


@pytest.mark.slow
def test_what_is_no_study_is_done_by_one_rank(tmp_path):
    study = flocsim.Study(write_small(tmp_path, vertices="[1]", replicates=4))
    study.run(output=tmp_path / "r.h5")
    words = ["info", "r.h5"]
    done = subprocess.run(
        command(*words, ranks=2, module="flocsim"), cwd=tmp_path, env=ENV, capture_output=True,
        text=True, timeout=PATIENCE,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    alone = run_command(tmp_path, *words, module="flocsim")
    assert done.stdout == alone.stdout
    assert done.stderr.count("runs on one rank only, and the other") == 1
