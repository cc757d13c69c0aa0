"""How much less the probabilities of pairs vary by Sobol's points than by independent draws.

    python -m benchmarks.accuracy.sobol_pairs [--seeds 6] [--points 64] [--pool 10]

runs `sampling = "sobol"` of Types I to III of tang2014 at N = 16, δ = .5, with a pool of ten flocs,
for some seeds, whose scrambles are all independent. The variance of independent draws over that of
a scramble's mean of 64, 128, … points is the ratio that a study of 16 such scrambles has. Small
studies of 16 scrambles, drawn from all with replacement, say how often their 95 % intervals hold
the mean of all. Goals: a ratio of 2 in the mean over the types with 1,024 points, and intervals
that hold it in 93 to 97 %.
"""

import numpy as np

from benchmarks.reporting import EXAMPLES, Table, begin
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.config.pair_scene import SOBOL, SOBOL_SCRAMBLES
from flocsim.ensembles.runner import run
from flocsim.io.confidence import bounded_sums, clustered_proportion
from flocsim.io.results.events import events

TYPES = ("I", "II", "III")
NAMES = ("pr_inside", "pr_a")


def scrambles_of(seed, points, pool):
    """{probability: (3, type, points, scramble)} of trials, successes and unknown, flags."""
    config = load_config(EXAMPLES / "quickstart.toml", {
        "seed": seed, "sampling": SOBOL, "replicates": points * SOBOL_SCRAMBLES,
        "scene": {"types": list(TYPES), "delta": [0.5]},
        # Flocs that are grown differ from seed to seed.
        "shapes": {"source": "library", "file": "synthetic", "vertices": [16], "pool": pool},
        "integrator": {"check_share": 0.0},
    })  # fmt: skip
    rows = run(config).replicates
    found = events(*(rows[name][:, 0, 0] for name in ("outcome", "inside", "bond")))
    return {name: np.stack(found[name]).reshape(3, len(TYPES), points, SOBOL_SCRAMBLES)
            for name in NAMES}  # fmt: skip


def variance_ratio(sums):
    """Of independent draws over a scramble's, of Σ S/Σ M; ``sums`` (3, scramble)."""
    m, s, _ = sums.astype(float)
    p = s.sum() / m.sum()
    return p * (1.0 - p) * m.mean() / np.var(s - p * m, ddof=1)


def coverage(sums, studies, rng):
    """(share of small studies whose interval holds the whole's value, mean half-width)."""
    truth = sums[1].sum() / sums[0].sum()
    some = rng.integers(0, sums.shape[-1], (studies, SOBOL_SCRAMBLES))
    trials, successes, unknown = sums[:, some]
    clusters = bounded_sums(successes, trials, unknown)
    _, low, high, _ = clustered_proportion(clusters, SOBOL_SCRAMBLES)
    return np.mean((low <= truth) & (truth <= high)), 0.5 * np.mean(high - low)


def main():
    """Print the table, and whether the goals are reached."""
    arguments = begin(__doc__, seeds=6, points=64, pool=10, studies=1000)
    if arguments.quick:
        arguments.seeds, arguments.points = 2, 16
    parts = [
        scrambles_of(seed, arguments.points, arguments.pool)
        for seed in range(1, 1 + arguments.seeds)
    ]
    flags = {name: np.concatenate([each[name] for each in parts], axis=-1) for name in NAMES}
    rng = np.random.default_rng(1)
    columns = ("probability", "points", "a study", *(f"ratio {each}" for each in TYPES), "mean",
               *(f"held {each} [%]" for each in TYPES), "half-width", "independent")  # fmt: skip
    scrambles = SOBOL_SCRAMBLES * arguments.seeds
    table = Table(f"{scrambles} scrambles; a study has {SOBOL_SCRAMBLES}", columns)
    points = 4
    while points <= arguments.points:
        for name, each in flags.items():
            sums = each[:, :, :points].sum(axis=2)
            kept = [t for t in range(len(TYPES)) if 0 < sums[1, t].sum() < sums[0, t].sum()]
            ratios = {t: variance_ratio(sums[:, t]) for t in kept}
            held = {t: coverage(sums[:, t], arguments.studies, rng) for t in kept}
            p = {t: sums[1, t].sum() / sums[0, t].sum() for t in kept}
            size = points * SOBOL_SCRAMBLES
            plain = np.mean([1.96 * np.sqrt(p[t] * (1.0 - p[t]) / size) for t in kept])
            table.add(
                name, points, size, *(ratios.get(t, np.nan) for t in range(3)),
                np.mean(list(ratios.values())),
                *(100.0 * held[t][0] if t in held else np.nan for t in range(3)),
                np.mean([width for _, width in held.values()]), plain,
            )  # fmt: skip
        points *= 2
    table.print()


if __name__ == "__main__":
    main()
