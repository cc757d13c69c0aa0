"""`flocsim compare`: what one study has more of than another."""

import argparse

from flocsim.ensembles.contents import compare, open_kind, studies


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Print the differences between two results files, at every condition, or time, that both
    have, with 95 % intervals: of paired replicates where both have drawn the same ones (the
    same seed), otherwise of independent samples. What the studies differ in is printed first.

    first: results file written by flocsim ensemble
    second: results file to compare with it
    --numerics: add how much each difference would change if all runs were exact
    """
    known = [
        f"for {kind.title}: "
        + ", ".join(f"{name} ({words})" for name, words in kind.compared.items())
        for kind in studies()
        if kind.compared
    ]
    words = f"what to compare: {'; '.join(known)} (default: the first)"
    parser.add_argument("first")
    parser.add_argument("second")
    parser.add_argument("--quantity", metavar="NAME", help=words.replace("%", "%%"))
    parser.add_argument("--numerics", action="store_true")


def run(args: argparse.Namespace) -> int:
    """Print the comparison; returns the exit code."""
    both = []
    for path in (args.first, args.second):
        kind, file = open_kind(path, "compare")
        both.append(kind.opened(file))
        print(f"{path}: {kind.source(both[-1]) or 'its source is not stated'}")
    print(compare(*both).table(args.quantity, args.numerics))
    return 0
