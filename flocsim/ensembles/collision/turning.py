"""How a lone body turns in a flow, and at which angle it is found there when another one comes.

A body that has long been in a flow has the angle θ with a density ∝ 1/|θ'(θ)|, the time that it
spends there: uniform for a sphere, along the flow for a slender body (G. B. Jeffery, Proc. R. Soc.
A 102 (1922) 161-179).
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from flocsim.body import Body
from flocsim.forces.drag import follows_shape
from flocsim.forces.settling import lone_view, no_force

ANGLES, FEW = 720, 7
"""Angles of a body at which its turning is sampled."""

BETWEEN = np.array([0.4, 1.9, 3.3, 5.1])
"""Angles [rad] at which it is tested whether a strain explains all of a body's turning."""


def turning_rates(system: Any, body: Body) -> np.ndarray:
    """Return the spins [rad/s] at which the body forces on a lone body put no torque on it, at even
    angles.

    Of all body forces together, so that a force under which shapes turn unevenly has its say.
    At ANGLES of them, or a FEW where these are alike; from a FEW to all where a strain turns it,
    by a + b cos 2θ + c sin 2θ. Where the drag is of shapes, turning and going along are one: at the
    velocity at which there is no force, either.
    """
    pieces: Any = system.pieces
    force = pieces.laws.get("body_force", no_force)
    scale = max(map(abs, system.fluid.gradient), default=0.0) or 1.0
    lone = lone_view(system, body)
    free = follows_shape(system.forces)

    def rates(angles: np.ndarray) -> np.ndarray:
        found = np.zeros(len(angles))
        for place, angle in enumerate(angles.tolist()):
            view = lone._replace(angle=angle)
            if free:
                found[place] = free_spin(force, view, pieces.parameters, scale)
                continue
            # The torque is linear in the spin: its zero from two values.
            less, more = (
                force(view._replace(spin=spin), pieces.parameters)[2] for spin in (-scale, scale)
            )
            if less > more:
                found[place] = scale * (less + more) / (less - more)
        return found

    few_angles, angles = (2.0 * np.pi * np.arange(count) / count for count in (FEW, ANGLES))
    few = rates(few_angles)
    if is_even(few):
        return few
    # A strain turns a rigid body by a + b cos 2θ + c sin 2θ (Jeffery 1922): fitted to a few angles,
    # and tested between them; laws of a user's own may be of any form.
    waves, *_ = np.linalg.lstsq(strain_waves(few_angles), few)
    left = strain_waves(BETWEEN) @ waves - rates(BETWEEN)
    if np.abs(left).max() <= 1e-9 * np.abs(few).max():
        return strain_waves(angles) @ waves
    return rates(angles)


def strain_waves(angles: np.ndarray) -> np.ndarray:
    """Return 1, cos 2θ and sin 2θ (k, 3)."""
    return np.column_stack([np.ones_like(angles), np.cos(2.0 * angles), np.sin(2.0 * angles)])


def free_spin(force: Callable, view: Any, parameters: Sequence[float], scale: float) -> float:
    """Return the spin [rad/s] of a body on which linear laws leave neither force nor torque."""
    # Newton's step is exact for a linear law, whose Jacobian are the differences over unit steps.
    steps = np.diag([scale * view.radius, scale * view.radius, scale])
    still = np.array(force(view, parameters))
    changes = [
        np.array(force(view._replace(vx=vx, vy=vy, spin=spin), parameters)) - still
        for vx, vy, spin in steps.tolist()
    ]
    return scale * float(np.linalg.solve(np.transpose(changes), -still)[2])


def is_even(rates: np.ndarray) -> bool:
    """Return True if a body turns alike at all angles, or not at all."""
    return bool(np.ptp(rates) <= 1e-6 * np.abs(rates).max())


def angles_by_turning(rates: np.ndarray) -> Callable[[float], float]:
    """Return a function from a uniform number in [0, 1) to an angle [rad], as bodies that turn at
    these rates have it: with a density ∝ 1/|rate|.

    Uniform for even turning or none; bodies that come to lie still have the angles at which they
    do, each as often as angles lead there.
    """
    if is_even(rates):
        return lambda number: 2.0 * math.pi * number
    step = 2.0 * math.pi / len(rates)
    if rates.min() > 0.0 or rates.max() < 0.0:
        # Linear between the angles: time that is spent from one to the next.
        ahead = np.roll(rates, -1)
        spent = np.append(0.0, np.cumsum(0.5 * (1.0 / np.abs(rates) + 1.0 / np.abs(ahead))))
        edges = step * np.arange(len(rates) + 1)
        return lambda number: float(np.interp(number * spent[-1], spent, edges))
    # Somewhere the rate changes its sign: there bodies come to rest, as many as begin in its basin.
    ends = [step * resting_place(rates, place) for place in range(len(rates))]
    return lambda number: ends[int(number * len(ends)) % len(ends)]


def resting_place(rates: np.ndarray, place: int) -> float:
    """Return where, in steps between the angles, a body comes to lie still that begins at a
    place."""
    way = 1 if rates[place] > 0.0 else -1
    before = float(rates[place])
    for ahead in range(1, len(rates) + 1):
        after = float(rates[(place + way * ahead) % len(rates)])
        if after * way <= 0.0:
            # The zero of the straight line between the two angles.
            share = before / (before - after) if before != after else 0.0
            return (place + way * (ahead - 1 + share)) % len(rates)
        before = after
    return float(place)
