"""`flocsim study`: from pictures to a report, in a folder of its own."""

import os
import re
import shlex
import signal
import subprocess
import sys

import imageio.v3
import numpy as np
import pytest

from flocsim.__main__ import main
from flocsim.commands.study import open_folder

WORDS = ["flocs.png", "--pixel-size", "1e-6", "--preset", "clay", "--jobs", "1", "-o", "mine"]
FEW = ["--replicates", "1", "--set", "shapes.vertices=[1]", "--set", "scene.delta=[0.0]"]


@pytest.fixture
def picture(in_tmp):
    """A picture of two dark discs of different sizes."""
    y, x = np.mgrid[:160, :240]
    grey = np.full(x.shape, 200, np.uint8)
    for centre, radius in (((80, 60), 22), ((80, 170), 32)):
        grey[(y - centre[0]) ** 2 + (x - centre[1]) ** 2 < radius**2] = 40
    imageio.v3.imwrite("flocs.png", grey)
    return in_tmp


def study(*words):
    """Exit code of a study, also of a step that has failed."""
    try:
        return main(["study", *WORDS, *FEW, *words])
    except SystemExit as error:
        return error.code


def steps(text):
    """The commands that were shown."""
    return re.findall(r"^\$ flocsim ([\w-]+)", text, re.MULTILINE)


def test_study_ends_with_an_answer(picture, capfd):
    (picture / "notes.png").write_text("no picture")
    assert main(["study", "notes.png", *WORDS, *FEW]) == 0
    told = capfd.readouterr().out
    assert steps(told) == ["fit", "init", "ensemble", "plot", "report"]
    *_, setting, answer, _, doubt, _, page, review, _ = told.split("\n")
    assert setting.startswith("Preset clay: real weight, water of 15 °C and 35 g/kg of salt, ")
    assert answer.startswith("Of pairs of spheres that touch, 100 % [")
    assert doubt == "warning: left out: notes.png"
    assert page == "all on one page: mine/report.html"
    assert review.startswith("choose flocs by eye on mine/shapes-review.html; then add --reviewed")
    assert (picture / "mine/report.html").exists()
    assert (picture / "mine/shapes-review.html").exists()


@pytest.mark.slow
def test_second_call_does_what_is_missing_and_leaves_what_is_not_its_own(picture, capfd):
    assert study() == 0 and study() == 0
    assert steps(capfd.readouterr().out)[5:] == ["ensemble"]
    config, note = picture / "mine/clay.toml", picture / "mine/figures/clay-notes.png"
    config.write_text(config.read_text() + "# edited\n")
    note.write_text("mine")
    assert study("--replicates", "2") == 0
    told = capfd.readouterr().out
    assert steps(told) == ["ensemble", "plot", "report"]
    assert "mine/clay.toml has been edited, and is used as it is" in told
    assert note.read_text() == "mine" and config.read_text().endswith("# edited\n")
    assert not list((picture / "mine").rglob("*.1.*"))


@pytest.mark.slow
def test_files_that_others_have_changed_are_replaced_only_when_asked_for(picture, capfd):
    assert study() == 0
    assert study("--pixel-size", "2e-6") == 2
    assert "mine/shapes.h5 was made from other pixel size: name another" in capfd.readouterr().err
    (picture / "mine/report.html").write_text("mine")
    assert study("--replicates", "2") == 2
    assert "mine/report.html already exists" in capfd.readouterr().err
    assert study("--pixel-size", "2e-6", "--overwrite") == 0
    names = {path.name for path in (picture / "mine").rglob("*.1.*")}
    assert {"shapes.1.h5", "clay.1.h5", "report.1.html"} <= names


def test_folder_of_somebody_else_is_refused(picture, capfd):
    (picture / "mine").mkdir()
    (picture / "mine/thesis.tex").touch()
    assert study() == 2
    assert capfd.readouterr().err == (
        "flocsim: mine has files and was not made by flocsim study: name another by -o\n"
    )
    (picture / "mine/study.json").write_text("{}")
    assert study() == 74
    assert "mine/study.json is no record of a study" in capfd.readouterr().err
    assert len(list((picture / "mine").iterdir())) == 2


def test_folder_in_use_is_refused(picture, capfd, monkeypatch):
    monkeypatch.setattr("flocsim.io.journal.LOCK_SECONDS", 0.1)
    with open_folder(picture / "mine"):
        assert study() == 74
    assert "being written by another job" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none/*.png"], "none/*.png is not a file: name pictures, or a folder of pictures"),
        (["flocs.png"], "give the length of its side, for example --pixel-size '0.95 um'"),
        (["flocs.png", "--pixel-size", "1e-6", "--fit=--min-radius 70"], "nothing was fitted"),
    ],
)
def test_study_without_flocs_ends_in_a_line(words, said, picture):
    command = [sys.executable, "-m", "flocsim", "study", *words, "-o", "mine"]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 2
    assert said in ended.stderr and ended.stderr.count("\n") == 1


def test_stopped_study_says_how_it_goes_on(picture):
    command = [sys.executable, "-m", "flocsim", "study", *WORDS, *FEW]
    # Where this Python is on the PATH, the command that goes on has its short name.
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env=os.environ | {"PATH": os.defpath},
    )  # fmt: skip
    assert process.stdout is not None
    while not process.stdout.readline().startswith("$ flocsim fit"):
        pass
    process.send_signal(signal.SIGINT)
    *_, said, again = process.communicate()[0].splitlines()
    assert process.returncode == 75
    assert said == "flocsim: stopped by SIGINT: what was finished is kept, go on with"
    assert shlex.split(again) == command
