"""The diffs of CONTRIBUTING.md are true: with each of them, and nothing else, the package works."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    "flocsim", "tests", "docs", "examples", "benchmarks", "README.md", "CHANGELOG.md",
    "pyproject.toml",
)  # fmt: skip

PAGE = "docs/schema_tables.py"

CONCERNED = {
    "Add a config key": ["tests/ensembles/config", "tests/docs/test_schema_tables.py"],
    "Add a result column": [
        "tests/io/results", "tests/io/test_hdf5.py", "tests/io/plots/test_results.py",
        "tests/io/test_held.py", "tests/commands/test_info.py", "tests/commands/test_outputs.py",
        "tests/commands/test_plot.py", "tests/docs/test_schema_tables.py",
        "tests/ensembles/test_study.py", "tests/ensembles/storage/test_unfinished.py",
        "tests/ensembles/estimates", "tests/ensembles/test_comparison.py",
        "tests/ensembles/storage/test_rows_only_get_more.py",
    ],
    "Add a figure": ["tests/io/plots/test_results.py", "tests/commands/test_plot.py"],
}  # fmt: skip
"""Section → the tests that know of what it adds."""


VERSION = ("--ignore", "tests/io/results/test_older_schemas.py")
"""What asks for the version, the migration and the stored file that CONTRIBUTING.md names as well:
no diff has that file."""


def diffs():
    """{section: its diff} of CONTRIBUTING.md."""
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    return {
        section.partition("\n")[0]: found[1]
        for section in text.split("\n## ")
        if (found := re.search(r"```diff\n(.*?)```", section, re.DOTALL))
    }


def apply(diff, folder):
    """Apply a diff whose hunks name what they lie in, in the place of line numbers."""
    for change in re.split(r"^--- a/.*\n", diff, flags=re.MULTILINE)[1:]:
        name, *hunks = re.split(r"^@@ ", change, flags=re.MULTILINE)
        path = folder / name.strip().removeprefix("+++ b/")
        text = path.read_text("utf-8")
        for hunk in hunks:
            within, _, lines = hunk.partition("\n")
            each = lines.splitlines(keepends=True)
            before = "".join(line[1:] for line in each if line[0] in " -")
            after = "".join(line[1:] for line in each if line[0] in " +")
            start = text.index(before, text.index(within.strip()))
            text = text[:start] + after + text[start + len(before) :]
        path.write_text(text, "utf-8")


@pytest.fixture
def copy(tmp_path):
    """A copy of what the diffs change and of what tests it."""
    for name in COPIED:
        if (ROOT / name).is_dir():
            left_out = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, tmp_path / name, ignore=left_out)
        else:
            shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def run(folder, *words):
    """What a Python command says in a folder whose flocsim it imports."""
    known = os.environ | {"PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=known, capture_output=True, text=True
    )
    return done.returncode, (done.stdout + done.stderr)[-4000:]


def test_every_diff_is_tried():
    assert diffs().keys() == CONCERNED.keys()
    assert not [each for some in CONCERNED.values() for each in some if not (ROOT / each).exists()]


@pytest.mark.slow
@pytest.mark.parametrize("section", CONCERNED)
def test_a_diff_is_all_that_is_needed(copy, section):
    apply(diffs()[section], copy)
    assert run(copy, PAGE)[0] == 0
    code, told = run(copy, "-m", "pytest", "-q", "-x", *VERSION, *CONCERNED[section])
    assert code == 0, told
