"""Terminal velocities: where a body's own forces balance, and how it yields to others there."""

import math
from typing import Any

import numpy as np

from flocsim.arrays import BodyView
from flocsim.body import Body
from flocsim.compiler.reads import where
from flocsim.errors import UsageError
from flocsim.forces.codegen import laws_of

ITERATIONS = 50
"""Newton steps for the terminal velocity; Stokes drag, being linear, needs one."""

NEARLY_AT_REST = 1e-6
"""Share of the terminal speed at which a body counts as at rest."""

VANISHING = 0.01
"""A resistance at rest below this share of that in settling is none: a drag such as v²."""


def no_force(view, parameters):
    """Where a system has no body forces."""
    return 0.0, 0.0, 0.0


def lone_view(body, fluid, vx, vy):
    """The BodyView of a body at the origin, without spin."""
    shape = body.shape
    return BodyView(
        0.0, 0.0, 0.0, body.angle, vx, vy, 0.0, body.mass, body.buoyant_mass(fluid), body.inertia,
        shape.equivalent_radius, shape.elongation, shape.long_axis,
    )  # fmt: skip


def balance(force, body, fluid, parameters, velocity):
    """(fx, fy) on a body that moves at a velocity."""
    return np.array(force(lone_view(body, fluid, *velocity), parameters)[:2])


def derivative(force, body, fluid, parameters, velocity):
    """∂(fx, fy)/∂(vx, vy) by central differences."""
    size = 1e-3 * max(abs(velocity[0]), abs(velocity[1])) + 1e-9
    columns = []
    for step in np.eye(2) * size:
        ahead = balance(force, body, fluid, parameters, velocity + step)
        behind = balance(force, body, fluid, parameters, velocity - step)
        columns.append((ahead - behind) / (2.0 * size))
    return np.array(columns).T


def resistance(system: Any, body: Body, speed: float, size: float = 0.0) -> float:
    """How much the body forces on a body grow with its speed along gravity [kg/s].

    At a ``speed`` [m/s] against the flow at the origin; ``size``: of the difference, by default a
    thousandth of the speed.
    """
    pieces: Any = system.pieces
    force = pieces.laws.get("body_force", no_force)
    u, v = system.fluid.velocity
    size = size or 1e-3 * speed + 1e-9
    ends = [
        balance(force, body, system.fluid, pieces.parameters, (u, v - speed + by))[1]
        for by in (size, -size)
    ]
    return float(ends[1] - ends[0]) / (2.0 * size)


@np.errstate(all="ignore")
def largest_mobility(system: Any, body: Body, speed: float, mobility: float) -> float:
    """The largest mobility [s/kg] of a body between rest and its terminal speed [m/s].

    A drag that grows faster than the speed yields most at rest; a linear one alike everywhere.
    ``mobility`` is that at the terminal speed, which stands where there is no drag at rest. So
    1/it is the least resistance with which what is left of a velocity dies away.
    """
    if not mobility > 0.0:
        return mobility
    size = NEARLY_AT_REST * speed + 1e-9
    try:
        at_rest = resistance(system, body, 0.0, size)
    except (ArithmeticError, ValueError):
        return mobility
    return max(mobility, 1.0 / at_rest) if at_rest * mobility > VANISHING else mobility


@np.errstate(all="ignore")
def least_mobility(system: Any, body: Body, speed: float, mobility: float) -> float:
    """The least mobility [s/kg] of a body up to a speed [m/s] that another may impose on it."""
    if not mobility > 0.0:
        return mobility
    try:
        there = resistance(system, body, speed)
    except (ArithmeticError, ValueError):
        return mobility
    return min(mobility, 1.0 / there) if 0.0 < there < math.inf else mobility


def no_number(system, body, velocity):
    """Which body force gives no number at a velocity, or around it, in words."""
    at = f"a velocity of ({velocity[0]:.3g}, {velocity[1]:.3g}) m/s"
    for force in system.pieces.used.values():
        own = laws_of([force], system.fluid)
        law = own.laws.get("body_force")
        try:
            known = (law, body, system.fluid, own.parameters)
            if law is None or np.isfinite(derivative(*known, velocity)).all():
                continue
        except (ArithmeticError, ValueError):
            pass
        return f"{where(force.kernel_in(system.fluid))} gives no number at {at}"
    return f"the body forces overflow at {at}"


@np.errstate(all="ignore")
def terminal_motion(system: Any, body: Body) -> tuple[np.ndarray, float]:
    """(velocity (2,) [m/s], mobility [s/kg]) of a body alone in the system's fluid.

    The velocity at which the system's body forces balance; the mobility is the inverse of their
    resistance along gravity. Zero both for a fixed body. UsageError where there is no balance.
    """
    if body.fixed:
        return np.zeros(2), 0.0
    pieces: Any = system.pieces
    force = pieces.laws.get("body_force", no_force)
    known = (force, body, system.fluid, pieces.parameters)
    velocity = np.zeros(2)
    for _ in range(ITERATIONS):
        try:
            slope = derivative(*known, velocity)
        except (ArithmeticError, ValueError):
            slope = np.full((2, 2), np.nan)
        if not np.isfinite(slope).all():
            raise UsageError(f"no terminal velocity: {no_number(system, body, velocity)}")
        if not abs(np.linalg.det(slope)) > 0.0:
            break
        change = np.linalg.solve(slope, balance(*known, velocity))
        velocity = velocity - change
        if np.abs(change).max() <= 1e-12 * (np.abs(velocity).max() + 1e-15):
            return velocity, float(-1.0 / slope[1, 1])
    raise UsageError(
        "no terminal velocity: a binary collision starts from steady settling, which needs a drag "
        f"(forces {', '.join(pieces.used) or 'none'} do not balance); add [forces.drag]"
    )


def turn_time(radius_i: float, radius_j: float, drift: np.ndarray) -> float:
    """(r_i + r_j)/|relative drift| [s]: how long the pair takes to pass or to turn over."""
    return (radius_i + radius_j) / math.hypot(*drift)
