"""Locating an event inside a step: the step is shortened until it ends there.

A bracket is (low, high, value at low, value at high, side, trials): step sizes that end before and
behind the event, the event's values there, which end the last trial moved (+1 low, −1 high), and
how many trials there were.
"""

import math

from flocsim.layout import TOLERANCE

EVENT_ACCURACY = 1e-3
"""Events are located to this share of the tolerance …"""

EVENT_FLOOR = 1e-13
"""… but not finer than this [m]."""

EVENT_TRIALS = 60
"""Steps tried to locate one event; the bracket is then as narrow as floats allow."""

NO_BRACKET = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""No event is being located."""


def event_accuracy(clock):
    """How near to an event's zero a located step must end [m]."""
    if clock[TOLERANCE] == math.inf:
        return EVENT_FLOOR
    return max(EVENT_ACCURACY * clock[TOLERANCE], EVENT_FLOOR)


def between(bracket):
    """Where a straight line through the bracket's values crosses zero; its middle where not."""
    low, high, at_low, at_high, _, _ = bracket
    trial = (low * at_high - high * at_low) / (at_high - at_low)
    if low < trial < high:
        return trial
    return 0.5 * (low + high)


def narrowed(bracket, step, value):
    """The bracket (low, high, values there, last side, trials) after a trial step (Illinois).

    The value of an end that stays is halved, so that both ends close in.
    """
    low, high, at_low, at_high, side, trials = bracket
    if trials == 0.0:
        return 0.0, step, at_low, value, 0.0, 1.0
    if value > 0.0:
        return step, high, value, at_high * (0.5 if side == 1.0 else 1.0), 1.0, trials + 1.0
    return low, step, at_low * (0.5 if side == -1.0 else 1.0), value, -1.0, trials + 1.0


def is_located(bracket, value, clock):
    """Whether a step that ends at this value of the event is near enough to it."""
    low, high, _, _, _, trials = bracket
    narrow = trials > 0.0 and high - low <= 1e-15 * high
    return narrow or trials >= EVENT_TRIALS or abs(value) <= event_accuracy(clock)
