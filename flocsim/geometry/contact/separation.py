"""How far two bodies lie apart: the one place that knows whether space repeats itself."""

import math
from collections.abc import Callable

import flocsim.arrays as at
from flocsim.hooks import hook


def length_of(x, y):
    """The length of a vector: a root, where math.hypot calls a library's function, which costs more
    than most of what is done with it. Squares of what a run has in it neither overflow nor vanish.
    """
    return math.sqrt(x * x + y * y)


@hook
def separation(scene, work, state, a, b):
    """(x, y) of body a as seen from body b, in a state [m]."""
    m = work.motion
    return m[state, a, at.X] - m[state, b, at.X], m[state, a, at.Y] - m[state, b, at.Y]


def nearest_way(length, period):
    """A way along an axis, by the nearest image [m]."""
    if period < math.inf:
        return length - period * math.floor(length / period + 0.5)
    return length


def nearest_image(scene, work, state, a, b):
    """The same where space repeats itself: of a's image that is nearest to b."""
    m, (width, height) = work.motion, scene.box
    x = nearest_way(m[state, a, at.X] - m[state, b, at.X], width)
    return x, nearest_way(m[state, a, at.Y] - m[state, b, at.Y], height)


PERIODIC: dict[Callable, Callable] = {separation: nearest_image}
"""The replacement for scenes that repeat themselves."""
