"""A small study as a job that can be killed, and the check that nothing of it was lost."""

import contextlib
import os
import sys
from pathlib import Path

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import run_to_file

BESIDE_PYTHON = Path(sys.executable).parent

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
