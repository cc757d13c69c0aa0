"""Damaged and hostile caches of compiled code: no wrong row, no crash, no traceback, nothing run.

A cache that a small study of spheres has filled is damaged in one way at a time, and the study is
run in a fresh process with it: it has to end with exit code 0 and the rows of an undisturbed run,
at most one line on stderr, and without running what was planted.
"""

import os
import pickle
import shutil
import subprocess
import sys

from flocsim.compiler.disk_cache import DIGEST_SIZE, MARK
from flocsim.io.results.file import read_results
from tests.helpers.jobs import make_study
from tests.helpers.results_files import same_data

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
    """(exit code, stderr) of the study in a fresh process; code None for a hang."""
    words = [sys.executable, "-m", "flocsim.ensemble", "study.toml", "--quiet",
             "--replicates", "2"]  # fmt: skip
    try:
        done = subprocess.run(
            words, cwd=folder, env={**os.environ, "FLOCSIM_CACHE": str(cache)},
            capture_output=True, text=True, timeout=PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return None, ""
    return done.returncode, done.stderr


def problem_of(folder, cache, mark, reference):
    """Return what is wrong with a run on a damaged cache; "" if nothing."""
    output = folder / "study.h5"
    output.unlink(missing_ok=True)
    code, errors = run(folder, cache)
    if code is None:
        return "hang"
    if code != 0:
        return f"exit code {code}: {errors[-300:]}"
    # What is implausible of the study itself is said whatever becomes of the cache.
    lines = [line for line in errors.splitlines() if not line.startswith("flocsim: warning: ")]
    if len(lines) > 1:
        return f"several lines: {errors[-300:]}"
    if mark.exists():
        return "what was planted has been run"
    if apart := same_data(reference, output):
        return f"wrong rows: {apart}"
    return ""


def choose(cache, rng):
    """Return a file of the cache, no engine: a law is compiled again in a second."""
    return rng.choice([path for path in sorted(cache.iterdir()) if "scene" not in path.name])


def damage_often(root, count, rng):
    """Return what is wrong after so many damages, each in the next of `WAYS`."""
    folder, pristine = make_study(root / "study"), root / "pristine"
    assert run(folder, pristine)[0] == 0
    reference = root / "reference.h5"
    shutil.move(folder / "study.h5", reference)
    assert read_results(reference).replicates["outcome"].size
    wrong = []
    for number in range(count):
        way = WAYS[number % len(WAYS)]
        # Of what nothing is taken, everything is compiled anew.
        cache, mark = root / "cache", root / "ran"
        shutil.rmtree(cache, ignore_errors=True)
        shutil.copytree(pristine, cache)
        cache.chmod(0o755)
        way(choose(cache, rng), rng, mark)
        if problem := problem_of(folder, cache, mark, reference):
            wrong.append(f"{way.__name__}: {problem}")
        shutil.rmtree(mark, ignore_errors=True)
    return wrong
