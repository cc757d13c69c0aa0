"""`flocsim ensemble cfg.toml`: the same as `python -m flocsim.ensemble cfg.toml`."""

from argparse import Namespace
from typing import Any

from flocsim.ensembles.cli import add_arguments, run_command


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser("ensemble", help="run the ensemble of a config file")
    add_arguments(parser).set_defaults(run=run)


def run(arguments: Namespace) -> int:
    return run_command(arguments)
