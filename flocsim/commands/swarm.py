"""`flocsim swarm cfg.toml`: a study of many bodies; the same command as `flocsim ensemble`."""

from typing import Any

from flocsim.commands.ensemble import run
from flocsim.ensembles.cli import add_arguments


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "swarm", help='run a study of many bodies (scene.kind = "swarm"), as ensemble does'
    )
    add_arguments(parser).set_defaults(run=run)
