"""The error that a run states: what the errors of its steps and of its switches have led to by now.

A step's error of place stays, one of velocity goes on moving a body until drag has used it up:

    dE_x/dt = E_v,  dE_v/dt = −E_v/τ,

with what every step adds to both. A switch adds to E_v: a touch that is noticed g too deep, or a
parting g too late, at the speed v, leaves out (or adds) the contact's force for a time g/v.
A contact that may be open, because it overlaps by no more than its gap may be wrong by, leaves the
force in doubt for all of the step.

Motion itself carries errors on and mixes them up. OF_SWITCHES, and a method's ``estimate_share``
of what it estimates for its steps, were found on random runs that make a nudge grow less than
tenfold (benchmarks/accuracy/stated_error.py); what amplifies it more, as a doublet that tips over
one way or the other, is told by a nudged companion alone.
"""

import math

from flocsim.arrays import (
    ANGLE,
    BOUNDING_RADIUS,
    CANDIDATES,
    CLOSED,
    DEVIATION,
    EDGE_ARM_N,
    EDGE_BODY,
    ERROR,
    ERROR_PLACE,
    ERROR_SPEED,
    ESTIMATE_SHARE,
    FREE,
    GAP,
    INERTIA,
    MASS,
    NORMAL_X,
    NORMAL_Y,
    NOW,
    RELAXATION,
    STEP_ERROR,
    STEP_PLACE,
    STEP_SPEED,
    SWITCH_PLACE,
    SWITCH_SPEED,
    VERTEX_ARM_N,
    VERTEX_BODY,
    X,
    Y,
)
from flocsim.integrators.rhs.views import contact_view, normal_rate
from flocsim.laws import contact_force

OF_SWITCHES = 1.5
"""By how much motion may have made the errors of switches grow."""

DOUBT = 2.0
"""A contact that overlaps by less than so many times what its gap may be wrong by may be open."""

LONG = 1e6
"""A relaxation so many times as long as a step counts as none."""


def carried(work, body, place, speed, step):
    """Carry one kind of error of a body over a step."""
    errors, lasting = work.bodies, work.bodies[body, RELAXATION]
    left = math.exp(-step / lasting) if step < LONG * lasting else 0.0
    way = step if lasting > LONG * step else lasting * (1.0 - left)
    errors[body, place] += errors[body, speed] * way
    errors[body, speed] *= left


def carry_errors(work, clock, step):
    """Carry every body's errors over a step that has been accepted, and add the step's own."""
    known, errors = False, work.bodies
    for body in range(work.bodies.shape[0]):
        carried(work, body, ERROR_PLACE, ERROR_SPEED, step)
        carried(work, body, SWITCH_PLACE, SWITCH_SPEED, step)
        errors[body, ERROR_PLACE] += errors[body, STEP_PLACE]
        errors[body, ERROR_SPEED] += errors[body, STEP_SPEED]
        known = known or errors[body, STEP_PLACE] + errors[body, STEP_SPEED] > 0.0
    largest = 0.0
    for body in range(work.bodies.shape[0]):
        if not known:
            errors[body, ERROR_PLACE] += clock[STEP_ERROR]
        stated = clock[ESTIMATE_SHARE] * errors[body, ERROR_PLACE]
        stated += OF_SWITCHES * errors[body, SWITCH_PLACE]
        largest = max(largest, stated)
    clock[ERROR] = largest


def add_impulse(scene, work, body, impulse):
    """Add what an impulse at its outline [N s] does to a body's velocity."""
    if scene.bodies[body, FREE] == 1.0:
        size = scene.bodies[body, BOUNDING_RADIUS]
        share = 1.0 / scene.bodies[body, MASS] + size * size / scene.bodies[body, INERTIA]
        work.bodies[body, SWITCH_SPEED] += impulse * share


def gap_deviation(work, row):
    """By how much the gap of a pair is likely to be wrong at the end of the step [m]."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    e, g = work.motion, work.geometry
    gap = g[NOW, row, NORMAL_X] * (e[DEVIATION, a, X] - e[DEVIATION, b, X])
    gap += g[NOW, row, NORMAL_Y] * (e[DEVIATION, a, Y] - e[DEVIATION, b, Y])
    gap += g[NOW, row, VERTEX_ARM_N] * e[DEVIATION, a, ANGLE]
    return gap - g[NOW, row, EDGE_ARM_N] * e[DEVIATION, b, ANGLE]


def doubtful_time(scene, work, row, step, depth):
    """For how much of a step it is in doubt whether a pair touched [s]."""
    gap = work.geometry[NOW, row, GAP]
    closed = 1 if gap < 0.0 else 0
    if closed != work.candidates[row, CLOSED]:
        speed = abs(normal_rate(work, NOW, row))
        return min(abs(gap) / speed, step) if speed > 0.0 else step
    doubt = max(depth, DOUBT * abs(gap_deviation(work, row)))
    return step if closed == 1 and -gap < doubt else 0.0


def add_switch_errors(scene, work, step, depth):
    """Add the errors of pairs that have touched or parted, before they are flagged anew, and of
    those closed by so little that they may be open; ``depth`` [m]: to which switches are told."""
    for row in range(work.tally[CANDIDATES]):
        late = doubtful_time(scene, work, row, step, depth)
        if late > 0.0:
            normal, tangential = contact_force(scene, contact_view(scene, work, NOW, row))
            impulse = late * math.hypot(normal, tangential)
            add_impulse(scene, work, work.candidates[row, VERTEX_BODY], impulse)
            add_impulse(scene, work, work.candidates[row, EDGE_BODY], impulse)
