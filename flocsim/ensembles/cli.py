"""The command `python -m flocsim.ensemble cfg.toml`, with and without mpirun."""

import argparse
import contextlib
import io
import os
import re
import shlex
import shutil
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flocsim.compiler import units
from flocsim.ensembles.parallel.communicator import Communicator, StopRequested
from flocsim.ensembles.parallel.processes import find_communicator, launched_rank, launched_size
from flocsim.errors import ConfigError, FileError, FlocsimError, UsageError
from flocsim.io.arguments import Parser
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.terminal import output_problem, plain_streams, plain_warnings, tell
from flocsim.process import INTERRUPTED, INTERRUPTION, STOPPED, end_with_parent, stop_requested

UNSHARED = ("quiet", "run", "read", "command")
"""Arguments in which ranks may differ: the others say what is run."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "config",
        help="config file (TOML), - for standard input; `flocsim init` writes an example",
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="settings",
        help="override any value of the config, e.g. --set 'scene.delta=[0.0, 0.5]' or --set "
        "forces.contact.k_n='10 N/m'; may be repeated",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, help="seed, overriding the config's")
    parser.add_argument("--replicates", type=int, help="replicates, overriding the config's")
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="results file, overriding the config's"
    )
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="processes on this machine, without MPI"
    )
    begin = parser.add_mutually_exclusive_group()
    begin.add_argument(
        "--resume", action="store_const", const="resume", default="new", dest="mode",
        help="continue an unfinished run, or extend a finished one; starts one if there is none",
    )  # fmt: skip
    begin.add_argument(
        "--restart", action="store_const", const="restart", dest="mode",
        help="start over; an unfinished run is kept under another name (finished results: "
        "--overwrite)",
    )  # fmt: skip
    parser.add_argument("--overwrite", action="store_true", help=OVERWRITE_HELP)
    parser.add_argument(
        "--dry-run", action="store_true",
        help="show what would be run, and what is doubtful, and stop: nothing is compiled or run",
    )  # fmt: skip
    parser.add_argument(
        "--pilot", action=argparse.BooleanOptionalAction, default=False,
        help="with --dry-run: run some replicates for some seconds, to estimate the core-hours of "
        "the study and the size of its file, and to find which forces matter",
    )  # fmt: skip
    parser.add_argument("--quiet", action="store_true", help="print warnings and errors only")
    parser.set_defaults(read=read_config)
    # What Study.run says to its own process: with whom it is to end, and of which sweep it is.
    parser.add_argument("--parent", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--plan", help=argparse.SUPPRESS)


def overrides(arguments: argparse.Namespace) -> dict:
    """The command line's values as a nested dict over the config's."""
    from flocsim.ensembles.config.loader import nested, parse_setting

    given = nested(map(parse_setting, arguments.settings))
    if arguments.seed is not None:
        given["seed"] = arguments.seed
    if arguments.replicates is not None:
        given["replicates"] = arguments.replicates
    if arguments.output is not None:
        given["output"] = {"file": arguments.output}
    return given


def read_config(arguments, sources, first):
    """The config of a study; on the ``first`` rank found to make one whose results can be written
    where they should go."""
    from flocsim.ensembles.config.loader import load_any_config
    from flocsim.ensembles.diagnose.preflight import inputs_of
    from flocsim.ensembles.kind import kind_of

    config = load_any_config(arguments.config, overrides(arguments), sources)
    if not first:
        return config
    if getattr(arguments, "command", "") == "kernel" and not config.is_kernel:
        raise UsageError(
            f'{arguments.config} has scene.kind = "{config.scene.kind}": flocsim kernel needs '
            'kind = "kernel" with sizes, as in examples/kernel.toml'
        )
    kind_of(config).check(config)
    if not arguments.dry_run:
        check_outputs([results_of(config, arguments)], inputs_of(config, arguments.config))
    return config


def results_of(config, arguments):
    """The results file as an Output; what is to be extended is looked at when the run begins."""
    from flocsim.ensembles.storage.resume import RESUME, WAYS
    from flocsim.io.journal import SUFFIX

    rule = data_rule(arguments.overwrite or arguments.mode == RESUME)
    return Output(config.output.file, rule, SUFFIX, WAYS)


def agree(comm, arguments):
    """(config, 0) on every rank, made of what rank 0 has read; (None, exit code) on every rank
    where one of them was started with other words or cannot make it."""
    config, problem = None, None
    try:
        config = own_config(comm, arguments)
    except FlocsimError as error:
        problem = (str(error), error.exit_code)
    problems = [each for each in comm.gather(problem) or [] if each is not None]
    code = comm.broadcast(problems[0][1] if problems else 0)
    if problems:
        tell(problems[0][0], sys.stderr)
    return (None, code) if code else (config, 0)


def own_config(comm, arguments):
    """This rank's config, of the text and the modules that rank 0 has read; None where it has not.

    So an edited file is read before or after the edit, by all.
    """
    from flocsim.ensembles.config.sources import Sources
    from flocsim.ensembles.parallel.agreement import Launch, refuse_other_words

    words = {name: value for name, value in vars(arguments).items() if name not in UNSHARED}
    if comm.rank == 0:
        launch, sources = None, Sources()
        try:
            config = arguments.read(arguments, sources, True)
            launch = Launch(words, sources)
        finally:
            comm.broadcast(launch)
        return config
    from flocsim.ensembles import runner  # noqa: F401 (takes its time, while rank 0 reads)

    launch = comm.broadcast(None)
    if launch is None:
        return None
    refuse_other_words(comm.rank, launch, words)
    try:
        return arguments.read(arguments, launch.sources, False)
    except ConfigError as error:
        raise ConfigError(f"rank {comm.rank}: {error}") from error


def study(config, comm, arguments):
    """Run the study and write its results; the exit code."""
    from flocsim.ensembles.config import contents_of
    from flocsim.ensembles.kind import kind_of
    from flocsim.ensembles.runner import RankZeroFailed, SharedError, run_to_file

    output = config.output.file
    try:
        ended = run_to_file(config, comm, output, arguments.mode, arguments.quiet,
                            arguments.overwrite, arguments.plan)  # fmt: skip
    except RankZeroFailed as error:
        return error.args[0]
    except SharedError as error:
        tell(f"flocsim: {error}", sys.stderr)
        return error.args[0].exit_code
    if ended.code == STOPPED:
        if comm.rank == 0:
            tell(INTERRUPTION.farewell(), sys.stderr)
        return STOPPED
    if comm.rank > 0:
        return 0
    shown = contents_of(kind_of(config).format)
    found, seconds = ended.results, ended.wall_time
    if not arguments.quiet:
        tell((shown.told or shown.table)(found))
        tell(shown.source(found))
        tell(f"{output}: {ended.total} replicates, {ended.computed} of them run in "
             f"{seconds:.1f} s, {ended.computed / seconds:.0f}/s")  # fmt: skip
    code, line = shown.verdict(found)
    if line:
        tell(f"flocsim: {line}; the rows are in {output}", sys.stderr)
    return code


def end_all(comm: Communicator, text: str, code: int) -> int:
    """Print why, and end every rank; returns the exit code where this process is alone."""
    who = f"rank {comm.rank}: " if comm.size > 1 else ""
    tell(f"flocsim: {who}{text}", sys.stderr)
    if comm.size > 1:
        comm.abort(code)
    return code


def guarded(comm, arguments):
    """Do the work; whatever goes wrong on any rank ends the job with a message, never a hang."""
    try:
        config, code = agree(comm, arguments)
        if config is not None and not arguments.dry_run:
            code = study(config, comm, arguments)
        elif config is not None and comm.rank == 0:
            from flocsim.ensembles.config import contents_of
            from flocsim.ensembles.kind import kind_of

            shown = contents_of(kind_of(config).format)
            text = shown.dry_run(config, max(comm.size, arguments.jobs), arguments.pilot)
            if stop_requested():
                raise StopRequested(f"stopped by {INTERRUPTION.name}")
            tell(text)
        comm.close()
        return code
    except StopRequested:
        if comm.rank == 0:
            tell(INTERRUPTION.farewell(), sys.stderr)
        if comm.size > 1:
            comm.abort(STOPPED)  # others may wait for this rank
        return STOPPED
    except FlocsimError as error:
        return end_all(comm, str(error), error.exit_code)
    except KeyboardInterrupt:
        return end_all(comm, "interrupted; continue with --resume", INTERRUPTED)
    except MemoryError:
        return end_all(
            comm, "out of memory: use fewer ranks on each machine", FlocsimError.exit_code
        )
    except Exception:
        text = f"internal error, please report it:\n{traceback.format_exc()}"
        return end_all(comm, text, FlocsimError.exit_code)


def what_is_wrong(arguments, comm):
    """Return what is wrong with --jobs or --pilot here; "" where nothing is."""
    if arguments.jobs < 1:
        return f"--jobs must be at least 1, found {arguments.jobs}"
    if arguments.pilot and not arguments.dry_run:
        return "--pilot is for --dry-run: leave it out"
    if arguments.jobs > 1 and comm.size > 1 and not arguments.dry_run:
        return "--jobs is for runs without an MPI launcher: leave out one or the other"
    return ""


def on_process(comm, arguments):
    plain_warnings(silent=True)
    return guarded(comm, arguments)


def run(arguments: argparse.Namespace) -> int:
    if arguments.parent is not None:
        end_with_parent(arguments.parent)
    comm: Communicator = Communicator()
    try:
        comm = find_communicator()
        wrong = what_is_wrong(arguments, comm)
        code = refused_anywhere(comm, UsageError.exit_code if wrong else None)
        if code is not None:
            if wrong and comm.rank == 0:
                tell(f"flocsim: {wrong}", sys.stderr)
            return code
        if arguments.jobs > 1 and not arguments.dry_run:
            from flocsim.ensembles.parallel.processes import start_processes

            comm = start_processes(arguments.jobs, on_process, arguments)
    except FlocsimError as error:
        return end_all(comm, str(error), error.exit_code)
    plain_warnings(silent=comm.rank > 0)
    INTERRUPTION.kept = lambda: "nothing more was finished"
    if arguments.parent is None and not arguments.dry_run:  # a parent says how it goes on
        INTERRUPTION.command = continuing(0 if arguments.jobs > 1 else comm.size)
    if arguments.quiet:
        units.show_by(units.silent)
    return guarded(comm, arguments)


ANEW = re.compile("--(resu|rest|overw)[a-z]*")
"""Options, also cut short, that a command which continues a run does not have or has at its end."""


def continuing(ranks: int = 1) -> str:
    """Return the command line that continues this run, with the launcher where it has ``ranks``."""
    words = [*(word for word in sys.argv[1:] if not ANEW.fullmatch(word)), "--resume"]
    module = sys.modules["__main__"].__spec__
    program = [on_path(sys.argv[0])]
    if module is not None:  # python -m flocsim, or flocsim.ensemble
        program = [sys.orig_argv[0], "-m", module.name.removesuffix(".__main__")]
    launcher = Path(sys.executable).with_name("mpirun")
    launch = [on_path(launcher) if launcher.exists() else "mpirun", "-n", str(ranks)]
    return shlex.join([*(launch if ranks > 1 else []), *program, *words])


def on_path(program: str | os.PathLike) -> str:
    """Return a program's name where the shell finds it by that, its path otherwise."""
    path = Path(program).absolute()
    return path.name if shutil.which(path.name) == str(path) else os.fspath(program)


def refused_anywhere(comm: Communicator, code: int | None) -> int | None:
    """The exit code where the arguments of a rank were refused, as the others would wait for it.

    ``code``: that of this rank, None where it can go on; 0 where it printed a help.
    """
    codes = comm.gather(code) or []
    which = [rank for rank, each in enumerate(codes) if each is not None]
    if which and len(which) < len(codes):
        tell(
            f"flocsim: rank {which[0]} was started with invalid arguments: start all ranks with "
            "the same ones",
            sys.stderr,
        )
        return comm.broadcast(UsageError.exit_code)
    return comm.broadcast(codes[0] if which else None)


def parse_on_all_ranks(parser: argparse.ArgumentParser, words: Sequence[str] | None) -> Any:
    """The arguments; where they are refused, or are for a help, all ranks end together.

    One rank says why. SystemExit as from argparse.
    """
    with silent_unless_first():
        try:
            return parser.parse_args(words)
        except SystemExit as end:
            if launched_size() in (0, 1):
                raise
            code = end.code if isinstance(end.code, int) else UsageError.exit_code
    try:
        ended = refused_anywhere(find_communicator(), code)
    except FlocsimError:
        ended = code
    raise SystemExit(ended)


@contextlib.contextmanager
def silent_unless_first():
    """Let one rank alone print the help, or what is wrong with the arguments."""
    if launched_rank() == 0:
        yield
        return
    nowhere = io.StringIO()
    with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        yield


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of `python -m flocsim.ensemble`; the exit code."""
    parser = Parser(
        prog="flocsim.ensemble", description="run the ensemble of a config file, also under mpirun"
    )
    add_arguments(parser)
    with plain_streams():
        arguments = parse_on_all_ranks(parser, argv)
        code = run(arguments)
        problem = output_problem() if code == 0 else ""
        if problem:
            tell(f"flocsim: {problem}", sys.stderr)
        return FileError.exit_code if problem and arguments.dry_run else code
