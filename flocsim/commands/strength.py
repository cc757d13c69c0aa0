"""`flocsim strength results.h5 --flow shear`: the rate at which a flow opens bonds of a study."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from flocsim.commands import FOLDER_HELP
from flocsim.ensembles.cli import run as run_command
from flocsim.ensembles.parallel.communicator import launched_rank
from flocsim.ensembles.parallel.heartbeat import SECONDS
from flocsim.errors import UsageError
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule, figure_rule
from flocsim.io.terminal import tell

DESCRIPTION = """\
Put every doublet that a finished study found bound into a flow of rising rate G, without
weight or inertia, and find the first rate at which it opens: on a ladder of factors of two, then by
halving in log G. Prints the distribution of every condition, and writes it and every single doublet
to one HDF5 file, with a figure beside it. Runs on ranks and processes, stops and goes on as a study
does."""


def add_arguments(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("results", help="results file of flocsim ensemble")
    add("--flow", default="shear", metavar="FLOW",
        help="shear, u = (G y, 0), or extension, u = (G x, -G y)/2 "
        "(default: %(default)s)")  # fmt: skip
    add(
        "--count", type=int, metavar="K", help="number of doublets of each condition (default: all)"
    )
    add("--precision", type=float, default=5e-3, metavar="P",
        help="relative precision of a rate (default: %(default)g)")  # fmt: skip
    add("--jobs", type=int, default=1, metavar="N",
        help="processes on this machine (default: %(default)d)")  # fmt: skip
    add("--resume", action="store_const", const="resume", default="new", dest="mode",
        help="continue a stopped survey, or test more (--count); starts one if there is "
        "none")  # fmt: skip
    add("-o", "--output", metavar="FILE", help="default: NAME-strength.h5")
    add("--folder", metavar="DIR", help=FOLDER_HELP)
    add("--figure", metavar="FILE", help="default: NAME-strength.png")
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)
    add("--quiet", action="store_true", help="print warnings and errors only")
    parser.set_defaults(
        read=read_survey, heartbeat=SECONDS, dry_run=False, pilot=False, parent=None,
        plan=None,
    )  # fmt: skip


def places(args: Namespace) -> tuple[Path, Path]:
    """(file, figure) to write."""
    output = Path(args.output or f"{Path(args.results).stem}-strength.h5")
    return output, Path(args.figure or output.with_suffix(".png"))


def read_survey(args: Namespace, sources: Any, first: bool) -> Any:
    """What is run, as a config; on the ``first`` rank what it writes is seen to be possible."""
    from flocsim.ensembles.pairs.opened import open_results
    from flocsim.ensembles.storage.resume import WAYS
    from flocsim.ensembles.strength.kind import Bonds, config_of
    from flocsim.io.journal import SUFFIX
    from flocsim.io.plots.style import checked_format

    output, figure = places(args)
    if first:
        checked_format(figure, "--figure")
        if figure.suffix == output.suffix:
            raise UsageError(
                f"--output {output} must not end in {figure.suffix}, as the figure does: use .h5"
            )
        rules = data_rule(args.overwrite or args.mode == "resume"), figure_rule(args.overwrite)
        check_outputs([Output(output, rules[0], SUFFIX, WAYS), Output(figure, rules[1])],
                      [args.results])  # fmt: skip
    bonds = Bonds(
        open_results(args.results, args.folder, sources), args.flow, args.count, args.precision
    )
    return config_of(bonds, str(output))


def run(args: Namespace) -> int:
    """Survey, write, print, and draw; the exit code."""
    from flocsim.io.plots.rates import over_rate
    from flocsim.io.plots.style import save
    from flocsim.io.results.strength_file import read_strengths

    code = run_command(args)
    if code == 0 and launched_rank() == 0:
        output, figure = places(args)
        save(over_rate(read_strengths(output)), figure, figure_rule(args.overwrite))
        if not args.quiet:
            tell(str(figure))
    return code
