"""`flocsim compare a.h5 b.h5`: what one study has more of than another."""

from argparse import Namespace
from typing import Any

from flocsim.commands import SUMMARIES
from flocsim.ensembles.contents import file_kind, studies
from flocsim.io.seals import held


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "compare",
        help=SUMMARIES["compare"],
        description="Print the differences between two results files, at every condition, or time, "
        "that both have, with 95 % intervals: of paired replicates where both have drawn the same "
        "ones (the same seed), otherwise of independent samples. What the studies differ in is "
        "printed first.",
    )
    parser.add_argument("first", help="results file written by flocsim ensemble")
    parser.add_argument("second", help="results file to compare with it")
    known = "; ".join(
        f"of {kind.title} "
        + ", ".join(f"{name} ({words})" for name, words in kind.compared.items())
        for kind in studies() if kind.compared
    ).replace("%", "%%")  # fmt: skip
    parser.add_argument(
        "--quantity", "--probability", metavar="NAME",
        help=f"what to compare: {known} (default: the first)",
    )  # fmt: skip
    parser.set_defaults(run=run)


def run(args: Namespace) -> int:
    """Print the comparison; the exit code."""
    from flocsim.ensembles.comparison import compare

    both = [file_kind(source := held(path), "compare").opened(source)
            for path in (args.first, args.second)]  # fmt: skip
    comparison = compare(*both)
    print(comparison.table(*filter(None, [args.quantity])))
    return 0
