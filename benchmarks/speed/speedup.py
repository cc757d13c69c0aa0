"""CPU time of other methods over that of Implicit, at equal error of the outcomes.

    python -m benchmarks.speed.speedup [--quick] [--markdown] [--presets si] [--types I III]

The same replicates (N = 64, displacements 0 to 3/4 in turn), the same compiled forces, the same
observer that stops them, one core. Error: the share of outcomes that differ from those of Implicit
at a tolerance of 1e-12 m. VelocityVerlet runs at the largest step, SciPy's solvers at the loosest
tolerance, at which that share is no more than Implicit's at the tolerance in question. Few
replicates are run where Verlet takes 1e7 steps for one. ``--budget``: CPU seconds of a replicate by
Verlet; ``--tolerance``: Implicit's [m].
"""

import math
import warnings

import numpy as np

from benchmarks.peers.scipy_solvers import SOLVERS, SciPyRun
from benchmarks.reporting import Table, begin
from benchmarks.speed.cases import VERTICES, Result, differing, make_cases, run_cases
from benchmarks.speed.measure import largest_step
from benchmarks.speed.scenes import collisions
from flocsim.ensembles.collision.draw import outcome_of
from flocsim.ensembles.collision.outcomes import OBSERVER
from flocsim.ensembles.study import Study
from flocsim.integrators import Implicit, VelocityVerlet
from flocsim.integrators.base import Status
from flocsim.state.work import work_of

TIGHT = 1e-12
TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-11)
GIVE_UP = 300.0
"""A SciPy solver is given up when it has taken so many times the CPU time of Implicit."""

PATIENCE = 2.0
"""A replicate of Verlet is given up when it lasts so many times longer than it ought."""


def verlet(cases, exact, allowed, budget):
    """(largest step, Result) of VelocityVerlet with no more than ``allowed`` outcomes wrong."""
    results = {}
    limits = [(PATIENCE * end, budget) for end in exact.ends]

    def good(step):
        if step > 2.0 * guess:  # past the stability limit 2/ω0 an outcome is right by luck
            return False
        results[step] = run_cases(cases, VelocityVerlet(step), limits, allowed, exact.outcomes)
        return results[step] is not None

    bodies = cases[0].encounter.system.bodies
    mass = 1.0 / sum(1.0 / body.mass for body in bodies)
    k_n = next(f.k_n for f in cases[0].encounter.system.forces if hasattr(f, "k_n"))
    guess = math.sqrt(mass / k_n)
    step = largest_step(good, guess, halvings=6, refinements=1)
    return step, results.get(step)


def run_scipy(runner, case, name, tolerance, budget):
    """(outcome, CPU time) of one replicate by a SciPy solver."""
    encounter = case.encounter
    observed = encounter.given.copy()
    work = work_of(encounter.scene, *encounter.motion(case.angles, case.share))
    until = encounter.time_limit()
    runner.system = encounter.system
    end, code = runner.run(name, tolerance, until, budget, work=work, observed=observed)
    status = Status[end.status] if end.status in Status.__members__ else Status.STEP_BUDGET
    return outcome_of(status, code, observed)[0], end.cpu


def scipy_result(runner, cases, exact, allowed, name, tolerance, limit):
    """The Result of a SciPy solver; None with more than ``allowed`` wrong, or beyond the limit."""
    outcomes, cpu = [], 0.0
    for case in cases:
        outcome, took = run_scipy(runner, case, name, tolerance, limit - cpu)
        outcomes.append(outcome)
        cpu += took
        if differing(outcomes, exact.outcomes) > allowed or cpu > limit:
            return None
    return Result(np.array(outcomes), exact.ends, cpu / len(cases))


def best_scipy(cases, exact, allowed, own):
    """(solver and tolerance, Result) of the cheapest SciPy solver; None where all fail.

    A setting is given up once it is dearer than the best so far, or than GIVE_UP times Implicit.
    """
    runner = SciPyRun(cases[0].encounter.system, OBSERVER)
    best, limit = ("none", None), GIVE_UP * own.cpu * len(cases)
    for name in SOLVERS:
        for tolerance in TOLERANCES:
            result = scipy_result(runner, cases, exact, allowed, name, tolerance, limit)
            if result is not None:
                best, limit = (f"{name} {tolerance:.0e} m", result), result.cpu * len(cases)
                break
    return best


def ratio(result, own):
    """CPU time over Implicit's; nan where there is no result."""
    return result.cpu / own.cpu if result is not None else math.nan


def on_some(cases, exact, tolerance, count):
    """(cases, exact Result, Implicit's Result, how many of it differ) of the first ``count``."""
    some = cases[:count]
    own = run_cases(some, Implicit(tolerance))
    part = exact.first(len(some))
    return some, part, own, differing(own.outcomes, part.outcomes)


def compare(study, preset, condition, counts, budget, table):
    """Add one type's row; the two ratios. ``counts``: replicates for Implicit, Verlet, SciPy."""
    tolerance = study.config.integrator.tolerance
    cases = make_cases(study, condition, counts[0])
    exact = run_cases(cases, Implicit(TIGHT))
    _, _, all_own, wrong = on_some(cases, exact, tolerance, counts[0])
    some, part, own, allowed = on_some(cases, exact, tolerance, counts[1])
    step, by_verlet = verlet(some, part, allowed, budget)
    few, part, own_few, allowed_few = on_some(cases, exact, tolerance, counts[2])
    solver, by_scipy = best_scipy(few, part, allowed_few, own_few)
    ratios = ratio(by_verlet, own), ratio(by_scipy, own_few)
    table.add(
        preset, study.config.scene.names[condition], f"{wrong}/{len(cases)}",
        1e3 * all_own.cpu, f"{allowed}/{len(some)}", f"{step:.1e}" if step else "none",
        1e3 * by_verlet.cpu if by_verlet else "-", ratios[0], f"{allowed_few}/{len(few)}", solver,
        1e3 * by_scipy.cpu if by_scipy else "-", ratios[1],
    )  # fmt: skip
    return ratios


def geometric_mean(values):
    """exp of the mean of the logs, of those that are numbers."""
    known = [math.log(value) for value in values if value == value]
    return math.exp(sum(known) / len(known)) if known else math.nan


COLUMNS = (
    "preset", "type", "Implicit wrong", "Implicit [ms]", "Verlet wrong", "step [s]", "Verlet [ms]",
    "Verlet / Implicit", "SciPy wrong", "best of SciPy", "SciPy [ms]", "SciPy / Implicit",
)  # fmt: skip

COUNTS = {"quick": (8, 4, 2), "slow": (12, 2, 2), "usual": (40, 12, 6)}
"""Replicates for Implicit, for Verlet and for SciPy; "slow": Verlet takes 1e7 steps for one."""


def counts_for(preset, name, quick):
    """How many replicates of a type each method runs."""
    if quick:
        return COUNTS["quick"]
    return COUNTS["slow" if (preset, name) == ("si", "III") else "usual"]


def main():
    """Print the table and the geometric means."""
    arguments = begin(
        __doc__, presets=("tang2014", "si"), types=("I", "II", "III"), budget=100.0,
        tolerance={"type": float},
    )  # fmt: skip
    warnings.filterwarnings("ignore", module="scipy")
    table = Table(f"CPU time per replicate, N = {VERTICES}", COLUMNS)
    ratios = []
    for preset in arguments.presets:
        overrides = {"tolerance": arguments.tolerance}
        scene = {"types": arguments.types}
        study = Study(collisions(preset, integrator=overrides, scene=scene))
        for condition, name in enumerate(arguments.types):
            counts = counts_for(preset, name, arguments.quick)
            ratios.append(compare(study, preset, condition, counts, arguments.budget, table))
    verlet_mean, scipy_mean = (geometric_mean(column) for column in zip(*ratios, strict=True))
    table.add("geometric mean", *[""] * 6, verlet_mean, "", "", "", scipy_mean)
    table.print()


if __name__ == "__main__":
    main()
