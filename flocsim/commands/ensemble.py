"""`flocsim ensemble cfg.toml`: the same as `python -m flocsim.ensemble cfg.toml`; and by another
name, `flocsim swarm` and `flocsim kernel`, for a config of that kind of scene."""

from argparse import Namespace
from typing import Any

from flocsim.ensembles.cli import add_arguments, run_command

NAMES = {
    "ensemble": "run the ensemble of a config file",
    "kernel": 'compute rates of encounters by size classes (scene.kind = "kernel"): collision '
    "kernels and efficiencies for population balances",
    "swarm": 'run a study of many bodies (scene.kind = "swarm"), as ensemble does',
}


def add_parser(subparsers: Any) -> None:
    for name, words in NAMES.items():
        parser = subparsers.add_parser(name, help=words, description=words)
        add_arguments(parser).set_defaults(run=run)


def run(arguments: Namespace) -> int:
    return run_command(arguments)
