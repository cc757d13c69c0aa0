"""Whether the stated numerical error of each probability covers the true share of flips.

    python -m benchmarks.accuracy.numerical_error [CONFIG] [--seeds 1 2 3] [--tolerance 1e-12]

runs the config's study (default: examples/quickstart.toml) as it is, a share of it checked, and
then every replicate again at the tolerance, which is taken for the truth, in one process. Of each
probability: in how many conditions with trials the stated error is at least the share of all
trials that flip. Goal: in 90 % of them.
"""

import time
from pathlib import Path

import numpy as np

from benchmarks.reporting import Table, parser_of, print_heading
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.estimates.numerical import count_changes
from flocsim.ensembles.estimates.statistics import CODES
from flocsim.ensembles.runner import run
from flocsim.io.results.events import events_of

QUICKSTART = Path(__file__).parents[2] / "examples" / "quickstart.toml"
GOAL = 90.0
"""Percent of conditions."""
MORE_STEPS = 20
"""Times the step budget of the config for the truth."""


def study(arguments, seed, **integrator):
    """(Results, CPU time [s]) of the config at a seed, with entries of [integrator] replaced."""
    changes = {"seed": seed, "integrator": integrator}
    if arguments.replicates:
        changes["replicates"] = arguments.replicates
    began = time.process_time()
    return run(load_config(arguments.config, changes)), time.process_time() - began


def compare(found, exact):
    """{probability: (stated, true)}: errors of all conditions with trials, as flat arrays."""
    codes = [[each.replicates[name] for name in CODES] for each in (found, exact)]
    changes, trials = count_changes(*codes), events_of(found.probabilities)
    pairs = {}
    for name, (number, _, _) in trials.items():
        flips = changes[f"n_gained_{name}"] + changes[f"n_lost_{name}"]
        stated = found.probabilities[f"{name}_numerical"]
        seen = (number > 0) & np.isfinite(stated)
        pairs[name] = stated[seen], flips[seen] / number[seen]
    return pairs


def sampling_of(found, name):
    """Half-widths of the 95 % intervals of all conditions with trials."""
    low, high = (found.probabilities[f"{name}_{end}"] for end in ("low", "high"))
    return (0.5 * (high - low))[np.isfinite(low)]


def main():
    """Print the table, and whether the goal is reached."""
    parser = parser_of(__doc__)
    parser.add_argument("config", nargs="?", default=QUICKSTART)
    parser.add_argument("--tolerance", type=float, default=1e-12)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--replicates", type=int)
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.replicates = arguments.replicates or 4
    print_heading()
    steps = MORE_STEPS * load_config(arguments.config).integrator.max_steps
    pairs, sampling, checked, flipped, wrong, total = {}, {}, 0, 0, 0, 0
    seconds = np.zeros(2)
    for seed in arguments.seeds:
        found, cost = study(arguments, seed)
        _, plain = study(arguments, seed, check_share=0.0)
        exact, _ = study(arguments, seed, check_share=0.0, tolerance=arguments.tolerance,
                         max_steps=steps)  # fmt: skip
        seconds += cost, plain
        for name, pair in compare(found, exact).items():
            pairs.setdefault(name, []).append(pair)
            sampling.setdefault(name, []).append(sampling_of(found, name))
        checked += found.probabilities["n_checked"].sum()
        flipped += found.probabilities["n_flipped"].sum()
        wrong += np.sum(found.replicates["outcome"] != exact.replicates["outcome"])
        total += found.replicates["outcome"].size
    columns = ("probability", "conditions", "covered [%]", "stated, mean", "true, mean",
               "true, largest", "sampling, mean")  # fmt: skip
    table = Table("Stated numerical error against the true share of flips", columns)
    covered_all = []
    for name, parts in pairs.items():
        stated, true = (np.concatenate(each) for each in zip(*[
            (one.ravel(), other.ravel()) for one, other in parts], strict=True))  # fmt: skip
        covered = stated >= true
        covered_all.append(covered)
        half = np.concatenate([each.ravel() for each in sampling[name]])
        table.add(name, len(true), 100.0 * covered.mean(), stated.mean(), true.mean(), true.max(),
                  half.mean())  # fmt: skip
    table.print(arguments.markdown)
    share = 100.0 * np.concatenate(covered_all).mean()
    verdict = "reached" if share >= GOAL else "not reached"
    print(
        f"covered in {share:.1f} % of all (goal: {GOAL:g} %: {verdict}); {wrong} of {total} "
        f"outcomes differ from those at {arguments.tolerance:g} m; {checked} were run again, "
        f"{flipped} of them flipped; "
        f"CPU time {seconds[0] / seconds[1]:.2f} times that without"
    )


if __name__ == "__main__":
    main()
