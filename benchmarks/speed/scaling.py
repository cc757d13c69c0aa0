"""What ranks cost: two ranks against two halves, and memory.

    python -m benchmarks.speed.scaling [--quick] [--markdown] [--only ranks memory]

*ranks*: `mpirun -n 2` and `--jobs 2` against two independent serial runs of half the replicates at
the same time. *memory*: the largest resident set of each rank.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from benchmarks.reporting import Table, begin

MPIRUN = Path(sys.executable).parent / "mpirun"

STUDY = """\
preset = "tang2014"
seed = 1
replicates = {replicates}
[scene]
types = ["I", "III"]
delta = [0.0, 0.5]
[shapes]
vertices = {vertices}
pool = 2
[output]
file = "study{number}.h5"
"""

REPORT = (
    "import json, resource, sys; from flocsim.__main__ import main; "
    "code = main(['ensemble', *sys.argv[1:]]); "
    "size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss; "
    "print(json.dumps(['peak', size])); sys.exit(code)"
)


def write_study(folder, number, replicates, vertices):
    """Write a config file into the folder and return its name. All have one seed: what is equal
    costs the same."""
    name = f"study{number}.toml"
    text = STUDY.format(number=number, replicates=replicates, vertices=list(vertices))
    (folder / name).write_text(text)
    return name


def seconds_of(folder, names, before=(), after=()):
    """Run studies at the same time; return the longest of their times, start included [s]."""
    from flocsim.io.results.file import read_results

    words = [*before, sys.executable, "-m", "flocsim.ensemble"]
    jobs = [subprocess.Popen([*words, name, "--overwrite", "--quiet", *after], cwd=folder)
            for name in names]  # fmt: skip
    for job in jobs:
        if job.wait():
            raise RuntimeError(f"a run ended with exit code {job.returncode}")
    files = [folder / name.replace(".toml", ".h5") for name in names]
    return max(read_results(file).run["wall_time"] for file in files)


def compare_ranks(folder, replicates, repeats):
    """Return the table of two ranks, MPI's and processes, against none that work together."""
    columns = ("run", "replicates", "s", "efficiency", "least", "most")
    table = Table("Two ranks against two serial runs of the study at once, halved", columns)
    # Halves of a study do not cost the same: two whole ones at once have twice its work exactly.
    whole, *twice = (write_study(folder, number, replicates, (1, 4)) for number in (1, 2, 3))
    seconds_of(folder, [whole])
    times = {"two serial runs of it at once, halved": [], "mpirun -n 2": [], "--jobs 2": []}
    serial, ranks, processes = times.values()
    for _ in range(repeats):
        serial.append(seconds_of(folder, twice) / 2.0)
        ranks.append(seconds_of(folder, [whole], [MPIRUN, "-n", "2"]))
        processes.append(seconds_of(folder, [whole], after=["--jobs", "2"]))
    for name, found in times.items():
        ratios = [one / other for one, other in zip(serial, found, strict=True)]
        table.add(name, 8 * replicates, median(found), median(ratios), min(ratios), max(ratios))
    return table


def peaks(folder, replicates, ranks):
    """Return the peak memory [MB] of each rank of a run."""
    name = write_study(folder, 4, replicates, (1,))
    launch = [MPIRUN, "-n", str(ranks)] if ranks > 1 else []
    words = [*launch, sys.executable, "-c", REPORT, name, "--overwrite", "--quiet"]
    done = subprocess.run(words, cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
    found = done.stdout.replace("][", "]\n[").split("\n")
    return sorted((json.loads(line)[1] / 1024 for line in found if "peak" in line), reverse=True)


def compare_memory(folder, counts):
    """Return the table of peak memory for ever more replicates, on one rank and on two."""
    columns = ("ranks", "replicates", "peak memory of each rank [MB]", "ratio")
    table = Table("Memory", columns)
    for ranks in (1, 2):
        first = None
        for count in counts:
            sizes = peaks(folder, count // 4, ranks)
            first = first or max(sizes)
            table.add(ranks, count, ", ".join(f"{size:.0f}" for size in sizes), max(sizes) / first)
    return table


def main():
    """Print the tables."""
    only = {"nargs": "+", "default": ["ranks", "memory"]}
    arguments = begin(__doc__, packages=("h5py", "mpi4py", "mpich"), used="two used", only=only)
    quick = arguments.quick
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "ranks" in arguments.only:
            compare_ranks(folder, 300 if quick else 6000, 2 if quick else 3).print()
        if "memory" in arguments.only:
            counts = (1_000, 10_000) if quick else (1_000, 10_000, 100_000)
            compare_memory(folder, counts).print()


if __name__ == "__main__":
    main()
