"""Terminal velocities: the balance of a lone body's forces by Newton's method, and its mobility
there."""

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
"""Newton iterations for the terminal velocity; Stokes drag is linear and needs one."""

NEGLIGIBLE_RESISTANCE = 0.01
"""A resistance at rest below this share of that in settling counts as zero: a drag such as v²."""


def no_force(view, parameters):
    """Stand in for the body forces of a system that has none."""
    return 0.0, 0.0, 0.0


def lone_view(system, body):
    """Return the BodyView of a body at rest at the origin."""
    # All fields before the numbers of the shape's resistance are zero, or replaced below.
    shape, zeros = body.shape, [0.0] * BodyView._fields.index("resistance_xx")
    view = BodyView(*zeros, *drag.resistance_numbers(system.forces, body))
    return view._replace(
        angle=body.angle, mass=body.mass, buoyant_mass=body.buoyant_mass(system.fluid),
        inertia=body.inertia, radius=shape.equivalent_radius, elongation=shape.elongation,
        long_axis=shape.long_axis,
    )  # fmt: skip


def balance(force, view, parameters, velocity):
    """Return the forces (fx, fy) [N] on a body at a velocity (2,) [m/s].

    For (vx, vy, r_eq spin) also the torque over r_eq.
    """
    r = view.radius
    spin = velocity[2] / r if len(velocity) > 2 else 0.0
    fx, fy, torque = force(view._replace(vx=velocity[0], vy=velocity[1], spin=spin), parameters)
    return np.array((fx, fy, torque / r)[: len(velocity)])


def derivative(force, view, parameters, velocity, speed):
    """Return ∂(fx, fy, …)/∂(vx, vy, …) by central differences; NaN if a force is undefined
    there.

    Increments are a thousandth of ``speed`` [m/s], with a floor for a body at rest.
    """
    size = 1e-3 * speed + 1e-9
    columns = []
    try:
        for step in np.eye(len(velocity)) * size:
            ahead = balance(force, view, parameters, velocity + step)
            behind = balance(force, view, parameters, velocity - step)
            columns.append((ahead - behind) / (2.0 * size))
    except (ArithmeticError, ValueError):
        return np.full((2, 2), np.nan)
    return np.array(columns).T


def forces_on_lone(system: Any, body: Body) -> tuple[Any, BodyView, list[float]]:
    """Return (law of the body forces, view of the body at rest, parameters of the law)."""
    pieces: Any = system.pieces
    return pieces.laws.get("body_force", no_force), lone_view(system, body), pieces.parameters


def resistance(system: Any, body: Body, speed: float) -> float:
    """Return the derivative of the body forces with respect to speed along gravity [kg/s].

    ``speed`` [m/s] is relative to the flow at the origin. NaN if a force is undefined there.
    """
    u, v = system.fluid.velocity
    velocity = np.array((u, v - speed))
    return -float(derivative(*forces_on_lone(system, body), velocity, speed)[1, 1])


@np.errstate(all="ignore")
def largest_mobility(system: Any, body: Body, speed: float, mobility: float) -> float:
    """Return the largest mobility [s/kg] of a body between rest and its terminal speed [m/s].

    Its reciprocal is the smallest resistance with which a velocity decays. A drag that grows faster
    than the speed has its largest mobility at rest; a linear drag the same everywhere. ``mobility``
    is that at the terminal speed; it is returned if there is no drag at rest. For a drag that
    follows the shape it is the largest over all directions.
    """
    if not mobility > 0.0:
        return mobility
    if drag.follows_shape(system.forces):
        return free_mobilities(system, body)[1]
    at_rest = resistance(system, body, 0.0)
    # The mobility is 1/resistance, so that the product is the ratio of the two resistances.
    return max(mobility, 1.0 / at_rest) if at_rest * mobility > NEGLIGIBLE_RESISTANCE else mobility


@np.errstate(all="ignore")
def least_mobility(system: Any, body: Body, speed: float, mobility: float) -> float:
    """Return the smallest mobility [s/kg] of a body up to a speed [m/s] that others may impose on
    it.

    For a drag that follows the shape it is that of the direction of largest resistance, without
    rotation.
    """
    if not mobility > 0.0:
        return mobility
    if drag.follows_shape(system.forces):
        return nonrotating_mobility(system, body)
    there = resistance(system, body, speed)
    return min(mobility, 1.0 / there) if 0.0 < there < math.inf else mobility


def nonrotating_mobility(system: Any, body: Body) -> float:
    """Return the smallest mobility [s/kg] of a body with a shape drag that cannot rotate."""
    resistance, _ = drag.resistance_matrices(drag.body_resistance(body))
    return float(1.0 / (system.fluid.viscosity * np.linalg.eigvalsh(resistance[:2, :2])[-1]))


def free_mobilities(system: Any, body: Body) -> tuple[float, float]:
    """Return the (smallest, largest) mobility [s/kg] over directions, of a freely rotating body."""
    resistance, _ = drag.resistance_matrices(drag.body_resistance(body))
    # Invert the full R: a free body turns until its torque vanishes. Eigenvalues are the extremes.
    mobility = np.linalg.inv(resistance)[:2, :2] / system.fluid.viscosity
    least, largest = np.linalg.eigvalsh(mobility).tolist()
    return least, largest


def describe_undefined_force(system, body, velocity):
    """Describe which body force is undefined at or around a velocity."""
    at = f"a velocity of ({velocity[0]:.3g}, {velocity[1]:.3g}) m/s"
    speed = np.abs(velocity).max()
    # Evaluate each force by itself: a sum does not tell which of its terms is NaN.
    for force in system.pieces.used.values():
        own = laws_of([force], system.fluid)
        law = own.laws.get("body_force")
        known = (law, lone_view(system, body), own.parameters)
        if law is not None and not np.isfinite(derivative(*known, velocity, speed)).all():
            return f"{where(force.kernel_in(system.fluid))} gives no number at {at}"
    return f"the body forces overflow at {at}"


@np.errstate(all="ignore")
def terminal_motion(system: Any, body: Body) -> tuple[np.ndarray, float]:
    """Return (velocity (2,) [m/s], mobility [s/kg]) of a body alone in the system's fluid.

    At this velocity the body forces balance; the mobility is that along gravity. With a shape drag
    a body rotates as well: torques balance, too, and both results hold at its present angle. Both
    are zero for a fixed body. Raises UsageError if there is no balance.
    """
    if body.fixed:
        return np.zeros(2), 0.0
    known = forces_on_lone(system, body)
    velocity = np.zeros(3 if drag.follows_shape(system.forces) else 2)
    # Newton's method from rest.
    for _ in range(ITERATIONS):
        slope = derivative(*known, velocity, np.abs(velocity).max())
        if not np.isfinite(slope).all():
            raise UsageError(
                f"no terminal velocity: {describe_undefined_force(system, body, velocity)}"
            )
        # Singular: in some direction no drag can balance a force.
        if not abs(np.linalg.det(slope)) > 0.0:
            break
        change = np.linalg.solve(slope, balance(*known, velocity))
        velocity = velocity - change
        # Converged to rounding. The mobility is the velocity per force, −(∂f/∂v)⁻¹.
        if np.abs(change).max() <= 1e-12 * (np.abs(velocity).max() + 1e-15):
            if len(velocity) > 2:
                return velocity[:2], float(-np.linalg.inv(slope)[1, 1])
            return velocity, float(-1.0 / slope[1, 1])
    raise UsageError(
        "no terminal velocity: a binary collision starts from steady settling, which needs a drag "
        f"(forces {', '.join(system.pieces.used) or 'none'} do not balance); add [forces.drag]"
    )
