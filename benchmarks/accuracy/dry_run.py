"""Whether `--dry-run` tells the truth: core-hours against the studies themselves.

    python -m benchmarks.accuracy.dry_run [--quick] [--replicates-of 1.0] [--studies …]

Each study is forecast, then run to its end in the same process, its code being compiled by then.
CPU time, as another job on the machine would stretch the clock on the wall. Goal: within a factor
1.5 on all of them; how many lie inside the interval is printed.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.reporting import EXAMPLES, Table, begin, cpu_of
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.diagnose.pilot import forecast_of
from flocsim.ensembles.kind import study_of
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import run_to_file

GOAL = 1.5

STUDIES = {
    "quickstart": (EXAMPLES / "quickstart.toml", 120),
    "tang2014": (
        'preset = "tang2014"\n[scene]\ntypes = ["I", "II", "III"]\ndelta = [0.0, 0.25, 0.5, 0.75, '
        "1.0]\n[shapes]\nvertices = [1, 4, 16, 64]\n",
        60,
    ),
    "si": (
        'preset = "si"\n[scene]\ntypes = ["I", "III"]\ndelta = [0.0, 0.4, 0.8]\n[shapes]\n'
        "vertices = [8, 32]\npool = 6\n",
        100,
    ),
    "own force": (EXAMPLES / "own_force.toml", 500),
    "spheres": (
        'preset = "tang2014"\n[scene]\ntypes = ["I", "II", "III"]\ndelta = [0.0, 0.25, 0.5, 0.75, '
        "1.0]\n[shapes]\nvertices = [1]\n",
        600,
    ),
}
"""Name → (config or its text, replicates)."""


def config_of(source, folder, replicates):
    """The Config of a study, its results in the folder."""
    path = source
    if isinstance(source, str):
        path = Path(folder) / "study.toml"
        path.write_text(source, "utf-8")
    output = {"file": str(Path(folder) / "results.h5")}
    return load_config(path, {"replicates": replicates, "output": output})


def judge(name, factor, table):
    """Forecast a study, run it, and add a line; by how much the forecast is off at most."""
    source, replicates = STUDIES[name]
    with TemporaryDirectory() as folder:
        config = config_of(source, folder, max(round(factor * replicates), 12))
        study = study_of(config)
        study.compile(study.kinds)
        pilot, found = cpu_of(forecast_of, study, 1)
        truth, _ = cpu_of(run_to_file, config, Communicator(), config.output.file, "new")
    ratio = found.cpu / truth
    inside = found.low <= truth <= found.high
    table.add(
        name, study.size, found.ended.total(), pilot, found.cpu,
        f"{found.low:.3g} to {found.high:.3g}", truth, ratio,
        "yes" if inside else "no",
    )  # fmt: skip
    return max(ratio, 1.0 / ratio), inside


def main():
    """Print the table, and what is the furthest off."""
    studies = {"nargs": "+", "choices": STUDIES, "default": list(STUDIES)}
    arguments = begin(__doc__, replicates_of=1.0, studies=studies)
    columns = ("study", "replicates", "of them in the pilot", "pilot [s]", "forecast [s]",
               "95 %", "truth [s]", "ratio", "inside")  # fmt: skip
    table = Table("--dry-run against the study itself, CPU time of one core", columns)
    factor = arguments.replicates_of * (0.25 if arguments.quick else 1.0)
    found = [judge(name, factor, table) for name in arguments.studies]
    table.print()
    hours, inside = max(each[0] for each in found), sum(each[1] for each in found)
    print(f"off by at most {hours:.2f} times (goal {GOAL}); "
          f"{inside} of {len(found)} inside the interval")  # fmt: skip


if __name__ == "__main__":
    main()
