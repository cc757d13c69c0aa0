"""The command in a process of its own: a script's processes, signals and memory stay apart."""

import contextlib
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

from flocsim.ensembles.config.sources import INSTALLED
from flocsim.ensembles.parallel.communicator import launched_size
from flocsim.errors import FileError, FlocsimError, PlausibilityWarning, UsageError
from flocsim.interruption import INTERRUPTED, STOPPED, WITHHELD

SAVING = 30.0
"""Seconds that an interrupted run has to keep what it has finished."""

WORDS = {
    "--resume": 'mode="resume"', "--restart": 'mode="restart"', "--overwrite": "overwrite=True",
}  # fmt: skip
"""What the command calls it → what a script calls it."""


WARNING = "flocsim: warning: "

STACK = 4
"""From `listen` to the script that called Study.run."""


def run_command(words: Sequence[str], text: str, folder: Path, quiet: bool) -> None:
    """Run `flocsim WORDS` in a folder with a text as its standard input.

    What it prints is printed here, unless ``quiet``; then its warnings become Python's. Raises the
    FlocsimError that its exit code stands for, with its last words; KeyboardInterrupt where it was
    interrupted, once it has saved.
    """
    if (launched_size() or 0) > 1:
        raise UsageError(
            "Study.run starts processes of its own and cannot be run as ranks: use "
            "`mpirun -n 2 flocsim ensemble FILE`"
        )
    environment = os.environ | {"PYTHONUNBUFFERED": "1", **path_to_flocsim()}
    # On Windows a virtual environment's Python is the child of a process that starts it.
    ends_with_this = [] if os.name == "nt" else ["--parent", str(os.getpid())]
    # -P: what lies beside a config is no part of Python.
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "flocsim", *words, *ends_with_this],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        cwd=folder, env=environment, encoding="utf-8", errors="replace",
    ) as process:  # fmt: skip
        try:
            said = listen(process, text, quiet)
        except BaseException:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(SAVING)
            except subprocess.TimeoutExpired:
                process.kill()
            raise
    if process.returncode in (INTERRUPTED, -signal.SIGINT):
        raise KeyboardInterrupt
    if process.returncode not in (0, WITHHELD):  # that is a warning, said already
        raise error_of(process.returncode, said)


def path_to_flocsim():
    """What the environment has to say where this flocsim is not installed, but lies in a folder."""
    package = Path(__file__).resolve().parents[3]
    if package.name in INSTALLED:
        return {}
    return {
        "PYTHONPATH": os.pathsep.join(filter(None, [str(package), os.environ.get("PYTHONPATH")]))
    }


def listen(process, text, quiet):
    """The lines that a process prints until it ends, printed here as well."""
    with contextlib.suppress(BrokenPipeError):  # it says why
        process.stdin.write(text)
        process.stdin.close()
    said = []
    for line in process.stdout:
        said.append(line.rstrip("\n"))
        if not quiet:
            print(said[-1])
        elif said[-1].startswith(WARNING):
            warnings.warn(said[-1].removeprefix(WARNING), PlausibilityWarning, STACK)
    process.wait()
    return said


def error_of(code: int, said: Sequence[str]) -> FlocsimError:
    """The error that an exit code stands for, with the last words in a script's terms."""
    last = next((line for line in reversed(said) if line.strip()), "it said nothing")
    for word, meant in WORDS.items():
        last = last.replace(word, meant)
    last = last.removeprefix("flocsim: ")
    if code == STOPPED:
        return FlocsimError(last)
    kind = {UsageError.exit_code: UsageError, FileError.exit_code: FileError}
    return kind.get(code, FlocsimError)(last if code > 0 else f"the run was killed: {last}")
