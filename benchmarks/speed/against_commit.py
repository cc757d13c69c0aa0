"""The throughput of this tree over that of another commit, replicates taken in turn.

    python -m benchmarks.speed.against_commit COMMIT [--quick] [--markdown] [--vertices N]
                                              [--meeting settling | shear] [--preset tang2014 | si]

Both run the same replicates in processes of their own, one group (forty replicates at each of four
displacements, or 160 points of a study of kernels in shear) after the other, in the chunks in
which a study deals them out, each group twice and in both orders; of two CPU times the smaller
counts. The machine's moods hit both alike then: the median over the groups is
steadier than the ratio of sums. Groups are spread over what a study of 240 replicates a condition
takes more than one of 40: of the first ones far more are run again, to know the numerical error.
Flocs are those of the library that is shipped, as each tree would fit grown ones in its own way.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.reporting import ROOT, Table, begin

TYPES = {
    "settling": ("I", "II", "III"),
    "shear": ("5 with 10 um", "10 with 20 um", "20 with 20 um"),
}

CHILD = """
import sys, time
from pathlib import Path
{made}
for line in sys.stdin:
    kind, first = map(int, line.split())
    began = time.process_time()
    for chunk in chunks_of(kind, first):
        assert len(run_chunk(study, chunk, lambda: False, 1e9).rows) == chunk.stop - chunk.first
    print(time.process_time() - began, flush=True)
"""
"""Runs groups of replicates on demand."""

MADE = """\
from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.kind import Chunk, study_of
from flocsim.ensembles.parallel.coordinator import run_chunk

study = study_of(load_any_config(Path(sys.argv[1])))
shares = len(study.conditions) // len(study.scene.names)


def chunks_of(kind, first):
    count = 160 // shares
    return [Chunk(shares * kind + k, first, first + count) for k in range(shares)]
"""
"""How the child makes its study, and what is in a group, with names that the other commit has."""

STUDY = {
    "settling": """\
preset = "{preset}"
seed = 1
replicates = 1000
[scene]
types = ["I", "II", "III"]
delta = [0.0, 0.25, 0.5, 0.75]
[shapes]
source = "library"
file = "synthetic"
vertices = [{vertices}]
pool = 10
""",
    "shear": """\
preset = "{preset}"
seed = 1
replicates = 1024
[scene]
kind = "kernel"
meeting = "shear"
rate = "10 1/s"
sizes = ["5 um", "10 um", "20 um"]
[shapes]
source = "library"
file = "synthetic"
vertices = [{vertices}]
""",
}

PLACES = {"settling": (0, 1, 2), "shear": (1, 4, 5)}
"""Of the conditions of a study, those that are run, by the names in TYPES."""


REPLICATES = 40, 240
"""Of a condition, the first that is run and the one behind the last."""


class Child:
    """A process that runs a program with the flocsim of a folder and answers line by line."""

    def __init__(self, tree, program, *arguments, folder, cache):
        environment = {**os.environ, "PYTHONPATH": str(tree), "FLOCSIM_CACHE": str(cache)}
        self.process = subprocess.Popen(
            [sys.executable, "-c", program, *map(str, arguments)],
            env=environment, cwd=folder, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    def ask(self, *words):
        """The line that answers one of these words."""
        self.process.stdin.write(" ".join(map(str, words)) + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline()

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def other_tree(commit, folder):
    """The files of a commit, in a folder."""
    tree = folder / "other"
    tree.mkdir()
    archive = subprocess.run(
        ["git", "-C", str(ROOT), "archive", commit], check=True, stdout=subprocess.PIPE
    ).stdout
    subprocess.run(["tar", "-x", "-C", str(tree)], input=archive, check=True)
    return tree


def seconds(child, condition, replicate):
    """CPU seconds of a group."""
    return float(child.ask(condition, replicate))


def compare(there, here, condition, groups):
    """(CPU times there, here) of so many groups of a condition."""
    found = []
    for replicate in np.linspace(*REPLICATES, groups, endpoint=False, dtype=int).tolist():
        seconds(there, condition, replicate), seconds(here, condition, replicate)  # makes shapes
        first = seconds(there, condition, replicate), seconds(here, condition, replicate)
        second = seconds(here, condition, replicate), seconds(there, condition, replicate)
        found.append((min(first[0], second[1]), min(first[1], second[0])))
    return np.array(found)


def main():
    """Print the table."""
    arguments = begin(
        __doc__, ("commit", {"help": "the other commit"}), vertices=64, preset="tang2014",
        meeting={"choices": list(TYPES), "default": "settling"},
    )  # fmt: skip
    meeting = arguments.meeting
    groups = 5 if arguments.quick else 20
    table = Table(
        f"Throughput over that of {arguments.commit}, {arguments.preset}, {meeting}, "
        f"N = {arguments.vertices}",
        ("type", "groups", "of all", "median", "a quarter below", "a quarter above"),
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study = folder / "study.toml"
        study.write_text(
            STUDY[meeting].format(vertices=arguments.vertices, preset=arguments.preset)
        )
        other = other_tree(arguments.commit, folder)
        program = CHILD.format(made=MADE)
        there = Child(other, program, study, folder=folder, cache=folder / "cache_there")
        here = Child(ROOT, program, study, folder=folder, cache=folder / "cache_here")
        every = []
        for condition, kind in zip(PLACES[meeting], TYPES[meeting], strict=True):
            found = compare(there, here, condition, groups)
            every.append(found)
            add(table, kind, found)
        add(table, "all", np.concatenate(every))
        there.close()
        here.close()
    table.print()


def add(table, kind, found):
    """A row of the table."""
    of_all = found[:, 0].sum() / found[:, 1].sum()
    quarters = np.percentile(found[:, 0] / found[:, 1], (50, 25, 75))
    table.add(kind, len(found), of_all, *quarters)


if __name__ == "__main__":
    main()
