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
    motion = work.motion
    return motion[state, a, at.X] - motion[state, b, at.X], motion[state, a, at.Y] - motion[
        state, b, at.Y
    ]


def nearest_image(scene, work, state, a, b):
    """The same where space repeats itself: of a's image that is nearest to b."""
    motion = work.motion
    x = motion[state, a, at.X] - motion[state, b, at.X]
    y = motion[state, a, at.Y] - motion[state, b, at.Y]
    width, height = scene.box
    if width < math.inf:
        x -= width * math.floor(x / width + 0.5)
    if height < math.inf:
        y -= height * math.floor(y / height + 0.5)
    return x, y


PERIODIC: dict[Callable, Callable] = {separation: nearest_image}
"""The replacement for scenes that repeat themselves."""
