"""The cubic through the start and the stages of a Radau IIA step.

It is the dense output inside the step, gives the state where a step ends early at an event, and
extrapolates the first guess of the next step's stages.
"""

import math

from flocsim.constants import TINY
from flocsim.integrators.radau.contact_frames import is_active
from flocsim.integrators.radau.grazing import any_grazes
from flocsim.integrators.radau.tableau import NODES, SECOND_STAGE, THIRD_STAGE
from flocsim.integrators.rhs.error import NEGLIGIBLE
from flocsim.integrators.rhs.forces import copy_motion
from flocsim.integrators.rhs.views import inertia
from flocsim.state.work import DAMPING, FIRST_STAGE, NEW, NOW, START, STIFFNESS, TRIAL

STIFF_STEP = 25.0
"""Largest h² K/M + h D/M of a step that may end on its cubic: five times its shortest time scale,
squared. Beyond it, stiff forces balance at the stages only, and contacts would vibrate."""

MAX_EXTRAPOLATION = 2.0
"""Longest step, over the last one, for which the last cubic is extrapolated. At 8, a sixth of the
steps is saved, but the momentum of a doublet is off by 6 to 20 times as much."""


def basis(fraction, node):
    """Return the cubic at a fraction that is 1 at one of the nodes 0, c₁, c₂, 1 and 0 at the
    others."""
    value = 1.0
    here = 0.0 if node == 0 else NODES[node - 1]
    for other in range(4):
        if other != node:
            there = 0.0 if other == 0 else NODES[other - 1]
            value *= (fraction - there) / (here - there)
    return value


def stage_weights(fraction):
    """Return the weights of START and the three stages in the cubic at a fraction of the step."""
    return basis(fraction, 0), basis(fraction, 1), basis(fraction, 2), basis(fraction, 3)


def interpolate(weights, start, one, two, three):
    """Return the cubic through the values at the start and at the three stages."""
    _, first, second, third = weights
    # The weights sum to 1. In differences, a coordinate at rest stays exactly where it is.
    change = first * (one - start)
    change += second * (two - start)
    return start + change + third * (three - start)


def interpolate_axis(of, body, axis, weights):
    """Return the cubic of one coordinate of the array ``of``, positions or velocities."""
    return interpolate(
        weights, of[START, body, axis], of[FIRST_STAGE, body, axis],
        of[SECOND_STAGE, body, axis], of[THIRD_STAGE, body, axis],
    )  # fmt: skip


def write_interpolated(work, weights, state, body):
    """Write a body's motion on the cubic with these weights into a state."""
    for axis in range(3):
        work.place[state, body, axis] = interpolate_axis(work.place, body, axis, weights)
        work.velocity[state, body, axis] = interpolate_axis(work.velocity, body, axis, weights)


def interpolate_stages(work, fraction, body):
    """Write a body's motion at a fraction of the step into TRIAL."""
    write_interpolated(work, stage_weights(fraction), TRIAL, body)


def stiffness_of(scene, work, step):
    """Return the largest h² K/M + h D/M over all coordinates: how stiff a step is."""
    stiffest = 0.0
    for body in range(work.poses.shape[0]):
        if scene.bodies[body].free == 1.0:
            for axis in range(3):
                mass = inertia(scene, body, axis)
                spring = abs(work.jacobian[STIFFNESS, body, axis, axis])
                damping = abs(work.jacobian[DAMPING, body, axis, axis])
                stiffest = max(stiffest, step * (step * spring + damping) / max(mass, TINY))
    return stiffest


def end_on_cubic(scene, work, step, ratio, fraction):
    """Make the motion on the cubic at a fraction of the step the new state; return False if too
    inexact.

    The error of the cubic scales as h⁴, like the estimate, and is at most .25 of it in smooth
    motion (the maximum over all fractions, for x = t⁴); the end of a step is far better than its
    estimate. So only a step whose error is negligible may end there, and no stiff step.
    """
    if ratio > NEGLIGIBLE or any_grazes(work) or stiffness_of(scene, work, step) > STIFF_STEP:
        return False
    weights = stage_weights(fraction)
    for body in range(work.place.shape[1]):
        write_interpolated(work, weights, NEW, body)
    return True


def guess_constant_velocities(work):
    """Guess that the velocities at all stages are those of the start."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            for stage in range(3):
                work.velocity[FIRST_STAGE + stage, body, axis] = work.velocity[NOW, body, axis]


def guess_constant_accelerations(scene, work, step):
    """Guess that the accelerations at all stages are those of the start."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            mass = inertia(scene, body, axis)
            gain = scene.bodies[body].free * step * work.force[NOW, body, axis]
            for stage in range(3):
                speed = work.velocity[NOW, body, axis]
                speed += NODES[stage] * gain / max(mass, TINY)
                work.velocity[FIRST_STAGE + stage, body, axis] = speed


def is_nonstiff(work, step):
    """Return True if no contact or surface force acts, and drag hardly slows a body within a
    step."""
    for row in range(work.tally.candidates):
        if is_active(work, row):
            return False
    shortest = math.inf
    for body in range(work.poses.shape[0]):
        shortest = min(shortest, work.errors[body].relaxation_time)
    return NEGLIGIBLE * shortest >= step


def extrapolate_cubic(work, begin, scale):
    """Guess the stages by the cubic of the last step.

    ``begin`` is the time from that step's start to this one's, and ``scale`` the size of this step,
    both as multiples of the last step.
    """
    one, two, three = NODES
    first = stage_weights(begin + one * scale)
    second = stage_weights(begin + two * scale)
    third = stage_weights(begin + three * scale)
    # All three values are read before the first is written: they overwrite the stages they come
    # from.
    for body in range(work.place.shape[1]):
        for axis in range(3):
            guesses = (
                interpolate_axis(work.velocity, body, axis, first),
                interpolate_axis(work.velocity, body, axis, second),
                interpolate_axis(work.velocity, body, axis, third),
            )
            for stage in range(3):
                work.velocity[FIRST_STAGE + stage, body, axis] = guesses[stage]


def guess_stages(scene, work, clock, step):
    """Write a first guess of the stage velocities; store the start of the step."""
    staged = clock.stages_step
    # The stages of the last step are known, and not too short for this one.
    if staged > 0.0 and step <= MAX_EXTRAPOLATION * staged:
        extrapolate_cubic(work, (clock.time - clock.stages_time) / staged, step / staged)
    # Nothing is known: constant accelerations suit free motion, constant velocities a stiff
    # contact, whose acceleration soon ends.
    elif is_nonstiff(work, step):
        guess_constant_accelerations(scene, work, step)
    else:
        guess_constant_velocities(work)
    # From here on the stages belong to this step.
    copy_motion(work, NOW, START)
    clock.stages_step, clock.stages_time = step, clock.time
