"""Methods that solve no systems: Dormand and Prince's, of order 5 with an embedded error estimate
of order 4, and velocity Verlet, of order 2, whose steps are fixed.
"""

import attrs

from flocsim.fields import quantity
from flocsim.integrators.base import Integrator
from flocsim.integrators.loop.step_size import adaptive_factor
from flocsim.integrators.parts import FixedStep, all_finite, evaluate, limit_slips, move_slips
from flocsim.integrators.rhs.error import end_of_run, error_ratio
from flocsim.integrators.rhs.forces import adopt_stage, locate_with_slip_rates, sum_forces
from flocsim.integrators.rhs.friction import slip_in
from flocsim.integrators.rhs.jacobian import weigh_velocities
from flocsim.integrators.rhs.views import inertia
from flocsim.state.work import FIRST_STAGE, NEW, NOW, STEP_ERROR

NODES = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
"""Where the stages lie in the step."""

MATRIX = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0, 0.0),
    (44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0, 0.0),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0, 0.0),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0, 0.0),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0.0),
)
"""Weights of the earlier stages' rates in each stage; the last one is the result."""

ESTIMATE = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
"""Weights of the rates in the error estimate (Hairer, Nørsett & Wanner 1993, table II.5.2)."""

ORDER_OF_ESTIMATE = 5.0
"""The estimate goes with this power of the step."""


def state_of(stage):
    """The state of a stage: the first one is NOW."""
    return NOW if stage == 0 else FIRST_STAGE + stage - 1


def acceleration_of(scene, work, state, body, axis):
    """Rate of a velocity in a state."""
    rate = work.force[state, body, axis]
    return rate * scene.bodies[body].free / inertia(scene, body, axis)


def combine(scene, work, weights, stages, base, end):
    """State ``end`` = ``base`` times state NOW + the weighted rates of the first stages."""
    for body in range(scene.bodies.shape[0]):
        for axis in range(3):
            way = faster = 0.0
            for stage in range(stages):
                if weights[stage] != 0.0:
                    state = state_of(stage)
                    way += weights[stage] * work.velocity[state, body, axis]
                    faster += weights[stage] * acceleration_of(scene, work, state, body, axis)
            work.place[end, body, axis] = base * work.place[NOW, body, axis] + way
            work.velocity[end, body, axis] = base * work.velocity[NOW, body, axis] + faster


def combine_slips(scene, work, weights, stages, step, end):
    """Tangential displacements of the closed pairs in state ``end``."""
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == 1:
            total = 0.0
            for stage in range(stages):
                total += weights[stage] * work.slip_rate[state_of(stage), row]
            work.slip[end, row] = slip_in(scene, work, end, row, work.slip[NOW, row] + step * total)


def times(weights, step):
    a, b, c, d, e, f, g = weights
    return a * step, b * step, c * step, d * step, e * step, f * step, g * step


def evaluate_stages(scene, work, time, step):
    """Rates of all seven stages; the last one becomes NEW."""
    for stage in range(7):
        state = state_of(stage)
        if stage > 0:
            combine(scene, work, times(MATRIX[stage], step), stage, 1.0, state)
        locate_with_slip_rates(scene, work, state)
        if stage > 0:
            combine_slips(scene, work, MATRIX[stage], stage, step, state)
        sum_forces(scene, work, time + NODES[stage] * step, state)
    adopt_stage(work, state)


@attrs.frozen
class DormandPrince54(Integrator):
    """Explicit Runge–Kutta of order 5, adaptive: for scenes that are not stiff, and to compare.

    Steps end where a pair of features touches or parts, so that the forces are smooth inside them.
    Parameters: ``tolerance`` [m], the error of a step in the place of any outline point, what its
    velocity error leads to included; ``first_step`` [s].

    Source: Dormand & Prince (1980), as in Hairer, Nørsett & Wanner (1993), table II.5.2.
    """

    tolerance: float = quantity("m", above=0.0, default=1e-9)
    first_step: float = quantity("s", above=0.0, default=1e-6)

    @staticmethod
    def attempt(scene, work, clock, step):
        """One step: error over tolerance, or −1 where the motion is no longer finite."""
        time = clock.time
        evaluate_stages(scene, work, time, step)
        weigh_velocities(scene, work, time, max(end_of_run(clock) - time, step))
        combine(scene, work, times(ESTIMATE, step), 7, 0.0, STEP_ERROR)
        return error_ratio(scene, work, clock, step)

    @staticmethod
    def next_step(clock, step, ratio):
        """The step for which the estimate meets the tolerance."""
        return step * adaptive_factor(clock, step, ratio, ORDER_OF_ESTIMATE)


HALFWAY = FIRST_STAGE
"""The state whose velocity is that of the middle of the step."""


def kick_and_drift(scene, work, step):
    """Half a kick into HALFWAY, whose velocity leads to the place of NEW; NEW has a whole kick."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            speed = work.velocity[NOW, body, axis]
            kick = gain(scene, work, NOW, body, axis, step)
            work.velocity[HALFWAY, body, axis] = speed + 0.5 * kick
            work.place[NEW, body, axis] = work.place[NOW, body, axis] + step * (speed + 0.5 * kick)
            # Drag at the half step's velocity would be half a step late: take a whole kick's.
            work.velocity[NEW, body, axis] = speed + kick


def finish_kick(scene, work, step):
    """The velocity of NEW: that of HALFWAY and half a kick at the force of NEW."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            kick = gain(scene, work, NEW, body, axis, 0.5 * step)
            work.velocity[NEW, body, axis] = work.velocity[HALFWAY, body, axis] + kick


def gain(scene, work, state, body, axis, step):
    """Change of a velocity in a step at the force of a state."""
    force = work.force[state, body, axis]
    return step * scene.bodies[body].free * force / inertia(scene, body, axis)


@attrs.frozen
class VelocityVerlet(FixedStep):
    """Fixed steps of ``step`` [s]: the plain explicit method, to compare with.

    Stable for steps below about 2/ω of the stiffest contact or the strongest damping.
    """

    @staticmethod
    def attempt(scene, work, clock, step):
        """Half a kick, a drift, half a kick: 0, or −1 where the motion is no longer finite."""
        evaluate(scene, work, clock.time, NOW)
        kick_and_drift(scene, work, step)
        move_slips(scene, work, step)
        sum_forces(scene, work, clock.time + step, NEW)
        finish_kick(scene, work, step)
        limit_slips(scene, work)
        return 0.0 if all_finite(work, NEW) else -1.0
