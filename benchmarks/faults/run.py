"""What is left of a study after kills, signals, full disks and damaged files.

    python -m benchmarks.faults.run [--quick] [--markdown] [--only kills signals disk flips]
                                [--seconds S]

Every fault hits a real job at a random time (fixed seed, real clock), half of them while it writes.
After each, a copy of what is left is finished in this process and compared byte for byte with an
undisturbed run, and must have computed just what was missing. The job itself then goes on, on
another number of ranks, into the next fault, until it is finished.
"""

import math
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.faults.damage import damage_journal, damage_results
from benchmarks.faults.job import KINDS, Job, Tally, make_study, run_here, verdict, whole_rows
from benchmarks.reporting import Table, parse_arguments, print_heading

SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)
LONGEST_SIGNAL = 2.0
"""Seconds in which a job has to end after a signal."""

COUNTS = {"kills": 1000, "signals": 200, "disk": 100, "flips": 10_000}
QUICK = {"kills": 12, "signals": 6, "disk": 6, "flips": 300}


def begin_job(folder, rng, lasts, **more):
    """A job on a random number of ranks, at a random time: some of them have ended by then.

    ``lasts``: see `undisturbed`.
    """
    kind = rng.choice(list(KINDS))
    job = Job.start(folder, kind, **more)
    job.wait_for_handlers()
    if rng.random() < 0.5:
        job.wait_for_journal()
    time.sleep(rng.uniform(0.0, 1.2 * lasts[kind]))
    return kind, job


def undisturbed(root):
    """{kind: seconds from when it listens until it ends} of a job that nothing disturbs: on a slow
    or busy machine, faults at fixed times would all hit its beginning."""
    found = {}
    for number, kind in enumerate(KINDS):
        job = Job.start(make_study(root / f"undisturbed{number}"), kind)
        job.wait_for_handlers()
        began = time.monotonic()
        assert job.finish([job.process.pid])[0] == 0
        found[kind] = time.monotonic() - began
    return found


def fresh(root, number):
    """The folder of the study at hand, a new one where the last is finished."""
    folder = root / f"study{number}"
    return folder if folder.exists() else make_study(folder)


def within(count, seconds):
    """0, 1, … below ``count``, for so many seconds."""
    until = time.monotonic() + seconds
    for number in range(count):
        if time.monotonic() > until:
            print(f"time is up after {number} of {count}", file=sys.stderr)
            return
        yield number


def kill_often(root, reference, count, rng, seconds):
    """{target: Tally} of kills of a rank, of the launcher, of all."""
    tallies = {target: Tally() for target in ("rank", "launcher", "group")}
    number, lasts = 0, undisturbed(root)
    for _ in within(count, seconds):
        folder = fresh(root, number)
        target = rng.choice(list(tallies))
        before = whole_rows(folder)
        kind, job = begin_job(folder, rng, lasts)
        pids = job.send(signal.SIGKILL, target, rng)
        code, seconds = job.finish(pids)
        problem = "hang" if code is None else verdict(folder, reference)
        if not problem and whole_rows(folder) < before and not (folder / "study.h5").exists():
            problem = "rows lost"
        problem = f"{kind}, {target}: {problem}" if problem else ""
        tallies[target].add(problem, seconds, code is None)
        if (folder / "study.h5").exists():
            number += 1
    return tallies


def signal_often(root, reference, count, rng, seconds):
    """{signal: Tally}: each has to end the job in time with exit code 75."""
    tallies, lasts = {number.name: Tally() for number in SIGNALS}, undisturbed(root)
    for number in within(count, seconds):
        folder = fresh(root, f"-signal{number}")
        sign = SIGNALS[number % len(SIGNALS)]
        kind, job = begin_job(folder, rng, lasts)
        target = rng.choice(["launcher", "group"])
        pids = job.send(sign, target, rng)
        code, seconds = job.finish(pids)
        problem = "" if code in (0, 75) else f"exit code {code}"
        if code == 0 and not (folder / "study.h5").exists():
            problem = "exit code 0 without results"
        if seconds > LONGEST_SIGNAL:
            problem = f"{seconds:.1f} s"
        problem = problem or verdict(folder, reference)
        tallies[sign.name].add(f"{kind}, {sign.name} to {target}: {problem}" if problem else "",
                               seconds, code is None)  # fmt: skip
        shutil.rmtree(folder)
    return tallies


def fill_disk(root, reference, count, rng, seconds):
    """{"file-size limit": Tally, "full tmpfs": Tally}: exit code 74, and chunks whole."""
    tallies = {"file-size limit": Tally(), "full tmpfs": Tally()}
    room = 2.2 * Path(reference).stat().st_size
    for number in within(count, seconds):
        way = "full tmpfs" if number % 3 == 0 and can_mount(root) else "file-size limit"
        # A file is as long as the results, a disk holds journal and results.
        size = int(rng.uniform(3e3, room if way == "full tmpfs" else 0.5 * room))
        folder = make_study(root / f"disk{number}")
        code, seconds, problem = fill_once(folder, way, size, rng)
        problem = problem or verdict(folder, reference)
        problem = f"{way} of {size}: {problem}" if problem else ""
        tallies[way].add(problem, seconds, code is None)
        if way == "full tmpfs":
            subprocess.run(["umount", "-l", folder], check=True)
        shutil.rmtree(folder)
    return tallies


def fill_once(folder, way, size, rng):
    """(exit code, seconds, what is wrong with it) of a job that runs out of disk."""
    more, kinds = {}, ["serial", "--jobs 2"]
    if way == "full tmpfs":
        # A file-size limit would hit MPI's own shared memory before it hits a journal.
        kinds = ["mpirun -n 2", "serial"]
        options = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder]
        subprocess.run(options, check=True)
        (folder / "study.toml").write_text((folder.parent / "study.toml").read_text())
    else:
        more["preexec_fn"] = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    job = Job.start(folder, rng.choice(kinds), **more)
    code, seconds = job.finish([job.process.pid])
    finished = (folder / "study.h5").exists()
    good = code == 74 or (code == 0 and finished)
    return code, seconds, "" if good else f"exit code {code}"


def can_mount(root):
    """Whether this user may mount a small disk."""
    place = root / "mount"
    place.mkdir(exist_ok=True)
    tried = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", place],
                           capture_output=True)  # fmt: skip
    if tried.returncode == 0:
        subprocess.run(["umount", place], check=True)
    return tried.returncode == 0


def add_rows(table, name, tallies):
    """Rows of the table, one for each kind."""
    for kind, tally in tallies.items():
        table.add(name, kind, tally.faults, tally.right, tally.hangs, tally.slowest)


def main():
    """Print the table; exit code 1 if anything was lost."""
    most = {"type": float, "default": math.inf, "help": "seconds for kills, for signals, for disks"}
    arguments = parse_arguments(__doc__, seconds=most, only={"nargs": "+", "default": list(COUNTS),
                                               "choices": list(COUNTS)})  # fmt: skip
    print_heading(("h5py", "mpi4py", "mpich"))
    most = arguments.seconds
    counts = QUICK if arguments.quick else COUNTS
    rng = np.random.default_rng(int(time.time()))
    table = Table(
        "Faults", ("fault", "of", "times", "same bytes after", "hangs", "slowest end [s]")
    )
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        (root / "study.toml").write_text((make_study(root / "ref") / "study.toml").read_text())
        reference = run_here(root / "ref")
        parts = {
            "kills": lambda count: kill_often(root, reference, count, rng, most),
            "signals": lambda count: signal_often(root, reference, count, rng, most),
            "disk": lambda count: fill_disk(root, reference, count, rng, most),
            "flips": lambda count: (
                damage_journal(root, reference, count // 2, rng)
                | damage_results(root, reference, count // 2, rng)
            ),
        }
        wrong = []
        for part in arguments.only:
            tallies = parts[part](counts[part])
            add_rows(table, part, tallies)
            wrong += [problem for tally in tallies.values() for problem in tally.wrong]
    table.print(arguments.markdown)
    print(*wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
