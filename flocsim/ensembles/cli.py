"""The command `python -m flocsim.ensemble cfg.toml`, with and without mpirun."""

import argparse
import contextlib
import io
import math
import sys
import traceback
from collections.abc import Sequence

from flocsim.ensembles.parallel.communicator import (
    Communicator,
    SerialCommunicator,
    StopRequested,
    find_communicator,
    launched_rank,
)
from flocsim.ensembles.parallel.heartbeat import SECONDS
from flocsim.errors import FileError, FlocsimError, UsageError
from flocsim.interruption import INTERRUPTED, INTERRUPTION, STOPPED
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.terminal import output_problem, plain_streams, plain_warnings, tell

INTERNAL = 70


def add_arguments(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    parser.add_argument("config", help="config file (TOML); `flocsim init` writes an example")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="settings",
        help="any value instead of the config's, e.g. --set 'scene.delta=[0.0, 0.5]' or --set "
        "forces.contact.k_n='10 N/m'; may be repeated",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, help="seed, instead of the config's")
    parser.add_argument("--replicates", type=int, help="replicates, instead of the config's")
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="results file, instead of the config's"
    )
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="processes on this machine, without MPI"
    )
    parser.add_argument(
        "--heartbeat", type=float, default=SECONDS, metavar="SECONDS",
        help="end the job where a rank has not been heard of for so long, stopped or on a machine "
        f"that is gone (default {SECONDS:g}; 0: wait without end)",
    )  # fmt: skip
    begin = parser.add_mutually_exclusive_group()
    begin.add_argument(
        "--resume", action="store_const", const="resume", default="new", dest="mode",
        help="go on with an unfinished run, or extend a finished one; starts one if there is none",
    )  # fmt: skip
    begin.add_argument(
        "--restart", action="store_const", const="restart", dest="mode",
        help="throw an unfinished run away and start anew (finished results: --overwrite)",
    )  # fmt: skip
    parser.add_argument("--overwrite", action="store_true", help=OVERWRITE_HELP)
    parser.add_argument("--dry-run", action="store_true", help="say what would be run, and stop")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    return parser


def overrides(arguments: argparse.Namespace) -> dict:
    """The command line's values as a nested dict over the config's."""
    from flocsim.ensembles.config.overrides import nested, parse_setting

    given = nested(map(parse_setting, arguments.settings))
    if arguments.seed is not None:
        given["seed"] = arguments.seed
    if arguments.replicates is not None:
        given["replicates"] = arguments.replicates
    if arguments.output is not None:
        given["output"] = {"file": arguments.output}
    return given


def checked_config(arguments):
    """The config, found to make a study whose results can be written where they should go."""
    from flocsim.ensembles.config.loader import load_config
    from flocsim.ensembles.preflight import check_study, inputs_of

    config = load_config(arguments.config, overrides(arguments))
    check_study(config)
    if not arguments.dry_run:
        check_outputs([results_of(config, arguments)], inputs_of(config, arguments.config))
    return config


def results_of(config, arguments):
    """The results file as an Output; what is to be extended is looked at when the run begins."""
    from flocsim.ensembles.storage.resume import RESUME, WAYS
    from flocsim.io.journal.journal import SUFFIX

    rule = data_rule(arguments.overwrite or arguments.mode == RESUME)
    return Output(config.output.file, rule, SUFFIX, WAYS)


def agree(comm, arguments):
    """The config on every rank; where one rank cannot load it, none goes on."""
    config, problem = None, None
    try:
        config = checked_config(arguments)
    except FlocsimError as error:
        problem = (str(error), error.exit_code)
    problems = [each for each in comm.all_gather(problem) if each is not None]
    if problems:
        if comm.rank == 0:
            tell(problems[0][0], sys.stderr)
        return None, problems[0][1]
    return config, 0


def study(config, comm, arguments):
    """Run the study and write its results; the exit code."""
    from flocsim.ensembles.runner import RankZeroFailed, SharedError, run_to_file

    output = config.output.file
    try:
        ended = run_to_file(config, comm, output, arguments.mode, arguments.quiet,
                            arguments.overwrite)  # fmt: skip
    except RankZeroFailed as error:
        return error.args[0]
    except SharedError as error:
        tell(f"flocsim: {error}", sys.stderr)
        return error.args[0].exit_code
    if ended.code == STOPPED:
        if comm.rank == 0:
            who = INTERRUPTION.name if INTERRUPTION.requested else "a signal to another rank"
            tell(
                f"flocsim: stopped by {who}: {ended.kept} finished replicates are in "
                f"{output}.journal; go on with --resume",
                sys.stderr,
            )
        return STOPPED
    if comm.rank > 0:
        return 0
    if not arguments.quiet:
        report(ended, output)
    return verdict(ended.results, output)


def verdict(results, output):
    """0, or the code of an error where not one replicate has come to an outcome: said why."""
    from flocsim.ensembles.report import undecided_line

    line = undecided_line(results)
    if line:
        tell(f"flocsim: {line}; the rows are in {output}", sys.stderr)
    return INTERNAL if line else 0


def report(ended, output):
    from flocsim.ensembles.report import format_table

    results = ended.results
    tell(format_table(results.types, results.vertices, results.delta, results.probabilities))
    total = int(results.probabilities["n_total"].sum())
    seconds = ended.wall_time
    tell(f"{output}: {total} replicates, {ended.computed} of them run in {seconds:.1f} s, "
         f"{ended.computed / seconds:.0f}/s")  # fmt: skip


def run_rank(comm, arguments):
    config, code = agree(comm, arguments)
    if config is None:
        return code
    if arguments.dry_run:
        from flocsim.ensembles.dry_run import dry_run

        if comm.rank == 0:
            tell(dry_run(config, comm.size))
        return 0
    return study(config, comm, arguments)


def end_all(comm: Communicator, text: str, code: int) -> int:
    """Print why, and end every rank; returns the exit code where this process is alone."""
    who = f"rank {comm.rank}: " if comm.size > 1 else ""
    tell(f"flocsim: {who}{text}", sys.stderr)
    if comm.size > 1:
        comm.abort(code)
    return code


def guarded(comm, arguments):
    """Do the work; whatever goes wrong on any rank ends the job with a message, never a hang."""
    comm.watch(arguments.heartbeat)
    try:
        code = run_rank(comm, arguments)
        comm.close()
        return code
    except StopRequested as error:
        if comm.rank == 0:
            tell(f"flocsim: {error}", sys.stderr)
        if comm.size > 1:
            comm.abort(STOPPED)  # others may wait for this rank
        return STOPPED
    except FlocsimError as error:
        return end_all(comm, str(error), error.exit_code)
    except KeyboardInterrupt:
        return end_all(comm, "interrupted; go on with --resume", INTERRUPTED)
    except MemoryError:
        return end_all(comm, "out of memory: ask for fewer ranks on a machine", INTERNAL)
    except Exception:
        text = f"internal error, please report it:\n{traceback.format_exc()}"
        return end_all(comm, text, INTERNAL)


def join_ranks(arguments):
    """The ranks of the job: those that a launcher started, or --jobs processes."""
    if not 0.0 <= arguments.heartbeat < math.inf:
        raise UsageError(f"--heartbeat must be 0 s or more, found {arguments.heartbeat:g}")
    comm = find_communicator()
    if arguments.jobs == 1 or arguments.dry_run:
        return comm
    if arguments.jobs < 1:
        raise UsageError(f"--jobs must be at least 1, found {arguments.jobs}")
    if comm.size > 1:
        raise UsageError("--jobs is for runs without an MPI launcher: leave out one of the two")
    from flocsim.ensembles.parallel.processes import start_processes

    return start_processes(arguments.jobs, on_process, arguments)


def on_process(comm, arguments):
    plain_warnings(silent=True)
    return guarded(comm, arguments)


def run_command(arguments: argparse.Namespace) -> int:
    try:
        comm = join_ranks(arguments)
    except FlocsimError as error:
        return end_all(SerialCommunicator(), str(error), error.exit_code)
    plain_warnings(silent=comm.rank > 0)
    return guarded(comm, arguments)


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
    parser = argparse.ArgumentParser(
        prog="flocsim.ensemble", description="run the ensemble of a config file, also under mpirun"
    )
    with plain_streams():
        with silent_unless_first():
            arguments = add_arguments(parser).parse_args(argv)
        code = run_command(arguments)
        problem = output_problem() if code == 0 else ""
        if problem:
            tell(f"flocsim: {problem}", sys.stderr)
        return FileError.exit_code if problem and arguments.dry_run else code
