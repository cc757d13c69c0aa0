"""A file decides nothing about which code is run: the user allows a folder or a module, or none."""

import json
import os
import shutil
import sys
from pathlib import Path

import attrs
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.errors import ConfigError, UsageError
from flocsim.io.results.file import read_results
from tests.helpers.own_force import OWN, write_own
from tests.helpers.results_files import write_results

CANARY = "import pathlib; pathlib.Path(__file__).with_name('was-run').touch()\n"
"""A module that says beside itself that it was run."""

NAMES = ("own_pull", "neighbour", "canary", "pack", "pack.inner", "linked", "outside")


def forget():
    """Let modules be loaded anew."""
    for name in NAMES:
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder with a finished study by a force of one's own."""
    folder = tmp_path_factory.mktemp("finished")
    forget()
    config = write_own(folder)
    assert main(["ensemble", str(config), "-o", str(folder / "r.h5"), "--quiet"]) in (0, 65)
    return folder


class Spy:
    """Notes every module that Python is asked to find."""

    def __init__(self):
        self.asked = []

    def find_spec(self, fullname, path=None, target=None):
        """Note the name and find nothing."""
        self.asked.append(fullname)


@pytest.fixture
def spy():
    """Notes every module that Python is asked to find from now on."""
    found = Spy()
    sys.meta_path.insert(0, found)
    yield found
    sys.meta_path.remove(found)


@pytest.fixture
def study(finished, in_tmp, monkeypatch):
    """The results alone in the current folder, with canaries of many names beside them."""
    here, elsewhere = in_tmp / "here", in_tmp / "elsewhere"
    for folder in (here / "pack", elsewhere):
        folder.mkdir(parents=True)
    shutil.copy(finished / "r.h5", here)
    for path in (here / "own_pull.py", here / "canary.py", here / "json.py", here / "idle.py",
                 here / "pack/__init__.py", here / "pack/inner.py",
                 elsewhere / "outside.py"):  # fmt: skip
        path.write_text(CANARY + OWN.replace("neighbour", "math").replace("FACTOR", "pi"))
    os.symlink(elsewhere / "outside.py", here / "linked.py")
    os.chdir(here)
    # As in a notebook, and in the worst case.
    monkeypatch.setattr(sys, "path", ["", str(here), *sys.path])
    forget()
    yield here
    forget()


def renamed(study, name):
    """Let the results name another class."""
    changed(study / "r.h5", lambda text: text.replace("own_pull:Pull", name))


def changed(path, change, **run):
    """Write the results once more with another config, and other facts about their run."""
    found = read_results(path)
    path.unlink()
    run = {"config": change(str(found.run["config"])), **run}
    write_results(path, attrs.evolve(found, run=found.run | run))


def was_run(study):
    """Return True if any canary was run."""
    return bool(list(study.parent.rglob("was-run")))


def refused(study, **allowed):
    """Return the one line that refuses to run a replicate again."""
    with pytest.raises(ConfigError) as caught:
        flocsim.open(study / "r.h5", **allowed).replicate(0)
    assert not was_run(study)
    assert "\n" not in str(caught.value)
    return str(caught.value)


FOREIGN = ["own_pull:Pull", "canary:Pull", "pack.inner:Pull", "linked:Pull", "json:JSONDecoder",
           "os:path", "antigravity:Pull", "idlelib.idle:Pull", "xml.sax:Pull",
           "flocsim.forces:Gravity"]  # fmt: skip


@pytest.mark.parametrize("name", FOREIGN)
def test_no_name_in_a_file_reaches_an_import(study, spy, name):
    renamed(study, name)
    before = set(sys.modules)
    said = refused(study)
    module = name.partition(":")[0]
    assert f"{name} was not loaded" in said and f"--own {module}" in said and "--folder" in said
    assert not {module, module.partition(".")[0]} & set(spy.asked)
    assert not {"antigravity", "idlelib.idle", "canary", "pack"} & (set(sys.modules) - before)


@pytest.mark.parametrize("name", ["canary:Pull", "pack.inner:Pull"])
@pytest.mark.parametrize(
    "words", [["report", "r.h5", "-o", "r.html"], ["info", "r.h5", "--water"], ["info", "r.h5"],
              ["info", "r.h5", "--modules"], ["strength", "r.h5", "--count", "1"],
              ["compare", "r.h5", "r.h5"], ["plot", "r.h5", "--figures", "4"],
              ["export", "matrix", "r.h5", "--curvilinear", "spheres"],
              ["trajectory", "r.h5"], ["sweep", "r.h5", "--over", "seed=1,2"]],
    ids=" ".join,
)  # fmt: skip
def test_no_command_imports_what_a_file_names(study, words, name, one_figure, capsys):
    renamed(study, name)
    code = main(words)
    out, err = capsys.readouterr()
    assert not was_run(study)
    assert "Traceback" not in out + err
    if words[0] in ("report", "strength") or "--water" in words:
        lines = [line for line in (out + err).splitlines() if f"{name} was not loaded" in line]
        assert len(lines) == 1 and "--folder DIR" in lines[0] and "--own " in lines[0]
        assert code == (0 if words[0] == "report" else 2)
    if words[0] == "report":
        assert f"{name} was not loaded" in (study / "r.html").read_text()


def test_a_named_folder_has_the_module_and_its_neighbours(study, finished):
    assert flocsim.open(study / "r.h5", folder=finished).replicate(0).row["outcome"]
    assert sys.modules["own_pull"].__file__ == str(finished / "own_pull.py")
    assert not was_run(study)


def test_a_module_may_lie_in_a_package_of_the_folder(study):
    renamed(study, "pack.inner:Pull")
    assert flocsim.open(study / "r.h5", folder=study).config.forces[-1]
    assert was_run(study)


@pytest.mark.parametrize("name", ["antigravity:Pull", "json.decoder:Pull", "pack.more:Pull"])
def test_a_folder_allows_its_own_files_only(study, spy, name):
    (study / "more.py").write_text(CANARY)
    renamed(study, name)
    assert f"{study} does not have it" in refused(study, folder=study)
    assert not {"antigravity", "json.decoder", "pack.more"} & set(spy.asked)


def test_a_link_out_of_the_folder_is_not_followed(study, finished):
    renamed(study, "linked:Pull")
    assert "leads out of" in refused(study, folder=study)
    shutil.copy(finished / "own_pull.py", study)
    os.symlink(study.parent / "elsewhere/outside.py", study / "neighbour.py")
    renamed(study, "own_pull:Pull")
    changed(study / "r.h5", lambda text: text.replace("linked:", "own_pull:"))
    assert "leads out of" in refused(study, folder=study)


def test_an_installed_module_is_allowed_by_its_whole_name(study, spy, finished):
    sys.path[:2] = [str(finished)]
    assert flocsim.open(study / "r.h5", own=["own_pull"]).replicate(0).row["outcome"]
    forget()
    spy.asked.clear()
    refused(study, own=["own", "own_pull.more", "neighbour"])
    assert not spy.asked
    renamed(study, "own_pull.inner:Pull")
    refused(study, own="own_pull")
    assert not spy.asked


@pytest.mark.parametrize("words", [["info", "r.h5", "--water"], ["report", "r.h5", "--overwrite"]])
def test_commands_take_a_folder_or_a_module(study, finished, words, one_figure, capsys):
    sys.path[:2] = [str(finished)]
    for allowed in (["--folder", str(finished)], ["--own", "json", "--own", "own_pull"]):
        forget()
        assert main([*words, *allowed]) == 0
        assert "was not loaded" not in capsys.readouterr().out
        assert "own_pull" in sys.modules


def test_results_of_a_study_use_the_classes_that_it_imported(study, finished):
    results = flocsim.Study(finished / "small.toml").run(output=study / "again.h5")
    assert results.replicate(0).row["outcome"]


def test_a_file_keeps_the_sources_as_a_record(study, finished, capsys):
    kept = json.loads(read_results(study / "r.h5").run["modules"])
    assert {place: each["source"] for place, each in kept.items()} == {
        "own_pull.py": OWN, "neighbour.py": "FACTOR = -1.0\n",
    }  # fmt: skip
    assert main(["info", "r.h5", "--modules"]) == 0
    assert OWN in capsys.readouterr().out
    # A record permits nothing.
    shutil.copy(finished / "own_pull.py", study)
    refused(study)


def test_another_physics_of_a_named_folder_is_seen(finished, tmp_path):
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    (tmp_path / "neighbour.py").write_text("FACTOR = -2.0\n")
    with pytest.raises(UsageError, match=r"the compiled code for .* has changed"):
        flocsim.open(tmp_path / "r.h5", folder=tmp_path).replicate(0)
    code = main(["ensemble", str(tmp_path / "small.toml"), "-o", str(tmp_path / "r.h5"),
                 "--resume"])  # fmt: skip
    assert code == 2


def test_cheap_checks_come_before_flocs_are_grown(finished, tmp_path):
    """A pool of 100,000 flocs takes hours: what has changed is seen before."""
    path = Path(shutil.copy(finished / "r.h5", tmp_path))
    changed(path, lambda text: text.replace("pool = 2", "pool = 100000"))
    with pytest.raises(UsageError, match=r"shapes.pool is 2 in the file, 100000 now"):
        flocsim.open(path, folder=finished).replicate(0)


def test_a_replicate_that_comes_out_otherwise_is_refused(finished, tmp_path):
    path = Path(shutil.copy(finished / "r.h5", tmp_path))
    found = read_results(path)
    rows = dict(found.replicates)
    rows["steps"][:] = 0
    rows["outcome"][0, 0, 0, 0], rows["bond"][0, 0, 0, 0] = 5, 255
    path.unlink()
    write_results(path, attrs.evolve(found, replicates=rows))
    with pytest.raises(UsageError, match="cannot be reproduced: outcome is"):
        flocsim.open(path, folder=finished).replicate(0)
