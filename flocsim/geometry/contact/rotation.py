"""Cosine and sine of a body's angle, found from those of an angle near by.

A run needs them some ten times a step, of angles that hardly differ, and a library's functions for
them take more time there than anything else. So they are asked for at multiples of 1/64 alone, and
from the nearest one, δ away,

    cos(φ + δ) = cos φ cos δ − sin φ sin δ,  sin(φ + δ) = sin φ cos δ + cos φ sin δ,

with the series of cos δ and sin δ, of which what is left out is below 1e-17. What is remembered
depends on the angle alone and not on the way there, so that a run that is gone on with, or is
turned back, finds the same.
"""

import math

import flocsim.arrays as at

PER_RADIAN = 64.0
"""Angles for which both are known lie this close."""

LARGEST = 1e6
"""Beyond that angle [rad] the library is asked every time."""


def know_nearest(work, body, nearest):
    """Remember cosine and sine of a multiple of 1/64, unless they are; no cosine of one is 0."""
    bodies = work.bodies
    if nearest != bodies[body, at.KNOWN_ANGLE] or bodies[body, at.KNOWN_COSINE] == 0.0:
        bodies[body, at.KNOWN_ANGLE] = nearest
        bodies[body, at.KNOWN_COSINE] = math.cos(nearest)
        bodies[body, at.KNOWN_SINE] = math.sin(nearest)


def cosine_and_sine(work, body, angle):
    """(cos, sin) of an angle of a body [rad], each within 3e-16."""
    if not abs(angle) < LARGEST:
        return math.cos(angle), math.sin(angle)
    nearest = math.floor(PER_RADIAN * angle + 0.5) / PER_RADIAN
    know_nearest(work, body, nearest)
    rest = angle - nearest
    square = rest * rest
    c = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square / 720.0))
    s = rest * (1.0 - square * (1.0 / 6.0 - square / 120.0))
    cosine, sine = work.bodies[body, at.KNOWN_COSINE], work.bodies[body, at.KNOWN_SINE]
    return cosine * c - sine * s, sine * c + cosine * s
