"""How many outcomes change with the integrator's tolerance: the numerical error of a study.

    python -m benchmarks.accuracy.tolerance CONFIG [--tolerances 1e-9 1e-10] [--replicates 100]

runs the config's study at every tolerance, in one process, and compares each with the tightest.
"""

import argparse
import subprocess
import sys

import numpy as np

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.estimates.outcome_changes import outcome_changes, percent_changed
from flocsim.ensembles.runner import run


def commit():
    """The commit that is measured, "-dirty" where files differ from it."""
    command = ["git", "describe", "--always", "--dirty"]
    return subprocess.run(command, capture_output=True, text=True).stdout.strip() or "unknown"


def study(arguments, tolerance):
    """Results of the config at a tolerance [m]."""
    changes = {"integrator": {"tolerance": tolerance}}
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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("config")
    parser.add_argument("--tolerances", type=float, nargs="+", default=[1e-7, 1e-8, 1e-9, 1e-10])
    parser.add_argument("--replicates", type=int)
    arguments = parser.parse_args()
    print(f"commit {commit()}; {' '.join(sys.argv)}")
    results = {tolerance: study(arguments, tolerance) for tolerance in arguments.tolerances}
    exact = results[min(results)]
    print("tolerance [m]  aggregation flip          zone flip    any, inner delta  replicates/s")
    for tolerance, found in sorted(results.items(), reverse=True):
        flips = compare(found, exact)
        rate = found.replicates["outcome"].size / found.run["wall_time"]
        shares = "  ".join(f"{flip:15.2f} %" for flip in flips)
        print(f"{tolerance:13g}  {shares}  {rate:12.0f}")


if __name__ == "__main__":
    main()
