"""`flocsim compare a.h5 b.h5`: what one study has more of than another."""

from argparse import Namespace
from typing import Any

from flocsim.commands import SUMMARIES
from flocsim.io.results.schema import COMPARED
from flocsim.io.results.swarm_file import COUNTS


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "compare",
        help=SUMMARIES["compare"],
        description="Print the differences of a probability between two results files, at every "
        "condition that both have, with 95 % intervals: of replicates paired where both have "
        "drawn the same orientations (studies of one seed), of independent samples else. What the "
        "studies differ in comes first.",
    )
    parser.add_argument("first", help="results file that flocsim ensemble wrote")
    parser.add_argument("second", help="another one")
    known = "; ".join(f"{name} {words}" for name, words in COMPARED.items())
    parser.add_argument(
        "--probability", default="pr_a", choices=COMPARED,
        help=f"{known} (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--quantity", default="mean_size", choices=COUNTS,
        help="of swarms: what is compared, a column of their counts (default: %(default)s)",
    )  # fmt: skip
    parser.set_defaults(run=run)


def run(args: Namespace) -> int:
    """Print the comparison; the exit code."""
    from flocsim.ensembles.studies.compare import SwarmComparison, compare
    from flocsim.ensembles.studies.opened import opened
    from flocsim.io.contents import RESULTS, SWARM

    first, second = (opened(path, (RESULTS, SWARM)) for path in (args.first, args.second))
    comparison = compare(first, second)
    of_swarms = isinstance(comparison, SwarmComparison)
    print(comparison.table(args.quantity if of_swarms else args.probability))
    return 0
