"""CPU time of other methods over that of Implicit, at equal error of the outcomes.

    python benchmarks/speedup.py [--quick] [--markdown] [--presets tang2014 si] [--types I III]

The same replicates (N = 64, displacements 0 to 3/4 in turn), the same compiled forces, the same
observer that stops them, one core. Error: the share of outcomes that differ from those of Implicit
at a tolerance of 1e-12 m. VelocityVerlet runs at the largest step, SciPy's solvers at the loosest
tolerance, at which that share is no more than Implicit's at the tolerance in question. Few
replicates are run where Verlet takes 1e7 steps for one.
"""

import math
import time
import warnings

import attrs
import numpy as np
from measure import largest_step
from peers.scipy_solvers import SOLVERS, SciPyRun
from reporting import Table, parse_arguments, print_heading
from scenes import collisions

from flocsim.ensembles.failures import outcome_of
from flocsim.ensembles.sampling import draws, orientations
from flocsim.ensembles.scene import OBSERVER, Encounter
from flocsim.ensembles.study import Study
from flocsim.integrators import Implicit, VelocityVerlet
from flocsim.integrators.status import Status
from flocsim.layout import CODE, PAUSE_AT, STEPS, TIME, UNTIL
from flocsim.state import with_capacity

VERTICES = 64
DELTAS = (0.0, 0.25, 0.5, 0.75)
TIGHT = 1e-12
CHUNK = 100_000
"""Steps between two looks at the clock."""

NO_LIMITS = math.inf, math.inf
TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-11)
GIVE_UP = 300.0
"""A SciPy solver is given up when it has taken so many times the CPU time of Implicit."""

PATIENCE = 2.0
"""A replicate of Verlet is given up when it lasts so many times longer than it ought."""


@attrs.frozen(eq=False)
class Case:
    """One replicate, ready to be run by any method."""

    encounter: Encounter
    angles: tuple
    share: float

    def with_integrator(self, integrator):
        """The case's encounter with another integrator."""
        system = attrs.evolve(self.encounter.system, integrator=integrator)
        return attrs.evolve(self.encounter, system=system)


@attrs.frozen(eq=False)
class Result:
    """Outcomes (k,) of the cases, when they ended [s], and CPU time [s] for each on average."""

    outcomes: np.ndarray
    ends: np.ndarray
    cpu: float

    def first(self, count):
        """The same of the first cases alone."""
        return Result(self.outcomes[:count], self.ends[:count], self.cpu)


def make_cases(study, condition, count):
    """The first ``count`` replicates of a condition."""
    cases = []
    for replicate in range(count):
        numbers = draws(study.config.seed, replicate)
        encounter = study.encounter(condition, VERTICES, numbers)
        share = DELTAS[replicate % len(DELTAS)]
        cases.append(Case(encounter, orientations(numbers), share))
    return cases


def run_case(case, encounter, driver, limits):
    """(outcome, end [s]) of a replicate, as run_encounter does it, but within a CPU time.

    ``limits``: most simulated time [s] and most CPU time [s]; beyond them it is undecided.
    """
    work, memo = encounter.start(case.angles, case.share), encounter.memo()
    integrator = encounter.system.integrator
    clock, counts = integrator.fresh_clock(), integrator.fresh_counts(10**12)
    clock[UNTIL] = min(encounter.time_limit(), limits[0])
    rows, began = np.zeros((0, 13)), time.process_time()
    while True:
        counts[PAUSE_AT] = counts[STEPS] + CHUNK
        status = Status(driver(encounter.scene, work, memo, clock, counts, rows))
        if status == Status.NO_ROOM:
            work = with_capacity(work, 2 * len(work.candidates))
        elif status != Status.PAUSED or time.process_time() - began > limits[1]:
            break
    if status == Status.PAUSED:
        status = Status.STEP_BUDGET
    return outcome_of(status, counts[CODE], memo)[0], clock[TIME]


def run_cases(cases, integrator, limits=None, allowed=None, exact=None):
    """The Result of an integrator; None once more than ``allowed`` differ from ``exact``."""
    encounters = [case.with_integrator(integrator) for case in cases]
    driver = encounters[0].system.compose(observer=OBSERVER)
    run_case(cases[0], encounters[0], driver, (1e-12, math.inf))
    found, began = [], time.process_time()
    for k, (case, encounter) in enumerate(zip(cases, encounters, strict=True)):
        most = NO_LIMITS if limits is None else limits[k]
        found.append(run_case(case, encounter, driver, most))
        if allowed is not None and differing([outcome for outcome, _ in found], exact) > allowed:
            return None
    cpu = (time.process_time() - began) / len(cases)
    outcomes, ends = (np.array(column) for column in zip(*found, strict=True))
    return Result(outcomes, ends, cpu)


def differing(outcomes, exact):
    """How many outcomes differ from the exact ones."""
    return int(np.count_nonzero(np.asarray(outcomes) != exact[: len(outcomes)]))


def verlet(cases, exact, allowed, budget):
    """(largest step, Result) of VelocityVerlet with no more than ``allowed`` outcomes wrong."""
    results = {}
    limits = [(PATIENCE * end, budget) for end in exact.ends]

    def good(step):
        results[step] = run_cases(cases, VelocityVerlet(step), limits, allowed, exact.outcomes)
        return results[step] is not None

    bodies = cases[0].encounter.system.bodies
    mass = 1.0 / sum(1.0 / body.mass for body in bodies)
    k_n = next(f.k_n for f in cases[0].encounter.system.forces if hasattr(f, "k_n"))
    step = largest_step(good, math.sqrt(mass / k_n), halvings=6, refinements=1)
    return step, results.get(step)


def run_scipy(runner, case, name, tolerance, budget):
    """(outcome, CPU time) of one replicate by a SciPy solver."""
    encounter = case.encounter
    memo, work = encounter.memo(), encounter.start(case.angles, case.share)
    until = encounter.time_limit()
    runner.system = encounter.system
    end, code = runner.run(name, tolerance, until, budget, work=work, memo=memo)
    status = Status[end.status] if end.status in Status.__members__ else Status.STEP_BUDGET
    return outcome_of(status, code, memo)[0], end.cpu


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
        preset, study.config.scene.conditions[condition][0], f"{wrong}/{len(cases)}",
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
    arguments = parse_arguments(
        __doc__,
        presets={"nargs": "+", "default": ["tang2014", "si"]},
        types={"nargs": "+", "default": ["I", "II", "III"]},
        budget={"type": float, "default": 100.0, "help": "CPU seconds a replicate of Verlet"},
        tolerance={"type": float, "help": "Implicit's [m], default: its own"},
    )
    print_heading()
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
    table.print(arguments.markdown)


if __name__ == "__main__":
    main()
