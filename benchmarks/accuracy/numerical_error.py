"""Whether the interval of what numerics change holds the true change, condition by condition.

    python -m benchmarks.accuracy.numerical_error [--presets tang2014 si] [--k-n 20 2e3 2e5]
        [--tolerances 1e-6 1e-7 1e-8 1e-9] [--replicates 400] [--folder DIR] [--choices 100]
        [--size N]

runs Types I to III, N = 1, 16, 64 and δ from 0 to 1 at each preset, stiffness k_n [N/m] (k_t a
tenth of it) and tolerance, at those of its second and third runs, and at 1e-12 m, taken for the
truth. What has been run is kept in a folder and not run again. Small studies of ``--size``
replicates, by default as many as there are, are drawn from these, with replacement, and of each
those are run again that the study itself would run again. Of each probability: in how many of them
its interval of the change holds the true one, in the worst condition and in the mean. Goals: in
93 % of them in each condition, and at most 20 % of the time for second and third runs at 1,000
replicates.
"""

import itertools
from pathlib import Path

import numpy as np

from benchmarks.reporting import EXAMPLES, Table, begin
from flocsim.ensembles.collision.draw import TIGHTER, further_runs, third_tolerance
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.estimates.numerical import change_intervals, count_changes
from flocsim.ensembles.estimates.statistics import CODES, count, probabilities
from flocsim.ensembles.runner import run
from flocsim.io.results.events import flips_easily
from flocsim.io.results.schema import NOT_APPLICABLE, PROBABILITIES

QUICKSTART = EXAMPLES / "quickstart.toml"
DELTA = [0.0, 0.25, 0.5, 0.75, 1.0]
GOAL, MOST_TIME, AT_COUNT = 0.93, 0.2, 1000
TRUTH = 1e-12
MORE_STEPS = 20
"""Times the step budget of the config from 1e-10 m on."""

ENOUGH = 0.5
"""Share of the small studies in which a condition has trials, for it to count."""


def outcomes_at(arguments, preset, stiffness, tolerance):
    """({column: codes}, steps, CPU time [s]) of all replicates at a tolerance."""
    path = Path(arguments.folder) / f"{preset}_{stiffness:g}_{tolerance:g}_1.npz"
    if not path.exists():
        steps = load_config(QUICKSTART).integrator.max_steps
        steps *= MORE_STEPS if tolerance < 1e-10 else 1
        rows = run(load_config(QUICKSTART, {
            "preset": preset, "replicates": arguments.replicates, "seed": 1,
            "integrator": {"check_share": 0.0, "tolerance": float(f"{tolerance:.3g}"),
                           "max_steps": steps},
            "scene": {"types": ["I", "II", "III"], "delta": DELTA},
            "shapes": {"source": "library", "file": "synthetic", "vertices": [1, 16, 64],
                       "pool": 10},
            "forces": {"contact": {"k_n": stiffness, "k_t": 0.1 * stiffness}},
        })).replicates  # fmt: skip
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, **{name: rows[name] for name in (*CODES, "steps", "rejected")})
    with np.load(path) as rows:
        few = np.s_[..., : arguments.replicates]
        return [rows[name][few] for name in CODES], (rows["steps"] + rows["rejected"])[few]


def levels_of(arguments, preset, stiffness, tolerance):
    """outcomes_at of the first, second and third run."""
    second = float(f"{TIGHTER * tolerance:.3g}")
    each = tolerance, second, third_tolerance(second)
    return [outcomes_at(arguments, preset, stiffness, float(f"{t:.3g}")) for t in each]


def further(first, rng, number=None):
    """How often each replicate of a study would be run again, of its ``number`` first ones."""
    number = number or first[0].shape[-1]
    seed = int(rng.integers(2**31))
    of_all, of_easy = (np.array([further_runs(seed, k, "auto", easily) for k in range(number)])
                       for easily in (False, True))  # fmt: skip
    easily = flips_easily(first[0], first[2])
    return easily, of_all, of_easy


def held(levels, truth, choices, size, rng):
    """{name: (studies with trials, those that hold the truth, half-widths)}."""
    found = dict.fromkeys(PROBABILITIES)
    for _ in range(choices):
        some = rng.integers(0, truth[0].shape[-1], size)
        one, two, three, true = ([each[..., some] for each in codes]
                                 for codes in (*levels, truth))  # fmt: skip
        easily, of_all, of_easy = further(one, rng)
        more = np.where(easily, of_easy, of_all)
        second, third = ([np.where(more >= k, each, NOT_APPLICABLE) for each in codes]
                         for k, codes in ((1, two), (2, three)))  # fmt: skip
        counts = count(*one) | count_changes(one, second, third)
        exact, here = probabilities(count(*true)), probabilities(counts)
        for name, (low, high) in change_intervals(counts).items():
            change = exact[name] - here[name]
            seen = np.isfinite(change) & np.isfinite(low)
            holds = seen & (low - 1e-12 <= change) & (change <= high + 1e-12)
            parts = np.stack([seen, holds, np.where(seen, 0.5 * (high - low), 0.0)])
            found[name] = parts if found[name] is None else found[name] + parts
    return found


def cost(levels, steps, rng):
    """Steps of second and third runs over those of all runs, at AT_COUNT replicates."""
    easily, of_all, of_easy = further(levels[0], rng, AT_COUNT)
    spent = 0.0
    for k in (1, 2):
        share = np.where(easily, np.mean(of_easy >= k), np.mean(of_all >= k))
        spent += float(np.mean(share * steps[k]))
    return spent / (spent + float(np.mean(steps[0])))


def main():
    """Print the table, and whether the goals are reached."""
    arguments = begin(
        __doc__, presets=("tang2014", "si"), k_n=(20.0, 2e3, 2e5),
        tolerances=(1e-6, 1e-7, 1e-8, 1e-9), replicates=400, choices=100, size=0,
        folder="numerical_error",
    )  # fmt: skip
    if arguments.quick:
        arguments.replicates, arguments.tolerances = 20, [1e-6]
        arguments.presets, arguments.k_n, arguments.choices = ["tang2014"], [20.0], 10
    rng = np.random.default_rng(1)
    columns = ("preset", "k_n", "tolerance", "flips", "missed by 2nd", "conditions", "entries",
               "below goal", "least", "mean", "half-width pr_a", "steps [%]")  # fmt: skip
    table = Table(f"Intervals of the change to {TRUTH:g} m", columns)
    conditions, worst, dearest = 0, [], []
    for preset, stiffness, tolerance in itertools.product(
        arguments.presets, arguments.k_n, arguments.tolerances
    ):
        truth, _ = outcomes_at(arguments, preset, stiffness, TRUTH)
        levels, steps = zip(*levels_of(arguments, preset, stiffness, tolerance), strict=True)
        first, second, exact = levels[0][0], levels[1][0], truth[0]
        found = held(levels, truth, arguments.choices, arguments.size or truth[0].shape[-1], rng)
        shares, half = [], []
        for name, (seen, holds, widths) in found.items():
            enough = seen >= ENOUGH * arguments.choices
            shares.append((holds[enough] / seen[enough]).ravel())
            if name == "pr_a":
                half, conditions = widths[enough] / seen[enough], conditions + int(enough.sum())
                of_pr_a = int(enough.sum())
        share = np.concatenate(shares)
        worst.append(share.min())
        dearest.append(cost(levels, steps, rng))
        table.add(
            preset, stiffness, tolerance, int(np.sum(first != exact)),
            int(np.sum((first == second) & (first != exact))), of_pr_a, share.size,
            int(np.sum(share < GOAL)), share.min(), share.mean(), np.mean(half),
            100.0 * dearest[-1],
        )  # fmt: skip
    table.print()
    if worst:
        reached = "reached" if min(worst) >= GOAL else "not reached"
        print(
            f"{conditions} conditions of pr_a; least {min(worst):.3f} (goal: {GOAL:g}: {reached}); "
            f"second and third runs take {100.0 * max(dearest):.0f} % of all steps at most "
            f"(goal, of the time: {100.0 * MOST_TIME:g} %)"
        )


if __name__ == "__main__":
    main()
