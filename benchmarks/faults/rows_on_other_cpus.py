"""How far the rows of a study agree between kinds of processor, and whether a mixture is refused.

    python -m benchmarks.faults.rows_on_other_cpus [--quick] [--markdown]

The settings are those of benchmarks.faults.other_cpus. Of each: in how many rows a byte is another
than as it is here, apart for spheres and polygons; the largest differences; what becomes of a run
that was begun as it is and is resumed under the setting, and of a job that has one rank of each
(under mpirun). The code is 1 where rows differ and a mixture was not refused.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.faults.other_cpus import settings
from benchmarks.reporting import ROOT, Table, begin

CONFIG = """\
preset = "tang2014"
seed = 1
replicates = {}
[scene]
types = ["I", "III"]
delta = [0.0, 0.5]
[shapes]
vertices = [1, 4, 16]
pool = 6
[output]
file = "r.h5"
"""

COLUMNS = (
    "setting", "rows that differ of spheres", "of polygons", "other outcomes",
    "largest change of d_c at collision [m]", "of d_c_last [m]", "resumed", "in one job",
)  # fmt: skip


def ensemble(*words):
    """The words of a command line that runs the study."""
    return [sys.executable, "-m", "flocsim.ensemble", "c.toml", *words]


def run(folder, words, environment):
    """Exit code and errors of a command in the folder."""
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode, done.stderr


def rows_in(folder):
    from flocsim.io.results.file import read_results

    return read_results(folder / "r.h5").replicates


def compare(here, there):
    """(differing rows of spheres, of polygons, other outcomes, largest changes of d_c)."""
    apart = np.zeros(here["outcome"].shape, bool)
    for name, values in here.items():
        if values.shape == apart.shape:
            same = (values == there[name]) | ((values != values) & (there[name] != there[name]))
            apart |= ~same
    changes = [
        float(np.nanmax(np.abs(here[name] - there[name]), initial=0.0))
        for name in ("d_c_collision", "d_c_last")
    ]
    size = f"/{apart[:, 0].size}", f"/{apart[:, 1:].size}"
    return (
        f"{apart[:, 0].sum()}{size[0]}", f"{apart[:, 1:].sum()}{size[1]}",
        int((here["outcome"] != there["outcome"]).sum()), *changes,
    )  # fmt: skip


def what_came(code, errors):
    """What became of a mixture, in words."""
    if code == 2:
        return "refused"
    told = "kind" in errors
    return ("recorded and told" if told else "let through") if code == 0 else f"code {code}"


def resumed(begun, folder, replicates, environment):
    """What becomes of a study that was begun as it is here and goes on under a setting."""
    shutil.copytree(begun, folder)
    words = ensemble("--resume", "--quiet", "--replicates", str(replicates + 1))
    return what_came(*run(folder, words, environment))


def in_one_job(folder, variables, environment):
    """What becomes of a job whose second rank runs under a setting."""
    launcher = Path(sys.executable).parent / "mpirun"
    if not launcher.exists():
        return "no mpirun"
    folder.mkdir()
    (folder / "c.toml").write_text(CONFIG.format(2))
    second = ["env", *(f"{name}={value}" for name, value in variables.items())]
    words = [str(launcher), "-n", "1", *ensemble("--quiet"), ":", "-n", "1", *second,
             *ensemble("--quiet")]  # fmt: skip
    return what_came(*run(folder, words, environment))


def main():
    """Print the table."""
    arguments = begin(__doc__)
    replicates = 3 if arguments.quick else 80
    table = Table("Rows by setting, against this machine as it is", COLUMNS)
    bad = False
    with tempfile.TemporaryDirectory() as scratch:
        base = Path(scratch) / "as it is"
        shared = os.environ.get("FLOCSIM_CACHE", f"{scratch}/cache")
        for number, (name, variables) in enumerate(settings().items()):
            folder = Path(scratch) / str(number) if variables else base
            folder.mkdir()
            (folder / "c.toml").write_text(CONFIG.format(replicates))
            own = f"{scratch}/cache{number}" if "NUMBA_CPU_NAME" in variables else shared
            environment = {
                **os.environ, "FLOCSIM_CACHE": own, "PYTHONPATH": str(ROOT), **variables,
            }  # fmt: skip
            code, errors = run(folder, ensemble("--quiet"), environment)
            if code:
                raise RuntimeError(errors)
            found = compare(rows_in(base), rows_in(folder))
            mixed = ["-", "-"]
            if variables:
                plain = {key: value for key, value in environment.items() if key not in variables}
                mixed = [
                    resumed(base, Path(scratch) / f"{number}r", replicates, environment),
                    in_one_job(Path(scratch) / f"{number}j", variables, plain),
                ]
            differ = any(not text.startswith("0/") for text in found[:2])
            bad |= differ and mixed != ["refused", "refused"]
            table.add(name, *found, *mixed)
    table.print()
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
