"""Reynolds and Stokes numbers of bodies at their terminal speeds, and what drag law serves them."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from flocsim.body import Body
from flocsim.errors import UsageError
from flocsim.forces.drag import SCHILLER_NAUMANN_UP_TO, StokesDrag, reynolds_number
from flocsim.forces.shape_drag import follows_shape
from flocsim.plausibility.settling import largest_mobility, terminal_motion

HOLDS = {
    "stokes": "Stokes's drag is accurate to 15 %",
    "shape": "slow flow around a shape is accurate to 15 %",
    "schiller_naumann": "the drag of Schiller and Naumann is accurate to 5 %",
}


class Settled(NamedTuple):
    """A body of equivalent radius r [m] at its terminal speed v [m/s] against the flow.

    ``reynolds`` = 2 r ρ_f v/γ; ``stokes`` = τ v/r, with τ the time in which a slow motion dies
    away, m/(6πγ r) in Stokes's drag.
    """

    radius: float
    speed: float
    reynolds: float
    stokes: float

    @property
    def words(self) -> str:
        """The numbers for people."""
        return (
            f"r_eq = {1e6 * self.radius:.4g} um settles at {1e3 * self.speed:.4g} mm/s: "
            f"Re = {self.reynolds:.2g}, St = {self.stokes:.2g}"
        )


def settled(system: Any, body: Body) -> Settled | None:
    """A free body alone in the system's fluid; None where it is held or does not settle."""
    if body.fixed:
        return None
    try:
        velocity, mobility = terminal_motion(system, body)
    except UsageError:
        return None
    u, v = system.fluid.velocity
    speed, radius = math.hypot(velocity[0] - u, velocity[1] - v), body.shape.equivalent_radius
    relaxation = body.mass * largest_mobility(system, body, speed, mobility)
    return Settled(
        radius,
        speed,
        reynolds_number(speed, radius, system.fluid.viscosity, system.fluid.density),
        relaxation * speed / radius,
    )


def all_settled(system: Any) -> list[Settled]:
    """Every free body that settles, those alike once, in the order of the bodies."""
    by_shape = follows_shape(system.forces)
    alike = {
        (
            body.shape.equivalent_radius, body.mass, body.buoyant_mass(system.fluid),
            (id(body.shape), body.angle) if by_shape else None,
        ): body
        for body in reversed(system.bodies)
        if not body.fixed
    }  # fmt: skip
    found = (settled(system, body) for body in reversed(alike.values()))
    return [each for each in found if each is not None]


def beyond_the_law(bodies: Sequence[Settled], forces: dict[str, Any]) -> str:
    """A line on the body whose Reynolds number is furthest beyond its drag law; "" for none.

    ``forces``: {name: force}. A drag of the user's own says itself what it is good for.
    """
    drags = {name: each for name, each in forces.items() if isinstance(each, StokesDrag)}
    if not drags or not bodies:
        return ""
    name, drag = min(drags.items(), key=lambda item: item[1].serves_up_to)
    worst = max(bodies, key=lambda each: each.reynolds)
    if worst.reynolds <= drag.serves_up_to:
        return ""
    advice = (
        f'give {name} law = "schiller_naumann", valid up to Re = {SCHILLER_NAUMANN_UP_TO:g}'
        if drag.law == "stokes"
        else "use smaller or lighter bodies, or a drag of your own"
    )
    return (
        f"a body of {worst.words}, but {HOLDS[drag.law]} only up to Re = {drag.serves_up_to:g} "
        f"(Clift, Grace and Weber 1978, Bubbles, Drops and Particles, ch. 5): {advice}"
    )
