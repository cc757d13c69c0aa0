"""flocsim's right-hand side as a function of one state vector, compiled, for SciPy's solvers.

The vector is x, y, angle, vx, vy, spin of each body, then the tangential displacement of every
listed pair.
"""

import math
from typing import NamedTuple

import numpy as np

from flocsim.geometry.contact.candidates import (
    outline_speed,
    rebuild_list_ahead,
    spent_budget,
    transfer_slips,
)
from flocsim.geometry.contact.points import locate_contacts
from flocsim.hooks import observe
from flocsim.integrators.events.crossings import any_too_deep
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.rhs.forces import locate_with_slip_rates, sum_forces
from flocsim.integrators.rhs.views import inertia
from flocsim.state.scene import Scene
from flocsim.state.work import NOW, Work


class Given(NamedTuple):
    """What all functions of this module work on; a solver calls them with a table of it."""

    scene: Scene
    work: Work
    observed: np.ndarray  # the observer's array


def read_state(work, vector):
    """Write a state vector into NOW."""
    bodies = work.place.shape[1]
    for body in range(bodies):
        for axis in range(3):
            work.place[NOW, body, axis] = vector[6 * body + axis]
            work.velocity[NOW, body, axis] = vector[6 * body + 3 + axis]
    for row in range(work.tally.candidates):
        work.slip[NOW, row] = vector[6 * bodies + row]


def rate_state(given, time, vector, rates):
    """Derivative of a state vector by time, every listed pair flagged as it is there."""
    scene, work = given[0].scene, given[0].work
    read_state(work, vector)
    locate_with_slip_rates(scene, work, NOW)
    sum_forces(scene, work, time, NOW)
    bodies = work.place.shape[1]
    for body in range(bodies):
        for axis in range(3):
            gain = scene.bodies[body].free / inertia(scene, body, axis)
            rates[6 * body + axis] = vector[6 * body + 3 + axis]
            rates[6 * body + 3 + axis] = gain * work.force[NOW, body, axis]
    for row in range(work.tally.candidates):
        closed = work.candidates[row].contact_mode == 1
        rates[6 * bodies + row] = work.slip_rate[NOW, row] if closed else 0.0


def locate_now(scene, work):
    """Geometry and flags of NOW; the smallest gap [m] (inf without pairs)."""
    least = locate_contacts(scene, work, NOW)
    set_modes(scene, work)
    return least


LISTED_FOR = 1e-4
"""Steps [s] that lists are made for: shorter lists cost the solvers more starts, longer ones rows
and accuracy."""


def longest_step(scene, work):
    """The step [s] in which the two bodies of a pair use up half of their list's budget."""
    if scene.bodies.shape[0] < 2:
        return math.inf
    speed = outline_speed(scene, work, 0) + outline_speed(scene, work, 1)
    return 0.5 * work.budget[0] / max(speed, 1e-12)


def list_anew(given):
    """Hand displacements on, list the pairs; the longest step for this list, −1 without room."""
    scene, work = given[0].scene, given[0].work
    locate_now(scene, work)
    transfer_slips(scene, work)
    if not rebuild_list_ahead(scene, work, LISTED_FOR):
        return -1.0
    locate_now(scene, work)
    return longest_step(scene, work)


def inspect(given, time, vector, watch):
    """(share of the list's budget spent, a pair with slip has opened, least gap, too deep, code).

    The code is the observer's if it is to ``watch``, else 0.
    """
    scene, work, observed = given[0].scene, given[0].work, given[0].observed
    read_state(work, vector)
    least = locate_now(scene, work) if work.tally.candidates > 0 else math.inf
    opened = False
    for row in range(work.tally.candidates):
        opened = opened or (work.candidates[row].contact_mode == 0 and work.slip[NOW, row] != 0.0)
    code = observe(scene, work, observed, time) if watch else 0
    return spent_budget(scene, work, NOW), opened, least, any_too_deep(scene, work, NOW), code
