"""What methods are made of, one's own included: the pieces that ``attempt`` may call.

examples/own_integrator.py is a whole method in a few lines; flocsim.integrators.base.Integrator
says what ``attempt`` is given and has to fill.
"""

import math
from collections.abc import Callable

import attrs

from flocsim.fields import quantity
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_acting, locate_contacts
from flocsim.integrators.base import Integrator
from flocsim.integrators.events.first_event import set_closed
from flocsim.integrators.loop.step_size import adaptive_factor
from flocsim.integrators.rhs.error import error_ratio
from flocsim.integrators.rhs.forces import locate_with_slip_rates, sum_forces
from flocsim.integrators.rhs.friction import limit_slips
from flocsim.integrators.rhs.jacobian import weigh_velocities
from flocsim.integrators.rhs.surface_gap import flag_near
from flocsim.integrators.rhs.views import inertia, tangential_rate
from flocsim.state.work import NEW, NOW

__all__ = [
    "NEW",
    "NOW",
    "FixedStep",
    "acceleration",
    "adaptive_factor",
    "all_finite",
    "error_ratio",
    "evaluate",
    "evaluate_as_they_lie",
    "limit_slips",
    "move_slips",
    "weigh_velocities",
]


def evaluate(scene, work, time, state):
    """Forces and torques in a state, from its motion and its tangential displacements."""
    locate_with_slip_rates(scene, work, state)
    sum_forces(scene, work, time, state)


def evaluate_as_they_lie(scene, work):
    """Forces and torques of NOW where bodies have been put: all pairs are listed and flagged anew;
    False where the list has no room."""
    if not rebuild_list(scene, work):
        return False
    locate_contacts(scene, work, NOW)
    set_closed(work)
    flag_near(scene, work, NOW, 0.0)
    evaluate(scene, work, 0.0, NOW)
    return True


def acceleration(scene, work, state, body, axis):
    """Rate of change of a body's velocity (axis 0, 1) or spin (2) in an evaluated state; 0 where
    the body is fixed."""
    force = work.force[state, body, axis]
    return scene.bodies[body].free * force / inertia(scene, body, axis)


def move_slips(scene, work, step):
    """Contact geometry of NEW, and the tangential displacements there from the mean of their rates
    at both ends of a fixed step whose start has been evaluated."""
    locate_with_slip_rates(scene, work, NEW)
    slip = work.slip
    for row in range(work.tally.candidates):
        slip[NEW, row] = 0.0
        if work.candidates[row].contact_mode == 1:
            rate = tangential_rate(work, NEW, row)
            if work.geometry[NOW, row].gap < 0.0:
                rate = 0.5 * (rate + tangential_rate(work, NOW, row))
            slip[NEW, row] = slip[NOW, row] + step * rate


def all_finite(work, state):
    for body in range(work.place.shape[1]):
        for axis in range(3):
            if not math.isfinite(work.place[state, body, axis]):
                return False
            if not math.isfinite(work.velocity[state, body, axis]):
                return False
    return True


def locate_and_flag(scene, work, state):
    """Fixed steps do not end at switches: every evaluation flags the pairs as they are."""
    locate_contacts(scene, work, state)
    set_closed(work, state)
    flag_near(scene, work, state, 0.0)


@attrs.frozen
class FixedStep(Integrator):
    """A method whose steps all have the size ``step`` [s]."""

    step: float = quantity("s", above=0.0, default=1e-8)

    @staticmethod
    def next_step(clock, step, ratio):
        return clock.largest_step

    @property
    def first_step(self) -> float:  # type: ignore[override]
        return self.step

    @property
    def largest_step(self) -> float:  # type: ignore[override]
        return self.step

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """Pairs are located and flagged at every evaluation."""
        return {locate_acting: locate_and_flag}
