"""The subcommands of ``flocsim``; ``fit_pictures`` and ``processes`` are the work behind ``fit``,
``show`` has those that show what is in a file.

The file of a command has ``add_arguments(parser)``, ``run(arguments)``, which gives the exit code,
and a DESCRIPTION; each has a line in SUMMARIES, and one in FILES where its file has another name.
"""

import importlib
from typing import Any

SUMMARIES = {
    "init": "write an example config file",
    "fit": "fit spheropolygons to the flocs in pictures",
    "shapes": "list, select and merge the flocs of shape libraries",
    "check": "check a study's scene at the extremes of its sizes, stiffness and tolerance",
    "ensemble": "run the ensemble of a config file",
    "kernel": 'compute rates of encounters by size classes (scene.kind = "kernel"): collision '
    "kernels and efficiencies for population balances",
    "swarm": 'run a study of many bodies (scene.kind = "swarm"), as ensemble does',
    "sweep": "run a study at several values of a key",
    "trajectory": "run one replicate of a config and draw it as a strip of frames",
    "plot": "draw the figures of a results file or a shape library",
    "report": "write one HTML page about a file",
    "export": "write tables, motion or rates of encounters for other programs",
    "compare": "compare two results files: differences of probabilities with 95 %% intervals",
    "strength": "find the rate at which a flow opens the bonds of a study",
    "work-precision": "flips and errors against CPU time, for the methods and tolerances of a "
    "config",
    "info": "describe a results file, a running study, a library, a trajectory or a sweep",
}
"""{command: what it does}, in the order of the help, which needs no more of them than this."""


def add_allowed(parser: Any) -> None:
    """Add the options that say which modules a file may name; `allowed_by` reads them."""
    parser.add_argument("--folder", metavar="DIR",
        help="folder of the study's shape library and of the modules of its own classes, which are "
        "run (default: the library is looked for beside the results, and no module is "
        "run)")  # fmt: skip
    parser.add_argument("--own", action="append", default=[], metavar="MODULE",
        help="installed module of the study's own classes, which is imported; may be "
        "repeated")  # fmt: skip


def allowed_by(arguments: Any) -> Any:
    """Return the Allowed of the command line."""
    from flocsim.ensembles.config.sources import Allowed

    return Allowed(arguments.folder, arguments.own)


ENSEMBLES = "ensemble", "kernel", "swarm"
"""A study by the name of its kind of scene."""

FILES = {
    **{name: ("commands.show", f"_{name}") for name in ("plot", "export", "compare", "info")},
    **dict.fromkeys(ENSEMBLES, ("ensembles.cli", "")),
}
"""{command: (the module that it shares, how the names of its functions end)}."""


def add_command(subparsers: Any, command: str) -> None:
    """Add the parser of a command."""
    name, end = FILES.get(command, (f"commands.{command.replace('-', '_')}", ""))
    module, summary = importlib.import_module(f"flocsim.{name}"), SUMMARIES[command]
    about = getattr(module, "DESCRIPTION", summary)
    parser = subparsers.add_parser(command, help=summary, description=about)
    getattr(module, f"add_arguments{end}")(parser)
    parser.set_defaults(run=getattr(module, f"run{end}"))
