"""Single steps of backward Euler, uncompiled, of a few bodies."""

from flocsim import System
from flocsim.compiler.composer import compose
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators import BackwardEuler
from flocsim.integrators.backward_euler.newton import begin_step
from flocsim.integrators.backward_euler.step import euler_step, solve_step
from flocsim.integrators.loop.driver import accept, keep_lists, went_too_far
from flocsim.state.work import NOW, work_of


def find_end(scene, work, clock, step):
    """The end of one step."""
    begin_step(work, clock)
    return solve_step(scene, work, clock, step)


def whole_step(scene, work, clock, counts, step):
    """One step, however large its error: that over the tolerance; a smaller one where no end is
    found, as a run has it."""
    ratio, _ = euler_step(scene, work, clock, step, False)
    while ratio < 0.0:
        assert step > 1e-9
        step *= 0.5
        ratio, _ = euler_step(scene, work, clock, step, False)
    assert not went_too_far(scene, work, clock, step)
    accept(scene, work, clock, counts, step, True)
    return ratio


class Stage:
    """Bodies, listed and located, for steps of backward Euler."""

    def __init__(self, bodies, forces, fluid=None, tolerance=1e-9):
        integrator = BackwardEuler(tolerance=tolerance)
        fluids = {} if fluid is None else {"fluid": fluid}
        system = System(bodies, forces, integrator, **fluids)
        self.fillings = system.fillings(grows=True)
        self.scene = system.scene(jit=False)
        self.work = work_of(self.scene, *system.motion())
        self.clock, self.counts = integrator.fresh_clock(), integrator.fresh_counts(10**6)
        self.clock.until = 1.0
        assert self.linked(keep_lists)(self.scene, self.work, 0.0)

    def linked(self, function):
        """The function with this family's others in the place of hooks."""
        return compose(function, self.fillings, jit=False)

    def end(self, step):
        """Whether the step's end was found; it is left in NOW."""
        return self.linked(find_end)(self.scene, self.work, self.clock, step)

    def step(self, step):
        """Take a step, however large its error: that over the tolerance."""
        return self.linked(whole_step)(self.scene, self.work, self.clock, self.counts, step)

    def locate(self):
        """Contacts anew, of what stands in NOW."""
        self.linked(locate_contacts)(self.scene, self.work, NOW)

    @property
    def time(self):
        return self.clock.time

    @property
    def position(self):
        return self.work.place[NOW].copy()

    @property
    def velocity(self):
        return self.work.velocity[NOW].copy()
