"""Every code block of the README and of docs/: commands parse, configs load, Python compiles, and
page by page, in order, in an empty folder, everything runs as it would be pasted.
"""

import ast
import glob
import re
import shlex
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import flocsim
from flocsim.__main__ import main, make_parser
from flocsim.ensembles.config.loader import load_any_config
from flocsim.errors import PlausibilityWarning

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
FOUND = [*ROOT.glob("docs/*.md"), *ROOT.glob("docs/evidence/*.md")]
PAGES = ["README.md", *sorted(path.relative_to(ROOT).as_posix() for path in FOUND)]

OTHER_PROGRAMS = ("python3 run.py", "python3 -m venv", ".venv/bin/", "srun ", "python ")
"""Commands that install flocsim, need a cluster, or are scripts with tests of their own."""

NOT_RUN = {
    "docs/check.md": "minutes, on a study that is the reader's",
    "docs/cluster.md": "one study, started in four ways, three of which need a machine for them",
    "docs/kernels.md": "1,024 points of each pair of classes: many minutes",
    "docs/presets.md": "a sweep of a study that is the reader's",
    "docs/reproduction.md": "an hour",
    "docs/evidence/accuracy.md": "benchmarks: minutes to hours",
    "docs/strength.md": "minutes, on a study that is the reader's",
    "docs/tutorial.md": "run as a notebook by test_tutorial.py",
}
"""Pages whose commands are parsed only, and why."""

LONG = ("settling_kernel", "settling_swarm", "--reviewed")
"""Words of further commands that are parsed only: they take a quarter of an hour, or a file that
the page of --review saves."""

GIVEN = {
    "README.md": ["frames"],
    "docs/config.md": ["modules"],
    "docs/formats.md": ["study.toml", "run.vtkhdf"],
    "docs/images.md": ["frames", "masks", "monday.h5"],
    "docs/own_integrator.md": ["modules"],
    "docs/results.md": ["study.h5"],
    "docs/study.md": ["frames"],
}
"""What a page takes for granted in the reader's folder."""

SMALL = """\
preset = "tang2014"
replicates = 18
[scene]
types = ["I"]
delta = [0.5]
[shapes]
vertices = [1, 64]
pool = 2
"""


def blocks(page):
    """[(language, number of its first line, text)] of the fenced blocks of a page."""
    text = (ROOT / page).read_text("utf-8")
    found = re.finditer(r"^```(sh|toml|python)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [(each[1], text.count("\n", 0, each.start(2)) + 1, each[2]) for each in found]


def commands(text):
    """The commands of a block for the shell, one a line, without comments."""
    lines = (line.strip() for line in text.replace("\\\n", " ").splitlines())
    return [line for line in lines if line and not line.startswith("#")]


def words_of(command):
    """The words of a command of flocsim behind its name, without a launcher, which changes no
    result; None of other programs."""
    command = command.removeprefix(".venv/bin/")
    if command.startswith(OTHER_PROGRAMS):
        return None
    words = shlex.split(re.sub(r"\s#.*", "", command))
    words = words[3:] if words[:2] == ["mpirun", "-n"] else words
    assert words[0] == "flocsim", command
    return words[1:]


def every(language):
    """Parameters of tests of every block in a language."""
    found = [(page, *each[1:]) for page in PAGES for each in blocks(page) if each[0] == language]
    assert found
    return [pytest.param(*each, id=f"{each[0]}:{each[1]}") for each in found]


@pytest.mark.parametrize(("page", "line", "text"), every("sh"))
def test_every_command_parses(page, line, text):
    for command in commands(text):
        if (words := words_of(command)) is not None:
            make_parser(words).parse_args(words)


@pytest.mark.parametrize(("page", "line", "text"), every("toml"))
def test_every_config_loads(page, line, text, tmp_path):
    for module in EXAMPLES.glob("*.py"):
        shutil.copy(module, tmp_path)
    load_any_config(config_of(text, tmp_path))


def config_of(text, folder):
    """The path of a config in a folder: that of a block, or a minimal one under its fragment."""
    for name in re.findall(r'^file = "(.*\.h5)"', text, re.MULTILINE):
        if not (folder / name).exists():
            shutil.copy(ROOT / "flocsim" / "io" / "synthetic.h5", folder / name)
    rest = 'source = "library"\nfile = "synthetic"\n'
    if 'pairs = "measured"' in text and "[shapes]" not in text:
        text += f"[shapes]\n{rest}"
    path = folder / "block.toml"
    path.write_text(text if "preset" in text else f'preset = "tang2014"\n{text}', "utf-8")
    return path


@pytest.mark.parametrize(("page", "line", "text"), every("python"))
def test_every_python_block_is_of_names_that_flocsim_has(page, line, text):
    tree = ast.parse("\n" * line + text, page)
    wanted = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    for module in {node.module for node in wanted if isinstance(node, ast.ImportFrom)}:
        if not module.startswith("flocsim"):
            pytest.importorskip(module)
    exec(compile(ast.Module(wanted, []), page, "exec"), {})
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "flocsim":
            assert hasattr(flocsim, node.attr), f"line {node.lineno}: flocsim.{node.attr}"


def test_the_force_of_the_readme_is_the_whole_file():
    brush = (EXAMPLES / "steric_brush.py").read_text("utf-8")
    assert [text for language, _, text in blocks("README.md") if text == brush]


RUN = [page for page in PAGES if blocks(page) and page not in NOT_RUN]


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN)
def test_every_block_runs_as_pasted_in_an_empty_folder(page, in_tmp, capsys):
    if page == "docs/formats.md":
        pytest.importorskip("gsd")
    if page in ("docs/library.md", "docs/kernels.md", "docs/results.md"):
        pytest.importorskip("xarray")
        pytest.importorskip("pandas")
    give(page, in_tmp)
    capsys.readouterr()
    names = {"__name__": "page"}
    for language, line, text in blocks(page):
        if language == "sh":
            for command in commands(text):
                words = words_of(command)
                if words is None or any(each in command for each in LONG):
                    continue
                globbed = [found for word in words for found in sorted(glob.glob(word)) or [word]]
                # A check may find that a scene's motion is too sensitive: exit code 1.
                expected = (0, 1) if words[0] == "check" else (0,)
                assert main(globbed) in expected, (line, command, capsys.readouterr().err)
        elif language == "toml":
            load_any_config(config_of(text, in_tmp))
        elif text == (EXAMPLES / "steric_brush.py").read_text("utf-8"):
            (in_tmp / "steric_brush.py").write_text(text, "utf-8")
        else:
            if "vtkmodules" in text:
                pytest.importorskip("vtkmodules.vtkIOHDF")
            with warnings.catch_warnings():
                warnings.simplefilter("error", PlausibilityWarning)
                exec(compile("\n" * (line - 1) + text, page, "exec"), names)
    if page == "README.md":
        said = capsys.readouterr().out
        flocs = re.search(r"shapes.h5: (\d+) flocs", said)
        assert said.count(f"preset clay · {flocs[1]} flocs of shapes.h5 · ") >= 3
        assert len(list(in_tmp.glob("clay-figure-*.png"))) == 4
        assert (in_tmp / "kaolin" / "report.html").exists()


def give(page, folder):
    """Put into a folder what a page takes for granted."""
    for name in GIVEN.get(page, ()):
        if name == "frames":
            (folder / "frames").mkdir()
            for number in (17, 19, 23, 24):
                drawn(number).save(folder / "frames" / f"{number:03}.png")
        elif name == "masks":
            labels = np.asarray(drawn(3)) < 128
            np.savez(folder / "masks.npz", labels.astype("u1"))
            Image.fromarray(labels.astype("u1")).save(folder / "labels.tif")
        elif name == "modules":
            for module in EXAMPLES.glob("*.py"):
                shutil.copy(module, folder)
        elif name == "examples":
            shutil.copytree(EXAMPLES, folder / "examples")
        elif name == "monday.h5":
            for day in ("monday.h5", "tuesday.h5"):
                shutil.copy(ROOT / "flocsim" / "io" / "synthetic.h5", folder / day)
        else:
            (folder / "study.toml").write_text(SMALL, "utf-8")
    if {"study.h5", "run.vtkhdf"} & set(GIVEN.get(page, ())):
        study = flocsim.Study(folder / "study.toml")
        study.run(output=folder / "study.h5")
        study.replicate(17).export(folder / "run.vtkhdf")


def drawn(seed):
    """A picture of twenty dark, lumpy flocs of different sizes on a light ground."""
    draw = np.random.default_rng(seed)
    y, x = np.mgrid[:480, :640]
    bright = np.ones((480, 640), bool)
    for place in range(20):
        middle = 64 + 128 * (place % 5), 60 + 120 * (place // 5)
        size = draw.uniform(9.0, 22.0)
        for _ in range(6):
            u, v = middle + draw.uniform(-0.8, 0.8, 2) * size
            bright &= np.hypot(x - u, y - v) > draw.uniform(0.4, 0.8) * size
    return Image.fromarray(np.where(bright, 220, 60).astype("u1"))
