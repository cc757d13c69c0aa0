"""Two jobs at once for one output, each stopped and continued at random moments.

    python -m benchmarks.faults.races [--quick] [--markdown] [--pairs N] [--seed S]

The two are of the same study or of another seed, and are to begin, to go on or to begin anew, on
one process or two, with an unfinished run of the first study before them or without; one in five
gets a SIGTERM. After each pair, whatever there is has to be whole: a results file is that of one
study, byte for byte; a journal, under whatever name, goes on to the same bytes; what a job has
finished, or has promised when it was stopped, is there; and no job ends but with one line.
"""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import attrs
import numpy as np

from benchmarks.faults.tally import Tally
from benchmarks.reporting import Table, begin
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import run_to_file
from flocsim.errors import FlocsimError
from flocsim.io.journal import SESSION
from flocsim.io.results.file import read_results
from tests.helpers.jobs import KINDS, PATIENCE, STUDY, alive, descendants, finished_in
from tests.helpers.journals import records_in
from tests.helpers.results_files import same_data

SEEDS = (3, 5)
WAYS = ([], ["--resume"], ["--restart"])
CODES = {0, 2, 74, 75}
PROMISE = re.compile(r"stopped by \w+: (\d+) finished replicates are in ")
SLOWEST = 3 * PATIENCE
"""Seconds after which two jobs hang: one may wait 10 s for the other."""


@attrs.define
class Racer:
    """One of two jobs."""

    seed: int
    way: list
    kind: str
    process: subprocess.Popen
    errors: Path
    is_stopped: bool = False

    @classmethod
    def start(cls, folder, name, rng):
        """Start it in the folder, in a random way."""
        seed, kind = int(rng.choice(SEEDS, p=(0.7, 0.3))), str(rng.choice(list(KINDS)))
        way = WAYS[rng.integers(len(WAYS))]
        more = kind.split() if kind.startswith("--") else []
        words = [*KINDS[kind], sys.executable, "-m", "flocsim.ensemble", "study.toml", "--quiet",
                 "--seed", str(seed), *way, *more]  # fmt: skip
        errors = folder / f"errors-{name}.txt"
        with open(errors, "wb") as stream:
            process = subprocess.Popen(
                words, cwd=folder, stdout=subprocess.DEVNULL, stderr=stream, start_new_session=True
            )
        return cls(seed, way, kind, process, errors)

    def signal(self, number):
        """Send a signal to all of its processes."""
        for pid in descendants(self.process.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)
        self.is_stopped = number == signal.SIGSTOP

    @property
    def name(self):
        """How it was started, in a few words."""
        return f"{self.kind} seed {self.seed} {' '.join(self.way) or 'new'}"

    @property
    def promised(self):
        """How many finished replicates it said are kept."""
        found = PROMISE.search(self.errors.read_text())
        return int(found[1]) if found else 0


def make_study(folder):
    """A folder with the config of a study that takes about a second."""
    folder.mkdir(parents=True)
    (folder / "study.toml").write_text(STUDY.replace("replicates = 200", "replicates = 40"))
    return folder


def finish(folder, seed):
    """Finish the study of a seed in a folder, in this process; its results file."""
    config = load_config(folder / "study.toml", {"seed": seed})
    ended = run_to_file(config, Communicator(), folder / "study.h5", "resume")
    assert ended.code == 0
    return folder / "study.h5"


def race(folder, rng):
    """Two jobs that have ended, or None where they hang; seconds."""
    began = time.monotonic()
    racers = [Racer.start(folder, "first", rng)]
    time.sleep(rng.choice([0.0, rng.uniform(0.0, 2.0)]))
    racers.append(Racer.start(folder, "second", rng))
    to_end = racers[rng.integers(2)] if rng.random() < 0.2 else None
    moment = began + rng.uniform(1.0, 3.0)
    while any(racer.process.poll() is None for racer in racers):
        if time.monotonic() - began > SLOWEST:
            for racer in racers:
                racer.signal(signal.SIGKILL)
                racer.process.wait()
            return None, SLOWEST
        if to_end is not None and time.monotonic() > moment:
            to_end.signal(signal.SIGCONT)
            with contextlib.suppress(ProcessLookupError):
                os.kill(to_end.process.pid, signal.SIGTERM)
            to_end = None
        racer = racers[rng.integers(2)]
        if racer.process.poll() is None and time.monotonic() - began < 8.0:
            racer.signal(signal.SIGSTOP)
            time.sleep(rng.exponential(0.15))
            racer.signal(signal.SIGCONT)
        time.sleep(rng.exponential(0.05))
    pids = [pid for racer in racers for pid in descendants(racer.process.pid)[1:]]
    assert not list(alive(pids))
    return racers, time.monotonic() - began


def seed_and_rows(path):
    """(seeds of the runs that wrote a journal, replicates that it has whole)."""
    sessions = [each.about for each in records_in(path) if each.kind == SESSION]
    return {each["identity"]["seed"] for each in sessions}, len(finished_in(path))


def what_is_there(folder, references):
    """{seed: finished replicates} of all files that are left; ValueError for one that is wrong."""
    there = dict.fromkeys(SEEDS, 0)
    for path in sorted(folder.glob("study*.h5")):
        seed = read_results(path, replicates=False).run["seed"]
        if apart := same_data(references[seed], path):
            raise ValueError(f"{path.name} is not the study of seed {seed}: {apart[:3]}")
        there[seed] = read_results(path).replicates["outcome"].size
    for number, path in enumerate(sorted(folder.glob("study.h5.journal*[l0-9]"))):
        seeds, rows = seed_and_rows(path)
        if not rows:
            continue
        if len(seeds) != 1:
            raise ValueError(f"{path.name} is of seeds {seeds}")
        [seed] = seeds
        copy = make_study(folder / f"copy{number}")
        shutil.copy(path, copy / "study.h5.journal")
        if apart := same_data(references[seed], finish(copy, seed)):
            raise ValueError(f"{path.name} ends otherwise: {apart[:3]}")
        there[seed] = max(there[seed], rows)
    return there


def verdict(folder, racers, before, references):
    """What is wrong with what two jobs have left; "" for nothing."""
    for racer in racers:
        errors = racer.errors.read_text()
        if abs(racer.process.returncode) == signal.SIGTERM and not errors:
            continue  # Python was still starting, and nothing had been promised
        if racer.process.returncode not in CODES:
            return f"{racer.name}: exit code {racer.process.returncode}: {errors[-300:]}"
        if "Traceback" in errors or "internal error" in errors:
            return f"{racer.name}: {errors[-300:]}"
    try:
        there = what_is_there(folder, references)
    except (ValueError, FlocsimError) as error:
        return str(error)
    total = read_results(references[SEEDS[0]]).replicates["outcome"].size
    if there[SEEDS[0]] < before:
        return f"{before} replicates were there before, {there[SEEDS[0]]} are left"
    for racer in racers:
        if there[racer.seed] < racer.promised:
            return f"{racer.name} promised {racer.promised}, {there[racer.seed]} are left"
        if racer.process.returncode == 0 and there[racer.seed] < total:
            return f"{racer.name} had finished, {there[racer.seed]} replicates are left"
    return ""


def main():
    """Print the table; exit code 1 if anything was lost or mixed."""
    arguments = begin(__doc__, packages=("h5py", "mpi4py", "mpich"), pairs=200, seed=1)
    rng = np.random.default_rng(arguments.seed)
    columns = ("before", "pairs", "whole", "hangs", "slowest [s]", "both 0", "one refused")
    table = Table("Two jobs for one output", columns)
    tallies = {"nothing": Tally(), "an unfinished run": Tally()}
    ends = {name: [0, 0] for name in tallies}
    with tempfile.TemporaryDirectory(prefix="flocsim-races-") as name:
        root = Path(name)
        references = {seed: finish(make_study(root / f"ref{seed}"), seed) for seed in SEEDS}
        unfinished = unfinished_journal(root, references)
        for number in range(20 if arguments.quick else arguments.pairs):
            folder = make_study(root / f"pair{number}")
            begun = rng.random() < 0.5
            if begun:
                shutil.copy(unfinished, folder / "study.h5.journal")
            before = seed_and_rows(unfinished)[1] if begun else 0
            racers, seconds = race(folder, rng)
            problem = verdict(folder, racers, before, references) if racers else "hang"
            kind = "an unfinished run" if begun else "nothing"
            tallies[kind].add(problem and f"pair {number}: {problem}", seconds, racers is None)
            codes = sorted(racer.process.returncode for racer in racers or [])
            ends[kind][0] += codes == [0, 0]
            ends[kind][1] += len(codes) == 2 and codes[0] == 0 and codes[1] in (2, 74)
            shutil.rmtree(folder)
    for kind, tally in tallies.items():
        table.add(kind, tally.faults, tally.right, tally.hangs, tally.slowest, *ends[kind])
    table.print()
    wrong = [problem for tally in tallies.values() for problem in tally.wrong]
    print(*wrong, sep="\n")
    return 1 if wrong else 0


def unfinished_journal(root, references):
    """A journal of the first study that holds about half of it."""
    folder = make_study(root / "unfinished")
    words = [sys.executable, "-m", "flocsim.ensemble", "study.toml", "--quiet"]
    path, results = folder / "study.h5.journal", folder / "study.h5"
    half = read_results(references[SEEDS[0]]).replicates["outcome"].size // 2
    while not path.exists():
        results.unlink(missing_ok=True)  # of a job that was not stopped in time
        job = subprocess.Popen(words, cwd=folder, stderr=subprocess.DEVNULL)
        while job.poll() is None and rows_so_far(path) < half:
            time.sleep(0.01)
        job.terminate()  # so that it is one file
        job.wait()
    return path


def rows_so_far(path):
    """Replicates in a journal that is being written; 0 where there is none, which may change
    between a look and the next."""
    return seed_and_rows(path)[1]


if __name__ == "__main__":
    sys.exit(main())
