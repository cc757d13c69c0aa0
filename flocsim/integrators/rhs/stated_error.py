"""The error that a run states: what the errors of its steps and of its switches have led to by now.

A step's error of place stays, one of velocity goes on moving a body until drag has used it up:

    dE_x/dt = E_v,  dE_v/dt = −E_v/τ,

with what every step adds to both. A switch adds to E_v: a touch that is noticed g too deep, or a
parting g too late, at the speed v, leaves out (or adds) the contact's force for a time g/v.
Motion itself carries errors on and mixes them up; SAFETY stands for a growth of that size, and
more (a doublet that tips over one way or the other) is told by a nudged companion alone.
"""

import math

from flocsim.arrays import (
    BOUNDING_RADIUS,
    CANDIDATES,
    CLOSED,
    EDGE_BODY,
    ERROR,
    ERROR_PLACE,
    ERROR_SPEED,
    FREE,
    GAP,
    INERTIA,
    MASS,
    NOW,
    RELAXATION,
    STEP_ERROR,
    STEP_PLACE,
    STEP_SPEED,
    VERTEX_BODY,
)
from flocsim.integrators.rhs.views import contact_view, normal_rate
from flocsim.laws import contact_force

SAFETY = 3.0
"""By how much motion may have made errors grow."""

LONG = 1e6
"""A relaxation so many times as long as a step counts as none."""


def carry_errors(work, clock, step):
    """Carry every body's errors over a step that has been accepted, and add the step's own."""
    known = False
    for body in range(work.bodies.shape[0]):
        errors, lasting = work.bodies, work.bodies[body, RELAXATION]
        left = math.exp(-step / lasting) if step < LONG * lasting else 0.0
        way = step if lasting > LONG * step else lasting * (1.0 - left)
        errors[body, ERROR_PLACE] += errors[body, ERROR_SPEED] * way + errors[body, STEP_PLACE]
        errors[body, ERROR_SPEED] = errors[body, ERROR_SPEED] * left + errors[body, STEP_SPEED]
        known = known or errors[body, STEP_PLACE] + errors[body, STEP_SPEED] > 0.0
    largest = 0.0
    for body in range(work.bodies.shape[0]):
        if not known:
            work.bodies[body, ERROR_PLACE] += clock[STEP_ERROR]
        largest = max(largest, work.bodies[body, ERROR_PLACE])
    clock[ERROR] = SAFETY * largest


def add_impulse(scene, work, body, impulse):
    """Add what an impulse at its outline [N s] does to a body's velocity."""
    if scene.bodies[body, FREE] == 1.0:
        size = scene.bodies[body, BOUNDING_RADIUS]
        share = 1.0 / scene.bodies[body, MASS] + size * size / scene.bodies[body, INERTIA]
        work.bodies[body, ERROR_SPEED] += impulse * share


def add_late_switches(scene, work, step):
    """Add the errors of the pairs that have touched or parted, before they are flagged anew."""
    for row in range(work.tally[CANDIDATES]):
        gap = work.geometry[NOW, row, GAP]
        closed = 1 if gap < 0.0 else 0
        if closed != work.candidates[row, CLOSED]:
            normal, tangential = contact_force(scene, contact_view(scene, work, NOW, row))
            speed = abs(normal_rate(work, NOW, row))
            late = min(abs(gap) / speed, step) if speed > 0.0 else step
            impulse = late * math.hypot(normal, tangential)
            add_impulse(scene, work, work.candidates[row, VERTEX_BODY], impulse)
            add_impulse(scene, work, work.candidates[row, EDGE_BODY], impulse)
