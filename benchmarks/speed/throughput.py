"""Replicates per second and core, the share of outcomes that flip, and µs per force evaluation.

    python -m benchmarks.speed.throughput [--quick] [--markdown] [--replicates 40]

Everything in one process on one core. Flips: replicates whose outcome (A, B, C, D, missed,
undecided, failed) differs from that at a tolerance 100 times tighter.
"""

import time

import attrs
import numpy as np

from benchmarks.reporting import Table, begin
from benchmarks.speed.evaluations import costs
from benchmarks.speed.scenes import collisions
from flocsim.ensembles.study import Study
from flocsim.io.results.schema import OUTCOMES

VERTICES = (1, 4, 16, 64)
LARGER = (4, 16, 64, 512)


@attrs.frozen
class Runs:
    """Outcome and steps of replicates (delta, replicate); CPU and set-up time of all [s]."""

    outcome: np.ndarray
    steps: np.ndarray
    cpu: float
    setup: float


def run_type(study, condition, vertices):
    """Runs of one type and N at every displacement."""
    replicates, cpu, setup, rows = range(study.config.replicates), 0.0, 0.0, []
    for share in study.config.scene.delta:
        began = time.process_time()
        for replicate in replicates:
            _ = study.draw(condition, vertices, share, replicate).encounter.scene
        made = time.process_time()
        rows.append(study.run_all((condition, vertices, share), replicates)[0])
        setup, cpu = setup + made - began, cpu + time.process_time() - made
    return Runs(*(np.array([each[name] for each in rows]) for name in ("outcome", "steps")),
                cpu, setup)  # fmt: skip


def share_of(runs, name):
    """Percent of replicates with an outcome."""
    return 100.0 * float(np.mean(runs.outcome == OUTCOMES.index(name)))


def rate_rows(table, name, vertices, runs):
    """Add one row of rates."""
    table.add(
        name, vertices, runs.steps.size, runs.steps.size / runs.cpu,
        runs.steps.size / (runs.cpu + runs.setup), int(np.median(runs.steps)),
        float(runs.steps.max() / np.median(runs.steps)),
        share_of(runs, "undecided"), share_of(runs, "failed"),
    )  # fmt: skip


def joined(all_runs):
    """Runs of several types as one."""
    arrays = (np.concatenate([getattr(r, f) for r in all_runs]) for f in ("outcome", "steps"))
    return Runs(*arrays, sum(r.cpu for r in all_runs), sum(r.setup for r in all_runs))


def rates(study):
    """Print rates by type and N; {type: Runs at the largest N}."""
    table = Table(
        f"Replicates at tolerance {study.config.integrator.tolerance:g} m, "
        f"{study.config.preset}, delta 0 to 1",
        ("type", "N", "replicates", "per s", "with set-up", "median steps",
         "slowest/median steps", "undecided %", "failed %"),
    )  # fmt: skip
    names = list(study.config.scene.names)
    for vertices in study.config.shapes.vertices:
        found = {n: run_type(study, c, vertices) for c, n in enumerate(names)}
        for name, runs in found.items():
            rate_rows(table, name, vertices, runs)
        rate_rows(table, "all", vertices, joined(list(found.values())))
    table.print()
    return found


def flips(found, exact, deltas):
    """Percent of replicates whose outcome differs, by displacement."""
    return dict(zip(deltas, 100.0 * np.mean(found.outcome != exact.outcome, axis=1), strict=True))


def print_flips(study, exact_study, found):
    """Print the share of flipped outcomes by type and displacement."""
    deltas = study.config.scene.delta
    tight = exact_study.config.integrator.tolerance
    vertices = study.config.shapes.vertices[-1]
    title = f"Outcomes [%] that differ from those at tolerance {tight:g} m, N = {vertices}"
    table = Table(title, ("type", *(f"delta {d:g}" for d in deltas), "all", "slower by"))
    total, count = 0, 0
    for condition, (name, runs) in enumerate(found.items()):
        exact = run_type(exact_study, condition, vertices)
        shares = flips(runs, exact, deltas).values()
        total += np.count_nonzero(runs.outcome != exact.outcome)
        count += runs.outcome.size
        mean = float(np.mean(list(shares)))
        table.add(name, *map(float, shares), mean, exact.cpu / runs.cpu)
    table.add("all", *([""] * len(deltas)), 100.0 * total / count, "")
    table.print()


def print_costs():
    """Print µs per force evaluation."""
    table = Table(
        "µs per force evaluation, contact search and list upkeep included, Type I",
        ("preset", "N", "contact", "near", "far", "pairs listed", "evaluations per list",
         "share in contact"),
    )  # fmt: skip
    for preset in ("tang2014", "si"):
        for vertices in LARGER:
            contact, near, far = costs(preset, vertices, 20_000)
            each = (contact.microseconds, near.microseconds, far.microseconds)
            table.add(preset, vertices, *each, contact.listed, contact.per_list, contact.touching)
    table.print()


def make_study(arguments, share):
    """The Study at ``share`` of the asked for tolerance, its kinds of code compiled."""
    config = collisions(
        arguments.preset,
        replicates=5 if arguments.quick else arguments.replicates,
        shapes={"vertices": list(VERTICES)},
        integrator={"tolerance": arguments.tolerance},
    )
    tolerance = share * config.integrator.tolerance
    integrator = attrs.evolve(config.integrator, tolerance=tolerance, check_share=0.0)
    study = Study(attrs.evolve(config, integrator=integrator))
    study.compile(study.kinds)
    return study


def main():
    """Print the three tables."""
    arguments = begin(__doc__, preset="tang2014", replicates=40, tolerance={"type": float})
    study = make_study(arguments, 1.0)
    found = rates(study)
    print_flips(study, make_study(arguments, 0.01), found)
    print_costs()


if __name__ == "__main__":
    main()
