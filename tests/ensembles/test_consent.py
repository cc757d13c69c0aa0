"""A results file names modules: they are run as the file keeps them, or where the user says so."""

import json
import os
import py_compile
import shutil
import sys
import zipfile
from pathlib import Path

import attrs
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.ensembles.config.sources import kept_sources
from flocsim.ensembles.pairs import contents
from flocsim.errors import ConfigError, UsageError
from flocsim.io.results.file import read_results
from tests.helpers.own_force import OWN, write_own
from tests.helpers.results_files import write_results
from tests.helpers.tiers import rest_slow

MARK = "import pathlib; pathlib.Path('was-run').touch()\n"
NAMES = ("own_pull", "neighbour", "pack", "pack.inner")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder with a finished study by a force of one's own."""
    folder = tmp_path_factory.mktemp("finished")
    forget()
    config = write_own(folder)
    assert main(["ensemble", str(config), "-o", str(folder / "r.h5"), "--quiet"]) in (0, 65)
    return folder


@pytest.fixture
def study(finished, tmp_path, monkeypatch):
    """A copy of it, its modules not loaded."""
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    forget()
    yield tmp_path
    forget()


def forget():
    """Let modules be loaded anew."""
    for name in NAMES:
        sys.modules.pop(name, None)


def changed(path, **run):
    """Write the results once more, with other facts about their run; None leaves one out."""
    found = read_results(path)
    facts = {name: value for name, value in (found.run | run).items() if value is not None}
    path.unlink()
    write_results(path, attrs.evolve(found, run=facts))


def refused(study, folder=None):
    """The one line that refuses to run a replicate again; nothing of the folder was run."""
    with pytest.raises(ConfigError) as caught:
        flocsim.open(study / "r.h5", folder=folder).replicate(0)
    assert not (study / "was-run").exists()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_file_keeps_the_sources_and_its_modules_are_run(study, capsys):
    kept = json.loads(read_results(study / "r.h5").run["modules"])
    assert {place: each["source"] for place, each in kept.items()} == {
        "own_pull.py": OWN, "neighbour.py": "FACTOR = -1.0\n",
    }  # fmt: skip
    assert flocsim.open(study / "r.h5").replicate(0).row["outcome"]
    assert main(["info", "r.h5", "--modules"]) == 0
    assert OWN in capsys.readouterr().out


def test_sources_are_kept_where_modules_had_been_loaded_before(study):
    for name in ("first.h5", "second.h5"):
        config = flocsim.ensembles.load_config(study / "small.toml")
        assert set(config.modules) == {"own_pull.py", "neighbour.py"}, name


@pytest.mark.parametrize("name", ["own_pull.py", "neighbour.py"])
def test_a_module_that_has_changed_is_not_run(study, name):
    path = study / name
    path.write_text(path.read_text() + MARK)
    said = refused(study)
    number = len(path.read_text().splitlines())
    assert f"{name} differs from the one" in said and f"(from line {number} on)" in said
    assert flocsim.open(study / "r.h5", folder=study).replicate(0).row["outcome"]
    assert (study / "was-run").exists()


def test_another_physics_of_a_named_folder_is_run_and_seen(study):
    (study / "neighbour.py").write_text("FACTOR = -2.0\n")
    with pytest.raises(UsageError, match=r"the compiled code for .* has changed"):
        flocsim.open(study / "r.h5", folder=study).replicate(0)


def test_files_of_before_name_modules_that_are_run_only_from_a_named_folder(study, capsys):
    changed(study / "r.h5", modules=None)
    assert "has no source of" in refused(study)
    assert flocsim.open(study / "r.h5", folder=study).replicate(0).row["outcome"]
    assert main(["info", "r.h5", "--modules"]) == 74
    assert "has no modules" in capsys.readouterr().err


@pytest.mark.parametrize(
    "own",
    rest_slow(
        ["antigravity:Pull", "this:Pull", "sys:Pull", "pack.inner:Pull"], lambda own: own[0] in "tp"
    ),
)
def test_no_other_module_is_imported(study, own):
    (study / "pack").mkdir()
    for name in ("__init__.py", "inner.py"):
        (study / "pack" / name).write_text(MARK + OWN.replace("neighbour", "pack"))
    text = str(read_results(study / "r.h5").run["config"])
    changed(study / "r.h5", config=text.replace("own_pull:Pull", own))
    before = set(sys.modules)
    assert "was not run" in refused(study)
    assert not {"antigravity", "this", "pack"} & (set(sys.modules) - before)


def test_an_installed_module_is_imported_only_for_a_class_of_its_own(study):
    """Running idlelib.idle opens a window; whoever makes a file can know its source."""
    kept = kept_sources(
        {"idlelib.idle": (Path(os.__file__).parent / "idlelib/idle.py").read_bytes()}
    )
    text = str(read_results(study / "r.h5").run["config"])
    changed(study / "r.h5", config=text.replace("own_pull:", "idlelib.idle:"), modules=kept)
    assert "has no 'Pull'" in refused(study)
    assert "idlelib.idle" not in sys.modules


def test_a_neighbour_without_source_is_not_run(study):
    (study / "neighbour.py").unlink()
    (study / "n.py").write_text(MARK + "FACTOR = -1.0\n")
    py_compile.compile(str(study / "n.py"), cfile=str(study / "neighbour.pyc"))
    assert "has no source to compare" in refused(study)


def test_a_module_in_an_archive_is_not_run(study, monkeypatch):
    """What Python finds on its path elsewhere has to be known as well."""
    with zipfile.ZipFile(study / "more.zip", "w") as archive:
        archive.writestr("zipped.py", MARK + OWN)
    monkeypatch.syspath_prepend(str(study / "more.zip"))
    text = str(read_results(study / "r.h5").run["config"])
    changed(study / "r.h5", config=text.replace("own_pull:", "zipped:"))
    assert "of which no source was found" in refused(study)


@pytest.mark.parametrize("words", [["report", "-o", "r.html"], ["strength", "--count", "1"]])
def test_commands_run_no_module_that_has_changed(study, words, monkeypatch, capsys):
    monkeypatch.setattr(contents, "FIGURES", {"4": contents.FIGURES["4"]})
    path = study / "own_pull.py"
    path.write_text(MARK + path.read_text())
    command, *more = words
    code = main([command, "r.h5", *more])
    out = capsys.readouterr()
    told = out.out + out.err
    assert not (study / "was-run").exists()
    assert "was not run" in told and "Traceback" not in told
    assert code == (0 if command == "report" else 2)


def test_cheap_checks_come_before_flocs_are_grown(study, monkeypatch):
    """A pool of 100,000 flocs takes hours: what has changed is seen before."""
    from flocsim.ensembles import study as module

    monkeypatch.setattr(module, "load_flocs", lambda *_: pytest.fail("flocs are grown"))
    path = study / "r.h5"
    text = str(read_results(path).run["config"])
    changed(path, config=text.replace("pool = 2", "pool = 100000"))
    with pytest.raises(UsageError, match=r"shapes.pool is 2 in the file, 100000 now"):
        flocsim.open(path).replicate(0)
    identity = json.loads(read_results(path).run["identity"]) | {"shapes.pool": 100000}
    grown = text.replace("pool = 2", "pool = 100000").replace("vertices = [1]", "vertices = [1, 4]")
    changed(path, config=grown, identity=json.dumps(identity))
    with pytest.raises(UsageError, match="asks for 100000 flocs, but its rows have 0"):
        flocsim.open(path).replicate(0, vertices=1)


def test_a_replicate_that_comes_out_otherwise_is_refused(study):
    path = study / "r.h5"
    found = read_results(path)
    found.replicates["steps"][:] = 0
    found.replicates["outcome"][0, 0, 0, 0], found.replicates["bond"][0, 0, 0, 0] = 5, 255
    path.unlink()
    write_results(path, found)
    with pytest.raises(UsageError, match="cannot be reproduced: outcome is"):
        flocsim.open(path).replicate(0)
