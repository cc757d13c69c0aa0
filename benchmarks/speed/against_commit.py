"""The throughput of this tree over that of another commit, replicates taken in turn.

    python -m benchmarks.speed.against_commit COMMIT [--quick] [--markdown] [--vertices N]

Both run the same replicates of `tang2014` in processes of their own, one group (four displacements)
after the other, each group twice and in both orders; of two CPU times the smaller counts. The
machine's moods hit both alike then: the median over the groups is steadier than the ratio of sums.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.reporting import ROOT, Table, parser_of, print_heading

TYPES = ("I", "II", "III")

CHILD = """
import sys, time
from pathlib import Path
from flocsim.ensembles import load_config
from flocsim.ensembles import study as room

config = load_config(Path(sys.argv[1]))
study = room.Study(config, flocs=room.flocs_of(config))
vertices, shares = config.shapes.vertices[0], config.scene.delta
for line in sys.stdin:
    condition, replicate = map(int, line.split())
    began = time.process_time()
    for share in shares:
        study.run(condition, vertices, share, replicate)
    print(time.process_time() - began, flush=True)
"""
"""Runs groups of replicates on demand, with names that were there in every version."""

STUDY = """\
preset = "tang2014"
seed = 1
replicates = 1000
[scene]
types = ["I", "II", "III"]
delta = [0.0, 0.25, 0.5, 0.75]
[shapes]
source = "synthetic"
vertices = [{}]
pool = 10
"""


class Child:
    """A process that runs groups of replicates with the flocsim of a folder."""

    def __init__(self, tree, study, cache):
        environment = {**os.environ, "PYTHONPATH": str(tree), "FLOCSIM_CACHE": str(cache)}
        self.process = subprocess.Popen(
            [sys.executable, "-c", CHILD, str(study)], env=environment, cwd=study.parent, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    def seconds(self, condition, replicate):
        """CPU seconds of a group."""
        self.process.stdin.write(f"{condition} {replicate}\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

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


def compare(there, here, condition, groups):
    """(CPU times there, here) of so many groups of a condition."""
    found = []
    for replicate in range(groups):
        there.seconds(condition, replicate), here.seconds(condition, replicate)  # shapes are made
        first = there.seconds(condition, replicate), here.seconds(condition, replicate)
        second = here.seconds(condition, replicate), there.seconds(condition, replicate)
        found.append((min(first[0], second[1]), min(first[1], second[0])))
    return np.array(found)


def main():
    """Print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("commit", help="the other commit")
    parser.add_argument("--vertices", type=int, default=64, metavar="N", help="default: 64")
    arguments = parser.parse_args()
    print_heading()
    groups = 10 if arguments.quick else 60
    table = Table(
        f"Throughput over that of {arguments.commit}, N = {arguments.vertices}",
        ("type", "groups", "of all", "median", "a quarter below", "a quarter above"),
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study = folder / "study.toml"
        study.write_text(STUDY.format(arguments.vertices))
        there = Child(other_tree(arguments.commit, folder), study, folder / "cache_there")
        here = Child(ROOT, study, folder / "cache_here")
        every = []
        for condition, kind in enumerate(TYPES):
            found = compare(there, here, condition, groups)
            every.append(found)
            add(table, kind, found)
        add(table, "all", np.concatenate(every))
        there.close()
        here.close()
    table.print(arguments.markdown)


def add(table, kind, found):
    """A row of the table."""
    of_all = found[:, 0].sum() / found[:, 1].sum()
    quarters = np.percentile(found[:, 0] / found[:, 1], (50, 25, 75))
    table.add(kind, len(found), of_all, *quarters)


if __name__ == "__main__":
    main()
