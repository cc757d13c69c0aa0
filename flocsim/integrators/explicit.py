"""Explicit methods: Dormand and Prince, of order 5 with an embedded estimate of order 4, and
velocity Verlet, of order 2 with fixed steps.

They solve no linear systems, and are limited to steps of a few 1/ω of the stiffest contact.
"""

import attrs

from flocsim.integrators.base import Adaptive
from flocsim.integrators.loop.step_size import adaptive_factor
from flocsim.integrators.parts import (
    FixedStep,
    acceleration,
    all_finite,
    evaluate,
    limit_slips,
    move_slips,
)
from flocsim.integrators.rhs.error import end_of_run, error_ratio
from flocsim.integrators.rhs.forces import adopt_stage, locate_with_slip_rates, sum_forces
from flocsim.integrators.rhs.friction import limited_slip
from flocsim.integrators.rhs.jacobian import weigh_velocities
from flocsim.state.contacts import CLOSED
from flocsim.state.work import FIRST_STAGE, NEW, NOW, STEP_ERROR

NODES = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
"""Times of the stages, as fractions of the step."""

MATRIX = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0, 0.0),
    (44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0, 0.0),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0, 0.0),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0, 0.0),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0.0),
)
"""Runge–Kutta matrix: weights of the earlier stages' rates in each stage; the last row is the
result."""

ESTIMATE = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
"""Weights of the rates in the error estimate (Hairer, Nørsett & Wanner 1993, table II.5.2)."""

ESTIMATE_ORDER = 5.0
"""The error estimate scales as this power of the step size."""


def state_of(stage):
    """Return the state of a stage; the first stage is NOW."""
    return NOW if stage == 0 else FIRST_STAGE + stage - 1


def combine(scene, work, weights, stages, step, base, end):
    """Write ``base`` times the motion of NOW, plus the step times the weighted rates of the first
    stages, to ``end``."""
    for body in range(scene.bodies.shape[0]):
        for axis in range(3):
            speed = change = 0.0
            for stage in range(stages):
                # Most rows of the tableau have zeros.
                if weights[stage] != 0.0:
                    state = state_of(stage)
                    speed += weights[stage] * work.velocity[state, body, axis]
                    change += weights[stage] * acceleration(scene, work, state, body, axis)
            work.place[end, body, axis] = base * work.place[NOW, body, axis] + step * speed
            work.velocity[end, body, axis] = base * work.velocity[NOW, body, axis] + step * change


def combine_slips(scene, work, weights, stages, step, end):
    """Write the tangential displacements of closed contacts, by the weighted rates, to state
    ``end``."""
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == CLOSED:
            total = 0.0
            for stage in range(stages):
                total += weights[stage] * work.slip_rate[state_of(stage), row]
            # A contact that slides stays at its limit.
            work.slip[end, row] = limited_slip(
                scene, work, end, row, work.slip[NOW, row] + step * total
            )


def evaluate_stages(scene, work, time, step):
    """Evaluate all seven stages; the last one becomes NEW."""
    for stage in range(7):
        state = state_of(stage)
        if stage > 0:
            combine(scene, work, MATRIX[stage], stage, step, 1.0, state)
        # Contacts are located before the forces are summed: these need the tangential
        # displacements.
        locate_with_slip_rates(scene, work, state)
        if stage > 0:
            combine_slips(scene, work, MATRIX[stage], stage, step, state)
        sum_forces(scene, work, time + NODES[stage] * step, state)
    # First same as last: the seventh stage is the result of order 5.
    adopt_stage(work, state)


@attrs.frozen
class DormandPrince54(Adaptive):
    """Explicit Runge–Kutta method of order 5 with error control, for scenes that are not stiff.

    Steps end where a contact opens, closes, sticks or slides, so that the forces are smooth inside
    them. It serves as a comparison for the implicit methods.

    Parameters
    ----------
    tolerance : float
        Largest error of a step [m], > 0: displacement of any point of an outline, including the
        displacement that the error of the velocity leads to later.
    first_step : float
        Size of the first step [s], > 0.

    Notes
    -----
    Source: Dormand & Prince (1980), as in Hairer, Nørsett & Wanner, Solving Ordinary Differential
    Equations I (1993), table II.5.2.
    """

    # Without a propagated vector the sums of estimates fell short by up to 1.8 times.
    estimate_share = 2.0

    @staticmethod
    def attempt(scene, work, clock, step):
        """Take one step; return its error over the tolerance, or −1 where the motion is no longer
        finite."""
        time = clock.time
        evaluate_stages(scene, work, time, step)
        # For how long a velocity error persists decides its weight.
        weigh_velocities(scene, work, time, max(end_of_run(clock) - time, step))
        # The embedded estimate, to STEP_ERROR.
        combine(scene, work, ESTIMATE, 7, step, 0.0, STEP_ERROR)
        return error_ratio(scene, work, clock, step)

    @staticmethod
    def next_step(clock, step, ratio):
        """Return the size [s] of the next step, for which the estimate meets the tolerance."""
        return step * adaptive_factor(clock, step, ratio, ESTIMATE_ORDER)


HALFWAY = FIRST_STAGE
"""The state that holds the velocity of the middle of the step."""


def kick_and_drift(scene, work, step):
    """Write the velocity after half the step to HALFWAY, and the position that it leads to into
    NEW.

    NEW also gets a preliminary velocity, for the drag at the end of the step.
    """
    for body in range(work.place.shape[1]):
        for axis in range(3):
            speed = work.velocity[NOW, body, axis]
            kick = step * acceleration(scene, work, NOW, body, axis)
            work.velocity[HALFWAY, body, axis] = speed + 0.5 * kick
            work.place[NEW, body, axis] = work.place[NOW, body, axis] + step * (speed + 0.5 * kick)
            # Drag at the velocity of HALFWAY would lag by half a step: predict the velocity of the
            # end.
            work.velocity[NEW, body, axis] = speed + kick


def finish_kick(scene, work, step):
    """Write the final velocity of NEW: HALFWAY plus half a step at the force of NEW."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            kick = 0.5 * step * acceleration(scene, work, NEW, body, axis)
            work.velocity[NEW, body, axis] = work.velocity[HALFWAY, body, axis] + kick


@attrs.frozen
class VelocityVerlet(FixedStep):
    """Velocity Verlet: explicit, of order 2, with fixed steps and without error control.

    Stable for steps below about 2/ω of the stiffest contact or the strongest damping. It serves as
    a comparison.

    Parameters
    ----------
    step : float
        Size of each step [s], > 0.

    Notes
    -----
    x₁ = x₀ + h v₀ + ½ h² a₀; v₁ = v₀ + ½ h (a₀ + a₁), where a₁ uses the predicted velocity v₀ + h
    a₀. Contacts are located, and their modes set, at both ends of a step.
    """

    @staticmethod
    def attempt(scene, work, clock, step):
        """Take one step; return 0, or −1 where the motion is no longer finite."""
        evaluate(scene, work, clock.time, NOW)
        kick_and_drift(scene, work, step)
        move_slips(scene, work, step)
        sum_forces(scene, work, clock.time + step, NEW)
        finish_kick(scene, work, step)
        limit_slips(scene, work)
        return 0.0 if all_finite(work, NEW) else -1.0
