"""Damaged and hostile caches of compiled code: no wrong row, no crash, no traceback, nothing run.

    python -m benchmarks.faults.damage_cache [--quick] [--markdown] [--seed S]

A cache that a small study of spheres has filled is damaged in one way at a time, and the study is
run in a fresh process with it: it has to end with exit code 0 and the rows of an undisturbed run,
at most one line on stderr, and without running what was planted.
"""

import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.faults.job import Tally, make_study
from benchmarks.reporting import Table, parse_arguments, print_heading
from flocsim.compiler.disk_cache import DIGEST_SIZE, MARK
from flocsim.io.results.file import read_results
from tests.helpers.results_files import same_data

COUNT, QUICK = 500, 24
PATIENCE = 600.0
"""Seconds after which a run hangs: some have to compile an engine."""

NOBODY = 65534


class Planted:
    """A pickle that makes a folder."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def flip(path, rng, mark):
    """One bit."""
    data = bytearray(path.read_bytes())
    data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)


def cut(path, rng, mark):
    """An end that is missing."""
    data = path.read_bytes()
    path.write_bytes(data[: int(rng.integers(len(data)))])


def empty(path, rng, mark):
    """No bytes at all."""
    path.write_bytes(b"")


def swap(path, rng, mark):
    """Another file of the cache under this name, and the other way round."""
    other = rng.choice([each for each in path.parent.iterdir() if each != path])
    first, second = path.read_bytes(), other.read_bytes()
    path.write_bytes(second)
    other.write_bytes(first)


def plant(path, rng, mark):
    """A pickle that runs something, bare or behind the mark and the checksum that was there."""
    head = b"" if rng.random() < 0.5 else path.read_bytes()[: len(MARK) + DIGEST_SIZE]
    path.write_bytes(head + pickle.dumps(Planted(mark)))


def link(path, rng, mark):
    """A link to a planted file elsewhere."""
    elsewhere = mark.with_name("elsewhere")
    elsewhere.write_bytes(pickle.dumps(Planted(mark)))
    path.unlink()
    path.symlink_to(elsewhere)


def pipe(path, rng, mark):
    """A named pipe, on which a reader waits."""
    path.unlink()
    os.mkfifo(path)


def open_file(path, rng, mark):
    """A planted file that all can write."""
    plant(path, rng, mark)
    path.chmod(0o666)


def open_folder(path, rng, mark):
    """A folder that all can write, with a planted file."""
    plant(path, rng, mark)
    path.parent.chmod(int(rng.choice([0o777, 0o775, 0o1777])))


def foreign(path, rng, mark):
    """A file, or the folder, of another user's (as root only)."""
    plant(path, rng, mark)
    if os.getuid() == 0:
        os.chown(path if rng.random() < 0.5 else path.parent, NOBODY, NOBODY)


WAYS = (flip, flip, cut, empty, swap, plant, link, pipe, open_file, open_folder, foreign)


def run(folder, cache):
    """(exit code, stderr, seconds) of the study in a fresh process; code None for a hang."""
    began = time.monotonic()
    words = [sys.executable, "-m", "flocsim.ensemble", "study.toml", "--quiet",
             "--replicates", "2"]  # fmt: skip
    try:
        done = subprocess.run(
            words, cwd=folder, env={**os.environ, "FLOCSIM_CACHE": str(cache)},
            capture_output=True, text=True, timeout=PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return None, "", PATIENCE
    return done.returncode, done.stderr, time.monotonic() - began


def problem_of(folder, cache, mark, reference):
    """(what is wrong with a run on a damaged cache, "" if nothing; seconds; whether it hangs)."""
    output = folder / "study.h5"
    output.unlink(missing_ok=True)
    code, errors, seconds = run(folder, cache)
    if code is None:
        return "hang", seconds, True
    if code != 0:
        return f"exit code {code}: {errors[-300:]}", seconds, False
    # What is implausible of the study itself is said whatever becomes of the cache.
    lines = [line for line in errors.splitlines() if not line.startswith("flocsim: warning: ")]
    if len(lines) > 1:
        return f"several lines: {errors[-300:]}", seconds, False
    if mark.exists():
        return "what was planted has been run", seconds, False
    if apart := same_data(reference, output):
        return f"wrong rows: {apart}", seconds, False
    return "", seconds, False


def choose(cache, rng, kept):
    """A file of the cache: a law mostly, which is compiled anew in a second, else an engine."""
    files = sorted(cache.iterdir())
    engines = [path for path in files if "scene" in path.name]
    others = [path for path in files if path not in engines]
    return rng.choice(engines if rng.random() < kept else others)


def damage_often(root, count, rng, engines=0.1):
    """{way: Tally} of so many damages; this share of them hits an engine."""
    folder, pristine = make_study(root / "study"), root / "pristine"
    assert run(folder, pristine)[0] == 0
    reference = root / "reference.h5"
    shutil.move(folder / "study.h5", reference)
    assert read_results(reference).replicates["outcome"].size
    tallies = {way.__name__: Tally() for way in WAYS}
    for number in range(count):
        way = WAYS[number % len(WAYS)]
        # Of what nothing is taken, everything is compiled anew.
        cache, mark = root / "cache", root / "ran"
        shutil.rmtree(cache, ignore_errors=True)
        shutil.copytree(pristine, cache)
        cache.chmod(0o755)
        way(choose(cache, rng, engines), rng, mark)
        problem, seconds, hang = problem_of(folder, cache, mark, reference)
        problem = f"{way.__name__}: {problem}" if problem else ""
        tallies[way.__name__].add(problem, seconds, hang)
        shutil.rmtree(mark, ignore_errors=True)
    return tallies


def main():
    """Print the table; exit code 1 if anything was wrong."""
    seed = {"type": int, "default": 1, "help": "of the damages"}
    arguments = parse_arguments(__doc__, seed=seed)
    print_heading()
    rng = np.random.default_rng(arguments.seed)
    table = Table(
        "Damaged caches", ("way", "times", "same rows, nothing run", "hangs", "slowest [s]")
    )
    with tempfile.TemporaryDirectory() as name:
        tallies = damage_often(Path(name), QUICK if arguments.quick else COUNT, rng)
    for way, tally in tallies.items():
        table.add(way, tally.faults, tally.right, tally.hangs, tally.slowest)
    table.print(arguments.markdown)
    return 1 if any(tally.wrong for tally in tallies.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
