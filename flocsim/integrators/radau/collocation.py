"""The cubic through the stages of a Radau IIA step: the motion in it, its end where something
switches, the guess for the next."""

import math

from flocsim.integrators.radau.grazing import any_grazes
from flocsim.integrators.radau.tableau import NODES, SECOND_STAGE, THIRD_STAGE
from flocsim.integrators.rhs.forces import save_start
from flocsim.integrators.rhs.views import inertia
from flocsim.state.work import DAMPING, FIRST_STAGE, NEW, NOW, START, STIFFNESS, TRIAL

GOOD_CUBIC = 0.1
"""A step whose error is at most this share of what is allowed may end anywhere on its cubic."""

STIFF = 25.0
"""h² K/M + h D/M from which on a step is stiff: five times as long as its fastest motion takes."""

TINY = 1e-300
"""Stands for no inertia."""

SOFT = 10.0
"""Accelerations last for a step that is so many times as short as velocities do."""

LONGEST_GUESS = 2.0
"""The last step's cubic is carried on for a step that is at most so many times as long."""


def basis(share, node):
    """The cubic that is 1 at one of the nodes 0, c1, c2, 1 and 0 at the others, at a share."""
    value = 1.0
    here = 0.0 if node == 0 else NODES[node - 1]
    for other in range(4):
        if other != node:
            there = 0.0 if other == 0 else NODES[other - 1]
            value *= (share - there) / (here - there)
    return value


def stage_weights(share):
    """Weights of START and of the stages in the cubic through them, at a share of the step."""
    return basis(share, 0), basis(share, 1), basis(share, 2), basis(share, 3)


def cubic(weights, start, one, two, three):
    """The cubic through a value at the start and those at the stages."""
    _, first, second, third = weights
    # In changes, so that what does not move stays just where it is.
    change = first * (one - start)
    change += second * (two - start)
    return start + change + third * (three - start)


def weighted(of, body, axis, weights):
    """The cubic through START and the stages, ``of`` places or velocities."""
    return cubic(
        weights, of[START, body, axis], of[FIRST_STAGE, body, axis],
        of[SECOND_STAGE, body, axis], of[THIRD_STAGE, body, axis],
    )  # fmt: skip


def write_cubic(work, weights, state, body):
    """Write a body's motion at a share of the step, of these weights, into a state."""
    for axis in range(3):
        work.place[state, body, axis] = weighted(work.place, body, axis, weights)
        work.velocity[state, body, axis] = weighted(work.velocity, body, axis, weights)


def collocate(work, step, share, body):
    """Write a body's motion at a share of the step into TRIAL: the cubic through the stages."""
    write_cubic(work, stage_weights(share), TRIAL, body)


def stiffness_of(scene, work, step):
    """How stiff a step is: the largest h² K/M + h D/M of a coordinate."""
    stiffest = 0.0
    for body in range(work.poses.shape[0]):
        if scene.bodies[body].free == 1.0:
            for axis in range(3):
                mass = inertia(scene, body, axis)
                spring = abs(work.jacobian[STIFFNESS, body, axis, axis])
                damping = abs(work.jacobian[DAMPING, body, axis, axis])
                stiffest = max(stiffest, step * (step * spring + damping) / max(mass, TINY))
    return stiffest


def end_on_the_cubic(scene, work, step, ratio, share):
    """Make the motion at a share of the step, on the cubic through the stages, the new state.

    Its error goes with h⁴ as the estimate of the step's does, and is at most .25 of that in smooth
    motion (the largest of all shares, for x = t⁴), while the end of the step is far better than
    estimated: only a step that is well within what is allowed may end so. Nor may a stiff one: only
    at the stages is a stiff force at rest, and contacts would hum.
    """
    if ratio > GOOD_CUBIC or any_grazes(work) or stiffness_of(scene, work, step) > STIFF:
        return False
    weights = stage_weights(share)
    for body in range(work.place.shape[1]):
        write_cubic(work, weights, NEW, body)
    return True


def keep_velocities(work):
    """First guess: the velocities stay as they are."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            for stage in range(3):
                work.velocity[FIRST_STAGE + stage, body, axis] = work.velocity[NOW, body, axis]


def keep_accelerations(scene, work, step):
    """First guess: the accelerations stay as they are."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            mass = inertia(scene, body, axis)
            gain = scene.bodies[body].free * step * work.force[NOW, body, axis]
            for stage in range(3):
                speed = work.velocity[NOW, body, axis]
                speed += NODES[stage] * gain / max(mass, TINY)
                work.velocity[FIRST_STAGE + stage, body, axis] = speed


def go_on_as_before(work, scale):
    """First guess: the accelerations of the last step, which was so much shorter, as a mean."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            speed = work.velocity[NOW, body, axis]
            gain = scale * (speed - work.velocity[START, body, axis])
            for stage in range(3):
                guess = speed + NODES[stage] * gain
                work.velocity[FIRST_STAGE + stage, body, axis] = guess


def is_soft(work, step):
    """Whether no pair of features acts, and drag takes little of a velocity in a step."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.contact_mode + candidate.surface_active > 0:
            return False
    shortest = math.inf
    for body in range(work.poses.shape[0]):
        shortest = min(shortest, work.errors[body].relaxation_time)
    return shortest >= SOFT * step


def carry_on(work, begin, scale):
    """First guess: the cubic of the stages that are there, whose step began ``begin`` of it ago."""
    one, two, three = NODES
    first = stage_weights(begin + one * scale)
    second = stage_weights(begin + two * scale)
    third = stage_weights(begin + three * scale)
    for body in range(work.place.shape[1]):
        for axis in range(3):
            guesses = (
                weighted(work.velocity, body, axis, first),
                weighted(work.velocity, body, axis, second),
                weighted(work.velocity, body, axis, third),
            )
            for stage in range(3):
                work.velocity[FIRST_STAGE + stage, body, axis] = guesses[stage]


def guess_stages(scene, work, clock, step):
    """The stages' velocities to start from, and where this step starts."""
    staged = clock.stages_step
    if staged < 0.0:
        go_on_as_before(work, -step / staged)
    elif staged > 0.0 and step <= LONGEST_GUESS * staged:
        carry_on(work, (clock.time - clock.stages_time) / staged, step / staged)
    elif is_soft(work, step):
        keep_accelerations(scene, work, step)
    else:
        keep_velocities(work)
    save_start(work)
    clock.stages_step, clock.stages_time = step, clock.time
