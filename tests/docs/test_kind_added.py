"""A kind of study is one folder and its name in one table: with tests/helpers/lone_flocs, single
flocs that settle past a wall, and a line, all commands run it and show it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
KIND = ROOT / "tests/helpers/lone_flocs"
TABLE = "flocsim/ensembles/config/kinds.py"
BEFORE = '    "flocsim strength": Folder("strength"),\n'
LINE = '    "flocsim lone": Folder("lone", "lone"),\n'
MOST_LINES = 450


@pytest.fixture
def home(tmp_path):
    """A folder with a package that has the kind, and a study of it."""
    shutil.copytree(
        ROOT / "flocsim", tmp_path / "flocsim", ignore=shutil.ignore_patterns("__pycache__")
    )
    shutil.copytree(KIND, tmp_path / "flocsim/ensembles/lone")
    text = (tmp_path / TABLE).read_text("utf-8")
    assert text.count(BEFORE) == 1
    (tmp_path / TABLE).write_text(text.replace(BEFORE, BEFORE + LINE), "utf-8")
    shutil.copy(KIND / "study.toml", tmp_path / "s.toml")
    return tmp_path


def run(home, *words):
    """(exit code, what a command says) with that package."""
    known = os.environ | {"PYTHONPATH": str(home)}
    done = subprocess.run(
        [sys.executable, "-m", "flocsim", *words], cwd=home, env=known, capture_output=True,
        text=True,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def test_it_is_one_folder_of_readable_size():
    sizes = [len(path.read_text("utf-8").splitlines()) for path in KIND.glob("*.py")]
    assert sum(sizes) <= MOST_LINES


@pytest.mark.slow
def test_a_folder_and_a_line_are_a_kind_of_study(home):
    for words, told in (
        ("ensemble s.toml -o a.h5 --dry-run", "8 flocs past a wall"),
        ("ensemble s.toml -o a.h5", "speed [um/s]"),
        ("info a.h5", "results of single flocs past a wall"),
        ("info a.h5 --config", 'kind = "lone"'),
        ("plot a.h5", "a-speeds.png"),
        ("report a.h5", "a.html"),
        ("ensemble s.toml --replicates 6 -o a.h5 --resume", "12 replicates, 4 of them run"),
        ("ensemble s.toml --replicates 6 --jobs 2 -o b.h5", "12 replicates"),
        ("compare a.h5 b.h5", "+0"),
        ("sweep s.toml --over fluid.viscosity=1e-3,2e-3 -o swept.h5", "swept.h5"),
        ("info swept.h5", "0.002"),
        ("plot swept.h5", "swept-sweep.png"),
    ):
        code, said = run(home, *words.split())
        assert code == 0, (words, said)
        assert told in said, (words, said)
    assert "<h1>a.h5: results of single flocs past a wall</h1>" in (home / "a.html").read_text()
    code, said = run(home, "export", "csv", "a.h5")
    assert code != 0 and "holds a flocsim lone: name a file of" in said
    found = (
        "import flocsim; a = flocsim.open('a.h5'); b = flocsim.Study('s.toml').run(output='c.h5');"
        "print(a.to_xarray().sizes['replicate'], a.columns['speed'][:, :4] == b.columns['speed'])"
    )
    known = os.environ | {"PYTHONPATH": str(home)}
    done = subprocess.run(
        [sys.executable, "-c", found], cwd=home, env=known, capture_output=True, text=True
    )
    assert done.stdout.startswith("6 [[ True") and "False" not in done.stdout, done.stderr
