"""`flocsim sweep s.toml --over KEY=1,2,3`: one study at several values of its keys, in one file."""

import re
import signal
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from shlex import quote
from types import FrameType
from typing import Any

from flocsim.commands import add_overwrite, add_settings
from flocsim.ensembles.cli import continuing
from flocsim.ensembles.config.loader import parse_setting, settings_in
from flocsim.ensembles.parallel.communicator import StopRequested
from flocsim.errors import UsageError
from flocsim.process import STOPPED, handle

COMMAS = re.compile(r""",(?=(?:[^"'\[\]]|"[^"]*"|'[^']*'|\[[^\]]*\])*$)""")
"""Commas outside quotes and brackets."""


def add_arguments(parser: ArgumentParser) -> None:
    """Run a study at every value of a key, or at all combinations of several, and join the results
    in one file whose tables have the keys as their first dimensions. The results of each value
    are stored in the folder NAME.parts beside it; --resume continues from there. On a cluster, run
    the commands that --dry-run prints, one for each value; --resume then joins their results.

    config: config file (TOML)
    --over KEY=VALUE,…: a key and its values, e.g. forces.van_der_waals.hamaker=1e-20,1e-19; may be
        repeated
    --output FILE: joined file (default: NAME-sweep.h5)
    --jobs N: processes on this machine
    --resume: continue a sweep, extend it, or join its parts
    --dry-run: print a command for each value, and stop
    """
    add = parser.add_argument
    add("config")
    add("--over", action="append", default=[])
    add_settings(parser)
    add("-o", "--output")
    add("--jobs", type=int, default=1)
    add("--resume", action="store_true")
    add_overwrite(parser)
    add("--dry-run", action="store_true")


def values_of(text: str) -> tuple[str, list[Any]]:
    """Return (key, values) of "forces.contact.k_n=1,2" or "…='10 N/m','20 N/m'"."""
    key, equals, values = text.partition("=")
    if not equals or not key.strip() or not values.strip():
        raise UsageError(f"--over {text!r}: write KEY=VALUE,VALUE")
    found = [parse_setting(f"{key}={value}") for value in COMMAS.split(values) if value.strip()]
    return ".".join(found[0][0]), [value for _, value in found]


def run(args: Namespace) -> int:
    """Run what is missing and join it; return the exit code."""
    handle(interrupt)
    try:
        return run_study(args)
    except (KeyboardInterrupt, StopRequested) as error:
        # The process of a part may have been stopped alone, and has said by what.
        who = str(error).partition(":")[0] or "stopped by SIGINT"
        print(f"flocsim: {who}: finished results are saved\n{continuing()}", file=sys.stderr)
        return STOPPED


def run_study(args: Namespace) -> int:
    """Do what the arguments ask for; return the exit code."""
    from flocsim.ensembles.script_study import Study, settings_of
    from flocsim.ensembles.sweep import planned, sweep

    pairs = [values_of(text) for text in args.over]
    over = dict(pairs)
    if not pairs:
        raise UsageError("sweep needs --over KEY=VALUE,VALUE")
    if len(over) < len(pairs):
        raise UsageError("--over names the same key twice: give all its values at once")
    study = Study(args.config).with_(settings_in(args.settings))
    output = args.output or f"{Path(args.config).stem}-sweep.h5"
    if args.dry_run:
        for path, part in planned(study, over, Path(output)).items():
            words = " ".join(f"--set {quote(f'{k}={v}')}" for k, v in settings_of(part.overrides))
            print(f"flocsim ensemble {quote(args.config)} {words} -o {quote(str(path))}")
        return 0
    mode = "resume" if args.resume else "new"
    sweep(study, over, output, jobs=args.jobs, mode=mode, overwrite=args.overwrite, tell=print)
    print(output)
    return 0


def interrupt(number: int, frame: FrameType | None) -> None:
    """Do as at Ctrl-C, so that the part that runs saves its rows."""
    raise KeyboardInterrupt(f"stopped by {signal.Signals(number).name}")
