"""The subcommands of ``flocsim``, a file each; ``fit_pictures`` is the work behind ``fit``.

The file of a command has ``add_arguments(parser)``, whose docstring is the command's help
(`flocsim.io.arguments.document`), and ``run(arguments)``, which returns the exit code. Each has a
line in SUMMARIES. Options of several commands, and their help:

--output FILE: file to write
--overwrite: replace files that exist; each is kept, study.h5 as study.1.h5
--quiet: print warnings and errors only
--set KEY=VALUE: override any value of the config, as in flocsim ensemble; may be repeated
--folder DIR: folder of the study's shape library and of the modules of its own classes, which are
    run (default: the library is looked for beside the results, and no module is run)
--own MODULE: installed module of the study's own classes, which is imported; may be repeated
"""

import importlib
from typing import Any

from flocsim.io.arguments import document

SUMMARIES = {
    "study": "pictures of flocs to a report, in one command",
    "init": "write an example config file",
    "fit": "fit spheropolygons to the flocs in pictures",
    "shapes": "list, select and merge the flocs of shape libraries",
    "check": "check the numerical error of a study at the extremes of its sizes and tolerance",
    "ensemble": "run the ensemble of a config file",
    "kernel": "compute collision kernels and efficiencies of size classes for population balances "
    '(scene.kind = "kernel")',
    "swarm": 'run a study of many bodies (scene.kind = "swarm"), as ensemble does',
    "sweep": "run a study at several values of a key",
    "trajectory": "run one replicate of a config and draw it as a strip of frames",
    "plot": "draw the figures of a results file or a shape library",
    "report": "write one HTML page about a file",
    "export": "write tables, motion or collision kernels for other programs",
    "compare": "compare two results files: differences of probabilities with 95 %% intervals",
    "strength": "find the rate at which a flow opens the bonds of a study",
    "work-precision": "measure flips, errors and CPU time of a config at many tolerances",
    "info": "describe a results file, a running study, a library, a trajectory or a sweep",
}
"""{command: what it does}, in the order of the help, which needs no more of them than this."""

STUDIES = frozenset({"ensemble", "kernel", "swarm"})
"""Commands that run a study, also under mpirun: one command by the names of kinds of scenes."""


def add_overwrite(parser: Any) -> None:
    """Add the option that lets a command replace files."""
    parser.add_argument("--overwrite", action="store_true")


def add_settings(parser: Any) -> None:
    """Add the option that overrides values of a config."""
    parser.add_argument("--set", action="append", default=[], dest="settings")


def add_allowed(parser: Any) -> None:
    """Add the options that say which modules a file may name; `allowed_by` reads them."""
    parser.add_argument("--folder")
    parser.add_argument("--own", action="append", default=[])


def allowed_by(arguments: Any) -> Any:
    """Return the Allowed of the command line."""
    from flocsim.ensembles.config.sources import Allowed

    return Allowed(arguments.folder, arguments.own)


def add_command(subparsers: Any, command: str) -> None:
    """Add the parser of a command."""
    name = "ensembles.cli" if command in STUDIES else f"commands.{command.replace('-', '_')}"
    module, summary = importlib.import_module(f"flocsim.{name}"), SUMMARIES[command]
    parser = subparsers.add_parser(command, help=summary)
    module.add_arguments(parser)
    document(parser, module.add_arguments.__doc__, __doc__)
    parser.set_defaults(run=module.run)
