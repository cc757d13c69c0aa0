"""A job that a signal stops says last, as a command, how it goes on; that command finishes it."""

import os
import signal
import subprocess
import sys
import time

import h5py
import pytest

from tests.ensembles.test_matrix import PAIRS
from tests.helpers.journals import has_begun
from tests.helpers.kernel_study import kernel_text
from tests.helpers.small_study import BESIDE_PYTHON, mpirun
from tests.helpers.swarm_study import SWARM

MANY = PAIRS.replace("replicates = 6", "replicates = 1500")
FLOCSIM, MODULE = [str(BESIDE_PYTHON / "flocsim")], [sys.executable, "-m", "flocsim.ensemble"]
OVER = ["--over", "fluid.viscosity=1e-3,2e-3"]

RUNS = {
    "pairs": (MANY, FLOCSIM, ["ensemble", "my study.toml"], signal.SIGHUP),
    "processes": (MANY, FLOCSIM, ["ensemble", "my study.toml", "--jobs", "2"], signal.SIGINT),
    "ranks": (MANY, [None, *FLOCSIM], ["ensemble", "my study.toml"], signal.SIGTERM),
    "module": (MANY, MODULE, ["my study.toml", "--restart"], signal.SIGXCPU),
    "kernel": (kernel_text(replicates=2048), FLOCSIM, ["kernel", "my study.toml"], signal.SIGINT),
    "swarm": (SWARM.replace("replicates = 2", "replicates = 40"), FLOCSIM,
              ["swarm", "my study.toml"], signal.SIGINT),
    "sweep": (MANY, FLOCSIM, ["sweep", "my study.toml", *OVER], signal.SIGHUP),
}  # fmt: skip
"""{name: (config, what is started, its words, the signal that stops it)}."""

JOURNALS = {"sweep": "new.parts/0000.h5.journal"}


def rows(path):
    """{dataset: its values as text} of a file, but for where it came from."""
    found = {}

    def take(name, node):
        if isinstance(node, h5py.Dataset) and not name.startswith("run/"):
            found[name] = repr(node[()].tolist())

    with h5py.File(path) as file:
        file.visititems(take)
    return found


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
def test_the_last_line_of_a_stopped_job_finishes_it(in_tmp, environment, name):
    text, start, words, number = RUNS[name]
    start = [mpirun(), "-n", "2", *start[1:]] if start[0] is None else start
    environment["PATH"] = str(BESIDE_PYTHON) + os.pathsep + environment["PATH"]
    (in_tmp / "my study.toml").write_text(text, "utf-8")
    code, errors = stopped(
        [*start, *words, "-o", "new.h5"], in_tmp / JOURNALS.get(name, "new.h5.journal"), number
    )
    assert code == 75, errors
    *_, why, last = errors
    assert f"stopped by {number.name}: " in why
    begun = {
        "ranks": "mpirun -n 2 flocsim ",
        "module": f"{sys.executable} -m flocsim ensemble ",
    }.get(name, "flocsim ")
    assert last.startswith(begun) and last.endswith(" -o new.h5 --resume")
    assert "--restart" not in last
    assert not (in_tmp / "new.h5").exists()
    subprocess.run(last, shell=True, check=True, stdout=subprocess.DEVNULL, timeout=600)
    whole = [each for each in words if each != "--restart"]
    undisturbed = [*(FLOCSIM if start[0] != sys.executable else start), *whole, "-o", "whole.h5"]
    subprocess.run(undisturbed, check=True, stdout=subprocess.DEVNULL, timeout=600)
    assert rows(in_tmp / "new.h5") == rows(in_tmp / "whole.h5")


def test_a_sweep_under_a_launcher_is_refused_before_it_begins(tmp_path):
    (tmp_path / "study.toml").write_text(PAIRS, "utf-8")
    words = [mpirun(), "-n", "2", *FLOCSIM, "sweep", "study.toml", *OVER]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert "flocsim: sweep runs on one rank only" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]
