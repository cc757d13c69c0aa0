"""What shapes make of collision rates: kernels of real flocs, swarms of them, strength of bonds.

    python -m benchmarks.accuracy.rates [--quick] [--markdown] [--images DIR] [--figures DIR]

Runs, in a temporary folder, the commands of examples/kernel.toml, of settling_kernel.toml and
settling_swarm.toml with kernel_against_swarm.py, and of `flocsim strength` for doublets of quartz
(preset si). Flocs are those of the pictures flocpy and safas. ``--figures``: copy the figures of
the evidence pages there.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.pictures import PICTURES, checked
from benchmarks.reporting import EXAMPLES, Table, begin
from flocsim.io.results.file import read_results
from flocsim.process import WITHHELD

CONFIGS = ("kernel.toml", "settling_kernel.toml", "settling_swarm.toml")

PAIRS = (("5um", "8um"), ("5um", "30um"), ("12um", "20um"), ("20um", "30um"), ("30um", "30um"))
"""Pairs of size classes in the table of kernels."""

FIGURES = {
    "kernel-kernels.png": "kernels-kernels.png",
    "kernel-efficiency.png": "kernels-efficiency.png",
    "kernel_against_swarm.png": "kernels-swarm.png",
    "si-strength-strength.png": "strength-shear.png",
}
"""{file that a command writes: its name among the figures of the pages}."""

QUARTZ = """\
preset = "si"
seed = 3
replicates = 60
[scene]
types = ["II", "III"]
delta = [0.25]
[shapes]
source = "library"
file = "synthetic"
vertices = [1, 16, 64]
"""


def flocsim(folder, *words):
    """Run a subcommand in the folder; return what it printed."""
    return python(folder, "-m", "flocsim", *words)


def python(folder, *words):
    """Run Python in the folder; return what it printed."""
    print("$", *words, file=sys.stderr, flush=True)
    command = [sys.executable, *map(str, words)]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    # An incomplete study has results, too, and says so in what it printed.
    if done.returncode not in (0, WITHHELD):
        done.check_returncode()
    return done.stdout


def print_kernels(kernel):
    """Print α and E₃ of some pairs of size classes, for the largest N."""
    table = Table(f"Efficiencies of real flocs, N = {kernel.vertices[-1]}",
                  ("meeting", "i", "j", "α", "95 %", "E₃", "95 %"))  # fmt: skip
    for m, meeting in enumerate(kernel.mechanisms):
        for pair in PAIRS:
            place = (m, -1, *map(kernel.labels.index, pair))
            cells = []
            for name in ("alpha", "efficiency3"):
                value, low, high = (
                    kernel.arrays[f"{name}{end}"][place] for end in ("", "_low", "_high")
                )
                cells += [f"{value:.2f}", f"{low:.2f} to {high:.2f}"]
            # Two of one size settle side by side.
            if np.isfinite(kernel.arrays["alpha"][place]):
                table.add(meeting, *pair, *cells)
    table.print()


def print_text(title, text):
    """Print lines of a command as they are, without those of single replicates and files."""
    lines = [
        each for each in text.strip().splitlines()
        if not each.startswith("replicate ") and not each.endswith((".h5", ".png"))
    ]  # fmt: skip
    print("\n".join([f"**{title}**\n", "```", *lines, "```\n"]))


def main():
    """Print tables, and copy the figures."""
    args = begin(__doc__, images=PICTURES, figures="", used="two used")
    pictures = checked(args.images, "flocpy", "safas")
    few = ["--replicates", "64"] if args.quick else []
    jobs = ["--jobs", os.cpu_count()]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for each in CONFIGS:
            shutil.copy(EXAMPLES / each, folder)
        images = [pictures.resolve() / each for each in ("flocpy", "safas")]
        flocsim(folder, "fit", *images, "--pixel-size", "0.95e-6", "--vertices", "16,32",
                "--radius", "1", "--max-blur", "inf", "--neck", "0", *jobs,
                "-o", "real_flocs_shapes.h5")  # fmt: skip
        flocsim(folder, "kernel", "kernel.toml", *few, *jobs)
        print_kernels(read_results(folder / "kernel.h5").kernel)
        flocsim(folder, "plot", "kernel.h5")
        flocsim(folder, "kernel", "settling_kernel.toml", *few, *jobs)
        fewer = ["--replicates", "2"] if args.quick else []
        flocsim(folder, "swarm", "settling_swarm.toml", *fewer, *jobs)
        script = EXAMPLES / "kernel_against_swarm.py"
        found = python(folder, script, "settling_kernel.h5", "settling_swarm.h5")
        print_text("Counts of swarms over what kernels of pairs predict", found)
        (folder / "si.toml").write_text(QUARTZ)
        flocsim(folder, "ensemble", "si.toml", *jobs)
        count = 2 if args.quick else 20
        found = flocsim(folder, "strength", "si.h5", "--flow", "shear", "--precision", "0.02",
                        "--count", count, *jobs)  # fmt: skip
        print_text("Rates at which a shear opens bonds", found)
        flocsim(folder, "plot", "si-strength.h5")
        for source, target in FIGURES.items() if args.figures else ():
            shutil.copy(folder / source, Path(args.figures) / target)


if __name__ == "__main__":
    main()
