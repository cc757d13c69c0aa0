"""Made-up results with the trends of the paper, for tests of files, tables and figures."""

from functools import cache

import numpy as np

from flocsim.io.results.schema import BLANKS, NOT_APPLICABLE, REPLICATES, Results
from tests.helpers.tabulate import tabulate

FAILURES = ("none", "overlap_too_deep", "step_budget")


def bonds_of(outcome, bond=1):
    """The codes of bonds that go with outcomes, all of one kind or as given."""
    return np.where(np.isin(outcome, [0, 2]), bond, NOT_APPLICABLE)


def draw_codes(rng, shape):
    """Outcome, inside and bond of random approaches: type 0 worst, the last type always inside."""
    t, v, d, _ = np.indices(shape)
    size = np.maximum(np.array(shape), 2)
    badness = v / (size[1] - 1) * (0.5 + 0.5 * d / (size[2] - 1))
    inside = rng.random(shape) > badness * (1 - t / (size[0] - 1))
    aggregated = rng.random(shape) > badness * np.where(inside, 0.5, 1.0)
    outcome = np.where(inside, np.where(aggregated, 0, 1), np.where(aggregated, 2, 3))
    ending = rng.random(shape)
    missed = ending < 0.05
    outcome = np.select([missed, ending < 0.07, ending < 0.08], [4, 5, 6], outcome)
    bond = bonds_of(outcome, rng.choice(3, shape, p=[0.6, 0.3, 0.1]) + 1)
    return outcome, np.where(missed, NOT_APPLICABLE, inside), bond


def draw_second_runs(first, seed=11):
    """Codes of second runs of a fifth of these replicates, a tenth of which end as another did, and
    of third runs, alike, of some of these."""
    rng, outcome = np.random.default_rng(seed), first[0]
    checked = rng.random(outcome.shape) < 0.2
    other = rng.permuted(np.arange(outcome.size)).reshape(outcome.shape)
    place = np.where(rng.random(outcome.shape) < 0.1, other, np.arange(outcome.size).reshape(
        outcome.shape))  # fmt: skip
    thrice = checked & (rng.random(outcome.shape) < 0.3)
    return {
        f"{run}_{name}": np.where(chosen, codes.ravel()[place], NOT_APPLICABLE)
        for run, chosen in (("checked", checked), ("third", thrice))
        for name, codes in zip(("outcome", "inside", "bond"), first, strict=True)
    }


def make_results(
    types=("I", "II", "III"),
    vertices=(1, 4, 16, 64),
    delta=(0.0, 0.25, 0.5, 0.75, 1.0),
    count=60,
    seed=7,
    run=None,
):
    """A complete Results of random numbers; the same arguments give the same one."""
    arrays = made(tuple(types), tuple(vertices), tuple(delta), count, seed)
    replicates, table = ({name: each.copy() for name, each in group.items()} for group in arrays)
    run = {"preset": "tang2014", "seed": seed, "wall_time": 12.5} if run is None else run
    return Results(types, vertices, delta, replicates, table, run, FAILURES)


@cache
def made(types, vertices, delta, count, seed):
    """(replicates, probabilities) of them: intervals of hundreds of counts take a second."""
    rng = np.random.default_rng(seed)
    shape = (len(types), len(vertices), len(delta), count)
    outcome, inside, bond = draw_codes(rng, shape)
    collided = inside != NOT_APPLICABLE
    drawn = rng.uniform(30e-6, 50e-6, (3, *shape))
    lengths = np.where(collided, drawn, np.nan)
    times = np.where(collided, rng.uniform(0.0, 0.1, shape), np.nan)
    again = draw_second_runs((outcome, inside, bond))
    failure = np.select([outcome == 6, outcome == 5], [1, 2], 0)
    zone = rng.uniform(30e-6, 50e-6, shape)
    blank = {name: np.full(shape, BLANKS[kind]) for name, (kind, _, _) in REPLICATES.items()}
    replicates = blank | {
        "r_i": rng.uniform(4e-6, 20e-6, shape),
        "r_j": rng.uniform(4e-6, 20e-6, shape),
        "D_0": zone,
        "d_c_over_D_0": lengths[0] / zone,
        "angle_i": rng.uniform(0.0, 2.0 * np.pi, shape),
        "angle_j": rng.uniform(0.0, 2.0 * np.pi, shape),
        "outcome": outcome,
        "inside": inside,
        "crossed_zone": np.where(collided, rng.integers(0, 2, shape), NOT_APPLICABLE),
        "bond": bond,
        **again,
        "d_c_collision": lengths[0],
        "d_c_max": lengths[1],
        "d_c_last": drawn[2],
        "t_collision": times,
        "t_end": rng.uniform(0.1, 2.0, shape),
        "steps": rng.integers(100, 3000, shape),
        "rejected": rng.integers(0, 50, shape),
        "error": rng.uniform(0.0, 1e-8, shape),
        "failure": failure,
        "floc_i": rng.integers(0, 4, shape),
        "floc_j": rng.integers(0, 4, shape),
    }
    for body in "ij":  # flocs of four shapes
        rank = replicates[f"floc_{body}"] / 3
        replicates[f"aspect_ratio_{body}"] = 1.0 + rank
        replicates[f"circularity_{body}"] = 0.9 - 0.5 * rank**2
        replicates[f"solidity_{body}"] = 0.8 + 0.1 * np.cos(3 * rank)
    typed = {
        name: np.asarray(replicates[name]).astype(kind) for name, (kind, _, _) in REPLICATES.items()
    }
    return typed, tabulate(outcome, inside, bond, **again)
