"""What ranks cost: two ranks against two halves, memory, and a simulation up to 100,000 ranks.

    python -m benchmarks.speed.scaling [--quick] [--markdown] [--only ranks memory simulation]

*ranks*: `mpirun -n 2` and `--jobs 2` against two independent serial runs of half the replicates at
the same time. *memory*: the largest resident set of each rank. *simulation*: the Schedule that runs
studies hands out replicates whose costs were measured here, to simulated ranks; rank 0 answers one
request at a time, in the time that was measured for taking in a chunk and writing it.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from benchmarks.reporting import Table, parse_arguments, print_heading
from benchmarks.speed.scaling_simulation import measure_costs, measure_rank_zero, simulate

BESIDE_PYTHON = Path(sys.executable).parent

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
    "import json, resource, sys; from flocsim.ensembles.cli import main; "
    "code = main(sys.argv[1:]); size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss; "
    "print(json.dumps(['peak', size])); sys.exit(code)"
)
RANKS = (10, 100, 1000, 10_000, 30_000, 100_000)


def write_study(folder, number, replicates, vertices):
    """A config file in the folder; its name. All have one seed: what is equal costs the same."""
    name = f"study{number}.toml"
    text = STUDY.format(number=number, replicates=replicates, vertices=list(vertices))
    (folder / name).write_text(text)
    return name


def start(folder, name, before=(), after=()):
    """A run of a study, as a process whose output is read."""
    words = [*before, sys.executable, "-m", "flocsim.ensemble", name, "--quiet", *after]
    return subprocess.Popen(words, cwd=folder)


def seconds_of(folder, *numbers):
    """The longest of the runs' times, start and compiled code included."""
    from flocsim.io.results.file import read_results

    files = [folder / f"study{number}.h5" for number in numbers]
    return max(read_results(file, replicates=False).run["wall_time"] for file in files)


def run_all(*jobs):
    """Wait for runs; they must all end well."""
    for job in jobs:
        if job.wait():
            raise RuntimeError(f"a run ended with exit code {job.returncode}")


def compare_ranks(folder, replicates, repeats, table):
    """Two ranks, MPI's and processes, against none that work together; medians of repeats."""
    whole = write_study(folder, 1, replicates, (1, 4))
    # Halves of a study do not cost the same: two whole ones at once have twice its work exactly.
    twice = [write_study(folder, number, replicates, (1, 4)) for number in (2, 3)]
    run_all(start(folder, whole))
    times = {"two serial runs of it at once, halved": [], "mpirun -n 2": [], "--jobs 2": []}
    ideal = times["two serial runs of it at once, halved"]
    for _ in range(repeats):
        run_all(*(start(folder, name) for name in twice))
        ideal.append(seconds_of(folder, 2, 3) / 2.0)
        run_all(start(folder, whole, [BESIDE_PYTHON / "mpirun", "-n", "2"]))
        times["mpirun -n 2"].append(seconds_of(folder, 1))
        run_all(start(folder, whole, after=["--jobs", "2"]))
        times["--jobs 2"].append(seconds_of(folder, 1))
    for name, found in times.items():
        ratios = [one / other for one, other in zip(ideal, found, strict=True)]
        table.add(name, 8 * replicates, median(found), median(ratios), min(ratios), max(ratios))


def peaks(folder, replicates, ranks):
    """Peak memory [MB] of each rank of a run."""
    name = write_study(folder, 4, replicates, (1,))
    launch = [BESIDE_PYTHON / "mpirun", "-n", str(ranks)] if ranks > 1 else []
    words = [*launch, sys.executable, "-c", REPORT, name, "--quiet"]
    done = subprocess.run(words, cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
    found = done.stdout.replace("][", "]\n[").split("\n")
    return sorted((json.loads(line)[1] / 1024 for line in found if "peak" in line), reverse=True)


def compare_memory(folder, counts, table):
    """Peak memory for ever more replicates, on one rank and on two."""
    for ranks in (1, 2):
        first = None
        for count in counts:
            sizes = peaks(folder, count // 4, ranks)
            first = first or max(sizes)
            table.add(ranks, count, ", ".join(f"{size:.0f}" for size in sizes), max(sizes) / first)


def simulate_all(folder, quick, table, about):
    """Rows of the simulation; ``about`` receives what was measured for it."""
    costs = measure_costs(20 if quick else 60)
    rank_zero = measure_rank_zero(folder)
    about.add(
        costs.number, 1e3 * costs.mean, costs.spread, 1e6 * rank_zero.answer, rank_zero.rows / 1e6
    )
    for ranks in RANKS[: 4 if quick else None]:
        for per_rank in (1e2, 1e4, 1e5):
            if ranks * per_rank > 1e10:
                continue
            table.add(*simulate(ranks, int(ranks * per_rank), costs, rank_zero))


def main():
    """Print the tables."""
    only = {"nargs": "+", "default": ["ranks", "memory", "simulation"]}
    arguments = parse_arguments(__doc__, only=only)
    print_heading(("h5py", "mpi4py", "mpich"))
    quick = arguments.quick
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tables = []
        if "ranks" in arguments.only:
            columns = ("run", "replicates", "s", "efficiency", "least", "most")
            tables.append(
                Table("Two ranks against two serial runs of the study at once, halved", columns)
            )
            compare_ranks(folder, 300 if quick else 6000, 2 if quick else 3, tables[-1])
        if "memory" in arguments.only:
            columns = ("ranks", "replicates", "peak memory of each rank [MB]", "ratio")
            tables.append(Table("Memory", columns))
            compare_memory(
                folder, (1_000, 10_000) if quick else (1_000, 10_000, 100_000), tables[-1]
            )
        if "simulation" in arguments.only:
            columns = ("costs measured", "mean [ms]", "largest/median", "answer [µs]",
                       "taken in [1e6 rows/s]")  # fmt: skip
            about = Table("What the simulation works with", columns)
            columns = ("ranks", "replicates", "ideal [s]", "handed out in [s]", "efficiency",
                       "rank 0 busy")  # fmt: skip
            table = Table("Simulated ranks", columns)
            simulate_all(folder, quick, table, about)
            tables += [about, table]
        for table in tables:
            table.print(arguments.markdown)


if __name__ == "__main__":
    main()
