"""Numbers with units: "16.41 um" is 16.41e-6 m, converted in decimals, its dimension checked."""

import functools
import re
from decimal import Decimal, localcontext

from flocsim.constants import BOLTZMANN

KINDS = {
    "m": ("a length", "16.41 um"),
    "s": ("a time", "5 s"),
    "J": ("an energy", "1e-18 J"),
    "V": ("an electric potential", "15 mV"),
    "N/m": ("a stiffness", "20 N/m"),
    "Pa s": ("a viscosity", "0.89 mPa s"),
    "kg/m^2": ("a mass per area", "2 kg/m^2"),
    "kg/m^3": ("a density", "2650 kg/m^3"),
    "m/s": ("a velocity", "1 mm/s"),
    "m/s^2": ("an acceleration", "9.81 m/s^2"),
    "1/s": ("a rate", "1e6 1/s"),
    "rad": ("an angle", "90 deg"),
    "rad/s": ("an angular velocity", "1 rad/s"),
    "N": ("a force", "1 pN"),
    "N m": ("a torque", "1e-18 N m"),
    "K": ("a temperature", "25 degC"),
    "g/kg": ("a salinity", "35 g/kg"),
    "mol/m^3": ("a concentration", "0.1 mol/l"),
    "1/m": ("a reciprocal length", "1.02 1/um"),
}
"""What a quantity of a unit is called, and how one is written."""

NUMBER = re.compile(
    r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?)(.*)", re.DOTALL
)
EXPONENT = r"(?:(?:\^|\*\*)?([+-]?[0-9](?:\.[0-9]{1,3})?)|(?:\^|\*\*)\(([+-]?[0-9])/([1-9])\))?"
THERMAL = re.compile(
    r"\s*([*·./]?)\s*k(?:_?[Bb])?T(?![^\W\d_])(?:\s*@\s*([0-9]+\.?[0-9]*)\s*K(?![^\W\d_]))?"
    + EXPONENT
)
UNIT_FACTOR = re.compile(r"\s*([*·./]?)\s*([^\W\d_]+)" + EXPONENT)
SIGNS = str.maketrans({"°": " deg", "⁻": "-"} | dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789", strict=True)))

PIXELS = ("px", "pixel", "dot", "pel", "picture_element", "css_pixel")
"""What pint takes for a length, of screens and paper."""

CELSIUS = ("degc", "deg c", "celsius")
"""Degrees that do not count from zero, as `read_quantity` has them in lower case ("°" is "deg")."""

LONGEST = 100
"""Letters of a number and its unit."""

# Far more digits than a float has, so that the only rounding is the last one.
DIGITS = 60


def kind_of(unit: str) -> str:
    """What a value of the unit is, in words: "an energy such as '1e-18 J'"."""
    name, example = KINDS.get(unit, (f"a quantity in {unit}", f"1 {unit}"))
    return f"{name} such as {example!r}"


def read_quantity(text: str, unit: str) -> float:
    """The value of ``text``, a number and its unit, in ``unit`` as a float.

    The conversion is decimal: ``read_quantity("16.41 um", "m") == 16.41e-6``. Units multiply by a
    space, "*" or "·", divide by "/", and have exponents: "mPa s", "kg/m^3", "kg m-3", "m²",
    "Pa^0.5", "m^(1/2)". An energy may be "4 kT@293K": the temperature is part of the unit. A
    temperature may be "25 degC".
    ValueError, with the reason, for text that is no quantity or has another dimension.
    """
    if len(text) > LONGEST:
        raise ValueError(f"more than {LONGEST} letters")
    match = NUMBER.fullmatch(text)
    if not match:
        raise ValueError("no number in front")
    written = match[2].translate(SIGNS).strip()
    if not written:
        raise ValueError("a number in quotes needs a unit")
    with localcontext() as context:
        context.prec = DIGITS
        if unit == "K" and written.lower() in CELSIUS:
            return float(Decimal(match[1]) + Decimal("273.15"))
        return float(Decimal(match[1]) * factor(written, unit))


def read_number(text: str, unit: str) -> float:
    """A number of the unit, as "1e-6", or a text with one, as in `read_quantity`."""
    try:
        return float(text)
    except ValueError:
        return read_quantity(text, unit)


@functools.cache
def registry():
    """pint's units, in decimals; loaded when the first quantity with a unit is met."""
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


@functools.lru_cache(maxsize=256)
def factor(written, unit):
    """How many of ``unit`` one of the ``written`` unit is (Decimal)."""
    import pint

    (scale, one), (per, wanted) = parse_unit(written), parse_unit(unit)
    try:
        return registry().Quantity(Decimal(1), one).to(wanted).magnitude * scale / per
    except (pint.PintError, ArithmeticError, TypeError, ValueError) as error:
        raise ValueError("") from error


def parse_unit(text):
    """(factor, product of powers of units). Read here, since pint would evaluate "9**9**9 m"."""
    units = registry()
    scale, product = Decimal(1), units.Unit("dimensionless")
    place = 1 if re.match(r"1\s*/", text) else 0
    while place < len(text):
        match = THERMAL.match(text, place)
        if match and match[2] is None:
            raise ValueError("kT needs its temperature, as in 'kT@298.15K'")
        thermal = Decimal(match[2]) * Decimal(str(BOLTZMANN)) if match else Decimal(1)
        match = match or UNIT_FACTOR.match(text, place)
        if not match or not (thermal != 1 or match[2].isidentifier()) or not thermal > 0:
            raise ValueError(f"{text[place:].strip()!r} is no unit")
        one = units.Unit("joule") if thermal != 1 else unit_of(match[2])
        exponent = exponent_of(*match.groups()[2:]) * (-1 if match[1] == "/" else 1)
        scale, product = scale * thermal**exponent, product * one**exponent
        place = match.end()
    return scale, product


def unit_of(name):
    """The unit of a name, as "um"."""
    import pint

    if name in PIXELS:
        raise ValueError(f"{name!r} is no unit of length: a pixel has the size that a picture has")
    try:
        unit = registry().Unit(name)
        shifted = registry().Quantity(Decimal(0), unit).to_base_units().magnitude != 0
    except (pint.PintError, ArithmeticError, AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"unknown unit {name!r}") from error
    if shifted:
        raise ValueError(f"{name!r} does not count from zero: give kelvins, or degC")
    return unit


def exponent_of(decimal, over, under):
    """The exponent that is written as a decimal, as "(1/2)", or not at all."""
    value = Decimal(over) / Decimal(under) if over else Decimal(decimal or 1)
    return int(value) if value == int(value) else value
