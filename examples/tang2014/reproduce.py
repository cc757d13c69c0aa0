"""The study of Tang, Alonso-Marroquín & Maggi (2014): shapes, collisions, figures, claims.

    python examples/tang2014/reproduce.py --images DIR… --launch "mpirun -n 2"
    python examples/tang2014/reproduce.py --replicates 100               # synthetic flocs, reduced

The study runs with flocsim's way from picture to polygon, with the paper's own finder and fit, and
with the preset clay. Each step shows its command and leaves its files in the output folder; what is
finished is not done again, and what was interrupted goes on, so the same command resumes.
"""

import argparse
import os
import shlex
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import steps

HERE = Path(__file__).resolve().parent
STUDY, READINGS = HERE / "study.toml", HERE / "readings.toml"
READING_VERTICES = (1, 4, 16, 64)
ERROR_RADII = "1,2,4"
ERROR_VERTICES = "4,8,16,28,40,52,64"
"""Of the fits for Fig. 3."""

PAPER_FINDER, PAPER_FIT = ("--finder", "paper"), ("--method", "paper")
"""Words of `flocsim fit` for the paper's way from picture to polygon."""


def parse_arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--images", nargs="+", metavar="DIR", help="pictures of flocs, or masks")
    parser.add_argument("--masks", action="store_true", help="the images are masks")
    parser.add_argument("--pixel-size", default="0.95e-6", metavar="METRES")
    parser.add_argument("--replicates", type=int, default=1000, help="default: %(default)s")
    parser.add_argument("--vertices", metavar="LIST", help="instead of the study's, e.g. 1,4,16,64")
    parser.add_argument(
        "--jobs", type=int, default=cores(), metavar="N", help="processes, default: %(default)s"
    )
    parser.add_argument("--launch", metavar="COMMAND", help='e.g. "mpirun -n 2" or "srun"')
    parser.add_argument("--readings", action="store_true", help="run the other readings too")
    parser.add_argument("--reading-replicates", type=int, default=100, metavar="N")
    parser.add_argument("--swarms", type=int, default=12, metavar="N", help="of claim 26")
    parser.add_argument("-o", "--output", type=Path, default=Path("tang2014"), metavar="DIR")
    return parser.parse_args()


def cores():
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def flocsim(folder, name, *words):
    """Run a subcommand of flocsim as a step."""
    steps.call(folder, name, sys.executable, "-m", "flocsim", *words)


def fit(arguments, output, vertices, radius, *more):
    """Fit a shape library, unless it is there."""
    if output.exists():
        return
    masks = ["--masks"] if arguments.masks else []
    flocsim(
        arguments.output, f"fits {output.stem}", "fit", *arguments.images, *masks,
        "--pixel-size", arguments.pixel_size, "--vertices", vertices, "--radius", radius,
        "--jobs", arguments.jobs, *more, "-o", output,
    )  # fmt: skip


def fit_all(arguments, vertices):
    """The libraries of the study, of Fig. 3, and of the readings."""
    folder = arguments.output
    polygons = ",".join(str(n) for n in vertices if n > 1)
    fit(arguments, folder / "shapes.h5", polygons, "1")
    fit(arguments, folder / "errors.h5", ERROR_VERTICES, ERROR_RADII)
    paper = PAPER_FIT if arguments.masks else (*PAPER_FINDER, *PAPER_FIT)
    fit(arguments, folder / "shapes-paper.h5", polygons, "1", *paper)
    fit(arguments, folder / "errors-paper.h5", ERROR_VERTICES, ERROR_RADII, *paper)
    if arguments.readings:
        few = ",".join(str(n) for n in READING_VERTICES if n > 1)
        fit(arguments, folder / "area.h5", few, "1", "--preserve-area")
        fit(arguments, folder / "inscribed.h5", few, "1", "--inscribed")


def settings(table, prefix=""):
    """A nested table as --set words."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from settings(value, f"{prefix}{key}.")
        else:
            shown = str(list(value)) if isinstance(value, list | tuple) else toml_scalar(value)
            yield from ("--set", f"{prefix}{key}={shown}")


def toml_scalar(value):
    """A flag, text or number as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


def ensemble(arguments, output, replicates, changes):
    """Run the study with changes into a results file, or go on with it."""
    launch = shlex.split(arguments.launch) if arguments.launch else []
    jobs = [] if launch else ["--jobs", arguments.jobs]
    steps.call(
        arguments.output, output.stem, *launch, sys.executable, "-m", "flocsim.ensemble", STUDY,
        *settings(changes), *jobs, "--replicates", replicates, "--output", output, "--resume",
        "--quiet",
    )  # fmt: skip


def changes_of(arguments, vertices, more=None):
    """What a run changes of study.toml: shapes and a reading, as one nested table."""
    more = dict(more or {})
    shapes = {"vertices": vertices} | more.pop("shapes", {})
    if arguments.images:
        file = arguments.output / shapes.get("file", "shapes.h5")
        shapes |= {"source": "library", "file": str(file.resolve())}
    return {"shapes": shapes} | more


def ways_of(arguments):
    """{name: changes} of the studies beside the main one; the paper's fits need images."""
    paper = {"paper": {"shapes": {"file": "shapes-paper.h5"}}} if arguments.images else {}
    return {**paper, "clay": {"preset": "clay"}}


def readings_of(arguments):
    """{name: changes} of the readings that can be run: fits need images."""
    readings = tomllib.loads(READINGS.read_text("utf-8"))
    return {n: c for n, c in readings.items() if arguments.images or "shapes" not in c}


def reading_file(folder, name):
    return folder / f"reading-{name.replace(' ', '-')}.h5"


def run_readings(arguments):
    """Run every reading, and the study's own with the same few N."""
    paths = {}
    for name, more in {"tang2014": {}, **readings_of(arguments)}.items():
        paths[name] = reading_file(arguments.output, name)
        changes = changes_of(arguments, READING_VERTICES, more)
        ensemble(arguments, paths[name], arguments.reading_replicates, changes)
    return paths


def draw_trajectory(path, replicate, changes):
    """Fig. 7 for one replicate of Type I, N = 64, δ = 0: frames, distance, forces, animation."""
    if path.with_suffix(".gif").exists():
        return
    strip, distance, forces = (f"{path}{which}.png" for which in ("", "-distance", "-forces"))
    flocsim(
        path.parent, path.stem, "trajectory", STUDY, *settings(changes),
        "--type", "I", "--vertices", 64, "--delta", 0, "--replicate", replicate,
        "--output", strip, "--distance", distance, "--forces", forces,
        "--animation", path.with_suffix(".gif"), "--overwrite",
    )  # fmt: skip


def refuse_launchers():
    """This script starts the launcher for the steps that have work for many ranks."""
    from flocsim.ensembles.parallel.processes import launched_rank, launched_size

    if launched_size() not in (0, 1):
        if launched_rank() == 0:
            text = 'start it once, with --launch "mpirun -n 2", not under mpirun itself'
            print(f"reproduce.py: {text}", file=sys.stderr)
        sys.exit(2)


def main():
    arguments = parse_arguments()
    refuse_launchers()
    folder = arguments.output
    folder.mkdir(parents=True, exist_ok=True)
    steps.check(folder / "steps.csv")
    vertices = chosen_vertices(arguments)
    if arguments.images:
        fit_all(arguments, vertices)
    changes = changes_of(arguments, vertices)
    ensemble(arguments, folder / "study.h5", arguments.replicates, changes)
    for name, more in ways_of(arguments).items():
        own = changes_of(arguments, vertices, more)
        ensemble(arguments, folder / f"study-{name}.h5", arguments.replicates, own)
    readings = run_readings(arguments) if arguments.readings else {}
    if not (folder / "several.csv").exists():
        swarms = "--swarms", arguments.swarms, "-o", folder
        steps.call(folder, "several", sys.executable, HERE / "several.py", *swarms)
    write_pages(arguments, changes, readings)


def chosen_vertices(arguments):
    """All N of the study, or those asked for."""
    if arguments.vertices:
        return [int(word) for word in arguments.vertices.split(",")]
    return tomllib.loads(STUDY.read_text("utf-8"))["shapes"]["vertices"]


def write_pages(arguments, changes, readings):
    """Fig. 7, then all that the results tell, the times of the steps with it."""
    import pages

    from flocsim.ensembles import load_config

    folder = arguments.output
    examples = pages.examples_of_classes(folder / "study.h5")
    paths = [folder / f"figure-7-{name}" for name in examples]
    with ThreadPoolExecutor(arguments.jobs) as pool:
        list(pool.map(draw_trajectory, paths, examples.values(), [changes] * len(paths)))
    pages.write(folder, load_config(STUDY), readings)


if __name__ == "__main__":
    main()
