"""How finely the instant of a touch must be known: what follows from a contact hangs on it.

A contact that is noticed g too deep gives back a velocity that is off by about ω0 g; one that goes
on damping until g behind its end, by that force's acceleration times g/speed.
"""

import math

from flocsim.integrators.rhs.stated_error import pressed, pressed_stiffness
from flocsim.integrators.rhs.views import contact_view, memory_of, normal_rate

SHARE_OF_DEPTH = 0.02
"""Where bodies bounce, their touch is located to this share of how deep they get, speed/ω0, …"""

SHARE_OF_DAMPED = 0.3
"""Where they do not, to this share: what they come to rest with may hang on far less than the
tolerance, and a touch that is noticed deeper than it would get has a force from nowhere."""

MOST_LATER = 100.0
"""… and so finely that the error of velocity leads to so many times that at most."""

MOST_AFTER_RELEASE = 1e3
"""As many where a contact ends: a step that has to be cut there costs more than that is worth."""

NEARLY = 0.99
"""Critical damping is told from less in spite of rounding."""

COARSEST_ROUNDING = 2e-15
"""Not finer than this share of the places, in which ten neighbouring numbers lie."""

TINY = 1e-300
"""Keeps a quotient finite."""


def bounces(scene, view, speed, frequency):
    """Whether bodies fly apart again: damping below critical, or none that pulls."""
    drag = 2.0 * NEARLY * frequency * speed * view.effective_mass
    return pressed(scene, view, 0.0, speed) < drag or (pressed(scene, view, 0.0, -speed) >= 0.0)


def furthest_place(work, state):
    """The largest coordinate of a body [m]."""
    furthest = 0.0
    for body in range(work.place.shape[1]):
        for axis in range(2):
            furthest = max(furthest, abs(work.place[state, body, axis]))
    return furthest


def above_rounding(work, state, length):
    """The length [m], not finer than places can be told apart."""
    return max(length, COARSEST_ROUNDING * furthest_place(work, state))


def touch_resolution(scene, work, state, row, resolution):
    """The overlap that a new contact may have got to unnoticed [m]."""
    speed = -normal_rate(work, state, row)
    view = contact_view(scene, work, state, row)
    stiffness = pressed_stiffness(scene, view, resolution)
    if not (stiffness > 0.0 and speed > 0.0):
        return resolution
    frequency = math.sqrt(stiffness / view.effective_mass)
    if not bounces(scene, view, speed, frequency):
        return above_rounding(work, state, min(resolution, SHARE_OF_DAMPED * speed / frequency))
    later = MOST_LATER * resolution / max(frequency * memory_of(work, row), TINY)
    return above_rounding(work, state, min(resolution, SHARE_OF_DEPTH * speed / frequency, later))


def release_resolution(scene, work, state, row, resolution):
    """How far a contact may have opened unnoticed [m], while its damping still pulls."""
    speed = normal_rate(work, state, row)
    if not speed > 0.0:
        return resolution
    view = contact_view(scene, work, state, row)
    pull = abs(pressed(scene, view, 0.0, -speed)) / view.effective_mass
    later = MOST_AFTER_RELEASE * resolution * speed / max(pull * memory_of(work, row), TINY)
    return above_rounding(work, state, min(resolution, later))
