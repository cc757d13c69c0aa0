"""`flocsim sweep s.toml --over KEY=1,2,3`: one study at several values of its keys, in one file;
`flocsim strength results.h5 --flow shear`: the rate at which a flow opens bonds of a study.
"""

import os
import re
import signal
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from shlex import quote
from types import FrameType
from typing import Any

from flocsim.commands import add_allowed, allowed_by
from flocsim.ensembles.cli import continuing
from flocsim.ensembles.cli import run as run_command
from flocsim.ensembles.config.loader import nested, parse_setting
from flocsim.ensembles.parallel.communicator import SECONDS, StopRequested
from flocsim.ensembles.parallel.processes import launched_rank
from flocsim.errors import UsageError
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.terminal import tell
from flocsim.process import STOPPED, handle

DESCRIPTION = """\
Run a study at every value of a key, or of several (all combinations), and join the results in
one file whose tables have the keys as their first dimensions. The results of each value lie in
NAME.parts beside it; --resume goes on there. On a cluster, --dry-run prints a command for each
value to be run by itself; --resume then joins what they made."""

COMMAS = re.compile(r""",(?=(?:[^"'\[\]]|"[^"]*"|'[^']*'|\[[^\]]*\])*$)""")
"""Commas outside quotes and brackets."""


def add_arguments(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("config", help="config file (TOML)")
    add(
        "--over", action="append", default=[], metavar="KEY=VALUE,…",
        help="a key and its values, e.g. forces.van_der_waals.hamaker=1e-20,1e-19; may be repeated",
    )  # fmt: skip
    add("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings",
        help="override any value of the config; may be repeated")  # fmt: skip
    add("-o", "--output", metavar="FILE", help="joined file (default: NAME-sweep.h5)")
    add("--jobs", type=int, default=1, metavar="N", help="processes on this machine")
    add("--resume", action="store_true", help="continue a sweep, extend it, or join its parts")
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)
    add("--dry-run", action="store_true", help="print a command for each value, and stop")


def values_of(text: str) -> tuple[str, list[Any]]:
    """(key, values) of "forces.contact.k_n=1,2" or "…='10 N/m','20 N/m'"."""
    key, equals, values = text.partition("=")
    if not equals or not key.strip() or not values.strip():
        raise UsageError(f"--over {text!r}: write KEY=VALUE,VALUE")
    found = [parse_setting(f"{key}={value}") for value in COMMAS.split(values) if value.strip()]
    return ".".join(found[0][0]), [value for _, value in found]


def run(args: Namespace) -> int:
    """Run what is missing and join it; return the exit code."""
    handle(interrupt)
    try:
        return run_study(args)
    except (KeyboardInterrupt, StopRequested) as error:
        # The process of a part may have been stopped alone, and has said by what.
        who = str(error).partition(":")[0] or "stopped by SIGINT"
        tell(f"flocsim: {who}: what was finished is kept\n{continuing()}", sys.stderr)
        return STOPPED


def run_study(args: Namespace) -> int:
    """Do what the arguments ask for; return the exit code."""
    from flocsim.ensembles.script_study import Study
    from flocsim.ensembles.storage.resume import WAYS

    if not args.over:
        raise UsageError("sweep needs --over KEY=VALUE,VALUE")
    study = Study(args.config)
    if args.settings:
        study = study.with_(nested(map(parse_setting, args.settings)))
    how = {
        "jobs": args.jobs, "mode": "resume" if args.resume else "new",
        "overwrite": args.overwrite, "tell": tell, "ways": WAYS,
    }  # fmt: skip
    return run_sweep(args, study, how)


def run_sweep(args, study, how):
    """Run what is missing and join it, or say what there is to run."""
    from flocsim.ensembles.script_study import settings_of
    from flocsim.ensembles.sweep import planned, sweep

    pairs = [values_of(text) for text in args.over]
    over = dict(pairs)
    if len(over) < len(pairs):
        raise UsageError("--over names the same key twice: give all its values at once")
    output = args.output or f"{Path(args.config).stem}-sweep.h5"
    if args.dry_run:
        for path, part in planned(study, over, Path(output)).items():
            words = " ".join(f"--set {quote(f'{k}={v}')}" for k, v in settings_of(part.overrides))
            tell(f"flocsim ensemble {quote(args.config)} {words} -o {quote(str(path))}")
        return 0
    sweep(study, over, output, **how)
    tell(os.fspath(output))
    return 0


def interrupt(number: int, frame: FrameType | None) -> None:
    """Do as at Ctrl-C, so that the part that runs saves its rows."""
    raise KeyboardInterrupt(f"stopped by {signal.Signals(number).name}")


def add_arguments_strength(parser: ArgumentParser) -> None:
    parser.description = (
        "Put every doublet that a finished study found bound into a flow of rising rate G, without "
        "weight or inertia, and find the first rate at which it opens: on a ladder of factors of "
        "two, then by halving in log G. Prints the distribution of every condition, and writes it "
        "and every single doublet to one HDF5 file, with a figure beside it. Runs on ranks and "
        "processes, stops and goes on as a study does."
    )
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
    add_allowed(parser)
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
        rules = data_rule(args.overwrite or args.mode == "resume"), data_rule(args.overwrite)
        check_outputs([Output(output, rules[0], SUFFIX, WAYS), Output(figure, rules[1])],
                      [args.results])  # fmt: skip
    results = open_results(args.results, allowed_by(args), sources)
    bonds = Bonds(results, args.flow, args.count, args.precision)
    return config_of(bonds, str(output))


def run_strength(args: Namespace) -> int:
    """Survey, write, print, and draw; the exit code."""
    from flocsim.io.plots.curves import over_rate
    from flocsim.io.plots.style import save
    from flocsim.io.results.run_group import source_line
    from flocsim.io.results.strength_file import read_strengths

    code = run_command(args)
    if code == 0 and launched_rank() == 0:
        output, figure = places(args)
        found = read_strengths(output)
        save(over_rate(found), figure, data_rule(args.overwrite), source_line(found.about))
        if not args.quiet:
            tell(str(figure))
    return code
