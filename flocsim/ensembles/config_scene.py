"""The table [scene] of a config file."""

from decimal import Decimal

import attrs

from flocsim.ensembles.config_fields import LARGEST_LENGTH, items_reader, read_by
from flocsim.ensembles.values import number_reader, read_choice, vector_reader
from flocsim.fields import choice, quantity, word_or_quantity

TYPES = {"I": (16.41e-6, 23.02e-6), "II": (4.95e-6, 23.02e-6), "III": (4.62e-6, 4.95e-6)}
"""Equivalent radii (receiving, approaching) [m] of the paper's three types of collision."""


@attrs.frozen
class SceneConfig:
    """[scene]: who meets whom, and how the meeting begins and ends."""

    pairs: tuple = attrs.field(
        default=(),
        metadata={
            "read": items_reader(
                vector_reader(2, "m", above=0.0, at_most=LARGEST_LENGTH),
                "a list of pairs such as [['16.41 um', '23.02 um']]",
            ),
            "allowed": "a list of pairs [r_i, r_j], each above 0 and at most 0.01",
            "unit": "m",
            "shown": "none",
            "help": "equivalent radii (receiving, approaching), instead of `types`",
        },
    )
    types: tuple = attrs.field(
        default=attrs.Factory(lambda self: () if self.pairs else tuple(TYPES), takes_self=True),
        metadata={
            "read": items_reader(
                lambda value: read_choice(value, tuple(TYPES)), "a list of 'I', 'II', 'III'"
            ),
            "allowed": 'a list of "I", "II", "III"',
            "shown": '["I", "II", "III"]',
            "help": "the paper's collision types: (r_i, r_j) = I (16.41, 23.02), "
            "II (4.95, 23.02), III (4.62, 4.95) µm",
        },
    )
    delta: tuple = read_by(
        items_reader(number_reader("", at_least=0.0), "a list of fractions such as [0.0, 0.5]"),
        "a list of distinct numbers, each at least 0",
        default=(0.0, 0.25, 0.5, 0.75, 1.0),
        help="horizontal displacements of the centres, as fractions of δ_max",
    )
    delta_max: str = choice(
        "projected",
        "radius",
        default="projected",
        help="δ_max: the facing horizontal half-extents at the drawn orientations (1 just grazes), "
        "or R_i + R_j, the largest centroid-to-outline distances (1 always misses)",
    )
    receiver: str = choice(
        "free", "fixed", default="free", help="whether the receiving body i settles or is held"
    )
    start_gap: float = quantity(
        "m",
        above=0.0,
        at_most=LARGEST_LENGTH,
        default=2e-6,
        help="distance of the outlines at the start",
    )
    escape_gap: float | str = word_or_quantity(
        "start_gap",
        "m",
        above=0.0,
        default="start_gap",
        help="a pair that touched and is further apart than this, and parting, has departed",
    )
    rest_time: float | str = word_or_quantity(
        "auto",
        "s",
        above=0.0,
        default="auto",
        help="how long a doublet must rest as a rigid body to count as bound",
    )
    time_limit: float | str = word_or_quantity(
        "auto",
        "s",
        above=0.0,
        default="auto",
        help="simulated time after which a replicate ends undecided",
    )

    @property
    def conditions(self):
        """(name, r_i, r_j) [-, m, m] of every collision type or pair, in the config's order."""
        if self.pairs:
            return tuple((pair_name(*pair), *pair) for pair in self.pairs)
        return tuple((name, *TYPES[name]) for name in self.types)


def pair_name(radius_i, radius_j):
    """ "16.41um-23.02um", of radii in metres."""
    return f"{micrometres(radius_i)}um-{micrometres(radius_j)}um"


def micrometres(length):
    """A length [m] in µm, with just the digits that it has: 16.41e-6 → "16.41"."""
    return format(Decimal(repr(float(length))).scaleb(6).normalize(), "f")
