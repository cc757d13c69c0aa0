"""`flocsim plot`: the paper's figures from a results file or a shape library."""

import argparse
import math
from pathlib import Path
from typing import Any

from flocsim.commands import SUMMARIES
from flocsim.errors import UsageError
from flocsim.io.files import make_folder
from flocsim.io.journal.journal import journal_of
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, figure_rule
from flocsim.io.plots.kernel import KERNEL_FIGURES
from flocsim.io.plots.results import FIGURES, MOST_ROWS, OF_ROWS
from flocsim.io.plots.shapes import POPULATION_FIGURES
from flocsim.io.plots.strength import STRENGTH_FIGURES
from flocsim.io.plots.style import FORMATS, mark_figure, save
from flocsim.io.plots.swarm import SWARM_FIGURES, write_swarm_animation
from flocsim.io.plots.sweep import SWARM_SWEEP_FIGURES, SWEEP_FIGURES
from flocsim.io.results.file import Results, with_rows

STRIP_FRAMES = 7


def strip(trajectory: Any) -> Any:
    """Frames of the motion, evenly along the way of the bodies against each other."""
    from flocsim.trajectories.figures import drawn

    return drawn(trajectory, "strip", STRIP_FRAMES)


def distance(trajectory: Any) -> Any:
    """Distance of the two centres against time."""
    from flocsim.trajectories.figures import drawn

    return drawn(trajectory, "distance", STRIP_FRAMES)


MOTION_FIGURES = {"strip": strip, "distance": distance}

FIGURES_OF: dict[str, dict] = {
    "a shape library that flocsim fit wrote": POPULATION_FIGURES,
    "a results file, with bars of Wilson's 95 % and thin outer ones with the numerical error":
        FIGURES,
    "a trajectory file (flocsim trajectory --save, Trajectory.save)": MOTION_FIGURES,
    "the joined file of flocsim sweep": SWEEP_FIGURES,
    "a file of flocsim strength": STRENGTH_FIGURES,
    "a swarm study": SWARM_FIGURES,
    "a kernel study": KERNEL_FIGURES,
}  # fmt: skip
"""{kind of file: {name: figure}}."""


def listed(figures):
    """A line for every figure: its name and the first line of its docstring."""
    told = {name: (draw.__doc__ or "").partition("\n")[0] for name, draw in figures.items()}
    return "\n".join(f"  {name:<8}  {text.removesuffix('.')}" for name, text in told.items())


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "plot",
        help=SUMMARIES["plot"],
        description="\n".join(
            [
                "Draw the figures of a file, each into a file of its own.",
                *(f"Of {kind}:\n{listed(figures)}" for kind, figures in FIGURES_OF.items()),
                "Of a study that still runs, its figures so far are drawn, marked as unfinished.",
                "Figures are numbered as in Tang et al. (2014).",
            ]
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("results", help="file that flocsim ensemble or flocsim fit wrote")
    parser.add_argument("--output-dir", default=".", metavar="DIR",
        help="folder for the figures, made if it is missing (default: the current "
        "one)")  # fmt: skip
    parser.add_argument("--format", default="png", choices=FORMATS, help="default: %(default)s")
    parser.add_argument("--figures", metavar="LIST",
        help="figures with commas between them (default: all that the file has)")  # fmt: skip
    parser.add_argument("--animation", metavar="FILE.gif",
        help="of a swarm study: also write its first swarm as an animation")  # fmt: skip
    parser.add_argument("--overwrite", action="store_true", help=OVERWRITE_HELP)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw the figures asked for, print the path of each; returns the exit code."""
    names = None if args.figures is None else figure_names(args.figures)
    content, figures, remark = read_content(args.results)
    foreign = [name for name in names or () if name not in figures]
    if foreign:
        raise UsageError(f"{args.results} has no figure {foreign[0]}, only {', '.join(figures)}")
    folder = Path(args.output_dir)
    make_folder(folder, "--output-dir ")
    stem, rule = Path(args.results).stem, figure_rule(args.overwrite)
    paths = {name: folder / f"{stem}-{label(name)}.{args.format}" for name in names or figures}
    drawn = [*paths.values(), *animation_of(args, content)]
    check_outputs([Output(path, rule) for path in drawn], [args.results])
    if OF_ROWS & paths.keys() and isinstance(content, Results) and not remark:
        content = with_rows(args.results, content, MOST_ROWS if names is None else math.inf)
    for name, path in paths.items():
        figure = figures[name](content)
        if remark:
            mark_figure(figure, remark)
        save(figure, path, rule)
        print(path)
    for path in drawn[len(paths) :]:
        write_swarm_animation(path, content, rule=rule)
        print(path)
    return 0


def animation_of(args, content):
    """[path of the animation asked for]; UsageError where there can be none."""
    if not args.animation:
        return []
    if getattr(content, "groups", None) is None:
        raise UsageError(
            "--animation is of swarm studies; of one collision: flocsim trajectory --animation"
        )
    if Path(args.animation).suffix.lower() != ".gif":
        raise UsageError(f"--animation {args.animation} must end in .gif")
    return [Path(args.animation)]


def label(name):
    return f"figure-{name}" if name.isdigit() else name


def read_content(path):
    """What a file holds, {name: function} of its figures, and what each of them has to say."""
    from flocsim.ensembles.unfinished import read_unfinished
    from flocsim.io.contents import LIBRARY, RESULTS, STRENGTH, SWARM, SWEEP, TRAJECTORY, content_of

    figures_of = {
        RESULTS: lambda found: FIGURES if found.kernel is None else KERNEL_FIGURES,
        SWARM: swarm_figures,
        SWEEP: lambda found: SWARM_SWEEP_FIGURES if "counts" in found.groups else SWEEP_FIGURES,
        STRENGTH: lambda found: STRENGTH_FIGURES,
        TRAJECTORY: lambda found: MOTION_FIGURES if len(found.shapes) == 2 else {"strip": strip},
        LIBRARY: lambda found: POPULATION_FIGURES,
    }
    if (journal := journal_of(path)) is not None:
        begun = read_unfinished(journal)
        return begun.results, figures_of[begun.kind](begun.results), begun.progress
    kind, found = content_of(path, figures_of)
    half = kind == STRENGTH and not found.complete
    return found, figures_of[kind](found), f"unfinished: {found.progress}" if half else ""


def swarm_figures(found):
    """{name: function} of the figures that swarms have."""
    many = len(found.scales["class"]) > 1
    return {name: draw for name, draw in SWARM_FIGURES.items() if many or name != "classes"}


def figure_names(text):
    """The names in a list such as "4,overview", each once; UsageError for an unknown one."""
    names = list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    known = [name for figures in FIGURES_OF.values() for name in figures]
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        found = ", ".join(map(repr, unknown)) or "none"
        raise UsageError(f"--figures: found {found}; choose from {', '.join(known)}")
    return names
