"""Building blocks of integrators, also of a user's own: the functions that ``attempt`` may call.

examples/own_integrator.py is a complete method in a few lines. flocsim.integrators.base.Integrator
specifies the input and output of ``attempt``.
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
from flocsim.state.contacts import CLOSED
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
    """Compute the forces and torques in a state.

    Parameters
    ----------
    scene, work
        As given to ``attempt``.
    time : float
        Time at which time-dependent forces are evaluated [s].
    state : int
        NOW or NEW. Motion and tangential displacements of that state are the input;
        ``work.force[state]`` (n, 3) [N, N, N m] is the output.
    """
    locate_with_slip_rates(scene, work, state)
    sum_forces(scene, work, time, state)


def evaluate_as_they_lie(scene, work):
    """Compute the forces of NOW for bodies that were placed by hand; return False without room.

    All candidate pairs are listed and their modes set anew from the positions. False means that the
    list of candidates is full.
    """
    # The existing list was made for other positions: which pairs are near must be found anew.
    if not rebuild_list(scene, work):
        return False
    locate_and_flag(scene, work, NOW)
    evaluate(scene, work, 0.0, NOW)
    return True


def acceleration(scene, work, state, body, axis):
    """Return the acceleration of a body in an evaluated state.

    Parameters
    ----------
    scene, work
        As given to ``attempt``.
    state : int
        A state that ``evaluate`` has been called for.
    body : int
        Index of the body.
    axis : int
        0 and 1: x and y [m/s²]; 2: rotation [rad/s²].

    Returns
    -------
    float
        Force over mass, or torque over moment of inertia; 0 for a fixed body.
    """
    force = work.force[state, body, axis]
    return scene.bodies[body].free * force / inertia(scene, body, axis)


def move_slips(scene, work, step):
    """Advance the tangential displacements over a fixed step, from NOW to ``work.slip[NEW]``.

    The motion of NEW must be known, and NOW evaluated. Contacts are located in NEW. The
    displacement grows by the step times the mean of its rates at both ends (trapezoidal rule); a
    contact that closed in the step has the rate at the end alone.
    """
    locate_with_slip_rates(scene, work, NEW)
    slip = work.slip
    for row in range(work.tally.candidates):
        # An open contact has no displacement.
        slip[NEW, row] = 0.0
        if work.candidates[row].contact_mode == CLOSED:
            # Contacts that were open at the start have no rate there.
            rate = tangential_rate(work, NEW, row)
            if work.geometry[NOW, row].gap < 0.0:
                rate = 0.5 * (rate + tangential_rate(work, NOW, row))
            slip[NEW, row] = slip[NOW, row] + step * rate


def all_finite(work, state):
    """Return True if all positions and velocities of a state are finite."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            if not math.isfinite(work.place[state, body, axis]):
                return False
            if not math.isfinite(work.velocity[state, body, axis]):
                return False
    return True


def locate_and_flag(scene, work, state):
    """Locate the contacts of a state and set their modes by the gaps there.

    Fixed steps do not end at events: every evaluation sets the modes anew.
    """
    # Geometry first: gaps decide which contacts are closed, and which share surface forces.
    locate_contacts(scene, work, state)
    set_closed(work, state)
    flag_near(scene, work, state, 0.0)


@attrs.frozen
class FixedStep(Integrator):
    """Base class of methods with steps of one fixed size.

    Parameters
    ----------
    step : float
        Size of each step [s], > 0.

    Notes
    -----
    There is no error control: ``attempt`` returns 0, or −1 where the motion is no longer finite.
    """

    step: float = quantity("s", above=0.0, default=1e-8)

    @staticmethod
    def next_step(clock, step, ratio):
        # The last step before a stop is shorter: return to the full size after it.
        return clock.largest_step

    @property
    def first_step(self) -> float:  # type: ignore[override]
        return self.step

    @property
    def largest_step(self) -> float:  # type: ignore[override]
        return self.step

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """{hook: function}: contacts are located and their modes set at every evaluation."""
        # By default modes change at events only, at which fixed steps do not end.
        return {locate_acting: locate_and_flag}
