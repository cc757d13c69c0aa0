"""What commands may write to: never what they read, and nothing that exists without being asked."""

import os
from itertools import product

import numpy as np
import pytest
from PIL import Image

from flocsim.__main__ import main
from tests.helpers.results_files import write_results
from tests.helpers.small_study import write_small, write_star_library
from tests.helpers.synthetic_results import make_results
from tests.helpers.tiers import rest_slow

ONE = ("--type", "III", "--vertices", 1)
"""A replicate of spheres."""

PIXEL = ("--pixel-size", "1e-6", "--vertices", "4")

FORCE = """\
import attrs

from flocsim.forces import CentreForce


@attrs.frozen
class Spring(CentreForce):
    reach = 1e-7

    @staticmethod
    def kernel(pair):
        return 0.0
"""


@pytest.fixture
def folder(in_tmp):
    """The current folder: a config with a library and a force of one's own, and pictures."""
    path = write_small(in_tmp, vertices="[1, 4]")
    text = path.read_text().replace("pool = 2", 'source = "library"\nfile = "lib.h5"')
    path.write_text(text + '[forces.mine]\nclass = "spring_of_mine:Spring"\n')
    (in_tmp / "spring_of_mine.py").write_text(FORCE)
    write_star_library(in_tmp / "lib.h5")
    (in_tmp / "thesis.txt").write_text("Chapter 1")
    grey = np.full((60, 60), 200, np.uint8)
    grey[20:40, 15:45] = 40
    for name in ("frame.png", "photo.png"):
        Image.fromarray(grey).save(in_tmp / name)
    return in_tmp


def content(folder):
    """{name: bytes} of the files in a folder, without what Python makes of modules."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def refused(folder, capsys, *words, code=2):
    """The one line of a command that ends with this code before it has changed anything."""
    before = content(folder)
    assert main([*map(str, words)]) == code
    output, errors = capsys.readouterr()
    assert output == "" and content(folder) == before
    [line] = errors.splitlines()
    return line


INPUTS = ["small.toml", "lib.h5", "spring_of_mine.py", "./link"]
MORE = [[], ["--overwrite"], ["--resume", "--overwrite"]]


@pytest.mark.parametrize(
    ("name", "more"),
    rest_slow(
        product(INPUTS, MORE), lambda name, more: MORE.index(more) == INPUTS.index(name) % len(MORE)
    ),
)
def test_inputs_of_a_study_are_never_its_output(folder, capsys, name, more):
    (folder / "link").symlink_to("lib.h5")
    line = refused(folder, capsys, "ensemble", "small.toml", "-o", name, *more)
    assert f"writing {name} would replace " in line and "which is an input: name another" in line


IN_THE_WAY = ["thesis.txt", "other.h5", "photo.png", "empty"]
MODES = [[], ["--restart"], ["--resume"]]


@pytest.mark.parametrize(
    ("name", "mode"),
    rest_slow(
        product(IN_THE_WAY, MODES),
        lambda name, mode: MODES.index(mode) == IN_THE_WAY.index(name) % len(MODES),
    ),
)
def test_nothing_at_the_output_of_a_study_is_replaced(folder, capsys, name, mode):
    write_star_library(folder / "other.h5")
    (folder / "empty").touch()
    line = refused(folder, capsys, "ensemble", "small.toml", "-o", name, *mode)
    assert name in line and "--overwrite" in line


@pytest.mark.parametrize("option", ["--output", "--distance", "--forces", "--animation", "--save"])
def test_nothing_at_the_outputs_of_a_trajectory_is_replaced(folder, capsys, option):
    ending = {"--animation": "gif", "--save": "h5"}.get(option, "png")
    (folder / f"mine.{ending}").write_bytes(b"precious")
    words = ["trajectory", "small.toml", *ONE, option, f"mine.{ending}"]
    assert f"mine.{ending} already exists" in refused(folder, capsys, *words)


def test_inputs_of_a_trajectory_are_never_its_output(folder, capsys):
    words = ["trajectory", "small.toml", *ONE, "--overwrite"]
    for name in ("lib.h5", "small.toml", "spring_of_mine.py"):
        assert "which is an input" in refused(folder, capsys, *words, "--save", name)
    line = refused(folder, capsys, *words, "-o", "a.png", "--distance", "./a.png")
    assert "./a.png and a.png are the same file, but two outputs" in line


def test_a_trajectory_has_the_name_of_its_config(folder, capsys):
    words = ["trajectory", "small.toml", *ONE, "--replicate", 2]
    assert main([*map(str, words)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "small-III-1-0-2.png"
    (folder / "small-III-1-0-2.png").write_bytes(b"touched up")
    refused(folder, capsys, *words)
    assert main([*map(str, words), "--overwrite"]) == 0
    assert (folder / "small-III-1-0-2.1.png").read_bytes() == b"touched up"


@pytest.mark.parametrize("more", [[], ["--overwrite"]])
@pytest.mark.parametrize("option", [["-o", "frame.png"], ["--masks-out", "."]])
def test_a_picture_is_never_replaced_by_what_is_fitted_to_it(folder, capsys, option, more):
    words = ["fit", "frame.png", "photo.png", *PIXEL, *option, *more]
    assert "frame.png would replace frame.png, which is an input" in refused(folder, capsys, *words)


def test_the_table_never_takes_the_place_of_the_library(folder, capsys):
    words = ["fit", "frame.png", *PIXEL, "-o", "shapes.csv"]
    assert "are the same file, but two" in refused(folder, capsys, *words)


def test_a_library_or_its_table_is_replaced_on_request_and_kept(folder, capsys):
    words = ["fit", "frame.png", *PIXEL, "-o", "lib.h5"]
    library = (folder / "lib.h5").read_bytes()
    assert "lib.h5 already exists" in refused(folder, capsys, *words)
    assert main([*words, "--overwrite"]) == 0
    assert (folder / "lib.1.h5").read_bytes() == library
    assert not (folder / "lib.1.csv").exists()
    (folder / "lib.h5").unlink()
    capsys.readouterr()
    assert "lib.csv already exists" in refused(folder, capsys, *words)


def test_a_figure_is_drawn_again_only_when_asked_to(folder, capsys):
    write_results(folder / "study.h5", make_results(types=("I",), count=4))
    words = ["plot", "study.h5", "--figures", "4"]
    assert main(words) == 0
    before = (folder / "study-figure-4.png").read_bytes()
    capsys.readouterr()
    assert "study-figure-4.png already exists" in refused(folder, capsys, *words)
    assert main([*words, "--overwrite"]) == 0
    assert (folder / "study-figure-4.1.png").read_bytes() == before


def test_what_is_plotted_is_not_replaced_by_its_plot(folder, capsys):
    write_results(folder / "study.h5", make_results(types=("I",), count=4))
    (folder / "study-overview.png").symlink_to("study.h5")
    line = refused(folder, capsys, "plot", "study.h5", "--figures", "overview", "--overwrite")
    assert "which is an input" in line


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_what_is_no_file_is_told_by_every_command(folder, capsys):
    os.mkfifo(folder / "pipe.png")
    write_results(folder / "study.h5", make_results(types=("I",), count=4))
    (folder / "study-overview.png").symlink_to("pipe.png")
    for words in (
        ["ensemble", "small.toml", "-o", "pipe.png"],
        ["trajectory", "small.toml", *ONE, "-o", "pipe.png"],
        ["fit", "frame.png", *PIXEL, "-o", "pipe.png"],
        ["init", "pipe.png"],
        ["plot", "study.h5", "--figures", "overview"],
        ["ensemble", "small.toml", "-o", os.devnull],
    ):
        assert main([*map(str, words), "--overwrite"]) == 74
        output, errors = capsys.readouterr()
        assert output == "" and "is not an ordinary file" in errors


def test_a_name_too_long_is_told_before_the_run(folder, capsys):
    line = refused(folder, capsys, "ensemble", "small.toml", "-o", "n" * 250, code=74)
    assert "name too long" in line
