"""`flocsim info`: what is in a file, for a person to read."""

import argparse
import sys
from typing import Any

from flocsim.commands import add_allowed, allowed_by
from flocsim.ensembles.config.sources import read_sources
from flocsim.ensembles.contents import info_of, open_kind, text_of, unfinished_text
from flocsim.errors import FileError
from flocsim.io.journal import journal_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Print the contents of a file: conditions, counts, probabilities with 95 % intervals,
    and how it was made. Of a study that is running or was interrupted, print the replicates so
    far, without disturbing it.

    results: file written, or being written, by flocsim
    --numerics: add the numerical error of each probability to the table
    --all: add all columns to the table
    --config: print only the config of the study
    --modules: print only the user's modules that the study used
    --water: print only how often the equivalent spheres of a study of pairs or kernels touch, with
        and without hydrodynamic interaction (a second or two for each pair); of a shape library,
        how fast its flocs settle and rotate
    """
    parser.add_argument("results")
    for name in ("--numerics", "--all", "--config", "--modules", "--water"):
        parser.add_argument(name, action="store_true")
    add_allowed(parser)


def run(args: argparse.Namespace) -> int:
    """Print what was asked for; returns the exit code."""
    journal = journal_of(args.results)
    if journal is not None:
        if args.config or args.modules or args.water:
            raise FileError(f"{journal} has no config: it belongs to an unfinished run")
        # All kinds of studies, and the engine with them, are wanted here alone.
        from flocsim.ensembles.storage.unfinished import read_unfinished

        print(unfinished_text(read_unfinished(journal)))
    elif args.water:
        kind, file = open_kind(args.results, "water")
        print("\n".join(kind.water(file, allowed_by(args))))
    elif args.config or args.modules:
        kind, file = open_kind(args.results)
        print_inputs(args, getattr(kind.read(file), "run", {}))
    elif args.numerics or args.all:
        kind, file = open_kind(args.results, "detailed")
        found = kind.read(file)
        table = kind.detailed(found, args.numerics, args.all)
        print(text_of(args.results, kind, found, table))
    else:
        print(info_of(args.results))
    return 0


def print_inputs(args: argparse.Namespace, run: dict[str, Any]) -> None:
    """Print the config, the modules, or both, that a file stores; FileError where it has none."""
    if args.config:
        if not run.get("config"):
            raise FileError(f"{args.results} has no config: it was not written by flocsim ensemble")
        sys.stdout.write(str(run["config"]))
    if args.modules:
        try:
            modules = read_sources(run)
        except ValueError as error:
            raise FileError(f"{args.results} has no readable results: {error}") from error
        if not modules:
            raise FileError(f"{args.results} has no modules: its study used none")
        for place, each in modules.items():
            sys.stdout.write(f"# {place}\n{each['source'].rstrip()}\n")
