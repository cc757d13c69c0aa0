"""Terminal velocities: where a body's own forces balance, and how it yields to others there."""

import math
from typing import Any

import numpy as np

from flocsim.body import Body
from flocsim.compiler.linker import where
from flocsim.errors import UsageError
from flocsim.forces import drag
from flocsim.forces.codegen import laws_of
from flocsim.state.views import BodyView

ITERATIONS = 50
"""Newton steps for the terminal velocity; Stokes drag, being linear, needs one."""

NEARLY_AT_REST = 1e-6
"""Share of the terminal speed at which a body counts as at rest."""

VANISHING = 0.01
"""A resistance at rest below this share of that in settling is none: a drag such as v²."""


def no_force(view, parameters):
    """Where a system has no body forces."""
    return 0.0, 0.0, 0.0


def lone_view(system, body):
    """The BodyView of a body at rest at the origin."""
    shape = body.shape
    return BodyView(
        0.0, 0.0, 0.0, body.angle, 0.0, 0.0, 0.0, body.mass, body.buoyant_mass(system.fluid),
        body.inertia, shape.equivalent_radius, shape.elongation, shape.long_axis, 0.0, 0.0, 0.0,
        *drag.resistance_numbers(system.forces, body),
    )  # fmt: skip


def balance(force, view, parameters, velocity):
    """(fx, fy) on a body that moves at a velocity (2,); where that is (vx, vy, r_eq spin) also
    the torque over r_eq."""
    r = view.radius
    spin = velocity[2] / r if len(velocity) > 2 else 0.0
    fx, fy, torque = force(view._replace(vx=velocity[0], vy=velocity[1], spin=spin), parameters)
    return np.array((fx, fy, torque / r)[: len(velocity)])


def derivative(force, view, parameters, velocity):
    """∂(fx, fy, …)/∂(vx, vy, …) by central differences; NaN where a force gives no number."""
    size = 1e-3 * np.abs(velocity).max() + 1e-9
    columns = []
    try:
        for step in np.eye(len(velocity)) * size:
            ahead = balance(force, view, parameters, velocity + step)
            behind = balance(force, view, parameters, velocity - step)
            columns.append((ahead - behind) / (2.0 * size))
    except (ArithmeticError, ValueError):
        return np.full((2, 2), np.nan)
    return np.array(columns).T


def resistance(system: Any, body: Body, speed: float, size: float = 0.0) -> float:
    """How much the body forces on a body grow with its speed along gravity [kg/s]; NaN where one of
    them gives no number.

    At a ``speed`` [m/s] against the flow at the origin; ``size``: of the difference, by default a
    thousandth of the speed.
    """
    pieces: Any = system.pieces
    force = pieces.laws.get("body_force", no_force)
    u, v = system.fluid.velocity
    size = size or 1e-3 * speed + 1e-9
    view = lone_view(system, body)
    ends = (u, v - speed + size), (u, v - speed - size)
    try:
        ahead, behind = (balance(force, view, pieces.parameters, end)[1] for end in ends)
    except (ArithmeticError, ValueError):
        return math.nan
    return float(behind - ahead) / (2.0 * size)


@np.errstate(all="ignore")
def largest_mobility(system: Any, body: Body, speed: float, mobility: float) -> float:
    """The largest mobility [s/kg] of a body between rest and its terminal speed [m/s].

    A drag that grows faster than the speed yields most at rest; a linear one alike everywhere.
    ``mobility`` is that at the terminal speed, which stands where there is no drag at rest. So
    1/it is the least resistance with which what is left of a velocity dies away. Of a shape that
    has one in every direction: the largest.
    """
    if not mobility > 0.0:
        return mobility
    if drag.follows_shape(system.forces):
        return free_mobilities(system, body)[1]
    at_rest = resistance(system, body, 0.0, NEARLY_AT_REST * speed + 1e-9)
    return max(mobility, 1.0 / at_rest) if at_rest * mobility > VANISHING else mobility


@np.errstate(all="ignore")
def least_mobility(system: Any, body: Body, speed: float, mobility: float) -> float:
    """The least mobility [s/kg] of a body up to a speed [m/s] that another may impose on it; of a
    shape that of the direction in which it resists most, held at its angle."""
    if not mobility > 0.0:
        return mobility
    if drag.follows_shape(system.forces):
        return held_mobility(system, body)
    there = resistance(system, body, speed)
    return min(mobility, 1.0 / there) if 0.0 < there < math.inf else mobility


def held_mobility(system: Any, body: Body) -> float:
    """The least mobility [s/kg] of a body whose drag follows its shape, held from turning."""
    resistance, _ = drag.resistance_matrices(drag.body_resistance(body))
    return float(1.0 / (system.fluid.viscosity * np.linalg.eigvalsh(resistance[:2, :2])[-1]))


def free_mobilities(system: Any, body: Body) -> tuple[float, float]:
    """(least, largest) [s/kg] by direction of a body free to turn, whose drag follows its shape."""
    resistance, _ = drag.resistance_matrices(drag.body_resistance(body))
    mobility = np.linalg.inv(resistance)[:2, :2] / system.fluid.viscosity
    least, largest = np.linalg.eigvalsh(mobility).tolist()
    return least, largest


def no_number(system, body, velocity):
    """Which body force gives no number at a velocity, or around it, in words."""
    at = f"a velocity of ({velocity[0]:.3g}, {velocity[1]:.3g}) m/s"
    for force in system.pieces.used.values():
        own = laws_of([force], system.fluid)
        law = own.laws.get("body_force")
        known = (law, lone_view(system, body), own.parameters)
        if law is not None and not np.isfinite(derivative(*known, velocity)).all():
            return f"{where(force.kernel_in(system.fluid))} gives no number at {at}"
    return f"the body forces overflow at {at}"


@np.errstate(all="ignore")
def terminal_motion(system: Any, body: Body) -> tuple[np.ndarray, float]:
    """(velocity (2,) [m/s], mobility [s/kg]) of a body alone in the system's fluid.

    The velocity at which the system's body forces balance; the mobility is that along gravity.
    Where the drag is of shapes a body turns as well, so that its torques balance, too, and both are
    those at its angle. Zero both for a fixed body. UsageError where there is no balance.
    """
    if body.fixed:
        return np.zeros(2), 0.0
    pieces: Any = system.pieces
    force = pieces.laws.get("body_force", no_force)
    known = (force, lone_view(system, body), pieces.parameters)
    velocity = np.zeros(3 if drag.follows_shape(system.forces) else 2)
    for _ in range(ITERATIONS):
        slope = derivative(*known, velocity)
        if not np.isfinite(slope).all():
            raise UsageError(f"no terminal velocity: {no_number(system, body, velocity)}")
        if not abs(np.linalg.det(slope)) > 0.0:
            break
        change = np.linalg.solve(slope, balance(*known, velocity))
        velocity = velocity - change
        if np.abs(change).max() <= 1e-12 * (np.abs(velocity).max() + 1e-15):
            if len(velocity) > 2:
                return velocity[:2], float(-np.linalg.inv(slope)[1, 1])
            return velocity, float(-1.0 / slope[1, 1])
    raise UsageError(
        "no terminal velocity: a binary collision starts from steady settling, which needs a drag "
        f"(forces {', '.join(pieces.used) or 'none'} do not balance); add [forces.drag]"
    )
