"""`flocsim strength results.h5 --flow shear`: the rates at which a flow opens a study's bonds."""

import os
import sys
import time
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from flocsim.commands import add_allowed, add_overwrite, allowed_by
from flocsim.commands.sweep import interrupt
from flocsim.ensembles.cli import continuing
from flocsim.errors import FlocsimError, UsageError
from flocsim.io.arguments import whole
from flocsim.io.outputs import check_outputs
from flocsim.io.seals import held
from flocsim.process import STOPPED, handle
from flocsim.tasks import Lost, attempt, workers

WAYS = "continue it with --resume, or add --overwrite, which keeps the old one under another name"

SAVED_EVERY = 30.0
"""Seconds between two writes of an unfinished survey: what a kill may cost."""


def add_arguments(parser: ArgumentParser) -> None:
    """Find the flow rate at which bonds open. Every bound doublet of a finished study is put into
    a flow of rising rate G, without weight or inertia. The first rate at which it opens is found
    in steps of a factor of two, then by bisection in log G. Prints the distribution of every
    condition, and writes it and every single doublet to one HDF5 file, with a figure beside it.

    results: results file of flocsim ensemble
    --flow FLOW: shear, u = (G y, 0), or extension, u = (G x, -G y)/2 (default: %(default)s)
    --count K: number of doublets of each condition (default: all)
    --precision P: relative precision of a rate (default: %(default)g)
    --jobs N: processes on this machine (default: %(default)d)
    --resume: test the doublets that the output does not have yet, of a stopped survey or for a
        larger --count
    --output FILE: default: NAME-strength.h5
    """
    add = parser.add_argument
    add("results")
    add("--flow", default="shear")
    add("--count", type=whole)
    add("--precision", type=float, default=5e-3)
    add("--jobs", type=whole, default=1)
    add("--resume", action="store_true")
    add("-o", "--output")
    add_allowed(parser)
    add_overwrite(parser)
    add("--quiet", action="store_true")


def run(args: Namespace) -> int:
    """Test the bonds, write and print what was found, draw it; return the exit code."""
    from flocsim.ensembles.strength.contents import CONTENTS
    from flocsim.ensembles.strength.survey import Survey, bound_doublets, gathered, in_words
    from flocsim.io.plots.curves import over_rate
    from flocsim.io.plots.style import save
    from flocsim.io.results.run_group import source_line
    from flocsim.io.results.strength_file import table_of

    output = Path(args.output or f"{Path(args.results).stem}-strength.h5")
    figure, resumed = output.with_suffix(".png"), args.resume and output.exists()
    rule = held(output) if resumed else args.overwrite
    drawn = args.overwrite or args.resume
    check_outputs([output], rule, [args.results], WAYS)
    check_outputs([figure], drawn, [args.results, output])
    survey = Survey(args.results, args.flow, args.count, args.precision, allowed_by(args))
    say = (lambda line: None) if args.quiet else print
    tested = earlier(survey, output) if resumed else {}
    doublets = bound_doublets(survey.results, args.count)
    say(f"{len(doublets)} bound doublets of {args.results} in {args.flow}")
    say(source_line(survey.about))
    saved = time.monotonic()

    def write(complete: bool = False) -> Any:
        """Write what was found so far, and return it."""
        nonlocal rule, saved
        found = gathered(survey, tested, complete)
        found.write(output, rule)
        rule, saved = held(output), time.monotonic()
        return found

    def take(doublet: Any, opening: Any) -> None:
        if isinstance(opening, Lost):
            raise FlocsimError(f"replicate {doublet.replicate}: {opening.reason}")
        tested[doublet] = opening
        say(f"replicate {doublet.replicate}: {in_words(opening)}")
        if time.monotonic() - saved > SAVED_EVERY:
            write()

    handle(interrupt)
    try:
        todo = [each for each in doublets if each not in tested]
        for first in todo[:1]:  # in this process, as it compiles what all of them need
            take(first, attempt(survey.test, first))
        rest = todo[1:]
        with workers(max(min(args.jobs, len(rest)), 1), int) as mapped:
            for doublet, opening in zip(rest, mapped(survey.test, rest), strict=True):
                take(doublet, opening)
    except KeyboardInterrupt as error:
        kept = "no doublet was tested"
        if tested:
            write()
            kept = f"{len(tested)} tested doublets are in {output}"
        who = str(error) or "stopped by SIGINT"
        print(f"flocsim: {who}: {kept}\n{continuing()}", file=sys.stderr)
        return STOPPED
    found = write(complete=True)
    source = CONTENTS.source(found)
    say(f"{table_of(found)}\n{source}\n{output}")
    save(over_rate(found), figure, drawn, source)
    say(os.fspath(figure))
    return 0


def earlier(survey: Any, path: Path) -> dict[Any, Any]:
    """Return {doublet: Opening} of an earlier survey; UsageError where that was another one."""
    from flocsim.ensembles.strength.survey import tested_in
    from flocsim.io.results.strength_file import read_strengths

    found = read_strengths(path)
    for name, value in survey.about.items():
        if found.about.get(name) != value:
            raise UsageError(
                f"{path} is of another survey: {name} is {found.about.get(name)!r} in the file, "
                f"{value!r} now; name another output, or start over with --overwrite"
            )
    return tested_in(found)
