"""`flocsim info`: what a file holds, for a person to read."""

import sys
from argparse import ArgumentParser, Namespace

from flocsim.ensembles.config.sources import read_sources
from flocsim.ensembles.contents import file_kind, text_of, unfinished_text
from flocsim.errors import FileError, visible
from flocsim.io.journal import journal_of
from flocsim.io.seals import held

DESCRIPTION = (
    "Print the contents of a file: conditions, counts, probabilities with 95 % "
    "intervals, and its origin; of a study that is running or was interrupted, the replicates "
    "so far, without touching it."
)


def add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("results", help="file written, or being written, by flocsim")
    parser.add_argument(
        "--config", action="store_true", help="print only the config that it was run with"
    )
    parser.add_argument(
        "--modules", action="store_true",
        help="print only the user's modules that it was run with",
    )  # fmt: skip
    parser.add_argument(
        "--water", action="store_true",
        help="print only how often the equivalent spheres of a study of pairs or rates touch, "
        "with and without the water that they push at each other (a second or two for each pair); "
        "of a shape library, how fast its flocs settle and turn",
    )  # fmt: skip


def run(args: Namespace) -> int:
    journal = journal_of(args.results)
    if journal is not None:
        if args.config or args.modules or args.water:
            raise FileError(f"{journal} has no config: it belongs to a run that has not ended")
        # All kinds of studies, and the engine with them, are wanted here alone.
        from flocsim.ensembles.storage.unfinished import read_unfinished

        print(unfinished_text(read_unfinished(journal)))
        return 0
    if args.water:
        source = held(args.results)
        print("\n".join(file_kind(source, "water").water(source)))
    elif args.config or args.modules:
        kind = file_kind(source := held(args.results), "run")
        print_kept(args, kind.run(kind.read(source)))
    else:
        print(text_of(args.results))
    return 0


def print_kept(args, run):
    """Print the config, the modules, or both, that a file keeps; FileError where it has none."""
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
            raise FileError(f"{args.results} has no modules: its study used none, or was run by a "
                "version of flocsim that kept none")  # fmt: skip
        for place, each in modules.items():
            sys.stdout.write(f"# {visible(place, '')}\n{each['source'].rstrip()}\n")
