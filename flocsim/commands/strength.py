"""`flocsim strength results.h5 --flow shear`: at what rate a flow opens the bonds of a study."""

import contextlib
import os
import signal
import sys
import threading
from argparse import Namespace
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from flocsim.commands import SUMMARIES
from flocsim.errors import UsageError
from flocsim.interruption import INTERRUPTED
from flocsim.io.files import Rule
from flocsim.io.outputs import (
    OVERWRITE_HELP,
    Output,
    check_outputs,
    data_rule,
    extension_rule,
    figure_rule,
)
from flocsim.io.results.strength_file import Strengths, read_strengths, write_strengths
from flocsim.io.terminal import tell

DESCRIPTION = """\
Put every doublet that a finished study has found bound into a flow of rising rate G, without
weight or inertia, and find the first rate at which it opens: on a ladder of factors of two, then by
halving in log G. Prints the distribution of every condition, and writes it and every single doublet
to one HDF5 file, anew every 20 s and at Ctrl-C, with a figure beside it at the end."""


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser("strength", help=SUMMARIES["strength"], description=DESCRIPTION)
    add = parser.add_argument
    add("results", help="results file of flocsim ensemble")
    add("--flow", default="shear", metavar="FLOW",
        help="shear, u = (G y, 0), or extension, u = (G x, -G y)/2 "
        "(default: %(default)s)")  # fmt: skip
    add("--count", type=int, metavar="K", help="so many doublets of each condition (default: all)")
    add("--precision", type=float, default=5e-3, metavar="P",
        help="relative precision of a rate (default: %(default)g)")  # fmt: skip
    add("--jobs", type=int, default=1, metavar="N",
        help="processes on this machine (default: %(default)d)")  # fmt: skip
    add("--resume", action="store_true",
        help="go on with what a stopped survey has written, or test more (--count); starts one if "
        "there is none")  # fmt: skip
    add("-o", "--output", metavar="FILE", help="default: NAME-strength.h5")
    add("--figure", metavar="FILE", help="default: NAME-strength.png")
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)
    add("--quiet", action="store_true", help="no line for every doublet")
    parser.set_defaults(run=run)


def run(args: Namespace) -> int:
    """Survey, write as it goes, and print; the exit code."""
    from flocsim.ensembles.strength.distribution import table_of
    from flocsim.ensembles.strength.survey import OtherSurvey, survey
    from flocsim.ensembles.studies.opened import open_results
    from flocsim.io.plots.strength import over_rate
    from flocsim.io.plots.style import checked_format, save

    stem = Path(args.results).stem
    output = Path(args.output or f"{stem}-strength.h5")
    figure = Path(args.figure or output.with_suffix(".png"))
    checked_format(figure, "--figure")
    if figure.suffix == output.suffix:
        raise UsageError(f"--output {output} must not end in {figure.suffix}: .h5 does")
    if args.resume and args.overwrite:
        raise UsageError("--resume goes on with a file, --overwrite puts it aside: leave out one")
    rules = data_rule(args.overwrite or args.resume), figure_rule(args.overwrite)
    check_outputs([Output(output, rules[0], "", WAYS), Output(figure, rules[1])], [args.results])
    file = Kept(output, data_rule(args.overwrite))
    known = file.read() if args.resume else None
    stop = Stop()
    with stop.listening():
        try:
            found = survey(
                open_results(args.results), args.flow, count=args.count, jobs=args.jobs,
                precision=args.precision, known=known, keep=stop.unbroken(file.write),
                tell=(lambda _: None) if args.quiet else tell,
            )  # fmt: skip
        except KeyboardInterrupt:
            tell(f"flocsim: stopped by {stop.name}: {file.words}", sys.stderr)
            return INTERRUPTED
        except OtherSurvey as error:
            raise UsageError(
                f"{output} cannot be gone on with: {error}; name another output, or add "
                "--overwrite in the place of --resume"
            ) from error
    print(table_of(found))
    print(os.fspath(output))
    save(over_rate(found), figure, rules[1])
    print(os.fspath(figure))
    return 0


WAYS = (
    "go on with it by --resume if it is of this study, or add --overwrite, which keeps the old one "
    "under another name"
)
"""What a user can do about a file in the way."""


class Kept:
    """The file of a survey, written anew as it goes: what it holds, whole at any time."""

    def __init__(self, path: Path, rule: Rule) -> None:
        """``rule``: what becomes of a file that lies there before the first is written."""
        self.path, self.rule = path, rule
        self.found: Strengths | None = None

    def read(self) -> Strengths | None:
        """What the file holds, which from now on may be replaced; None where there is none."""
        if os.path.lexists(self.path):
            self.rule = extension_rule(self.path)
            self.found = read_strengths(self.path)
        return self.found

    def write(self, found: Strengths) -> None:
        """Write what has been tested so far; a file of somebody else's is kept."""
        write_strengths(self.path, found, self.rule)
        self.found, self.rule = found, extension_rule(self.path)

    @property
    def words(self) -> str:
        """What it holds, for a person who has stopped the survey."""
        if self.found is None:
            return "no doublet has been tested yet, and nothing has been written"
        return f"{self.found.progress} are in {self.path}; go on with --resume"


class Stop:
    """Ctrl-C and a batch system's SIGTERM: a KeyboardInterrupt, but while a file is written."""

    def __init__(self) -> None:
        self.number, self.held = int(signal.SIGINT), False
        self.late = False

    @property
    def name(self) -> str:
        """Name of the signal, "SIGTERM"."""
        return signal.Signals(self.number).name

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self.number = number
        if not self.held:
            raise KeyboardInterrupt
        self.late = True

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Take over the signals."""
        if threading.current_thread() is not threading.main_thread():
            yield  # signals are the main thread's
            return
        before = {number: signal.signal(number, self) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def unbroken(self, write: Callable[[Strengths], None]) -> Callable[[Strengths], None]:
        """``write`` to its end, and only then what a signal has asked for meanwhile."""

        def whole(found: Strengths) -> None:
            self.held = True
            try:
                write(found)
            finally:
                self.held = False
            if self.late:
                self.late = False
                raise KeyboardInterrupt

        return whole
