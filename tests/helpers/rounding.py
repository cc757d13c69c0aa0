"""Equality of a number that two paths of code compute: numpy and compiled, scalar and array."""

import numpy as np
import pytest

LAST_PLACES = 4.0 * np.finfo(float).eps
"""hypot, exp, log, sin and powers are not rounded alike by numpy, by Python and by what numba
compiles, nor by one of them on two kinds of CPU: each is an ulp or two off the true value. Sums,
products, quotients and square roots are rounded alike everywhere (IEEE 754)."""


def to_rounding(number):
    """What equals the number or array up to its last places, for numbers of one formula."""
    return pytest.approx(number, rel=LAST_PLACES, abs=0.0)
