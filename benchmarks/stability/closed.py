"""Motions in closed form: settling, and a linear contact with free flight before and after."""

import numpy as np
from scipy.optimize import brentq

PHASES = np.concatenate([np.geomspace(1e-9, 1e-3, 200), np.linspace(1e-3, 40.0, 20_001)[1:],
                         np.geomspace(40.0, 1e4, 200)[1:]])  # fmt: skip
"""Instants, in 1/ω0, searched for the end of a contact."""


def settle(velocity, terminal, relaxation, time):
    """Distance after a time of ẋ = v, v̇ = −(v − terminal)/relaxation."""
    gained = -relaxation * np.expm1(-time / relaxation)
    return terminal * time + (velocity - terminal) * gained


def oscillate(s, x, v, z):
    """(place, velocity) at s of ẍ = −x − 2 z ẋ from place x and velocity v."""
    root = np.sqrt(abs(1.0 - z * z)) if z != 1.0 else 0.0
    fall = np.exp(-z * s)
    if root * np.max(s) < 1e-6:
        wave, slow = np.ones_like(s), s
    elif z < 1.0:
        wave, slow = np.cos(root * s), np.sin(root * s) / root
    else:
        # e^(−z s) cosh(root s) without overflow.
        up, down = np.exp((root - z) * s), np.exp(-(root + z) * s)
        fall, wave, slow = 1.0, 0.5 * (up + down), 0.5 * (up - down) / root
    place = fall * (x * wave + (v + z * x) * slow)
    return place, fall * (v * wave - (x + z * v) * slow)


def contact_end(x, v, z, tension):
    """The s at which a contact ends (inf if never): overlap 0, or force 0 without tension."""

    def opening(s):
        place, velocity = oscillate(s, x, v, z)
        return place if tension else place + 2.0 * z * velocity

    if tension and z >= 1.0:
        return np.inf
    values = opening(PHASES)
    behind = np.flatnonzero(values < 0.0)
    if not len(behind):
        return np.inf
    k = behind[0]
    return brentq(opening, PHASES[k - 1] if k else 0.0, PHASES[k], xtol=1e-300, rtol=1e-15)


def bounce(gap, speed, omega, z, tension, time):
    """(gap after a time, greatest overlap) of two bodies that close in from a gap at a speed.

    A negative gap is an overlap at the start. ω0 [1/s], z the damping ratio.
    """
    free = gap / speed if gap > 0.0 else 0.0
    if time <= free:
        return gap - speed * time, 0.0
    x, v = max(-gap, 0.0), speed / omega
    scale = max(x, v)
    end = contact_end(x / scale, v / scale, z, tension)
    s = omega * (time - free)
    inside = np.append(PHASES[: np.searchsorted(PHASES, min(s, end))], min(s, end))
    places, velocities = oscillate(inside, x / scale, v / scale, z)
    flight = max(s - end, 0.0)
    return -scale * (places[-1] + flight * velocities[-1]), scale * max(places.max(), x / scale)


def resting_overlap(load, omega, decay, time):
    """(overlap, greatest overlap) of ẍ = load − ω² x − decay ẋ from rest at x = 0."""
    s, z = omega * time, 0.5 * decay / omega
    inside = np.append(PHASES[: np.searchsorted(PHASES, s)], s)
    places, _ = oscillate(inside, -1.0, 0.0, z)
    sunk = load / omega**2 * (1.0 + places)
    return sunk[-1], sunk.max()
