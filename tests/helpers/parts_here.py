"""The parts of sweeps run in this process, in the place of one for each: seconds less."""

import contextlib
import io
import os
from unittest import mock

from flocsim.__main__ import main
from flocsim.ensembles import script_study as studies
from flocsim.ensembles.script_study import error_of


def run_here(words, text, folder, quiet):
    """What `process.run_command` does."""
    errors, place = io.StringIO(), os.getcwd()
    os.chdir(folder)
    try:
        with contextlib.redirect_stderr(errors), input_of(text):
            code = main(words)
    finally:
        os.chdir(place)
    if code:
        raise error_of(code, errors.getvalue().splitlines())


@contextlib.contextmanager
def input_of(text):
    """The text as standard input."""
    import sys

    before, sys.stdin = sys.stdin, io.TextIOWrapper(io.BytesIO(text.encode()))
    try:
        yield
    finally:
        sys.stdin = before


@contextlib.contextmanager
def used(between=lambda: None):
    """Let Study.run use it; ``between()`` is called before each run."""

    def run(*given):
        between()
        run_here(*given)

    with mock.patch.object(studies, "run_command", run):
        yield
