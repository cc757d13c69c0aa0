"""Runs with their CPU time, and the error of their end."""

import time

import attrs
import numpy as np

from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from flocsim.integrators.amplification import end_distance
from flocsim.integrators.base import Status
from flocsim.run import Run
from flocsim.state.work import NOW, motion_of, work_of

CHUNK = 100_000
"""Steps between two looks at the clock."""

TIGHTEST = 1e-13
"""Tolerance [m] of the runs that stand for the truth."""


@attrs.frozen(eq=False)
class Measured:
    """A run's end: motion (n, 6), how it ended, CPU time [s] and what it took."""

    motion: np.ndarray
    status: str
    cpu: float
    steps: int = 0
    rejected: int = 0
    evaluations: int = 0

    @property
    def finished(self):
        """Whether the run reached its end time."""
        return self.status == "FINISHED"


def run_once(system, driver, until, budget):
    """One run of a composed driver; "TIME_BUDGET" where it takes more CPU seconds than that."""
    scene = system.scene()
    work = work_of(scene, *system.motion())
    run = Run(driver, scene, work, system.integrator, until, max_steps=10**12)
    began = time.process_time()
    while (status := run.advance(CHUNK)) == Status.PAUSED:
        if time.process_time() - began > budget:
            break
    cpu = time.process_time() - began
    name = "TIME_BUDGET" if status == Status.PAUSED else status.name
    motion = motion_of(run.work, NOW)
    return Measured(motion, name, cpu, run.steps, run.rejected, run.evaluations)


def measure(scene, integrator, budget=20.0, repeat_for=0.1):
    """The scene with an integrator, compiled beforehand; the fastest of several short runs."""
    system = scene.system(integrator)
    driver = system.compose()
    run_once(system, driver, 1e-12, budget)
    best = run_once(system, driver, scene.until, budget)
    spent = best.cpu
    while spent < repeat_for:
        again = run_once(system, driver, scene.until, budget)
        best = min(best, again, key=lambda run: run.cpu)
        spent += max(again.cpu, 1e-3)
    return best


def distance(scene, motion, exact):
    """How far apart [m] any point of an outline ends in two runs, at most."""
    return end_distance(scene.bodies, motion[:, :3], exact[:, :3])


def reference(scene, budget=60.0):
    """(end motion of Implicit at its tightest, its distance to an explicit method, its name).

    The explicit method is DormandPrince54 at the same tolerance or, where that takes too long or
    does not end, VelocityVerlet in ten million steps.
    """
    exact = measure(scene, Implicit(TIGHTEST), budget, repeat_for=0.0)
    other, name = measure(scene, DormandPrince54(TIGHTEST), budget, 0.0), "DormandPrince54"
    if not other.finished:
        other = measure(scene, VelocityVerlet(scene.until / 1e7), budget, repeat_for=0.0)
        name = "VelocityVerlet"
    if not (exact.finished and other.finished):
        raise RuntimeError(f"no reference for {scene.name}: {exact.status}, {other.status}")
    return exact.motion, distance(scene, other.motion, exact.motion), name


def largest_step(good, guess, halvings=24, refinements=3):
    """The largest step [s] that ``good(step)`` accepts, to 9 %; None where none is found.

    From ``guess`` up or down by factors of two, then by bisection of the last factor.
    """
    step = guess
    if good(step):
        while good(2.0 * step):
            step *= 2.0
    else:
        for _ in range(halvings):
            step *= 0.5
            if good(step):
                break
        else:
            return None
    low, high = step, 2.0 * step
    for _ in range(refinements):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if good(middle) else (low, middle)
    return low
