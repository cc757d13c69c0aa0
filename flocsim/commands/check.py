"""`flocsim check study.toml`: whether a study's own scene is computed right, at its extremes."""

import itertools
import math
from argparse import ArgumentParser, Namespace
from collections import Counter

from flocsim.commands import add_settings
from flocsim.ensembles.collision.draw import TIGHTER, exact_method
from flocsim.ensembles.config.loader import load_config, settings_in
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.diagnose.accuracy import (
    Bench,
    Comparison,
    ending,
    number,
    setting_of,
    table_line,
)
from flocsim.ensembles.diagnose.preflight import check_study
from flocsim.ensembles.kind import study_of
from flocsim.integrators import Implicit
from flocsim.integrators.base import Integrator
from flocsim.io.arguments import whole
from flocsim.io.results.schema import AGGREGATED, CLASSES, OUTCOMES

COUNT = 2
"""Replicates of each combination of ends, by default."""

TIGHTEST = 1e-14
"""Least tolerance of references [m]: beyond lies rounding."""

CLOSE = 1e-2
"""Error over the smaller r_eq up to which a method without a tolerance is right."""

RIGHT, STATED, WRONG = "within the tolerance", "within the stated error", "failed"

DEPARTED = frozenset(CLASSES) - frozenset(AGGREGATED)
"""Classes of collisions that end apart."""

COLUMNS = {
    "type": -12, "N": 5, "method": 18, "setting": 11, "delta": 7, "repl.": 6,
    "steps": 8, "CPU [ms]": 10, "error [m]": 11, "stated [m]": 12, "  verdict": -1,
}  # fmt: skip


def add_arguments(parser: ArgumentParser) -> None:
    """Check the numerical error of a study. Some replicates of every combination of extreme sizes,
    numbers of vertices and tolerances are run, and again at a hundredth of the tightest
    tolerance. The table gives the error of each, and whether it is within the tolerance, or at
    least within the error that the method states. Use --set for other values, such as the
    stiffness. Nothing is written. Exit code 0 if no run failed, 1 otherwise.

    --count K: replicates of each combination (default: %(default)s)
    """
    parser.add_argument("config", help="config file (TOML)")
    parser.add_argument("--count", type=whole, default=COUNT)
    add_settings(parser)


def extremes_of(config: Config) -> tuple[list[int], list[int]]:
    """Return the places of the smallest and the largest pair, and the least and the largest N.

    Of size classes, and of rates, all places.
    """
    given, vertices = config.scene.given, config.shapes.vertices
    places = [*range(len(config.scene.names))]
    if given and not config.is_kernel:
        places = sorted(places, key=lambda place: sum(given[place][1]))
        places = sorted({places[0], places[-1]})
    return places, sorted({min(vertices), max(vertices)})


def verdict_on(found: Comparison, method: Integrator) -> tuple[str, str]:
    """Return (RIGHT, STATED or WRONG, why it is wrong) of a run by a method."""
    if found.why:
        return WRONG, found.why
    row, exact = found.row, found.exact
    right = method.tolerance
    if not math.isfinite(right):
        right = CLOSE * min(row["r_i"], row["r_j"])
    if found.flipped:
        most = max(right, found.stated) + found.slack
        if found.error <= most and is_close_call(row, exact, most):
            return STATED, f"{ending(row)}, but {ending(exact)} in the reference, within the error"
        return WRONG, f"{ending(row)}, but {ending(exact)} in the reference"
    if found.error <= right:
        return RIGHT, ""
    if found.error <= found.stated:
        return STATED, ""
    return WRONG, f"error {found.error:.3g} m, of the reference at most {found.slack:.2g} m"


def is_close_call(row: dict, exact: dict, most: float) -> bool:
    """Return True if two outcomes may differ by an error of at most ``most`` [m].

    One run just grazes what the other misses, or the collision is at the zone's border D_0.
    """
    one, two = OUTCOMES[row["outcome"]], OUTCOMES[exact["outcome"]]
    if "missed" in (one, two):
        return DEPARTED.issuperset({one, two} - {"missed"})
    alike = (one in AGGREGATED) == (two in AGGREGATED)
    return alike and abs(row["d_c_collision"] - exact["d_c_collision"]) <= most


def run(args: Namespace) -> int:
    """Run all cases and print the table; 0 where all are right or within their stated error."""
    config = load_config(args.config, settings_in(args.settings))
    check_study(config)
    # The tolerances of the study and of its second runs; the reference is a hundred times tighter.
    method = config.integrator.method
    methods = [method, *filter(None, [exact_method(method)])]
    tightest = methods[-1].tolerance
    exact = Implicit(max(TIGHTER * (tightest if math.isfinite(tightest) else 1e-9), TIGHTEST))
    print(
        "Runs at the extremes of sizes, N and tolerance, compared with a reference: Implicit with "
        f"a tolerance of {exact.tolerance:.0e} m.\nerror: largest distance between a point of an "
        "outline and the same point in the reference, at the time when the first of the two runs "
        f"ends\n\n{table_line(COLUMNS)}"
    )
    verdicts: Counter[str] = Counter()
    deltas, bench = config.scene.delta, Bench(study_of(config), exact)
    places = itertools.product(*extremes_of(config), range(args.count))
    for turn, (condition, n, _) in enumerate(places):
        # Other displacements and other random numbers each time, as far as there are any.
        task = (condition, n, deltas[turn % len(deltas)]), turn % config.replicates
        for each in methods:
            found = bench.compare(task, each)
            verdict, why = verdict_on(found, each)
            verdicts[verdict] += 1
            cells = [
                config.scene.names[condition], n, type(each).__name__, setting_of(each),
                f"{task[0][2]:.3g}", task[1], found.steps or "-", number(1e3 * found.cpu, ".2f"),
                number(found.error), number(found.stated), f"  {verdict}{': ' * bool(why)}{why}",
            ]  # fmt: skip
            print(table_line(COLUMNS, cells))
    print(f"\n{verdicts[RIGHT]} {RIGHT}, {verdicts[STATED]} {STATED}, {verdicts[WRONG]} {WRONG}")
    return 1 if verdicts[WRONG] else 0
