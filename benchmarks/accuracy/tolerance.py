"""How many outcomes change with the integrator's tolerance: the numerical error of a study.

    python -m benchmarks.accuracy.tolerance CONFIG [--tolerances 1e-9 1e-10] [--replicates 100]

runs the config's study at every tolerance, in one process, and compares each with the tightest.
"""

import numpy as np

from benchmarks.reporting import Table, begin
from examples.tang2014.changes import OutcomeChanges, changes_between
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.runner import run
from flocsim.errors import UsageError
from flocsim.io.results.schema import Results


def outcome_changes(found: Results, exact: Results) -> OutcomeChanges:
    """The OutcomeChanges of the first runs of ``found`` against those of ``exact``.

    Of the same conditions. Replicates are paired; the shorter of the two decides how many are
    compared. UsageError where the conditions differ.
    """
    same = (
        found.types == exact.types
        and np.array_equal(found.vertices, exact.vertices)
        and np.array_equal(found.delta, exact.delta)
    )
    if not same:
        raise UsageError("the two results are not of the same conditions: name runs of one config")
    outcomes = [each.replicates["outcome"] for each in (found, exact) if each.replicates]
    count = min(each.shape[-1] for each in outcomes)
    a, b = (each[..., :count] for each in outcomes)
    return changes_between(a, b)


def percent_changed(changed: np.ndarray, among: np.ndarray) -> float:
    """Percent of what is in ``among`` that has changed; NaN of nothing."""
    count = np.count_nonzero(among)
    return 100.0 * np.count_nonzero(changed & among) / count if count else np.nan


def study(arguments, tolerance):
    """Results of the config at a tolerance [m]."""
    changes = {"integrator": {"tolerance": tolerance, "check_share": 0.0}}
    if arguments.replicates:
        changes["replicates"] = arguments.replicates
    return run(load_config(arguments.config, changes))


def compare(found, exact):
    """(aggregation flips, zone flips, any flips below the largest δ) in percent."""
    changes = outcome_changes(found, exact)
    polygons = (found.vertices > 1)[None, :, None, None]
    inner = (found.delta < found.delta.max())[None, None, :, None]
    among = np.broadcast_to(polygons & inner, changes.outcome.shape)
    changed = found.replicates["inside"] != exact.replicates["inside"]
    return (
        percent_changed(changes.aggregation, changes.both),
        percent_changed(changed, changes.both),
        percent_changed(changes.outcome, among),
    )


def main():
    """Print the table."""
    tolerances = 1e-7, 1e-8, 1e-9, 1e-10
    arguments = begin(__doc__, ("config", {}), tolerances=tolerances, replicates=0)
    if arguments.quick:
        arguments.replicates, arguments.tolerances = 2, [1e-8, 1e-9]
    results = {tolerance: study(arguments, tolerance) for tolerance in arguments.tolerances}
    exact = results[min(results)]
    columns = ("tolerance [m]", "aggregation flip [%]", "zone flip [%]", "any, inner delta [%]",
               "replicates/s")  # fmt: skip
    table = Table("Outcomes that differ from those at the tightest tolerance", columns)
    for tolerance, found in sorted(results.items(), reverse=True):
        rate = found.replicates["outcome"].size / found.run["wall_time"]
        table.add(f"{tolerance:g}", *map(float, compare(found, exact)), rate)
    table.print()


if __name__ == "__main__":
    main()
