"""Random numbers that are a function of what they are for: a counter and a key, no state.

Philox 4 × 32 with ten rounds, written so that the same integers come out in plain Python and in
compiled code, where a product of two of 32 bits wraps around in a signed 64-bit integer: the bits
that are kept are the same.

Source: Salmon, Moraes, Dror and Shaw (2011), Parallel random numbers: as easy as 1, 2, 3, SC11.
"""

import math

LOW = 0xFFFFFFFF
"""The lower 32 bits."""

FIRST_FACTOR, SECOND_FACTOR = 0xD2511F53, 0xCD9E8D57
FIRST_WEYL, SECOND_WEYL = 0x9E3779B9, 0xBB67AE85

ROUNDS = 10

WORD = 2.0**-32
"""One part of the range of a word."""


def philox(one, two, three, four, key, other):
    """Four words of 32 bits from a counter of four and a key of two."""
    for _ in range(ROUNDS):
        first, second = FIRST_FACTOR * one, SECOND_FACTOR * three
        one, two, three, four = (
            ((second >> 32) & LOW) ^ two ^ key,
            second & LOW,
            ((first >> 32) & LOW) ^ four ^ other,
            first & LOW,
        )
        key, other = (key + FIRST_WEYL) & LOW, (other + SECOND_WEYL) & LOW
    return one, two, three, four


def three_normals(index, level, body, key):
    """Three independent standard normal numbers (Box and Muller) for a place in a tree of kicks.

    ``index`` of the place at its ``level``, whole numbers from 0; ``body``: whom it is for;
    ``key``: two words.
    """
    one, two, three, four = philox(
        index & LOW, (index >> 32) & LOW, level & LOW, body & LOW, key[0], key[1]
    )
    turn = 2.0 * math.pi * WORD * (two + 0.5)
    size = math.sqrt(-2.0 * math.log(WORD * (one + 0.5)))
    last = math.sqrt(-2.0 * math.log(WORD * (three + 0.5)))
    last *= math.cos(2.0 * math.pi * WORD * (four + 0.5))
    return size * math.cos(turn), size * math.sin(turn), last
