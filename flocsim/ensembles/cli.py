"""The commands that run a study: `flocsim ensemble cfg.toml`, with and without mpirun."""

import argparse
import contextlib
import io
import os
import re
import shlex
import shutil
import sys
import traceback
from pathlib import Path
from typing import Any

from flocsim.compiler import units
from flocsim.ensembles.parallel.communicator import Communicator, SharedError, StopRequested
from flocsim.ensembles.parallel.processes import (
    find_communicator,
    launched_rank,
    start_processes,
)
from flocsim.errors import FlocsimError, UsageError, plural
from flocsim.io.outputs import check_outputs
from flocsim.io.terminal import plain_warnings
from flocsim.process import INTERRUPTED, INTERRUPTION, STOPPED, end_with_parent, stop_requested


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Run the study of a config file, in one process or, under mpirun, on all ranks.

    config: config file (TOML), - for standard input; `flocsim init` writes an example
    --set KEY=VALUE: override any value of the config, e.g. --set 'scene.delta=[0.0, 0.5]' or --set
        forces.contact.k_n='10 N/m'; may be repeated
    --seed: seed, instead of the config's
    --replicates: number of replicates, instead of the config's
    --output FILE: results file, instead of the config's
    --jobs N: processes on this machine, without MPI
    --resume: continue an unfinished run, or extend a finished one; starts one if there is none
    --restart: start over; an unfinished run is kept under another name (finished results:
        --overwrite)
    --overwrite: replace files that exist; each is kept, study.h5 as study.1.h5
    --dry-run: show what would be run, with warnings, and stop: nothing is compiled or run
    --pilot: with --dry-run: run replicates for a few seconds, to estimate the core-hours of the
        study and the size of its file
    --verbose: with --dry-run: also show collisions, forces and time scales
    --quiet: print warnings and errors only
    """
    add = parser.add_argument
    add("config")
    add("--set", action="append", default=[], dest="settings")
    add("--seed", type=int)
    add("--replicates", type=int)
    add("-o", "--output")
    add("--jobs", type=int, default=1)
    begin = parser.add_mutually_exclusive_group().add_argument
    begin("--resume", action="store_const", const="resume", default="new", dest="mode")
    begin("--restart", action="store_const", const="restart", dest="mode")
    add("--overwrite", action="store_true")
    add("--dry-run", action="store_true")
    add("--pilot", action="store_true")
    add("--verbose", action="store_true")
    add("--quiet", action="store_true")
    # What Study.run says to its own process: with whom it is to end.
    add("--parent", type=int, help=argparse.SUPPRESS)


def overrides_of(options: argparse.Namespace) -> dict[str, Any]:
    """Return the command line's values as a nested dict over the config's."""
    from flocsim.ensembles.config.loader import settings_in

    file = None if options.output is None else {"file": options.output}
    given = {"seed": options.seed, "replicates": options.replicates, "output": file}
    return settings_in(options.settings) | {
        name: value for name, value in given.items() if value is not None
    }


def check_start(options: argparse.Namespace, config: Any, comm: Communicator) -> None:
    """Raise UsageError or FileError for options or a config that no study can start with, and
    where its results could not be written where they should go."""
    from flocsim.ensembles.diagnose.preflight import inputs_of
    from flocsim.ensembles.kind import kind_of
    from flocsim.ensembles.storage.resume import RESUME, WAYS

    if options.jobs < 1:
        raise UsageError(f"--jobs must be at least 1, found {options.jobs}")
    for name in ("pilot", "verbose"):
        if getattr(options, name) and not options.dry_run:
            raise UsageError(f"--{name} is for --dry-run: leave it out")
    if options.jobs > 1 and comm.is_launched and not options.dry_run:
        raise UsageError("--jobs is for runs without an MPI launcher: leave out one or the other")
    if options.command == "kernel" and not config.is_kernel:
        raise UsageError(
            f'{options.config} has scene.kind = "{config.scene.kind}": flocsim kernel needs '
            'kind = "kernel" with sizes, as in examples/kernel.toml'
        )
    kind_of(config).check(config)
    if not options.dry_run:
        # What is to be extended is looked at when the run begins.
        rule = options.overwrite or options.mode == RESUME
        check_outputs([config.output.file], rule, inputs_of(config, options.config), WAYS)


def agree(comm: Communicator, options: Any) -> tuple[Any, argparse.Namespace]:
    """Return (config, options) on every rank, made of the command line, the text and the modules
    that rank 0 has read: an edited file is read before or after the edit, by all.

    SharedError on every rank where one of them cannot make it.
    """
    from flocsim.ensembles.config.loader import load_any_config
    from flocsim.ensembles.config.sources import Sources

    config, problem, sources = None, None, Sources()
    with comm.sharing_errors():
        if comm.rank == 0:
            config = load_any_config(options.config, overrides_of(options), sources)
            check_start(options, config, comm)
    options, sources = comm.broadcast((options, sources))
    try:
        if comm.rank > 0:
            config = load_any_config(options.config, overrides_of(options), sources)
    except FlocsimError as error:
        problem = type(error)(f"rank {comm.rank}: {error}")
    comm.agree(problem)
    return config, options


def study(config: Any, comm: Communicator, options: argparse.Namespace) -> int:
    """Run the study and write its results; the exit code."""
    from flocsim.ensembles.config import contents_of
    from flocsim.ensembles.kind import kind_of
    from flocsim.ensembles.runner import run_to_file

    output = config.output.file
    ended = run_to_file(config, comm, output, options.mode, options.quiet, options.overwrite)
    if ended.code == STOPPED:
        if comm.rank == 0:
            print(INTERRUPTION.farewell(), file=sys.stderr)
        return STOPPED
    if comm.rank > 0:
        return 0
    shown = contents_of(kind_of(config).format)
    found, seconds = ended.results, ended.wall_time
    if not options.quiet:
        print(shown.table(found))
        print(shown.source(found))
        print(f"{output}: {plural(ended.total, 'replicate')}, of which {ended.computed} were run "
              f"now, in {seconds:.1f} s ({ended.computed / seconds:.2g}/s)")  # fmt: skip
    code, line = shown.verdict(found)
    if line:
        print(f"flocsim: {line}; the rows are in {output}", file=sys.stderr)
    return code


def end_all(comm: Communicator, text: str, code: int) -> int:
    """Print why, and end every rank; returns the exit code where this process is alone."""
    who = f"rank {comm.rank}: " if comm.size > 1 else ""
    print(f"flocsim: {who}{text}", file=sys.stderr)
    if comm.size > 1:
        comm.abort(code)
    return code


def dry_run(config: Any, comm: Communicator, options: argparse.Namespace) -> int:
    """Say what would be run, on rank 0; the exit code."""
    from flocsim.ensembles.config import contents_of
    from flocsim.ensembles.kind import kind_of

    if comm.rank == 0:
        shown = contents_of(kind_of(config).format)
        ranks = max(comm.size, options.jobs)
        text = shown.dry_run(config, ranks, options.pilot, options.verbose)
        if stop_requested():
            raise StopRequested(f"stopped by {INTERRUPTION.name}")
        print(text)
    return 0


def guarded(comm: Communicator, options: argparse.Namespace | None = None) -> int:
    """Do the work; whatever goes wrong on any rank ends the job with a message, never a hang.

    Rank 0's ``options`` are those of all.
    """
    try:
        try:
            config, options = agree(comm, options)
            if options.dry_run:
                code = dry_run(config, comm, options)
            else:
                code = study(config, comm, options)
        except SharedError as error:
            code = error.args[0].exit_code
            if comm.rank == 0:
                print(f"flocsim: {error}", file=sys.stderr)
        comm.close()
        return code
    except StopRequested:
        if comm.rank == 0:
            print(INTERRUPTION.farewell(), file=sys.stderr)
        if comm.size > 1:
            comm.abort(STOPPED)  # others may wait for this rank
        return STOPPED
    except FlocsimError as error:
        return end_all(comm, str(error), error.exit_code)
    except KeyboardInterrupt:
        return end_all(comm, "interrupted; continue with --resume", INTERRUPTED)
    except MemoryError:
        text = "out of memory: use fewer ranks on each machine"
        return end_all(comm, text, FlocsimError.exit_code)
    except Exception:
        text = f"internal error, please report it:\n{traceback.format_exc()}"
        return end_all(comm, text, FlocsimError.exit_code)


def run(arguments: argparse.Namespace) -> int:
    """Run what the command line asks for, on all ranks of the job; return the exit code."""
    if arguments.parent is not None:
        end_with_parent(arguments.parent)
    comm = Communicator()
    try:
        comm = find_communicator()
        ranks = comm.size
        if arguments.jobs > 1 and comm.size == 1 and not arguments.dry_run:
            comm, ranks = start_processes(arguments.jobs, guarded), 0
    except FlocsimError as error:
        return end_all(comm, str(error), error.exit_code)
    plain_warnings(silent=comm.rank > 0)
    INTERRUPTION.kept = lambda: "nothing more was finished"
    if arguments.parent is None and not arguments.dry_run:  # a parent says how it goes on
        INTERRUPTION.command = continuing(ranks)
    if arguments.quiet:
        units.quiet = True
    return guarded(comm, arguments)


ANEW = re.compile("--(resu|rest|overw)[a-z]*")
"""Options, also cut short, that a command which continues a run does not have or has at its end."""


def continuing(ranks: int = 1) -> str:
    """Return the command line that continues this run, with the launcher where it has ``ranks``."""
    words = [*(word for word in sys.argv[1:] if not ANEW.fullmatch(word)), "--resume"]
    launcher = Path(sys.executable).with_name("mpirun")
    launch = [on_path(launcher) if launcher.exists() else "mpirun", "-n", str(ranks)]
    return shlex.join([*(launch if ranks > 1 else []), *program(), *words])


def program() -> list[str]:
    """Return the words that start flocsim as this process was started."""
    # python -m flocsim, or flocsim.ensemble, or a program that is not ours.
    if sys.modules["__main__"].__spec__ is not None or Path(sys.argv[0]).stem != "flocsim":
        return [on_path(sys.executable), "-m", "flocsim"]
    return [on_path(sys.argv[0])]


def on_path(program: str | os.PathLike) -> str:
    """Return a program's name where the shell finds it by that, its path otherwise."""
    path = Path(program).absolute()
    return path.name if shutil.which(path.name) == str(path) else os.fspath(program)


@contextlib.contextmanager
def silent_unless_first():
    """Let one rank alone print the help, or what is wrong with the arguments."""
    if launched_rank() == 0:
        yield
        return
    nowhere = io.StringIO()
    with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        yield
