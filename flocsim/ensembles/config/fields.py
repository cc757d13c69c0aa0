"""Makers of the schema's own fields: integers, lists, words, and what may be left out."""

import attrs

from flocsim.ensembles.config.values import Misfit, misfit, read_each
from flocsim.errors import ConfigError
from flocsim.fields import describe_range, range_validator

LARGEST_LENGTH = 0.01
"""[m] Upper limit of sizes: a larger one is a length in µm whose unit was forgotten."""


def whole_reader(at_least, at_most):
    """A reader of integers within the limits; 3.0 is none."""

    def read(value):
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not whole or not at_least <= value <= at_most:
            raise misfit(f"an integer from {at_least} to {at_most}", value)
        return value

    return read


def read_text(value):
    """A string of printable characters that is not blank."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise misfit("a string that is not blank", value)
    return value


def items_reader(read_item, allowed):
    """A reader of lists with at least one item, no two the same; returns a tuple."""

    def read(value):
        items = read_each(value, read_item, allowed)
        first = {item: place for place, item in reversed(list(enumerate(items)))}
        repeated = [
            (f"[{place}]", f"must differ from the others, found the same as in [{first[item]}]")
            for place, item in enumerate(items)
            if first[item] != place
        ]
        if repeated:
            raise Misfit(*repeated)
        return items

    return read


def read_by(read, allowed, *, default=attrs.NOTHING, help=""):
    """A field with a reader of its own (flocsim.ensembles.config.values), also held in Python."""

    def check(instance, attribute, value):
        try:
            read(value)
        except Misfit as error:
            place, text = error.findings[0]
            raise ConfigError(f"{attribute.name}{place} {text}") from None

    metadata = {"read": read, "allowed": allowed, "help": help}
    return attrs.field(default=default, validator=check, metadata=metadata)


def whole(at_least, at_most, *, default=attrs.NOTHING, help=""):
    """A field that takes an integer."""
    allowed = f"an integer from {at_least} to {at_most}"
    return read_by(whole_reader(at_least, at_most), allowed, default=default, help=help)


def word(*, default, help):
    """A field that takes a string."""
    return read_by(read_text, "a string", default=default, help=help)


def optional_quantity(unit, *, help, **limits):
    """A quantity that may be left out (None)."""
    return attrs.field(
        default=None,
        validator=attrs.validators.optional(range_validator(**limits)),
        metadata={"unit": unit, "allowed": describe_range(**limits), "help": help},
    )
