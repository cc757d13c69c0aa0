"""Whether intervals hold what undecided and failed replicates would have come to.

    python -m benchmarks.accuracy.undecided [--studies 1000] [--shares 0 .01 .05 .2 .6]

runs a large study of pairs and one of rates, all of which is decided, and takes small studies from
them: of pairs 40 replicates a condition, drawn with replacement; of rates 8 scrambles. Of each a
share is made undecided, the replicates that took most steps (budget), or failed, as by a kernel
that gives nan at chosen orientations of i (nan). The truth is what the large study has. Goal: the
95 % intervals of each probability, efficiency and rate hold it in 95 % of the small studies.
"""

import sys

import numpy as np

from benchmarks.reporting import EXAMPLES, Table, begin
from flocsim.ensembles.collision.draw import points_of
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.estimates.capture import estimate, weighted
from flocsim.ensembles.estimates.statistics import (
    clustered_probabilities,
    pooled_sums,
    probabilities,
)
from flocsim.ensembles.kind import study_of
from flocsim.ensembles.runner import run
from flocsim.io.confidence import efficiency
from flocsim.io.results.kernel_group import ESTIMATES
from flocsim.io.results.schema import NOT_APPLICABLE, OUTCOMES, POOLED_PROBABILITIES, PROBABILITIES
from tests.helpers.tabulate import tabulate

DELTA = [0.0, 0.5, 1.0]
PAIRS = {
    "replicates": 2000, "scene": {"delta": DELTA}, "shapes": {"vertices": [16], "pool": 10},
    "integrator": {"check_share": 0.0},
}  # fmt: skip
SCRAMBLES_RUN = 64
RATES = {
    "replicates": 16 * SCRAMBLES_RUN, "shapes": {"vertices": [1], "file": "synthetic"},
    "scene": {"meeting": ["shear"], "sizes": ["5 um", "8 um"], "scrambles": SCRAMBLES_RUN},
    "integrator": {"check_share": 0.0},
}  # fmt: skip
SEEDS = range(1, 7)
"""Of the rates: so many times as many scrambles."""
SMALL, SCRAMBLES = 40, 8
UNDECIDED, FAILED = OUTCOMES.index("undecided"), OUTCOMES.index("failed")
GOAL = 95.0
"""Percent of the small studies."""


def hidden(rows, share, how):
    """Flags as the rows: a ``share`` of each condition, the costliest or those at some angles."""
    if share == 0.0:
        return np.zeros(rows["outcome"].shape, dtype=bool)
    key = rows["steps"] + rows["rejected"] if how == "budget" else rows["angle_i"]
    return key > np.quantile(key, 1.0 - share, axis=-1, keepdims=True)


def cut(rows, share, how):
    """The rows where that share has no outcome; what failed is known to have touched."""
    gone = hidden(rows, share, how)
    changed = {"outcome": np.where(gone, UNDECIDED if how == "budget" else FAILED, rows["outcome"]),
               "bond": np.where(gone, NOT_APPLICABLE, rows["bond"])}  # fmt: skip
    if how == "budget":
        changed["inside"] = np.where(gone, NOT_APPLICABLE, rows["inside"])
    return rows | changed


def of_pairs(rows):
    """{name: (value, low, high)} of all probabilities, those pooled, and efficiencies."""
    codes = [rows[name] for name in ("outcome", "inside", "bond")]
    table = tabulate(*codes)
    pooled = clustered_probabilities(pooled_sums(*codes))
    ends = ("", "_low", "_high")
    found = {name: [table[name + end] for end in ends] for name in PROBABILITIES}
    found |= {f"{name}, pooled": [pooled[name + end] for end in ends]
              for name in POOLED_PROBABILITIES}  # fmt: skip
    axial = efficiency(table | probabilities(table), np.array(DELTA), True)
    return found | {"efficiency, axial": axial}


def of_rates(points, rows, scrambles):
    """The same of the rates of a pair of sizes."""
    values = estimate(points, rows, scrambles)
    return {name: [values[f"{name}{end}"] for end in ("", "_low", "_high")] for name in ESTIMATES}


def held_by(found, truth):
    """(how many intervals hold the truth, of how many): of values that exist."""
    value = np.asarray(truth[0])
    seen = np.isfinite(value)
    low, high = (np.nan_to_num(np.asarray(each), nan=end)[seen]
                 for each, end in zip(found[1:], (0.0, np.inf), strict=True))  # fmt: skip
    slack = 1e-9 * np.abs(value[seen])
    return int(np.sum((low <= value[seen] + slack) & (value[seen] - slack <= high))), seen.sum()


def pair_samples(arguments):
    """(truth, sample(rng, share, how)) of studies of pairs."""
    quick = {"replicates": 200} if arguments.quick else {}
    rows = run(load_config(EXAMPLES / "quickstart.toml", PAIRS | quick)).replicates
    names = ("outcome", "inside", "bond", "steps", "rejected", "angle_i")
    rows = {name: rows[name] for name in names}
    keep = ~np.isin(rows["outcome"], (UNDECIDED, FAILED)).any(axis=(0, 1, 2))
    rows = {name: each[..., keep] for name, each in rows.items()}

    def sample(rng, share, how):
        some = rng.integers(0, keep.sum(), SMALL)
        return of_pairs({name: each[..., some] for name, each in changed(share, how).items()})

    made = {}

    def changed(share, how):
        if (share, how) not in made:
            made[share, how] = cut(rows, share, how)
        return made[share, how]

    return of_pairs(rows), sample


def of_seed(seed):
    """(weighted points, rows) of the encounters of 5 with 8 um."""
    config = load_config(EXAMPLES / "kernel.toml", RATES | {"seed": seed})
    study, found = study_of(config), run(config)
    rows = {name: each[1, 0, 0] for name, each in found.replicates.items()}
    points = points_of(seed, SCRAMBLES_RUN, 0, found.count)
    return weighted(study, (1, 1), rows, points), rows


def rate_samples(arguments):
    """The same of studies of rates: small ones are of some scrambles."""
    parts = [of_seed(seed) for seed in (SEEDS[:2] if arguments.quick else SEEDS)]
    count, scrambles = RATES["replicates"], SCRAMBLES_RUN * len(parts)
    # Of all seeds together: replicate k of each is of scramble k mod the scrambles of all.
    order = np.arange(count * len(parts)).reshape(len(parts), -1, SCRAMBLES_RUN)
    order = order.transpose(1, 0, 2).ravel()
    rows = {name: np.concatenate([each[1][name] for each in parts])[order] for name in parts[0][1]}
    points = np.concatenate([each[0] for each in parts])[order].view(np.recarray)
    made = {}

    def sample(rng, share, how):
        if (share, how) not in made:
            made[share, how] = cut(rows, share, how)
        some = rng.integers(0, scrambles, SCRAMBLES)
        at = np.arange(len(order)).reshape(-1, scrambles)[:, some].ravel()
        mine = {name: each[at] for name, each in made[share, how].items()}
        return of_rates(points[at], mine, SCRAMBLES)

    return of_rates(points, rows, scrambles), sample


def main():
    """Print the table, and whether the goal is reached."""
    arguments = begin(__doc__, studies=1000, shares=(0.0, 0.01, 0.05, 0.2, 0.6))
    if arguments.quick:
        arguments.studies = min(arguments.studies, 100)
    columns = ("of", "what", *(f"{100.0 * share:g} % {how}" for share in arguments.shares
               for how in ("budget", "nan")))  # fmt: skip
    table = Table(
        f"Intervals of {arguments.studies} small studies that hold the truth [%]", columns
    )
    least = 100.0
    for name, samples in (("pairs", pair_samples), ("rates", rate_samples)):
        truth, sample = samples(arguments)
        shown = {}
        for share in arguments.shares:
            for how in ("budget", "nan"):
                rng = np.random.default_rng(1)
                counts = {what: np.zeros(2) for what in truth}
                for _ in range(arguments.studies):
                    for what, each in sample(rng, share, how).items():
                        counts[what] += held_by(each, truth[what])
                for what, (held, of) in counts.items():
                    shown.setdefault(what, []).append(100.0 * held / of if of else np.nan)
        values = np.array(list(shown.values()))
        table.add(name, "least of them", *np.nanmin(values, axis=0).tolist())
        table.add(name, "mean of them", *np.nanmean(values, axis=0).tolist())
        worst = list(shown)[int(np.argmin(np.nanmin(values[:, 2:], axis=1)))]
        print(f"{name}: {worst} is held least often", file=sys.stderr)
        least = min(least, np.nanmin(values[:, 2:]))
    table.print()
    print(f"least with undecided ones: {least:.1f} % (goal: {GOAL:g} %: "
          f"{'reached' if least >= GOAL else 'not reached'})")  # fmt: skip


if __name__ == "__main__":
    main()
