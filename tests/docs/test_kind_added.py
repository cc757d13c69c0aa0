"""A kind of study is one file and its name in one table: with tests/helpers/lone_flocs.py, single
flocs that settle past a wall, and a line, all commands run it and show it, or say why not."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
KIND = ROOT / "tests/helpers/lone_flocs.py"
TABLE = "flocsim/ensembles/config/__init__.py"
BEFORE = '    "flocsim swarm": Folder("swarms", "swarm"),\n'
LINE = '    "flocsim lone": Folder("lone", "lone"),\n'
MOST_LINES = 110
CONFIG = """\
preset = "si"
replicates = 4
[scene]
kind = "lone"
radius = "8 um"
gap = "0.2 um"
duration = "2 ms"
[shapes]
vertices = [1, 8]
pool = 3
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A folder with a package that has the kind, and a study of it that has been run."""
    folder = tmp_path_factory.mktemp("kind")
    shutil.copytree(
        ROOT / "flocsim", folder / "flocsim", ignore=shutil.ignore_patterns("__pycache__")
    )
    shutil.copy(KIND, folder / "flocsim/ensembles/lone.py")
    text = (folder / TABLE).read_text("utf-8")
    assert text.count(BEFORE) == 1
    (folder / TABLE).write_text(text.replace(BEFORE, BEFORE + LINE), "utf-8")
    (folder / "s.toml").write_text(CONFIG, "utf-8")
    code, said = run(folder, "ensemble s.toml -o a.h5")
    assert code == 0 and "speed [m s-1]" in said, said
    return folder


def python(home, *words, **options):
    """A process of Python with that package."""
    return subprocess.Popen(
        [sys.executable, *words], cwd=home, env=os.environ | {"PYTHONPATH": str(home)}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options,
    )  # fmt: skip


def run(home, words):
    """(exit code, what a command says)."""
    with python(home, "-m", "flocsim", *words.split()) as process:
        said = process.communicate()[0]
    return process.returncode, said


def flocs(home, file):
    """The rows of a results file as text, read by a script."""
    with python(home, "-c", f"import flocsim; print(flocsim.open('{file}').to_pandas())") as script:
        return script.communicate()[0]


def test_it_is_one_file_of_readable_size():
    assert len(KIND.read_text("utf-8").splitlines()) <= MOST_LINES


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("ensemble s.toml -o b.h5 --dry-run", "8 replicates: 1 type x 2 vertex counts"),
        ("info a.h5", "results of single flocs past a wall"),
        ("info a.h5 --config", 'kind = "lone"'),
        ("report a.h5", "a.html"),
        ("export csv a.h5", ".csv"),
    ],
)
def test_its_files_are_shown(home, words, told):
    code, said = run(home, words)
    assert code == 0 and told in said, said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "why"),
    [
        (
            "compare a.h5 a.h5",
            ": name a file with results of a collision ensemble or",
        ),
        ("export matrix a.h5", 'is a "flocsim lone" file: name a file with results'),
        ("plot a.h5 --animation a.gif", "--animation is for results of a swarm study"),
        ("kernel s.toml", 's.toml has scene.kind = "lone"'),
    ],
)
def test_what_it_cannot_do_is_refused_in_one_line(home, words, why):
    code, said = run(home, words)
    assert code in (2, 74) and why in said and said.count("\n") == 1, said


@pytest.mark.slow
def test_it_is_extended_by_processes_and_run_by_a_script(home):
    shutil.copy(home / "a.h5", home / "more.h5")
    code, said = run(home, "ensemble s.toml --replicates 6 -o more.h5 --resume")
    assert code == 0 and "12 replicates, of which 4 were run" in said
    code, said = run(home, "ensemble s.toml --replicates 6 --jobs 2 -o whole.h5")
    assert code == 0 and "12 replicates, of which 12 were run" in said
    assert flocs(home, "more.h5") == flocs(home, "whole.h5") != flocs(home, "a.h5")
    script = "import flocsim; flocsim.Study('s.toml').run(output='script.h5')"
    with python(home, "-c", script) as process:
        assert process.communicate()[0] == ""
    assert flocs(home, "script.h5") == flocs(home, "a.h5")


@pytest.mark.slow
def test_it_is_swept(home):
    code, said = run(home, "sweep s.toml --over fluid.viscosity=1e-3,2e-3 -o swept.h5")
    assert code == 0, said
    code, said = run(home, "info swept.h5")
    assert code == 0 and "0.002" in said
    code, said = run(home, "report swept.h5")
    assert code == 0 and "swept.html" in said
