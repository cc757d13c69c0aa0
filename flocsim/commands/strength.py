"""`flocsim strength results.h5 --flow shear`: the rates at which a flow opens a study's bonds."""

import os
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import attrs

from flocsim.commands import add_allowed, allowed_by
from flocsim.commands.processes import Lost, workers
from flocsim.commands.sweep import interrupt
from flocsim.ensembles.cli import continuing
from flocsim.errors import FlocsimError, UsageError
from flocsim.io.files import Rule
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule, extension_rule
from flocsim.io.terminal import tell
from flocsim.process import STOPPED, handle

WAYS = "continue it with --resume, or add --overwrite, which keeps the old one under another name"

SAVED_EVERY = 30.0
"""Seconds between two writes of an unfinished survey: what a kill may cost."""

DESCRIPTION = (
    "Put every doublet that a finished study found bound into a flow of rising rate G, without "
    "weight or inertia, and find the first rate at which it opens: on a ladder of factors of "
    "two, then by halving in log G. Prints the distribution of every condition, and writes it "
    "and every single doublet to one HDF5 file, with a figure beside it."
)


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
    add("--resume", action="store_true",
        help="test what the output does not have yet, of a stopped survey or with a larger "
        "--count")  # fmt: skip
    add("-o", "--output", metavar="FILE", help="default: NAME-strength.h5")
    add_allowed(parser)
    add("--figure", metavar="FILE", help="default: NAME-strength.png")
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)
    add("--quiet", action="store_true", help="print warnings and errors only")


def run(args: Namespace) -> int:
    """Test the bonds, write and print what was found, draw it; return the exit code."""
    from flocsim.ensembles.strength.survey import Survey, bound_doublets
    from flocsim.io.plots.curves import over_rate
    from flocsim.io.plots.style import checked_format, save
    from flocsim.io.results.run_group import source_line
    from flocsim.io.results.strength_file import table_of

    output = Path(args.output or f"{Path(args.results).stem}-strength.h5")
    figure = Path(args.figure or output.with_suffix(".png"))
    checked_format(figure, "--figure ")
    if args.jobs < 1:
        raise UsageError(f"--jobs must be at least 1, found {args.jobs}")
    rule, drawn = data_rule(args.overwrite), data_rule(args.overwrite or args.resume)
    if args.resume and output.exists():
        rule = extension_rule(output)
    check_outputs([Output(output, rule, ways=WAYS), Output(figure, drawn)], [args.results])
    survey = Survey(args.results, args.flow, args.count, args.precision, allowed_by(args))
    say = (lambda line: None) if args.quiet else tell
    work = Work(survey, output, rule, say)
    if args.resume and output.exists():
        work.take_earlier()
    doublets = bound_doublets(survey.results, args.count)
    say(f"{len(doublets)} bound doublets of {args.results} in {args.flow}")
    say(source_line(survey.about))
    handle(interrupt)
    try:
        work.test([each for each in doublets if each not in work.tested], args.jobs)
    except KeyboardInterrupt as error:
        kept = (
            f"{len(work.tested)} tested doublets are in {output}"
            if work.tested
            else "no doublet was tested"
        )
        if work.tested:
            work.write()
        who = str(error) or "stopped by SIGINT"
        tell(f"flocsim: {who}: {kept}\n{continuing()}", sys.stderr)
        return STOPPED
    found = work.write(complete=True)
    say(f"{table_of(found)}\n{source_line(found.about)}\n{output}")
    save(over_rate(found), figure, drawn, source_line(found.about))
    say(os.fspath(figure))
    return 0


@attrs.define
class Work:
    """A Survey under way: ``tested`` {doublet: Opening}, written to ``output`` now and then."""

    survey: Any
    output: Path
    rule: Rule
    say: Callable[[str], object]
    tested: dict[Any, Any] = attrs.Factory(dict)
    saved: float = attrs.Factory(time.monotonic)

    def take_earlier(self) -> None:
        """Take the doublets of an earlier survey; UsageError where that was another one."""
        from flocsim.ensembles.strength.survey import tested_in
        from flocsim.io.results.strength_file import read_strengths

        found = read_strengths(self.output)
        for name, value in self.survey.about.items():
            if found.about.get(name) != value:
                raise UsageError(
                    f"{self.output} is of another survey: {name} is {found.about.get(name)!r} in "
                    f"the file, {value!r} now; name another output, or start over with --overwrite"
                )
        self.tested = tested_in(found)

    def test(self, doublets: Sequence[Any], jobs: int) -> None:
        """Test the doublets in several processes, and keep what is found."""
        from flocsim.ensembles.strength.survey import in_words

        # The first compiles what all of them need.
        first = partial(self.survey.test, doublets[0]) if doublets else int
        with workers(min(jobs, max(len(doublets), 1)), first) as mapped:
            for doublet, opening in zip(doublets, mapped(self.survey.test, doublets), strict=True):
                if isinstance(opening, Lost):
                    raise FlocsimError(f"replicate {doublet.replicate}: {opening.reason}")
                self.tested[doublet] = opening
                self.say(f"replicate {doublet.replicate}: {in_words(opening)}")
                if time.monotonic() - self.saved > SAVED_EVERY:
                    self.write()

    def write(self, complete: bool = False) -> Any:
        """Write what was found so far, and return it."""
        from flocsim.ensembles.strength.survey import gathered
        from flocsim.io.results.strength_file import write_strengths

        found = gathered(self.survey, self.tested, complete)
        write_strengths(self.output, found, self.rule)
        self.rule, self.saved = extension_rule(self.output), time.monotonic()
        return found
