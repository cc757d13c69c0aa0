"""What is possible in a scene but implausible: a line each, with the way out."""

import warnings
from collections.abc import Sequence
from typing import Any

import attrs

from flocsim.body import Body
from flocsim.errors import PlausibilityWarning
from flocsim.forces.base import ContactForce, told_apart
from flocsim.forces.contact import Contact
from flocsim.forces.drag import StokesDrag
from flocsim.forces.gravity import Gravity
from flocsim.forces.pair_resistance import Lubrication
from flocsim.forces.thermal import Thermal, thermal_in
from flocsim.plausibility.ranges import RADIUS, ROUNDING, unusual
from flocsim.plausibility.reynolds import all_settled, beyond_the_law


@attrs.frozen
class Names:
    """What the user calls the parts of a scene: in Python, or as the tables of a config.

    ``forces``: in step with those of the System; by default their classes' names.
    """

    fluid: str = "Fluid"
    body: str = "Body"
    forces: tuple[str, ...] = ()
    buoyancy: str = "Fluid(buoyancy=True)"
    drop: str = "leave {} out"

    def thermal_in(self, forces: Sequence[Any]) -> dict[str, Any]:
        """{name: force} of those forces that act, two of one name told apart."""
        names = told_apart(self.forces or [type(force).__name__ for force in forces])
        named = zip(names, forces, strict=True)
        return {name: force for name, force in named if not force.absent}


def doubts_of(systems: Sequence[Any], names: Names | None = None) -> list[str]:
    """Lines on what is implausible of Systems that have forces and fluid in common.

    Values outside their usual ranges, sizes, weight, drag, contacts.
    """
    names, first = names or Names(), systems[0]
    forces = names.thermal_in(first.forces)
    bodies = [body for system in systems for body in system.bodies]
    lines = [line for name, force in forces.items() for line in unusual(force, name)]
    lines += unusual(first.fluid, names.fluid)
    warm = bool(thermal_in(forces.values()))
    for body in bodies:
        lines += [*unusual(body, names.body), *about_shape(body, warm)]
    settled = [each for system in systems for each in all_settled(system)]
    lines += [
        about_weight(first.fluid, bodies, forces, names.buoyancy),
        beyond_the_law(settled, forces),
        about_kicks(forces),
        about_contacts(max(map(meeting, systems)), forces, names.drop),
    ]
    return [line for line in dict.fromkeys(lines) if line]


def about_shape(body: Body, warm: bool) -> list[str]:
    """Lines on the size of a body, which thermal motion allows to be as small as it likes, and on
    its spheroradius where it has edges."""
    size = body.shape.equivalent_radius
    lines = [] if warm and size < RADIUS.low else [RADIUS.doubt("equivalent radius", size)]
    if len(body.shape.vertices) > 1:
        lines.append(ROUNDING.doubt("spheroradius / equivalent radius", body.shape.radius / size))
    return lines


def about_weight(fluid: Any, bodies: Sequence[Body], forces: dict[str, Any], cure: str) -> str:
    """A line where bodies of a real density weigh as in a vacuum; "" where none does."""
    falls = any(isinstance(force, Gravity) for force in forces.values())
    known = [each.density for each in bodies if each.density is not None and not each.fixed]
    if fluid.buoyancy or not falls or not known or not fluid.density > 0.0:
        return ""
    density = min(known)
    what = (
        "in this fluid it would float"
        if density <= fluid.density
        else f"it weighs {density / (density - fluid.density):.3g} times as much as in the fluid"
    )
    return (
        f"buoyancy is off, but a body has a real density, {density:g} kg/m^3: {what}, of "
        f"{fluid.density:g} kg/m^3 (Clift, Grace and Weber 1978, Bubbles, Drops and Particles, "
        f"ch. 5): give {cure}"
    )


def about_kicks(forces: dict[str, Any]) -> str:
    """A line where random forces are not balanced by the resistance that belongs to them."""
    for name, thermal in forces.items():
        if not isinstance(thermal, Thermal):
            continue
        drags = [each for each in forces.values() if isinstance(each, StokesDrag)]
        if not drags:
            return (
                f"{name} kicks the bodies continually, but no StokesDrag takes up the energy, so "
                "they do not stay at its temperature: add the drag"
            )
        if thermal.rotational != drags[0].rotational:
            return (
                f"{name} and the drag treat rotation differently, so spins are not at the "
                "temperature: give both the same rotational"
            )
        for other, each in forces.items():
            if isinstance(each, Lubrication):
                return (
                    f"{other} resists the motion that {name} causes but adds no kicks of its own: "
                    "near contact, bodies move as if it were colder; leave one of them out, or "
                    "read meeting rates as lower bounds"
                )
    return ""


def meeting(system: Any) -> int:
    """How many bodies can meet others: fixed ones alone do not act on each other."""
    return 0 if all(body.fixed for body in system.bodies) else len(system.bodies)


def about_contacts(count: int, forces: dict[str, Any], drop: str) -> str:
    """A line where ``count`` bodies pass through each other, or have Contact beside another law."""
    contacts = {name: each for name, each in forces.items() if isinstance(each, ContactForce)}
    if count > 1 and not contacts:
        return (
            f"{count} bodies and no contact force: they will pass through each other: add "
            "flocsim.forces.Contact(), or a ContactForce of your own"
        )
    plain = [name for name, each in contacts.items() if type(each) is Contact]
    if count < 2 or not plain or len(contacts) < 2:
        return ""
    return (
        f"{' and '.join(contacts)} both act at every contact, and their forces add up: if one of "
        f"them is to replace the other, {drop.format(plain[0])}"
    )


def warn_of(system: Any, stacklevel: int) -> None:
    """A PlausibilityWarning for each of a System's doubts, told as of the caller's caller."""
    for line in doubts_of([system]):
        warnings.warn(line, PlausibilityWarning, stacklevel=stacklevel + 1)
