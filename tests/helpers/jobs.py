"""A small study as a job that can be killed, and the check that nothing of it was lost."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import attrs

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import run_to_file
from flocsim.io.journal import journal_path
from flocsim.io.results.file import read_results
from tests.helpers.journals import computed_in, records_in
from tests.helpers.results_files import same_data

BESIDE_PYTHON = Path(sys.executable).parent
PATIENCE = 30.0
"""Seconds after which a job that does not end hangs."""

STUDY = """\
preset = "tang2014"
seed = 3
replicates = 200
[scene]
types = ["I", "III"]
delta = [0.0, 0.25, 0.5, 0.75, 1.0]
[shapes]
vertices = [1]
[output]
file = "study.h5"
"""

KINDS = {
    "serial": [],
    "mpirun -n 2": [str(BESIDE_PYTHON / "mpirun"), "-n", "2"],
    "mpirun -n 3": [str(BESIDE_PYTHON / "mpirun"), "-n", "3"],
    "--jobs 2": [],
}
"""Ways to run a study, and the words before Python's."""


def command(kind):
    """The words that run the study in a way, and go on where it was left."""
    more = kind.split() if kind.startswith("--") else []
    return [*KINDS[kind], sys.executable, "-m", "flocsim.ensemble", "study.toml", "--quiet",
            "--resume", *more]  # fmt: skip


def descendants(root):
    """Process ids of a process and all that it has started, by /proc."""
    parents = {}
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            with contextlib.suppress(OSError, IndexError, ValueError):
                text = Path("/proc", entry, "stat").read_text()
                parents[int(entry)] = int(text.rpartition(")")[2].split()[1])
    found = [root]
    for pid in found:
        found += [child for child, parent in parents.items() if parent == pid]
    return found


def is_python(pid):
    """Whether a process is a rank: a Python that runs the study."""
    with contextlib.suppress(OSError):
        words = Path("/proc", str(pid), "cmdline").read_bytes().split(b"\0")
        return b"python" in words[0] and (b"flocsim.ensemble" in words or b"spawn_main" in
                                          b" ".join(words))  # fmt: skip
    return False


def alive(pids):
    """Which of the processes still run (a zombie does not)."""
    for pid in pids:
        with contextlib.suppress(OSError):
            if Path("/proc", str(pid), "stat").read_text().rpartition(")")[2].split()[0] != "Z":
                yield pid


def errors_of(folder):
    """Where what a job says on stderr goes: not to its own disk, which may be full. There mpirun
    cannot write either, and ends with 255 whatever its ranks end with."""
    return folder.with_name(f"{folder.name}-errors.txt")


@attrs.define
class Job:
    """A running study in its folder."""

    folder: Path
    process: subprocess.Popen
    errors: object
    ranks: int

    @classmethod
    def start(cls, folder, kind, **more):
        """Start the study in a way; ``more`` are options of Popen."""
        errors = open(errors_of(folder), "w+b")  # noqa: SIM115 (closed by `finish`)
        process = subprocess.Popen(
            command(kind), cwd=folder, stdout=subprocess.DEVNULL, stderr=errors,
            start_new_session=True, **more,
        )  # fmt: skip
        return cls(folder, process, errors, int(kind[-1]) if kind[-1].isdigit() else 1)

    def wait_for_journal(self):
        """Until the run has begun to write, or has ended."""
        path = self.folder / "study.h5.journal"
        before = len(records_in(path)) if path.exists() else 0
        until = time.monotonic() + PATIENCE
        while self.process.poll() is None and time.monotonic() < until:
            if path.exists() and len(records_in(path)) > before:
                return
            time.sleep(0.005)

    def send(self, number, target, rng):
        """Send a signal to one rank, to the first process, or to the whole group; the ids."""
        pids = descendants(self.process.pid)
        ranks = [pid for pid in pids if is_python(pid)] or pids
        chosen = {"rank": [rng.choice(ranks)], "launcher": [pids[0]], "group": pids}[target]
        for pid in chosen:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)
        return pids

    def finish(self, pids):
        """(exit code, seconds until all processes have gone); a hang ends in None."""
        began = time.monotonic()
        while time.monotonic() - began < PATIENCE:
            code = self.process.poll()
            if code is not None and not list(alive(pids)):
                self.errors.close()
                return code, time.monotonic() - began
            time.sleep(0.005)
        for pid in alive(pids):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.wait()
        self.errors.close()
        return None, PATIENCE


def make_study(folder):
    """A folder with the study's config."""
    folder.mkdir(parents=True)
    (folder / "study.toml").write_text(STUDY)
    return folder


def run_here(folder):
    """Finish the study in this process; its results file."""
    config = load_config(folder / "study.toml")
    output = folder / "study.h5"
    ended = run_to_file(config, Communicator(), output, "resume")
    assert ended.code == 0
    return output


def whole_rows(folder):
    """How many replicates the journal holds whole."""
    path = journal_path(folder / "study.h5")
    if not path.exists():
        return 0
    return len(finished_in(path))


def finished_in(path):
    """{(condition, replicate)} of the chunks in a journal."""
    done = set()
    for each in computed_in(path):
        done |= {(each["condition"], each["first"] + k) for k in range(each["count"])}
    return done


def verdict(folder, reference):
    """What is wrong with what a fault has left behind, once a copy of it is finished; or ""."""
    copy = folder.with_name(folder.name + "-copy")
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(folder, copy)
    kept = whole_rows(copy)
    finished = (copy / "study.h5").exists()
    try:
        output = run_here(copy)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    if apart := same_data(reference, output):
        return f"bytes differ: {apart}"
    results = read_results(output)
    total = results.replicates["outcome"].size
    if not finished and results.run["computed"] != total - kept:
        return f"{results.run['computed']} computed where {total - kept} were missing"
    return ""
