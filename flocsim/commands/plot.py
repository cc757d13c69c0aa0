"""`flocsim plot`: the paper's figures from a results file."""

from pathlib import Path

from flocsim.errors import FileError, UsageError

FIGURE_NAMES = ("4", "5", "6", "8", "overview")
DESCRIPTION = """\
Draw the figures of a results file, each into a file of its own:
  4         Pr[C inside]: probability that a collision happens inside the attraction zone
  5         Pr[A | inside]: probability of aggregation after a collision inside the zone
  6         Pr[A | outside]: probability of aggregation after a collision outside the zone
  8         probability of the classes A, B, C, D, all displacements pooled
  overview  Pr[C inside], Pr[A] and the classes in one picture
Bars are Wilson 95 % intervals. Figures are numbered as in Tang et al. (2014)."""


def add_parser(subparsers):
    """Add the subcommand to argparse's ``subparsers``."""
    import argparse

    parser = subparsers.add_parser(
        "plot",
        help="draw the figures of a results file",
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("results", help="results file that flocsim ensemble wrote")
    parser.add_argument(
        "--output-dir",
        default=".",
        metavar="DIR",
        help="folder for the figures, made if it is missing (default: the current one)",
    )
    parser.add_argument(
        "--format", default="png", choices=("png", "pdf", "svg"), help="default: %(default)s"
    )
    parser.add_argument(
        "--figures",
        default=",".join(FIGURE_NAMES),
        metavar="LIST",
        help="figures with commas between them (default: %(default)s)",
    )
    parser.set_defaults(run=run)
    return parser


def run(args):
    """Draw the figures asked for, print the path of each; returns the exit code."""
    names = figure_names(args.figures)

    from flocsim.io.plots import FIGURES, save
    from flocsim.io.results import read_results

    results = read_results(args.results, replicates=False)
    folder = made_folder(args.output_dir)
    for name in names:
        label = f"figure-{name}" if name.isdigit() else name
        path = folder / f"{Path(args.results).stem}-{label}.{args.format}"
        save(FIGURES[name](results), path)
        print(path)
    return 0


def figure_names(text):
    """The names in a list such as "4,overview", each once; UsageError for an unknown one."""
    names = list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    unknown = [name for name in names if name not in FIGURE_NAMES]
    if unknown or not names:
        found = ", ".join(map(repr, unknown)) or "none"
        raise UsageError(f"--figures: found {found}; choose from {', '.join(FIGURE_NAMES)}")
    return names


def made_folder(name):
    """The output folder, made if missing."""
    folder = Path(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(
            f"--output-dir {name} could not be made: {error.strerror}; name another folder"
        ) from error
    return folder
