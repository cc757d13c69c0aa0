"""Jobs whose ranks are started with different things, or whose files change while they start.

    python -m benchmarks.faults.mixed [--quick] [--markdown] [--launches N] [--seed S]

Ranks with two configs, with other words, or with other versions have to be refused by all, with
one line that names the rank. Where the config, the module of a force or the shape library is
replaced at a random moment of the start, all rows have to be those of the one or of the other.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.faults.job import BESIDE_PYTHON, PATIENCE, STUDY, Tally
from benchmarks.reporting import Table, parse_arguments, print_heading
from tests.helpers.results_files import same_data
from tests.helpers.small_study import write_star_library

SMALL = STUDY.replace("replicates = 200", "replicates = 30")
OWN = '[forces.mine]\nclass = "own_pull:Pull"\n'
FORCE = """\
import attrs
from flocsim.forces import CentreForce
from neighbour import FACTOR


@attrs.frozen
class Pull(CentreForce):
    @staticmethod
    def kernel(pair):
        return FACTOR * 1e-9
"""
LIBRARY = SMALL.replace(
    "[shapes]\nvertices = [1]", '[shapes]\nsource = "library"\nfile = "stars.h5"\nvertices = [4]'
).replace("replicates = 30", "replicates = 4")

RUN = [sys.executable, "-m", "flocsim.ensemble"]
LAUNCH = {
    "--jobs 2": [*RUN, "study.toml", "--quiet", "--jobs", "2"],
    "mpirun -n 2": [str(BESIDE_PYTHON / "mpirun"), "-n", "2", *RUN, "study.toml", "--quiet"],
    "mpirun -n 3": [str(BESIDE_PYTHON / "mpirun"), "-n", "3", *RUN, "study.toml", "--quiet"],
}
OTHERS = (
    ["other.toml"], ["study.toml", "--seed", "5"], ["study.toml", "--resume"],
    ["study.toml", "-o", "other.h5"], ["study.toml", "--set", "scene.delta=[0.5]"],
    ["study.toml", "--replicates", "7"], ["study.toml", "--bogus"], ["nowhere.toml"],
)  # fmt: skip

VERSION = """\
import os
if "1" in map(os.environ.get, ("PMI_RANK", "OMPI_COMM_WORLD_RANK")):
    from flocsim.ensembles.parallel import agreement

    found = agreement.versions()
    agreement.versions = lambda: found | {"version of numpy": "0.9"}
"""


def write_variant(folder, what, variant):
    """Put one of two variants of a file in place, at once as editors do."""
    new = folder / ".new"
    if what == "config":
        new.write_text(SMALL.replace("seed = 3", f"seed = {(3, 5)[variant]}"))
    elif what == "module":
        new.write_text(f"FACTOR = {('-1.0', '+1.0')[variant]}\n")
    else:
        write_star_library(new, ratios=((8.0, 16.0, 24.0), (9.0, 17.0, 25.0))[variant])
    os.replace(new, folder / {"config": "study.toml", "module": "neighbour.py",
                              "library": "stars.h5"}[what])  # fmt: skip


def make_folder(folder, what, variant=0):
    """A folder with a study of which one file has two variants."""
    folder.mkdir(parents=True)
    text = {"config": SMALL, "module": SMALL + OWN, "library": LIBRARY}[what]
    (folder / "study.toml").write_text(text)
    (folder / "own_pull.py").write_text(FORCE)
    write_variant(folder, what, variant)
    return folder


def run(words, folder, env=None, patience=2 * PATIENCE):
    """(exit code, errors, seconds); a hang ends in None."""
    began = time.monotonic()
    try:
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True,
                              timeout=patience, env=env)  # fmt: skip
    except subprocess.TimeoutExpired:
        return None, "hang", patience
    return done.returncode, done.stderr, time.monotonic() - began


def mixed_words(root, number, rng):
    """Ranks with other words: (problem, seconds, whether they hang)."""
    folder = make_folder(root / f"words{number}", "config")
    write_variant(folder, "config", 1)
    os.replace(folder / "study.toml", folder / "other.toml")
    write_variant(folder, "config", 0)
    other = list(OTHERS[rng.integers(len(OTHERS))])
    parts = [["study.toml"], other] if rng.random() < 0.5 else [other, ["study.toml"]]
    if rng.random() < 0.5:
        parts.append(["study.toml"])
    words = [str(BESIDE_PYTHON / "mpirun")]
    for part in parts:
        words += [":"] if len(words) > 1 else []
        words += ["-n", "1", *RUN, *part, "--quiet"]
    code, errors, seconds = run(words, folder)
    return refusal(folder, code, errors, words), seconds, code is None


def mixed_versions(root, number, rng):
    """A rank with another version."""
    folder = make_folder(root / f"version{number}", "config")
    (folder / "sitecustomize.py").write_text(VERSION)
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    words = LAUNCH[f"mpirun -n {rng.integers(2, 4)}"]
    code, errors, seconds = run(words, folder, os.environ | {"PYTHONPATH": path})
    return refusal(folder, code, errors, words), seconds, code is None


def refusal(folder, code, errors, words):
    """What is wrong with the refusal of a job; "" for nothing."""
    lines = [line for line in errors.splitlines() if not line.startswith(("usage:", " "))]
    left = [path.name for path in folder.glob("*.h5*")]
    shutil.rmtree(folder)
    if code != 2 or left or "Traceback" in errors:
        return f"{' '.join(words[1:])}: exit code {code}, {left}: {errors[-300:]}"
    told = [line for line in lines if "rank " in line or "error: " in line or "no such" in line]
    return "" if told and len(lines) < 4 else f"{' '.join(words[1:])}: {errors[-300:]}"


def edited(root, number, rng, what, references):
    """A file that is replaced while a job starts."""
    folder = make_folder(root / f"{what}{number}", what)
    kind = str(rng.choice(list(LAUNCH)))
    job = subprocess.Popen(LAUNCH[kind], cwd=folder, stdout=subprocess.DEVNULL,
                           stderr=subprocess.PIPE, text=True)  # fmt: skip
    began, variant = time.monotonic(), 0
    while job.poll() is None and time.monotonic() - began < 4.0:
        time.sleep(rng.uniform(0.0, 0.6))
        variant = 1 - variant
        write_variant(folder, what, variant)
    try:
        errors = job.communicate(timeout=2 * PATIENCE)[1]
    except subprocess.TimeoutExpired:
        job.kill()
        job.communicate()
        return f"{what}, {kind}: hang", 2 * PATIENCE, True
    problem = ""
    if job.returncode:
        problem = f"exit code {job.returncode}: {errors[-300:]}"
    elif all(same_data(folder / "study.h5", reference) for reference in references[what]):
        problem = "rows of both variants, or of none"
    shutil.rmtree(folder)
    return problem and f"{what}, {kind}: {problem}", time.monotonic() - began, False


def make_references(root):
    """{what: [results of each variant]}, undisturbed."""
    found = {}
    for what in ("config", "module", "library"):
        found[what] = []
        for variant in (0, 1):
            folder = make_folder(root / f"ref-{what}{variant}", what, variant)
            # It compiles what the others then find.
            code, errors, _ = run([*RUN, "study.toml", "--quiet"], folder, patience=600.0)
            assert code == 0, errors
            found[what].append(folder / "study.h5")
        assert same_data(*found[what])
    return found


def main():
    """Print the table; exit code 1 if any launch was not refused or gave mixed rows."""
    arguments = parse_arguments(
        __doc__,
        launches={"type": int, "default": 200, "help": "how many launches"},
        seed={"type": int, "default": 1, "help": "seed of the moments"},
    )
    print_heading(("h5py", "mpi4py", "mpich"))
    rng = np.random.default_rng(arguments.seed)
    table = Table("Mixed launches", ("what", "launches", "right", "hangs", "slowest [s]"))
    wrong = []
    with tempfile.TemporaryDirectory(prefix="flocsim-mixed-") as name:
        root = Path(name)
        references = make_references(root)
        kinds = {
            "other words": lambda number: mixed_words(root, number, rng),
            "other versions": lambda number: mixed_versions(root, number, rng),
            "config edited": lambda number: edited(root, number, rng, "config", references),
            "module edited": lambda number: edited(root, number, rng, "module", references),
            "library replaced": lambda number: edited(root, number, rng, "library", references),
        }
        launches = 20 if arguments.quick else arguments.launches
        for place, (kind, launch) in enumerate(kinds.items()):
            tally = Tally()
            for number in range(place, launches, len(kinds)):
                tally.add(*launch(number))
            table.add(kind, tally.faults, tally.right, tally.hangs, tally.slowest)
            wrong += tally.wrong
    table.print(arguments.markdown)
    print(*wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
