"""A job that a signal stops says last how it goes on, and goes on so."""

import signal
import subprocess
import time

import pytest

from tests.ensembles.test_matrix import PAIRS
from tests.helpers.journals import has_begun
from tests.helpers.kernel_study import kernel_text
from tests.helpers.results_files import same_data
from tests.helpers.small_study import BESIDE_PYTHON, mpirun
from tests.helpers.swarm_study import SWARM

MANY = PAIRS.replace("replicates = 6", "replicates = 1500")
FLOCSIM = str(BESIDE_PYTHON / "flocsim")
OVER = ["--over", "fluid.viscosity=1e-3,2e-3"]

RUNS = {
    "pairs": (MANY, ["ensemble", "my study.toml"], signal.SIGHUP),
    "processes": (MANY, ["ensemble", "my study.toml", "--jobs", "2"], signal.SIGINT),
    "ranks": (MANY, ["ensemble", "my study.toml"], signal.SIGTERM),
    "kernel": (kernel_text(replicates=2048), ["kernel", "my study.toml"], signal.SIGINT),
    "swarm": (SWARM.replace("replicates = 2", "replicates = 40"), ["swarm", "my study.toml"],
              signal.SIGXCPU),
    "sweep": (MANY, ["sweep", "my study.toml", *OVER], signal.SIGHUP),
}  # fmt: skip
"""{name: (config, words of the command, the signal that stops it)}."""

JOURNALS = {"sweep": "new.parts/0000.h5.journal"}


def stopped(command, journal, number):
    """(exit code, lines on stderr) of a command that is stopped once its journal has rows."""
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as job:
        until = time.monotonic() + 300.0
        while time.monotonic() < until and job.poll() is None:
            if has_begun(journal):
                job.send_signal(number)
                break
            time.sleep(0.01)
        _, errors = job.communicate(timeout=120)
    return job.returncode, errors.splitlines()


@pytest.mark.parametrize(
    "name", [name if name == "pairs" else pytest.param(name, marks=pytest.mark.slow)
             for name in RUNS],
)  # fmt: skip
def test_a_stopped_job_goes_on_with_resume(tmp_path, monkeypatch, name):
    text, words, number = RUNS[name]
    start = [*([mpirun(), "-n", "2"] if name == "ranks" else []), FLOCSIM, *words]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my study.toml").write_text(text, "utf-8")
    journal = tmp_path / JOURNALS.get(name, "new.h5.journal")
    code, errors = stopped([*start, "-o", "new.h5"], journal, number)
    assert code == 75, errors
    assert f"stopped by {number.name}: " in errors[-1]
    assert errors[-1].endswith("; continue with --resume")
    assert not (tmp_path / "new.h5").exists()
    for more in (["new.h5", "--resume"], ["whole.h5"]):
        done = [*start, "-o", *more]
        subprocess.run(done, check=True, stdout=subprocess.DEVNULL, timeout=600)
    assert same_data(tmp_path / "new.h5", tmp_path / "whole.h5") == []


def test_a_sweep_under_a_launcher_is_refused_before_it_begins(tmp_path):
    (tmp_path / "study.toml").write_text(PAIRS, "utf-8")
    words = [mpirun(), "-n", "2", FLOCSIM, "sweep", "study.toml", *OVER]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert "flocsim: sweep runs on one rank only" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]
