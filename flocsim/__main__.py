"""The command `flocsim`, also `python -m flocsim`: one subcommand for each thing to do."""

import argparse
import signal
import sys
from collections.abc import Sequence

# Ctrl-C while modules are loaded ends the process without a traceback.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from flocsim import __version__
from flocsim.commands import STUDIES, SUMMARIES, add_command
from flocsim.io.terminal import output_problem, plain_streams, plain_warnings
from flocsim.process import check_memory, forget_left_over_launch, install, is_limited

if STUDIES.intersection(sys.argv[1:2]):
    install()  # before anything slow is imported
if is_limited():
    check_memory()

from flocsim.ensembles.cli import silent_unless_first
from flocsim.ensembles.parallel.processes import launched_rank, launched_size
from flocsim.errors import FileError, FlocsimError, UsageError
from flocsim.io.arguments import Parser

if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
    signal.signal(signal.SIGINT, signal.default_int_handler)

STARTERS = ("study", "sweep")
"""Commands that start processes of their own, which would meet those of a launcher."""


def make_parser(words: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """Return the parser of a command line ``words``, with the arguments of its command alone, as
    the others need not be loaded for it; of all commands without words."""
    parser = Parser(
        prog="flocsim",
        description="When two flocs of real shape meet in water, do they collide, and do they "
        "stick?",
    )
    parser.add_argument("--version", action="version", version=f"flocsim {__version__}")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command, summary in SUMMARIES.items():
        if words is None or command in words[:1]:
            add_command(subparsers, command)
        else:
            subparsers.add_parser(command, help=summary)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand; the exit code. Errors are one line on stderr."""
    with plain_streams():
        plain_warnings()
        forget_left_over_launch()
        words = sys.argv[1:] if argv is None else argv
        with silent_unless_first():
            arguments = make_parser(words).parse_args(argv)
        if arguments.command not in STUDIES:
            if launched_rank() > 0:
                return 0  # what is no study is one rank's work
            if (launched_size() or 0) > 1:
                print(
                    f"flocsim: {arguments.command} runs on one rank only, and the other ranks of "
                    "this job have ended: start it without mpirun or srun, and use --jobs if it "
                    "has that option",
                    file=sys.stderr,
                )
                if arguments.command in STARTERS and not getattr(arguments, "dry_run", False):
                    return UsageError.exit_code
        code = run(arguments)
        problem = output_problem() if code == 0 else ""
        if problem:
            print(f"flocsim: {problem}", file=sys.stderr)
        # The results of a study are whole, whether anybody reads its table or not.
        needed = arguments.command not in STUDIES or arguments.dry_run
        return FileError.exit_code if problem and needed else code


def run(arguments: argparse.Namespace) -> int:
    """Run a command; the exit code, also of what went wrong, which is told in one line."""
    try:
        return arguments.run(arguments)
    except FlocsimError as error:
        code, text = error.exit_code, str(error)
    except MemoryError:
        code, text = FlocsimError.exit_code, "out of memory"
    except KeyboardInterrupt:
        code, text = 130, "interrupted"
    except BrokenPipeError:
        # The reader of our output has gone (`| head`): not an error, but nothing more to say.
        return 0
    print(f"flocsim: {text}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
