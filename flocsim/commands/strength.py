"""`flocsim strength results.h5 --flow shear`: at what rate a flow opens the bonds of a study."""

import os
import signal
from argparse import Namespace
from pathlib import Path
from types import FrameType
from typing import Any

from flocsim.errors import UsageError
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule, figure_rule
from flocsim.io.terminal import tell

DESCRIPTION = """\
Put every doublet that a finished study has found bound into a flow of rising rate G, without
weight or inertia, and find the first rate at which it opens: on a ladder of factors of two, then by
halving in log G. Prints the distribution of every condition, and writes it and every single doublet
to one HDF5 file, at the end, whole or not at all, with a figure beside it."""

INTERRUPTED = 130


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "strength", help="at what rate a flow opens the bonds of a study", description=DESCRIPTION
    )
    add = parser.add_argument
    add("results", help="results file of flocsim ensemble")
    add("--flow", default="shear", metavar="FLOW",
        help="shear, u = (G y, 0), or extension, u = (G x, -G y)/2 "
        "(default: %(default)s)")  # fmt: skip
    add("--count", type=int, metavar="K", help="so many doublets of each condition (default: all)")
    add("--precision", type=float, default=5e-3, metavar="P",
        help="relative precision of a rate (default: %(default)g)")  # fmt: skip
    add("-o", "--output", metavar="FILE", help="default: NAME-strength.h5")
    add("--figure", metavar="FILE", help="default: NAME-strength.png")
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)
    add("--quiet", action="store_true", help="no line for every doublet")
    parser.set_defaults(run=run)


def run(args: Namespace) -> int:
    """Survey, print and write; the exit code."""
    from flocsim.ensembles.strength.distribution import table_of
    from flocsim.ensembles.strength.survey import survey
    from flocsim.ensembles.studies.opened import open_results
    from flocsim.io.plots.strength import over_rate
    from flocsim.io.plots.style import checked_format, save
    from flocsim.io.results.strength_file import write_strengths

    stem = Path(args.results).stem
    output = Path(args.output or f"{stem}-strength.h5")
    figure = Path(args.figure or output.with_suffix(".png"))
    checked_format(figure, "--figure")
    if figure.suffix == output.suffix:
        raise UsageError(f"--output {output} must not end in {figure.suffix}: .h5 does")
    rules = data_rule(args.overwrite), figure_rule(args.overwrite)
    check_outputs(
        [Output(path, rule) for path, rule in zip((output, figure), rules, strict=True)],
        [args.results],
    )
    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        found = survey(
            open_results(args.results), args.flow, count=args.count, precision=args.precision,
            tell=(lambda _: None) if args.quiet else tell,
        )  # fmt: skip
    except KeyboardInterrupt:
        tell("flocsim: stopped: nothing has been written")
        return INTERRUPTED
    finally:
        signal.signal(signal.SIGTERM, before)
    write_strengths(output, found, rules[0])
    print(table_of(found))
    print(os.fspath(output))
    save(over_rate(found), figure, rules[1])
    print(os.fspath(figure))
    return 0


def interrupt(number: int, frame: FrameType | None) -> None:
    """What a batch system's SIGTERM does: as Ctrl-C."""
    raise KeyboardInterrupt
