"""How a run can end."""

from enum import IntEnum


class Status(IntEnum):
    """How a run ended: a typed result, never an exception."""

    FINISHED = 1
    STOPPED = 2
    STEP_BUDGET = 3
    STALLED = 4
    TOO_DEEP = 5
    NO_ROOM = 6
    RECORD_FULL = 7
    PAUSED = 8
    NOT_FINITE = 9

    @property
    def reason(self):
        """What happened and what to do, in one line."""
        return REASONS[self]


REASONS = {
    Status.FINISHED: "the end time was reached",
    Status.STOPPED: "the observer stopped the run",
    Status.STEP_BUDGET: "the step budget ran out: raise integrator.max_steps or the tolerance",
    Status.STALLED: "the step shrank to nothing: the forces change too abruptly for the tolerance",
    Status.TOO_DEEP: "two bodies overlap by more than half of r_i + r_j, where the contact law has "
    "lost its meaning: use stiffer contacts, smaller steps or a larger spheroradius",
    Status.NO_ROOM: "the list of contact candidates is full",
    Status.RECORD_FULL: "the record is full",
    Status.PAUSED: "the run is paused",
    Status.NOT_FINITE: "the motion is no longer finite: the step is too large for these forces",
}
