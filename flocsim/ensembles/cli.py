"""The command `python -m flocsim.ensemble cfg.toml`, with and without mpirun."""

import argparse
import contextlib
import io
import sys
import traceback

from flocsim.ensembles.progress import plain_warnings, tell
from flocsim.ensembles.team import Alone, find_team, launched_rank
from flocsim.errors import FlocsimError

INTERRUPTED = 130
INTERNAL = 70


def add_arguments(parser):
    """The arguments of the command."""
    parser.add_argument("config", help="config file (TOML); `flocsim init` writes an example")
    parser.add_argument("--seed", type=int, help="seed, instead of the config's")
    parser.add_argument("--replicates", type=int, help="replicates, instead of the config's")
    parser.add_argument("--output", metavar="FILE", help="results file, instead of the config's")
    parser.add_argument("--dry-run", action="store_true", help="say what would be run, and stop")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    return parser


def overrides(arguments):
    """The command line's values as a nested dict over the config's."""
    given = {}
    if arguments.seed is not None:
        given["seed"] = arguments.seed
    if arguments.replicates is not None:
        given["replicates"] = arguments.replicates
    if arguments.output is not None:
        given["output"] = {"file": arguments.output}
    return given


def checked_config(arguments):
    """The config, found to make a study whose results can be written where they should go."""
    from flocsim.ensembles.loader import load_config
    from flocsim.ensembles.preflight import check_output, check_study

    config = load_config(arguments.config, overrides(arguments))
    check_study(config)
    if not arguments.dry_run:
        sources = [arguments.config, config.shapes.file]
        check_output(config.output.file, *(source for source in sources if source))
    return config


def agree(team, arguments):
    """The config on every rank; where one rank cannot load it, none goes on."""
    config, problem = None, None
    try:
        config = checked_config(arguments)
    except FlocsimError as error:
        problem = (str(error), error.exit_code)
    problems = [each for each in team.collect(problem) if each is not None]
    if problems:
        if team.rank == 0:
            print(problems[0][0], file=sys.stderr, flush=True)
        return None, problems[0][1]
    return config, 0


def study(config, team, arguments):
    """Run the study and write its results."""
    from flocsim.ensembles.report import format_table
    from flocsim.ensembles.runner import run
    from flocsim.io.results import write_results

    results = run(config, team, quiet=arguments.quiet)
    if team.rank > 0:
        return
    # The table first: should the disk be full, it is not lost with the file.
    table = format_table(results.types, results.vertices, results.delta, results.probabilities)
    if not arguments.quiet:
        tell(table)
    write_results(config.output.file, results)
    if not arguments.quiet:
        seconds = results.run["wall_time"]
        tell(
            f"{config.output.file}: {results.replicates['outcome'].size} replicates in "
            f"{seconds:.1f} s, {results.replicates['outcome'].size / seconds:.0f}/s"
        )


def work(team, arguments):
    """The whole command on one rank; its exit code."""
    config, code = agree(team, arguments)
    if config is None:
        return code
    if arguments.dry_run:
        from flocsim.ensembles.dry_run import dry_run

        if team.rank == 0:
            tell(dry_run(config, team))
        return 0
    study(config, team, arguments)
    return 0


def end_all(team, text, code):
    """Print why, and end every rank; returns the exit code where this process is alone."""
    who = f"rank {team.rank}: " if team.size > 1 else ""
    print(f"flocsim: {who}{text}", file=sys.stderr, flush=True)
    if team.size > 1:
        team.abort(code)
    return code


def guarded(team, arguments):
    """Do the work; whatever goes wrong on any rank ends the job with a message, never a hang."""
    try:
        return work(team, arguments)
    except FlocsimError as error:
        return end_all(team, str(error), error.exit_code)
    except KeyboardInterrupt:
        return end_all(team, "interrupted; nothing was saved", INTERRUPTED)
    except MemoryError:
        return end_all(team, "out of memory: ask for fewer replicates at a time", INTERNAL)
    except Exception:
        text = f"internal error, please report it:\n{traceback.format_exc()}"
        return end_all(team, text, INTERNAL)


def run_command(arguments):
    """Find the ranks of the job and do the work; the exit code."""
    try:
        team = find_team()
    except FlocsimError as error:
        return end_all(Alone(), str(error), error.exit_code)
    plain_warnings(silent=team.rank > 0)
    return guarded(team, arguments)


@contextlib.contextmanager
def silent_unless_first():
    """Let one rank alone print the help, or what is wrong with the arguments."""
    if launched_rank() == 0:
        yield
        return
    nowhere = io.StringIO()
    with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        yield


def main(argv=None):
    """Entry of `python -m flocsim.ensemble`; the exit code."""
    parser = argparse.ArgumentParser(
        prog="flocsim.ensemble", description="run the ensemble of a config file, also under mpirun"
    )
    with silent_unless_first():
        arguments = add_arguments(parser).parse_args(argv)
    return run_command(arguments)
