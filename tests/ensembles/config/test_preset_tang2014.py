"""examples/tang2014/reproduce.py: the whole study, reduced, and what it leaves behind."""

import csv
import os
import re
import subprocess
import sys
import tomllib

import pytest

from flocsim.ensembles.config.loader import lay_over, load_config
from flocsim.io.results.file import read_results
from tests.helpers.small_study import ROOT, problems
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE

FOLDER = ROOT / "examples" / "tang2014"
READINGS = tomllib.loads((FOLDER / "readings.toml").read_text("utf-8"))


def reproduce(folder, *words, env=None):
    """Run the script; the finished process."""
    script = [sys.executable, FOLDER / "reproduce.py", "-o", folder / "out", "--jobs", "1"]
    return subprocess.run(
        [*script, *words], capture_output=True, text=True, timeout=PATIENCE, env=env
    )


@pytest.mark.parametrize("name", [name for name, each in READINGS.items() if "shapes" not in each])
def test_a_reading_is_another_config(name):
    plain = load_config(FOLDER / "study.toml")
    other = load_config(FOLDER / "study.toml", lay_over({}, READINGS[name]))
    assert (plain.forces, plain.scene, plain.zone) != (other.forces, other.scene, other.zone)


@pytest.mark.parametrize(
    ("vertices", "animations"), rest_slow([("1,4", 0), ("1,64", 1)], lambda *_: False)
)
def test_a_reduced_study_runs_and_resumes(tmp_path, vertices, animations):
    words = ["--replicates", "4", "--swarms", "1", "--vertices", vertices]
    done = reproduce(tmp_path, *words)
    assert (done.returncode, problems(done.stderr)) == (0, [])
    out = tmp_path / "out"
    names = {f"figure-{name}.{end}" for name in "4568" for end in ("png", "pdf")}
    assert {"study.h5", "probabilities.csv", "summary.md", "steps.csv"} | names <= {
        path.name for path in out.iterdir()
    }
    assert len(list(out.glob("figure-7-*.gif"))) >= animations
    with (out / "probabilities.csv").open() as file:
        rows = list(csv.DictReader(file))
    table = read_results(out / "study.h5").probabilities
    assert len(rows) == table["n_total"].size
    assert [int(row["run_again"]) for row in rows] == table["n_checked"].ravel().tolist()
    assert table["n_checked"].min() > 0
    summary = (out / "summary.md").read_text()
    parts = re.findall(r"<!-- ([a-z-]+) -->\n\n.+?\n\n<!-- end -->", summary, re.DOTALL)
    assert parts == ["times", "totals", "flips", "claims", "against", "beside"]
    assert "| all | 120 |" in summary
    (out / "summary.md").unlink()
    (out / "figure-4.png").unlink()
    draw = f"import fill_page, pathlib; fill_page.draw(pathlib.Path({str(out)!r}))"
    subprocess.run([sys.executable, "-c", draw], cwd=FOLDER, check=True, timeout=PATIENCE)
    assert (out / "figure-4.png").exists()
    assert (out / "summary.md").read_text() == summary
    before = (out / "study.h5").read_bytes()
    again = reproduce(tmp_path, *words)
    assert (again.returncode, problems(again.stderr)) == (0, [])
    assert (out / "study.h5").read_bytes() == before
    assert "trajectory" not in again.stdout


def test_a_failing_step_ends_the_study(tmp_path):
    done = reproduce(tmp_path, "--replicates", "2", "--images", str(tmp_path / "nowhere"))
    assert done.returncode == 2
    assert "nowhere" in done.stderr
    assert "Traceback" not in done.stderr


def test_it_is_not_started_under_a_launcher(tmp_path):
    done = reproduce(tmp_path, env=os.environ | {"PMI_SIZE": "2", "PMI_RANK": "0"})
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        'reproduce.py: start it once, with --launch "mpirun -n 2", not under mpirun itself'
    ]
    assert not (tmp_path / "out").exists()
