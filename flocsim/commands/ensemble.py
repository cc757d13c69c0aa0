"""`flocsim ensemble cfg.toml`: the same as `python -m flocsim.ensemble cfg.toml`; and by another
name, `flocsim swarm` and `flocsim kernel`, for a config of that kind of scene."""

from argparse import Namespace
from typing import Any

from flocsim.commands import ENSEMBLES, SUMMARIES
from flocsim.ensembles.cli import add_arguments, run_command


def add_parser(subparsers: Any) -> None:
    for name in ENSEMBLES:
        words = SUMMARIES[name]
        parser = subparsers.add_parser(name, help=words, description=words)
        add_arguments(parser).set_defaults(run=run)


def run(arguments: Namespace) -> int:
    return run_command(arguments)
