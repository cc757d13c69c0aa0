"""Questions about a scene whose answer is a warning: what is possible, but implausible.

QUESTIONS has them. The usual ranges of quantities are declared once, with their source and what to
do outside, and hold for subclasses, too. Nothing is refused. Reynolds and Stokes numbers are those
of bodies at their terminal speeds.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import attrs

from flocsim.body import Body, Fluid
from flocsim.errors import UsageError
from flocsim.forces.base import ContactForce, unique_names
from flocsim.forces.body_forces import Gravity, Thermal, thermal_forces
from flocsim.forces.contact import Contact
from flocsim.forces.dlvo import DoubleLayer, VanDerWaals
from flocsim.forces.drag import SCHILLER_NAUMANN_UP_TO, StokesDrag, follows_shape, reynolds_number
from flocsim.forces.pair_resistance import Lubrication
from flocsim.forces.settling import largest_mobility, terminal_motion

CHECK = "check the number and its unit"

HOLDS = {
    "stokes": "Stokes's drag is accurate to 15 %",
    "shape": "slow flow around a shape is accurate to 15 %",
    "schiller_naumann": "the drag of Schiller and Naumann is accurate to 5 %",
}


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


@attrs.frozen
class Asked:
    """What questions are about: Systems that have forces and fluid in common, and their names."""

    systems: Sequence[Any]
    names: Names

    @property
    def fluid(self) -> Any:
        """The fluid of all Systems."""
        return self.systems[0].fluid

    @property
    def forces(self) -> dict[str, Any]:
        """{name: force} of the forces that act."""
        forces = self.systems[0].forces
        names = unique_names(self.names.forces or [type(force).__name__ for force in forces])
        return {
            name: each for name, each in zip(names, forces, strict=True) if not each.absent
        }  # fmt: skip

    @property
    def bodies(self) -> list[Body]:
        """The bodies of all Systems."""
        return [body for system in self.systems for body in system.bodies]


def plausibility_warnings(systems: Sequence[Any], names: Names | None = None) -> list[str]:
    """Return lines on what is implausible of Systems that have forces and fluid in common."""
    asked = Asked(systems, names or Names())
    lines = (line for question in QUESTIONS for line in question(asked))
    return [line for line in dict.fromkeys(lines) if line]


def about_values(asked: Asked) -> Iterator[str]:
    """Are all values within their usual ranges?"""
    for name, force in asked.forces.items():
        yield from unusual(force, name)
    yield from unusual(asked.fluid, asked.names.fluid)
    warm = bool(thermal_forces(asked.forces.values()))  # then bodies may be as small as they like
    for body in asked.bodies:
        yield from unusual(body, asked.names.body)
        size = body.shape.equivalent_radius
        if not warm or size >= RADIUS.low:
            yield RADIUS.warning("equivalent radius", size)
        if len(body.shape.vertices) > 1:
            yield ROUNDING.warning("spheroradius / equivalent radius", body.shape.radius / size)


def about_weight(asked: Asked) -> Iterator[str]:
    """Do bodies of a real density weigh as in a vacuum?"""
    fluid, forces = asked.fluid, asked.forces.values()
    known = [each.density for each in asked.bodies if each.density is not None and not each.fixed]
    falls = any(isinstance(force, Gravity) for force in forces)
    if fluid.buoyancy or not falls or not known or not fluid.density > 0.0:
        return
    density = min(known)
    what = "in this fluid it would float"
    if density > fluid.density:
        ratio = density / (density - fluid.density)
        what = f"it weighs {ratio:.3g} times as much as in the fluid"
    yield (
        f"buoyancy is off, but a body has a real density, {density:g} kg/m^3: {what}, of "
        f"{fluid.density:g} kg/m^3 (Clift, Grace and Weber 1978, Bubbles, Drops and Particles, "
        f"ch. 5): give {asked.names.buoyancy}"
    )


def about_drag(asked: Asked) -> Iterator[str]:
    """Is a Reynolds number beyond the drag law? A drag of the user's own says itself what it is
    good for."""
    settled = [each for system in asked.systems for each in all_settled(system)]
    drags = {name: each for name, each in asked.forces.items() if isinstance(each, StokesDrag)}
    if not drags or not settled:
        return
    name, drag = min(drags.items(), key=lambda item: item[1].valid_up_to)
    worst = max(settled, key=lambda each: each.reynolds)
    if worst.reynolds <= drag.valid_up_to:
        return
    advice = "use smaller or lighter bodies, or a drag of your own"
    if drag.law == "stokes":
        advice = (
            f'give {name} law = "schiller_naumann", valid up to Re = {SCHILLER_NAUMANN_UP_TO:g}'
        )
    yield (
        f"a body of {worst.words}, but {HOLDS[drag.law]} only up to Re = {drag.valid_up_to:g} "
        f"(Clift, Grace and Weber 1978, Bubbles, Drops and Particles, ch. 5): {advice}"
    )


def about_kicks(asked: Asked) -> Iterator[str]:
    """Are random forces balanced by the resistance that belongs to them?"""
    forces = asked.forces
    drags = [each for each in forces.values() if isinstance(each, StokesDrag)]
    films = [name for name, each in forces.items() if isinstance(each, Lubrication)]
    for name, thermal in forces.items():
        if not isinstance(thermal, Thermal):
            continue
        if not drags:
            yield (
                f"{name} kicks the bodies continually, but no StokesDrag takes up the energy, so "
                "they do not stay at its temperature: add the drag"
            )
        elif thermal.rotational != drags[0].rotational:
            yield (
                f"{name} and the drag treat rotation differently, so spins are not at the "
                "temperature: give both the same rotational"
            )
        elif films:
            yield (
                f"{films[0]} resists the motion that {name} causes but adds no kicks of its own: "
                "near contact, bodies move as if it were colder; leave one of them out, or "
                "read meeting rates as lower bounds"
            )


def about_contacts(asked: Asked) -> Iterator[str]:
    """Do bodies pass through each other, or have Contact beside another law?"""
    # Fixed bodies alone do not act on each other.
    moving = (each.bodies for each in asked.systems if not all(body.fixed for body in each.bodies))
    count = max(map(len, moving), default=0)
    contacts = {name: each for name, each in asked.forces.items() if isinstance(each, ContactForce)}
    plain = [name for name, each in contacts.items() if type(each) is Contact]
    if count > 1 and not contacts:
        yield (
            f"{count} bodies and no contact force: they will pass through each other: add "
            "flocsim.forces.Contact(), or a ContactForce of your own"
        )
    elif count > 1 and plain and len(contacts) > 1:
        yield (
            f"{' and '.join(contacts)} both act at every contact, and their forces add up: if one "
            f"of them is to replace the other, {asked.names.drop.format(plain[0])}"
        )


QUESTIONS = (about_values, about_weight, about_drag, about_kicks, about_contacts)
"""What is asked about a scene; each yields lines with numbers, source and way out."""


@attrs.frozen
class Usual:
    """The usual range, ends included, of ``what`` in a unit; where that is known from; and what to
    do about a value outside."""

    what: str
    low: float
    high: float
    unit: str
    source: str
    advice: str = CHECK

    def warning(self, place: str, value: object) -> str:
        """Return a line on the value of a name, e.g. "fluid.viscosity"; "" where it is usual.

        A value that is not a number has no range. The sign does not count.
        """
        if isinstance(value, tuple):
            return next(filter(None, (self.warning(place, each) for each in value)), "")
        if isinstance(value, str | bool) or not isinstance(value, int | float):
            return ""
        if self.low <= abs(value) <= self.high:
            return ""
        unit = f" {self.unit}" if self.unit else ""
        low = f"{self.low:g} to " if self.low > 0.0 else "at most "
        return (
            f"{place} = {value:g}{unit} is implausible: {self.what} is usually {low}"
            f"{self.high:g}{unit} ({self.source}): {self.advice}"
        )


VISCOSITY = Usual(
    "the viscosity of water, from 100 C to brines and suspensions as thick as oil,",
    2e-4, 1e-1, "Pa s",
    "pure water has 2.8e-4 to 1.8e-3: Huber et al. 2009, J. Phys. Chem. Ref. Data 38, 101",
)  # fmt: skip

USUAL: dict[type, dict[str, Usual]] = {
    VanDerWaals: {
        "hamaker": Usual(
            "a Hamaker constant", 1e-22, 1e-18, "J",
            "Israelachvili 2011, Intermolecular and Surface Forces, ch. 13",
            'check the number and its unit, as in "5 zJ"',
        ),
    },
    DoubleLayer: {
        "potential": Usual(
            "a surface potential", 0.0, 0.2, "V",
            "Hunter 1981, Zeta Potential in Colloid Science, ch. 2",
            'check the number and its unit, as in "15 mV"',
        ),
        "debye_length": Usual(
            "a Debye length", 2e-10, 1e-6, "m",
            "0.304 nm/sqrt(c in mol/L), 960 nm in pure water: Israelachvili 2011, ch. 14",
            'check the number and its unit, as in "0.98 nm"',
        ),
        "permittivity": Usual(
            "the relative permittivity of a liquid", 1.5, 200.0, "",
            "water has 78.5 at 25 C: CRC Handbook of Chemistry and Physics, sec. 6",
        ),
    },
    Fluid: {
        "viscosity": VISCOSITY,
        "density": Usual(
            "the density of water and brines", 600.0, 1500.0, "kg/m^3",
            "Wagner and Pruss 2002, J. Phys. Chem. Ref. Data 31, 387",
        ),
    },
    Body: {
        "density": Usual(
            "the density of a solid, or of a floc,", 500.0, 2.3e4, "kg/m^3",
            "quartz has 2650, osmium 22590: CRC Handbook of Chemistry and Physics, sec. 4",
            'check the number and its unit, as in "2.65 g/cm^3"',
        ),
    },
}  # fmt: skip
"""Class → field → its usual range."""

RADIUS = Usual(
    "the equivalent radius of a settling body", 5e-7, 1e-2, "m",
    "below, Brownian motion, which is left out here, moves bodies as fast as they settle: Russel, "
    "Saville and Schowalter 1989, Colloidal Dispersions, ch. 3",
    "use larger bodies, or read the results as those of bodies that do not diffuse",
)  # fmt: skip

ROUNDING = Usual(
    "the spheroradius over the equivalent radius", 0.0, 0.5, "",
    "0.04 to 0.22 in Tang et al. 2014; near 1 every floc is a disc",
    "choose a smaller spheroradius",
)  # fmt: skip

PIXEL_SIZE = Usual(
    "the side of a pixel", 1e-11, 1e-4, "m",
    "electron micrographs have about 1e-9, floc cameras 1e-5: Smith and Friedrichs 2011, Cont. "
    "Shelf Res. 31, S50",
    'check the number and its unit, as in "0.95 um"',
)  # fmt: skip


def unusual(owner: object, place: str) -> list[str]:
    """Return lines on the values of an object outside their usual ranges; ``place``: its name."""
    found: dict[str, Usual] = {}
    for each in type(owner).__mro__:
        found = USUAL.get(each, {}) | found
    lines = [
        usual.warning(f"{place}.{name}", getattr(owner, name)) for name, usual in found.items()
    ]
    return [line for line in lines if line]


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
    """Return how a free body settles alone; None where it is fixed or does not settle."""
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
    """Return every free body that settles, those alike once, in the order of the bodies."""
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
