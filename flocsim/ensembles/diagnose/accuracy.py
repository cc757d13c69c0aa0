"""How far a run of a replicate is from a more exact one of the same replicate.

`flocsim check` and `flocsim work-precision` are tables of such comparisons.
"""

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import attrs

from flocsim.ensembles.collision.draw import FAILURES
from flocsim.errors import FlocsimError
from flocsim.integrators.amplification import end_distance
from flocsim.integrators.base import Integrator
from flocsim.io.results.schema import OUTCOMES
from flocsim.run import Run
from flocsim.state.work import NOW

Task = tuple[tuple[int, int, float], int]
"""A replicate: (index of its type, N, share of δ_max), and its own index."""

MORE_STEPS = 20
"""Step budget of a reference over that of the config."""


@attrs.frozen
class Comparison:
    """A run, and by how much it is off where the first of it and its reference is decided.

    ``row`` and ``exact``: rows of the run and of its reference, empty where there is none; CPU time
    [s]; ``error``: of the point of an outline that is furthest off [m]; ``stated`` and ``slack``:
    what the run and the reference state of it; ``why`` there is no error. NaN for what is unknown.
    """

    row: dict = attrs.Factory(dict)
    exact: dict = attrs.Factory(dict)
    steps: int = 0
    cpu: float = math.nan
    error: float = math.nan
    stated: float = math.nan
    slack: float = math.nan
    why: str = ""

    @property
    def flipped(self) -> bool:
        """Return True if the two end differently, as the column n_flipped counts."""
        return any(self.row.get(name) != self.exact.get(name) for name in ("outcome", "inside"))


def ending(row: Mapping[str, Any]) -> str:
    """Return how a replicate ended, in words."""
    if row["failure"]:
        return f"{OUTCOMES[row['outcome']]} ({FAILURES[row['failure']]})"
    zone = {0: ", outside", 1: ", inside"}.get(row["inside"], "")
    return f"{OUTCOMES[row['outcome']]}{zone}"


@attrs.define(eq=False)
class Bench:
    """Runs replicates of a study by any method, and compares them with the method ``exact``."""

    study: Any
    exact: Integrator
    references: dict[Task, tuple[Run, dict]] = attrs.Factory(dict)
    warm: set = attrs.Factory(set)

    def run(
        self, task: Task, method: Integrator, budget: int, until: float = math.inf
    ) -> tuple[Run, dict, float]:
        """Run a replicate in so many steps at most, to a time [s]; return (Run, row, CPU time)."""
        place, replicate = task
        draw = self.study.draw(*place, replicate)
        driver = self.study.driver(draw.encounter, method)
        _ = draw.encounter.scene  # prepared before the clock starts
        if driver not in self.warm:  # and compiled, or loaded, by one run that is not timed
            draw.begin(driver, budget, integrator=method).to_end()
            self.warm.add(driver)
        began = time.process_time()
        made = draw.begin(driver, budget, until, integrator=method)
        row = draw.row_of_run(made, made.to_end())
        return made, row, time.process_time() - began

    @property
    def most_steps(self) -> int:
        """The step budget of a reference."""
        return MORE_STEPS * self.study.config.integrator.max_steps

    def reference(self, task: Task) -> tuple[Run, dict]:
        """Return the reference (Run, row) of a replicate, which is run once."""
        if task not in self.references:
            run, row, _ = self.run(task, self.exact, self.most_steps)
            self.references[task] = run, row
        return self.references[task]

    def compare(self, task: Task, method: Integrator, budget: int | None = None) -> Comparison:
        """Run a replicate by a method; an exception costs no more than this run."""
        try:
            return self.compared(task, method, budget or self.study.config.integrator.max_steps)
        except MemoryError:
            raise
        except Exception as error:  # of a class of the user's own, too
            kind = "" if isinstance(error, FlocsimError) else f"{type(error).__name__}: "
            return Comparison(why=f"{kind}{' '.join(str(error).split())}")

    def compared(self, task: Task, method: Integrator, budget: int) -> Comparison:
        """The same, where an exception goes on."""
        run, row, cpu = self.run(task, method, budget)
        stated = run.error if math.isfinite(method.tolerance) else math.nan
        found = Comparison(row, {}, run.steps + run.rejected, cpu, stated=stated)
        if row["failure"]:
            return attrs.evolve(found, why=ending(row))
        reference, exact = self.reference(task)
        if exact["failure"]:
            return attrs.evolve(found, why=f"no reference: it ends {ending(exact)}")
        # Both are stopped where the first of them was decided.
        until = min(run.time, reference.time)
        if run.time > until:
            run, *_ = self.run(task, method, budget, until)
        elif reference.time > until:
            reference, *_ = self.run(task, self.exact, self.most_steps, until)
        bodies = self.study.draw(*task[0], task[1]).encounter.system.bodies
        error = end_distance(bodies, run.work.place[NOW], reference.work.place[NOW])
        if math.isfinite(method.tolerance):
            stated = run.error
        return attrs.evolve(found, exact=exact, error=error, stated=stated, slack=reference.error)


def setting_of(method: Integrator) -> str:
    """Return the tolerance or the step of a method in words."""
    if math.isfinite(method.tolerance):
        return f"{method.tolerance:.0e} m"
    return f"{getattr(method, 'step', math.nan):.0e} s"


def number(value: float, form: str = ".1e") -> str:
    """Return a number for a table, "-" where it is NaN."""
    return "-" if math.isnan(value) else f"{value:{form}}"


def table_line(columns: Mapping[str, int], values: Sequence[object] | None = None) -> str:
    """Return a line of a table, by default its head.

    ``columns`` {title: width}, of those aligned to the left a negative one.
    """
    cells = zip(values or columns, columns.values(), strict=False)
    return "".join(f"{each!s:{'<' if width < 0 else '>'}{abs(width)}}" for each, width in cells)
