"""Makers of attrs fields that carry their unit and their permitted range; numbers with units.

The range is checked when an object is made, in Python as from a config file; the unit lets both
read "16.41 um" as 16.41e-6 m, converted in decimals, and refuse "3 kg". A field's metadata has its
``reader`` and a ``help``.
"""

import functools
import math
import os
import re
from collections.abc import Callable, Iterable
from decimal import Decimal, localcontext
from numbers import Integral, Real
from typing import Any

import attrs

from flocsim.constants import BOLTZMANN
from flocsim.errors import LONGEST_SHOWN, RangeError, UsageError, suggestion

KINDS = {
    "m": ("a length", "16.41 um"),
    "s": ("a time", "5 s"),
    "J": ("an energy", "1e-18 J"),
    "V": ("an electric potential", "15 mV"),
    "N/m": ("a stiffness", "20 N/m"),
    "Pa": ("an elastic modulus", "1 MPa"),
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

DIGITS = 60
"""Far more than a float has, so that the only rounding is the last one."""


def is_number(value: Any) -> bool:
    """A finite real number that a float can hold; True and False are not numbers."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def is_whole(value: Any) -> bool:
    """An integer; True and False are none."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def list_words(words: Iterable[str]) -> str:
    """Return "'a', 'b' or 'c'"."""
    *most, last = [repr(word) for word in words]
    return f"{', '.join(most)} or {last}" if most else last


def in_unit(value: Any, unit: str, name: str, word: str | None = None) -> Any:
    """Return a text such as "16.41 um" as a number of the unit; all else as it is.

    RangeError, with the ``name`` of what it is for, for a text that is no such quantity;
    ``word`` is what may stand there instead.
    """
    if not isinstance(value, str):
        return value
    try:
        return read_quantity(value, unit)
    except ValueError as reason:
        hint = suggestion(value, [word] if word else []) or (f" ({reason})" if str(reason) else "")
    raise refused(name, f"{word!r} or {kind_of(unit)}" if word else kind_of(unit), value, hint)


def above_zero(value: Any, unit: str, name: str) -> float:
    """A number above zero, or a text such as "16.41 um", as one of the unit; UsageError for others,
    with the ``name`` of what it is for."""
    number = in_unit(value, unit, name)
    if not is_number(number) or not number > 0.0:
        raise UsageError(f"{name} must be {KINDS[unit][0]} above 0 {unit}, found {value!r}")
    return float(number)


def check_whole(value: Any, least: int, name: str) -> None:
    """UsageError unless a value is a whole number of at least so much."""
    if not is_whole(value) or value < least:
        raise UsageError(f"{name} must be a whole number of at least {least}, found {value!r}")


def refused(name: str, allowed: str, value: object, hint: str = "") -> RangeError:
    """Return the error that says what a field takes and what was found."""
    text = repr(value)
    text = text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}…"
    return RangeError(f"{name} must be {allowed}, found {text}{hint}")


@attrs.frozen
class Reader:
    """What a field takes: in words, and as a function of a value and the field's name.

    ``read`` returns the value that flocsim computes with, the same for values from Python and from
    a config file, and raises RangeError, whose text begins with the name, for one that does not
    fit.
    """

    allowed: str
    read: Callable[[Any, str], Any]
    unit: str = ""


def number(unit: str = "", word: str | None = None, **limits: float | None) -> Reader:
    """Return a reader of finite numbers, of texts such as "16.41 um", and of one special word.

    ``limits``: above, at_least, at_most, below.
    """
    bounds = {name: limit for name, limit in limits.items() if limit is not None}
    words = " and ".join(f"{name.replace('_', ' ')} {limit:g}" for name, limit in bounds.items())
    allowed = f"a finite number {words}".strip()
    allowed = f"{word!r} or {allowed}" if word else allowed
    inside = {
        "above": float.__gt__, "at_least": float.__ge__, "at_most": float.__le__,
        "below": float.__lt__,
    }  # fmt: skip

    def read(value: Any, name: str) -> float | str:
        if isinstance(value, str) and value == word:
            return value
        found = in_unit(value, unit, name, word) if unit else value
        if is_number(found):
            found = float(found)
            if all(inside[bound](found, float(limit)) for bound, limit in bounds.items()):
                return found
        raise refused(name, f"{allowed} [{unit}]" if unit else allowed, value)

    return Reader(allowed, read, unit)


def whole(at_least: int, at_most: int) -> Reader:
    """Return a reader of integers within limits; 3.0 is none."""
    allowed = f"an integer from {at_least} to {at_most}"

    def read(value: Any, name: str) -> int:
        if not is_whole(value) or not at_least <= value <= at_most:
            raise refused(name, allowed, value)
        return int(value)

    return Reader(allowed, read)


def one_of(*words: str) -> Reader:
    """Return a reader of one of these words."""

    def read(value: Any, name: str) -> str:
        if not isinstance(value, str) or value not in words:
            hint = suggestion(value, words) if isinstance(value, str) else ""
            raise refused(name, list_words(words), value, hint)
        return value

    return Reader(list_words(words), read)


def text(allowed: str = "a string") -> Reader:
    """Return a reader of a line of printable characters that is not blank, and of paths."""

    def read(value: Any, name: str) -> str | os.PathLike:
        if isinstance(value, os.PathLike):
            return value
        if not isinstance(value, str) or not value.strip() or not value.isprintable():
            raise refused(name, "a string that is not blank", value)
        return value

    return Reader(allowed, read)


def several(
    item: Reader, length: int | None = None, distinct: bool = True, or_word: bool = False
) -> Reader:
    """Return a reader of lists, as tuples, of at least one item or of a ``length``.

    ``or_word``: a single word is a list of it.
    """
    allowed = (
        f"a list of {length or ('different values' if distinct else 'values')}, each {item.allowed}"
    )

    def read(value: Any, name: str) -> tuple:
        value = value.tolist() if hasattr(value, "tolist") else value
        value = [value] if or_word and isinstance(value, str) else value
        if not isinstance(value, list | tuple) or not value or len(value) != (length or len(value)):
            raise refused(name, allowed, value)
        found = tuple(item.read(each, f"{name}[{place}]") for place, each in enumerate(value))
        if distinct and len(set(found)) < len(found):
            twice = next(place for place, each in enumerate(found) if each in found[:place])
            raise refused(f"{name}[{twice}]", "another value than those before it", value[twice])
        return found

    return Reader(allowed, read, item.unit)


def either(one: Reader, many: Reader) -> Reader:
    """Return a reader of lists by ``many``, and of all else by ``one``."""

    def read(value: Any, name: str) -> Any:
        return (many if isinstance(value, list | tuple) else one).read(value, name)

    return Reader(f"{one.allowed}, or {many.allowed}", read, one.unit or many.unit)


def field(
    reader: Reader, *, default: Any = attrs.NOTHING, kw_only: bool = False, **metadata: Any
) -> Any:
    """Return an attrs field whose values a Reader reads; None where that is the default.

    ``metadata`` of flocsim's own: ``help``; ``table``, a class whose objects it takes as well.
    """

    def convert(value: Any, attribute: attrs.Attribute) -> Any:
        # A default that is computed may be None, too.
        optional = default is None or isinstance(default, attrs.Factory)  # type: ignore[arg-type]
        if (value is None and optional) or isinstance(value, table):
            return value
        return reader.read(value, attribute.name)

    metadata = {"reader": reader, **metadata}
    table = metadata.get("table", ())
    converter = attrs.Converter(convert, takes_field=True)
    return attrs.field(default=default, converter=converter, metadata=metadata, kw_only=kw_only)


def quantity(
    unit: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
    default: Any = attrs.NOTHING,
    help: str = "",
    word: str | None = None,
    **more: Any,
) -> Any:
    """A field with a unit ("" for a pure number), e.g. ``quantity("J", at_least=0.0)``.

    It takes numbers in that unit, and texts with any of the same dimension: 5e-21 or "5 zJ"; and
    one special ``word``, where there is one.
    """
    reader = number(unit, word, above=above, at_least=at_least, at_most=at_most, below=below)
    return field(reader, default=default, help=help, **more)


def quantity_of_each(unit: str, *, default: Any = attrs.NOTHING, help: str = "") -> Any:
    """A field that takes a quantity of both bodies of a pair, or a list of one for each."""
    one = number(unit)
    return field(either(one, several(one, 2, distinct=False)), default=default, help=help)


def choice(*options: str, default: Any = attrs.NOTHING, help: str = "", **more: Any) -> Any:
    """A field that takes one of the given words."""
    return field(one_of(*options), default=default, help=help, **more)


def word_or_quantity(word: str, unit: str, **more: Any) -> Any:
    """A field that takes one special word, e.g. ``"critical"``, or a quantity: else as that."""
    return quantity(unit, word=word, **more)


def flag(*, default: Any = attrs.NOTHING, help: str = "") -> Any:
    """A field that takes true or false."""

    def read(value: Any, name: str) -> bool:
        if not isinstance(value, bool):
            raise refused(name, "true or false", value)
        return value

    return field(Reader("true or false", read), default=default, help=help)


def only(kind: type, allowed: str) -> Callable[[object, attrs.Attribute, Any], None]:
    """A validator that lets objects of a class pass; UsageError says what is ``allowed``."""

    def validate(instance: object, attribute: attrs.Attribute, value: Any) -> None:
        if not isinstance(value, kind):
            raise UsageError(f"{allowed}, found {value!r}")

    return validate


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
def registry() -> Any:
    """pint's units, in decimals; loaded when the first quantity with a unit is met."""
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


@functools.lru_cache(maxsize=256)
def factor(written: str, unit: str) -> Any:
    """How many of ``unit`` one of the ``written`` unit is (Decimal)."""
    import pint

    (scale, one), (per, wanted) = parse_unit(written), parse_unit(unit)
    try:
        return registry().Quantity(Decimal(1), one).to(wanted).magnitude * scale / per
    except (pint.PintError, ArithmeticError, TypeError, ValueError) as error:
        raise ValueError("") from error


def parse_unit(text: str) -> tuple[Decimal, Any]:
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


def unit_of(name: str) -> Any:
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


def exponent_of(decimal: str, over: str, under: str) -> int | Decimal:
    """The exponent that is written as a decimal, as "(1/2)", or not at all."""
    value = Decimal(over) / Decimal(under) if over else Decimal(decimal or 1)
    return int(value) if value == int(value) else value
