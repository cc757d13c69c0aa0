"""Single steps of backward Euler, uncompiled, of a few bodies."""

import numpy as np

from flocsim import System
from flocsim.arrays import NOW, TIME, UNTIL, VX, elimination_of, work_of
from flocsim.compiler.composer import compose
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators import Implicit
from flocsim.integrators.backward_euler.driver import EULER_SIZE, take_end, try_step
from flocsim.integrators.backward_euler.interior import find_closed
from flocsim.integrators.backward_euler.newton import begin_step, solve_end
from flocsim.integrators.loop.driver import keep_lists


def newton_alone(scene, work, clock, euler, step, most):
    """One step by Newton's method from its start."""
    begin_step(work)
    return solve_end(scene, work, clock, step, most)


def newton_from_inside(scene, work, clock, euler, step, most):
    """One step by both methods."""
    begin_step(work)
    return find_closed(scene, work, clock, step) and solve_end(scene, work, clock, step, most)


class Stage:
    """Bodies, listed and located, for steps of backward Euler."""

    def __init__(self, bodies, forces, fluid=None, tolerance=1e-9):
        integrator = Implicit(tolerance=tolerance)
        fluids = {} if fluid is None else {"fluid": fluid}
        system = System(bodies, forces, integrator, **fluids)
        self.fillings = system.fillings(grows=True)
        self.scene = system.scene(jit=False)
        work = work_of(self.scene, *system.motion())
        n = len(bodies)
        self.work = work._replace(elimination=elimination_of(n, len(work.pairs), 50 * n, dense=0))
        self.clock, self.counts = integrator.fresh_clock(), integrator.fresh_counts(10**6)
        self.clock[UNTIL] = 1.0
        self.euler = np.zeros(EULER_SIZE)
        assert self.linked(keep_lists)(self.scene, self.work)

    def linked(self, function):
        """The function with this family's others in the place of hooks."""
        return compose(function, self.fillings, jit=False)

    def end(self, step, how=newton_alone, most=100):
        """Whether the step's end was found; it is left in NOW."""
        return self.linked(how)(self.scene, self.work, self.clock, self.euler, step, most)

    def step(self, step):
        """Take a step, however large its error: that over the tolerance."""
        ratio = self.linked(try_step)(self.scene, self.work, self.clock, self.euler, step)
        assert ratio >= 0.0
        self.linked(take_end)(self.scene, self.work, self.clock, self.counts, self.euler, step)
        return ratio

    def locate(self):
        """Contacts anew, of what stands in NOW."""
        self.linked(locate_contacts)(self.scene, self.work, NOW)

    @property
    def time(self):
        return self.clock[TIME]

    @property
    def position(self):
        return self.work.motion[NOW, :, :VX].copy()

    @property
    def velocity(self):
        return self.work.motion[NOW, :, VX:].copy()
