"""Which replicates are run again, more exactly, so that what numerics change is seen and counted.

The choice follows from the seed, the replicate's index and how it ended: whatever ranks, kills, and
later extensions there are, the same ones are run again. An index does nothing but name random
numbers, so that a choice which does not look at them is a random sample of those that ended alike.
More are taken of those that flip easily (`io.results.events.flips_easily`), and each kind counts
for as many as there are of it (`estimates.numerical`). One in THIRD_OF of these is run a third
time, more exactly still: first and second runs may lie on one plateau.
"""

import math
from collections.abc import Callable
from functools import cache

import attrs
import numpy as np

from flocsim.integrators.base import Integrator

TIGHTER = 0.01
"""Tolerance of a second run over that of the first."""

THIRD_TIGHTER, FINEST, LEAST_TIGHTER = 1e-3, 1e-12, 0.1
"""Tolerance of a third run over that of the second; the tolerance [m] at which it ends, unless it
is to be tighter than the second at least by the last."""

SHORTER = 0.25
"""The same for a fixed step: 16 times less error of a method of second order."""

MORE_STEPS = 5
"""By how much a run may take more steps than the one before."""

THIRD_OF = 16
"""One in so many second runs has a third one behind it."""

THIRD_COST = 4.0
"""CPU time of a third run over that of a second (benchmarks.accuracy.numerical_error)."""

Z = 1.959963984540054
"""Normal quantile of 95 % intervals."""

LEAST_SHARE, MOST_SHARE, FEW = 0.01, 0.035, 16
"""Of the replicates "auto" has run again at least, and at most where that is more than FEW: less
than a fifth of the cost of a study of 1,000 (benchmarks.accuracy.numerical_error)."""

EASILY = 3
"""Times as many "auto" has run again of those that flip easily."""

STREAM = (0, 0, 1)
"""Spawn key of the number that the choice starts from; replicates have keys of one part."""


def expected_checks(replicates: int, share: float | str, easily: bool = False) -> float:
    """How many of the first so many replicates of a condition are run again, before rounding.

    ``easily``: if all of them were of those that flip easily, EASILY times as many by "auto".

    "auto": where no outcome flips, Wilson's interval of the flip rate at m is as wide as that of a
    probability of ½ at n replicates, z²/(m + z²) = z/√(n + z²), so m = z √(n + z²) − z²; beyond
    FEW of them at most MOST_SHARE, and at least LEAST_SHARE. Never falls, nor rises by more than 1
    from one replicate to the next.
    """
    if isinstance(share, str):
        wanted = Z * math.sqrt(replicates + Z * Z) - Z * Z
        wanted = min(wanted, max(FEW, MOST_SHARE * replicates))
        wanted = max(wanted, LEAST_SHARE * replicates)
        return min(EASILY * wanted, replicates) if easily else wanted
    return share * replicates


@cache
def beginning(seed: int) -> float:
    """A number in [0, 1) that says where the choice begins."""
    stream = np.random.SeedSequence(seed, spawn_key=STREAM)
    return float(np.random.Generator(np.random.Philox(stream)).random())


def further_runs(seed: int, replicate: int, share: float | str, easily: bool = False) -> int:
    """How often a replicate is run again, up to twice: a systematic sample from a random beginning.

    Of the first n of any condition expected_checks(n) would be, up or down to a whole number, if
    all ended alike, the first of these and one in THIRD_OF twice; ``easily``: whether it is of
    those that flip easily.
    """
    start = beginning(seed)
    before, after = (
        math.floor(expected_checks(n, share, easily) + start) for n in (replicate, replicate + 1)
    )
    return 0 if after == before else 1 if before % THIRD_OF else 2


def count_checks(seed: int, replicates: int, share: float | str) -> int:
    """How many of the first so many replicates of a condition are run again."""
    return math.floor(expected_checks(replicates, share) + beginning(seed))


def exact_method(
    method: Integrator, tighter: Callable[[float], float] = lambda value: TIGHTER * value
) -> Integrator | None:
    """The method with a 100 times tighter tolerance, or a quarter of its step; None for neither.

    ``tighter`` gives another tolerance. A class of a user's own has them as parameters of these
    names, or cannot be checked.
    """
    names = {field.alias for field in attrs.fields(type(method)) if field.init}
    for name, smaller in (("tolerance", tighter), ("step", lambda value: SHORTER * value)):
        value = getattr(method, name, math.inf)
        if name in names and value < math.inf:
            return attrs.evolve(method, **{name: float(f"{smaller(value):.15g}")})
    return None


def third_tolerance(second: float) -> float:
    """That of a third run behind a second one [m]."""
    return max(THIRD_TIGHTER * second, min(FINEST, LEAST_TIGHTER * second))


def exact_methods(method: Integrator) -> tuple[Integrator, Integrator] | None:
    """Those of the second and the third run; None where a method cannot be made more exact."""
    second = exact_method(method)
    third = None if second is None else exact_method(second, third_tolerance)
    return None if second is None or third is None else (second, third)
