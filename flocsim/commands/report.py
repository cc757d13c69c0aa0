"""`flocsim report r.h5`: all that a results file holds on one page for a browser."""

import argparse
from pathlib import Path
from typing import Any

from flocsim.commands import FOLDER_HELP, SUMMARIES
from flocsim.commands.reporting.page import report_page
from flocsim.ensembles.contents import overview_of
from flocsim.errors import UsageError
from flocsim.io.files import write_file
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, figure_rule, marked
from flocsim.io.plots.results import MOST_ROWS
from flocsim.io.seals import held

DESCRIPTION = """\
Write one HTML page on a file that needs no other file: the figures of flocsim plot, the numbers
with their errors, warnings, and where it came from; of pairs one replicate of each class (A to D)
to watch, which is run again for it."""


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser("report", help=SUMMARIES["report"], description=DESCRIPTION)
    add = parser.add_argument
    add("results", help="file that flocsim wrote")
    add("-o", "--output", metavar="FILE.html",
        help="page to write (default: r.html for r.h5, in the current folder)")  # fmt: skip
    add(
        "--no-motion",
        action="store_true",
        help="do not run replicates again: a page without motion",
    )
    add("--folder", metavar="DIR", help=FOLDER_HELP)
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write the page and print its path; returns the exit code."""
    path = Path(args.output or f"{Path(args.results).stem}.html")
    if path.suffix.lower() != ".html":
        raise UsageError(f"--output {path}: a page's name must end in .html")
    rule = figure_rule(args.overwrite)
    check_outputs([Output(path, rule)], [args.results])
    source = held(args.results)
    kind, found = overview_of(source)
    examples = [] if args.no_motion else kind.examples(source, args.folder)
    found = kind.with_rows(source, found, MOST_ROWS)
    page = report_page(str(args.results), kind, found, examples)
    write_file(path, marked(page.encode(), ".html"), rule)
    for example in examples:
        if example.reason:
            print(f"class {example.outcome} is not animated: {example.reason}")
    print(path)
    return 0
