"""SciPy's LSODA, BDF and Radau on flocsim's own compiled right-hand side.

One solver is kept while the candidate list holds. It starts afresh, displacements handed over,
when the list is made anew or a pair that carries displacement opens.
"""

import math
import time

import attrs
import numpy as np
from scipy.integrate import BDF, LSODA, Radau
from scipy.optimize import brentq

from benchmarks.peers.compiled import Given, inspect, list_anew, rate_state
from benchmarks.speed.measure import Measured
from flocsim.compiler.by_pointer import Stacked, table_of
from flocsim.constants import WATER_VISCOSITY
from flocsim.integrators import VelocityVerlet
from flocsim.state.work import NOW, motion_of, with_room, work_of

SOLVERS = {"LSODA": LSODA, "BDF": BDF, "Radau": Radau}

SMALLEST_RELATIVE = 1e-12
"""Relative tolerance below which SciPy's solvers no longer work well."""

FIRST_STEP = 1e-8
"""The step [s] that every run starts with."""


def state_tolerances(system, tolerance):
    """Absolute tolerances of x, y, angle, vx, vy, spin of all bodies for an error in metres.

    A velocity error counts by what it leads to until drag has wiped it out: e · m/(6πγ r_eq).
    """
    found = []
    for body in system.bodies:
        size = body.shape.bounding_radius
        drag = 6.0 * math.pi * WATER_VISCOSITY * body.shape.equivalent_radius
        place = np.array([tolerance, tolerance, tolerance / size])
        found += [place, place * drag / body.mass]
    return np.concatenate(found)


@attrs.define(eq=False)
class SciPyRun:
    """A system, composed for a SciPy solver; ``observer`` fills the driver's slots."""

    system: object
    observer: dict = None
    pieces: tuple = attrs.field(init=False)
    evaluations: int = 0
    work: object = None
    scene: object = None
    observed: object = None
    given: object = None

    def __attrs_post_init__(self):
        self.system = attrs.evolve(self.system, integrator=VelocityVerlet())
        entries = (rate_state, list_anew, inspect)
        self.pieces = tuple(self.system.compose(entry, self.observer or {}) for entry in entries)

    def rate(self, time, vector):
        """The right-hand side."""
        self.evaluations += 1
        # Radau hands over rows of a transposed array; the compiled code takes contiguous ones.
        vector = np.ascontiguousarray(vector)
        rates = np.empty_like(vector)
        self.pieces[0](self.given, time, vector, rates)
        return rates

    def bind(self):
        """Make the table of the arrays that all calls hand over: a solver makes thousands."""
        one = Given(self.scene, self.work, self.observed)
        words, kinds = table_of(one)
        self.given = Stacked(np.frombuffer(words, np.int64)[None].copy(), (Given, *kinds), one)

    def make_list(self):
        """(state vector, longest step) with the pairs listed anew."""
        while (longest := self.pieces[1](self.given)) < 0.0:
            self.work = with_room(self.work)
            self.bind()
        slips = self.work.slip[NOW, : self.work.tally.candidates]
        return np.concatenate([motion_of(self.work, NOW).ravel(), slips]), longest

    def start_solver(self, method, time, until, tolerance, step):
        """A solver from the present state."""
        vector, longest = self.make_list()
        slips = np.full(len(vector) - 6 * len(self.work.poses), tolerance)
        absolute = np.concatenate([state_tolerances(self.system, tolerance), slips])
        relative = max(tolerance / 1e-5, SMALLEST_RELATIVE)
        largest = min(longest, until - time)
        return SOLVERS[method](
            self.rate, time, vector, until, rtol=relative, atol=absolute, max_step=largest,
            first_step=min(step, largest),
        )  # fmt: skip

    def touch(self, solver):
        """Show the observer the instant inside the last step at which the outlines touched."""
        path = solver.dense_output()

        def gap(time):
            return self.inspect(time, path(time), False)[2]

        low, high = solver.t_old, solver.t
        if gap(low) > 0.0 > gap(high):
            high = brentq(gap, low, high, xtol=1e-15 * high, rtol=1e-14)
            high += 1e-13 * high if gap(high) >= 0.0 else 0.0
        return self.inspect(high, path(high), True)[4]

    def prepare(self, work, observed):
        """Arrays for a run; everything compiled beforehand."""
        self.scene = self.system.scene()
        self.work = work or work_of(self.scene, *self.system.motion())
        self.evaluations = 0
        # Compile with a copy: the observer has not seen anything yet.
        self.observed = observed.copy()
        self.bind()
        vector, _ = self.make_list()
        self.rate(0.0, vector)
        self.inspect(0.0, vector, True)
        self.observed = observed
        self.bind()

    def inspect(self, time, vector, watch):
        """See peers.compiled.inspect."""
        return self.pieces[2](self.given, time, np.ascontiguousarray(vector), watch)

    def advance(self, solver, apart):
        """One step: (status or "", observer's code, whether the list must be made anew, apart)."""
        solver.step()
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            return "SOLVER_FAILED", 0, False, apart
        spent, opened, least, deep, code = self.inspect(solver.t, solver.y, False)
        if apart and least < 0.0:
            apart, code = False, self.touch(solver)
        code = code or self.inspect(solver.t, solver.y, True)[4]
        status = "STOPPED" if code else "TOO_DEEP" if deep else ""
        return status, code, opened or spent > 0.5, apart

    def run(self, method, tolerance, until, budget, *, work=None, observed=None):
        """(Measured, observer's code) of a run to a time [s] with a CPU budget [s]."""
        observed = np.zeros(1) if observed is None else observed
        self.prepare(work, observed)
        began, steps, code, apart, status = time.process_time(), 0, 0, True, ""
        solver = self.start_solver(method, 0.0, until, tolerance, FIRST_STEP)
        while not status and solver.t < until:
            status, code, anew, apart = self.advance(solver, apart)
            steps += 1
            if anew and not status and solver.t < until:
                step = max(solver.t - solver.t_old, 1e-12)
                solver = self.start_solver(method, solver.t, until, tolerance, step)
            if time.process_time() - began > budget:
                status = status or "TIME_BUDGET"
        cpu = time.process_time() - began
        motion = motion_of(self.work, NOW)
        return Measured(motion, status or "FINISHED", cpu, steps, 0, self.evaluations), code
