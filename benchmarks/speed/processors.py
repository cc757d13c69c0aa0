"""What engines lose that are compiled for any processor of a kind, not for this very one.

    python -m benchmarks.speed.processors [--quick] [--markdown]

CPU time of the replicates between 40 and 240 of a condition (N = 64, head on), where engines are
for flocsim.compiler.processor.BASELINE as they are by default, over that where NUMBA_CPU_NAME names
this processor. Both in turn, three times.
"""

import sys
import tempfile

import llvmlite.binding as llvm

from benchmarks.reporting import ROOT, Table, begin, spent_by

CONFIG = """\
preset = "{preset}"
seed = 1
replicates = 40
[scene]
types = ["I", "II", "III"]
delta = [0.0]
[shapes]
source = "library"
file = "synthetic"
vertices = [64]
{more}
"""

CASES = {
    "tang2014": ("tang2014", ""),
    "si": ("si", ""),
    "tang2014, attraction of outlines": (
        "tang2014", '[forces.van_der_waals]\nlaw = "outline"',
    ),
}  # fmt: skip


def cpu_seconds(folder, variables, replicates):
    """CPU time of the study with so many replicates [s]."""
    words = [sys.executable, "-m", "flocsim.ensemble", "c.toml", "--quiet", "--restart",
             "--overwrite", "--replicates", str(replicates), "--output", "r.h5"]  # fmt: skip
    return spent_by(words, folder, PYTHONPATH=str(ROOT), **variables).cpu


def main():
    """Print the table."""
    arguments = begin(__doc__)
    columns = ("study", "for its kind [s]", "for this one [s]", "ratio")
    table = Table("CPU time of 600 replicates", columns)
    ways = {}, {"NUMBA_CPU_NAME": llvm.get_host_cpu_name()}
    low, high = (4, 24) if arguments.quick else (40, 240)
    for name, (preset, more) in CASES.items():
        with tempfile.TemporaryDirectory() as folder:
            with open(f"{folder}/c.toml", "w") as file:
                file.write(CONFIG.format(preset=preset, more=more))
            for way in ways:
                cpu_seconds(folder, way, 1)  # compiled
            for _ in range(1 if arguments.quick else 3):
                found = [cpu_seconds(folder, w, high) - cpu_seconds(folder, w, low) for w in ways]
                table.add(name, *found, found[0] / found[1])
    table.print()


if __name__ == "__main__":
    main()
