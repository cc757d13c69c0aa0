"""Implicit: linearly implicit in the velocities, adaptive, second order by extrapolation.

Each step is done once whole and once in halves; their difference is the error, and their
extrapolation is the result.
"""

import attrs

from flocsim import slots
from flocsim.fields import quantity
from flocsim.geometry.contacts import locate_contacts
from flocsim.integrators.active_set import end_view, solve_velocities
from flocsim.integrators.assembly import assemble_base
from flocsim.integrators.base import Integrator, all_finite
from flocsim.integrators.slips import limited_slip
from flocsim.layout import (
    BOUNDING_RADIUS,
    CANDIDATES,
    EVALUATIONS,
    FULL,
    HALF,
    NEW,
    NOW,
    TIME,
    TOLERANCE,
)
from flocsim.slots import has_contact, surface_reach


def end_slips(scene, work, start, end, step):
    """Tangential displacements at the end of the step."""
    for row in range(work.tally[CANDIDATES]):
        work.slip[end, row] = 0.0
        if work.candidates[row, 5] == 1:
            view = end_view(scene, work, row, start, end, step)
            work.slip[end, row] = limited_slip(scene, view)


def single_step(scene, work, time, tolerance, start, end, step):
    """One linearly implicit step from state ``start`` to state ``end``; False where it fails."""
    work.tally[EVALUATIONS] += 1
    motion = work.motion
    if has_contact() or surface_reach(scene.parameters) > 0.0:
        locate_contacts(scene, work, start)
    assemble_base(scene, work, time, start, step)
    for body in range(scene.bodies.shape[0]):
        for axis in range(3, 6):
            motion[end, body, axis] = motion[start, body, axis]
    if not solve_velocities(scene, work, start, end, step, tolerance):
        return False
    end_slips(scene, work, start, end, step)
    for body in range(scene.bodies.shape[0]):
        for axis in range(3):
            motion[end, body, axis] = motion[start, body, axis] + step * motion[end, body, 3 + axis]
    return True


def extrapolate(scene, work):
    """NEW = twice the halves less the whole; the largest difference of place [m]."""
    largest = 0.0
    motion = work.motion
    for body in range(scene.bodies.shape[0]):
        for axis in range(6):
            change = motion[NEW, body, axis] - motion[FULL, body, axis]
            motion[NEW, body, axis] += change
            if axis < 3:
                lever = scene.bodies[body, BOUNDING_RADIUS] if axis == 2 else 1.0
                largest = max(largest, abs(change) * lever)
    for row in range(work.tally[CANDIDATES]):
        if work.slip[NEW, row] != 0.0 and work.slip[FULL, row] != 0.0:
            work.slip[NEW, row] += work.slip[NEW, row] - work.slip[FULL, row]
    return largest


def implicit_attempt(scene, work, clock, step):
    """A step and its two halves: error over tolerance, or −1 where a solve failed."""
    time, tolerance = clock[TIME], clock[TOLERANCE]
    half = 0.5 * step
    # One call in a loop: every place that a driver calls from is compiled again.
    for stage in range(3):
        start = HALF if stage == 2 else NOW
        end = FULL if stage == 0 else HALF if stage == 1 else NEW
        length = step if stage == 0 else half
        begin = time + half if stage == 2 else time
        if not single_step(scene, work, begin, tolerance, start, end, length):
            return -1.0
    error = extrapolate(scene, work)
    if not all_finite(work, NEW):
        return -1.0
    return error / tolerance


def implicit_next_step(clock, step, ratio):
    """The error goes with step²: aim below the tolerance, change by a factor of 1/5 to 4."""
    factor = 0.9 / max(ratio, 1e-12) ** 0.5
    return step * min(max(factor, 0.2), 4.0)


@attrs.frozen
class Implicit(Integrator):
    """Adaptive and stable for any stiffness: the default.

    Parameters: ``tolerance`` [m], the local error of a step in the place of any outline point;
    ``first_step`` [s].
    """

    tolerance: float = quantity("m", above=0.0, default=1e-9)
    first_step: float = quantity("s", above=0.0, default=1e-6)

    @property
    def fillings(self):
        """The slots that this integrator fills."""
        return {slots.attempt: implicit_attempt, slots.next_step: implicit_next_step}
