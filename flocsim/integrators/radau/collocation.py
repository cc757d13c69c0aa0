"""The cubic through the stages of a Radau IIA step: the motion in it, the guess for the next."""

from flocsim.arrays import FIRST_STAGE, NOW, STAGED_AT, STAGED_STEP, START, TIME, TRIAL, VELOCITY
from flocsim.integrators.radau.tableau import NODES, SECOND_STAGE, THIRD_STAGE

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


def weighted(work, body, axis, weights):
    """The cubic through START and the stages."""
    motion = work.motion
    start, first, second, third = weights
    value = start * motion[START, body, axis] + first * motion[FIRST_STAGE, body, axis]
    value += second * motion[SECOND_STAGE, body, axis]
    return value + third * motion[THIRD_STAGE, body, axis]


def collocate(work, step, share):
    """Write the motion at a share of the step into TRIAL: the cubic through the stages."""
    weights = stage_weights(share)
    for body in range(work.motion.shape[1]):
        for axis in range(6):
            work.motion[TRIAL, body, axis] = weighted(work, body, axis, weights)


def keep_velocities(work):
    """First guess: the velocities stay as they are."""
    for body in range(work.motion.shape[1]):
        for axis in range(VELOCITY, VELOCITY + 3):
            for stage in range(3):
                work.motion[FIRST_STAGE + stage, body, axis] = work.motion[NOW, body, axis]


def carry_on(work, begin, scale):
    """First guess: the cubic of the stages that are there, whose step began ``begin`` of it ago."""
    one, two, three = NODES
    first = stage_weights(begin + one * scale)
    second = stage_weights(begin + two * scale)
    third = stage_weights(begin + three * scale)
    for body in range(work.motion.shape[1]):
        for axis in range(VELOCITY, VELOCITY + 3):
            guesses = (
                weighted(work, body, axis, first),
                weighted(work, body, axis, second),
                weighted(work, body, axis, third),
            )
            for stage in range(3):
                work.motion[FIRST_STAGE + stage, body, axis] = guesses[stage]


def guess_stages(work, clock, step):
    """The stages' velocities to start from, and where this step starts."""
    staged = clock[STAGED_STEP]
    if staged > 0.0 and step <= LONGEST_GUESS * staged:
        carry_on(work, (clock[TIME] - clock[STAGED_AT]) / staged, step / staged)
    else:
        keep_velocities(work)
    for body in range(work.motion.shape[1]):
        for axis in range(6):
            work.motion[START, body, axis] = work.motion[NOW, body, axis]
    clock[STAGED_STEP], clock[STAGED_AT] = step, clock[TIME]
