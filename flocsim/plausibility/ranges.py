"""The usual ranges of quantities, each declared once, with its source and what to do outside it.

A value outside is possible, and is computed with; it is doubted in one line. A force of a user's
own that subclasses one of these is held to the same.
"""

import attrs

from flocsim.body import Body, Fluid
from flocsim.forces.double_layer import DoubleLayer
from flocsim.forces.van_der_waals import VanDerWaals

CHECK = "check the number and its unit"


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

    def doubt(self, place: str, value: object) -> str:
        """A line on a value that stands at a place, e.g. "fluid.viscosity"; "" where it is usual.

        A value that is not a number has no range. The sign does not count.
        """
        if isinstance(value, tuple):
            return next(filter(None, (self.doubt(place, each) for each in value)), "")
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
    """Lines on the values of an object that are outside their usual ranges; ``place``: its name."""
    found: dict[str, Usual] = {}
    for each in type(owner).__mro__:
        found = USUAL.get(each, {}) | found
    lines = [usual.doubt(f"{place}.{name}", getattr(owner, name)) for name, usual in found.items()]
    return [line for line in lines if line]
