"""Claims 6 to 11: what the paper says of collisions without "generally"."""

from statistics import NormalDist

import numpy as np

from flocsim.io.results.events import UNDECIDED
from flocsim.io.results.schema import CLASSES, FAILED

from .trends import mean_polygons
from .verdicts import (
    FAILS,
    HOLDS,
    MissingData,
    Part,
    above,
    always,
    occurs,
)

SHOWN = 3
"""Contradicting replicates that a remark names."""


def named(results, flags):
    """ "2 against: III N=4 δ=1 replicate 63, …" for flags (type, vertices, delta, replicate)."""
    places = np.argwhere(flags)
    if not len(places):
        return ""
    names = [
        f"{results.types[t]} N={results.vertices[v]} δ={results.delta[d]:g} replicate {k}"
        for t, v, d, k in places[:SHOWN]
    ]
    return f"{len(places)} against: {', '.join(names)}{', …' if len(places) > SHOWN else ''}"


def only(results, types=None, vertices=None, delta=None):
    """Flags of the replicates of some conditions, in the shape of the replicates."""
    flags = np.ones(results.replicates["outcome"].shape, dtype=bool)
    for axis, (wanted, found) in enumerate(
        ((types, results.types), (vertices, results.vertices), (delta, results.delta))
    ):
        if wanted is not None:
            chosen = np.isin(found, wanted)
            flags &= chosen.reshape([-1 if k == axis else 1 for k in range(4)])
    if not flags.any():
        raise MissingData(f"there are no conditions {types or ''} {vertices or ''}".rstrip())
    return flags


def all_of(results, what, trials, good):
    """always() of good among trials, the exceptions named."""
    happened, count = int(np.sum(trials & good)), int(np.sum(trials))
    return always(what, happened, count, named(results, trials & ~good))


def spheres(results):
    """(6) Equivalent spheres: always inside, always aggregated."""
    chosen = only(results, vertices=[1])
    outcome, inside = results.replicates["outcome"], results.replicates["inside"]
    yield "Pr[C inside], spheres", chosen & (inside <= 1), inside == 1
    yield "Pr[A], spheres", chosen & (outcome < len(CLASSES)), outcome % 2 == 0


def small_inside(results):
    """(7) Type III: always inside."""
    inside = results.replicates["inside"]
    yield "Pr[C inside], Type III", only(results, types=["III"]) & (inside <= 1), inside == 1


def type_order(results, counts):
    """(8) Pr[C inside]: I ≤ II ≤ III, on the mean and in no condition clearly otherwise."""
    p = counts.pr_inside
    for less, more in (("I", "II"), ("II", "III")):
        differences = p[counts.type(more)] - p[counts.type(less)]
        what = f"Pr[C inside], {more} less {less}"
        yield above(f"{what}, mean over N > 1 and δ", mean_polygons(counts, differences))
        yield least_difference(f"{what}, least condition", differences[counts.polygons])


def least_difference(what, differences):
    """Part: no condition where a difference is clearly below 0, by Bonferroni's bound for all.

    One condition below 0 within its error is what equal probabilities look like.
    """
    cells = differences.reshape(-1, differences.shape[-1])
    cells = cells[np.isfinite(cells[:, 0])]
    if not len(cells):
        raise MissingData("there are no collisions to compare")
    z = NormalDist().inv_cdf(1.0 - 0.025 / len(cells))
    values, reach = cells[:, 0], z * np.nanstd(cells[:, 1:], axis=1)
    least = int(np.argmin(values + reach))
    clear = int(np.sum(values + reach < 0.0))
    note = f"{int(np.sum(values < 0.0))} of {len(cells)} conditions below 0, {clear} clearly"
    value, spread = float(values[least]), float(reach[least])
    return Part(what, value, value - spread, value + spread, FAILS if clear else HOLDS, note)


def identities(results):
    """(9) A + B = Pr[C inside] and A + B + C + D = 1, over decided collisions."""
    outcome, inside = results.replicates["outcome"], results.replicates["inside"]
    decided = outcome < len(CLASSES)
    agrees = np.where(outcome <= 1, inside == 1, inside == 0)
    yield "decided collisions whose class agrees with their side", decided, agrees
    ended = (inside <= 1) & (outcome != FAILED) & (outcome != UNDECIDED)
    yield "decided collisions that are of a class", ended, decided


def small_classes(results):
    """(10) Type III: only A and B."""
    outcome = results.replicates["outcome"]
    chosen = only(results, types=["III"]) & (outcome < len(CLASSES))
    yield "Pr[A or B], Type III", chosen, outcome <= 1


ALWAYS = {6: spheres, 7: small_inside, 9: identities, 10: small_classes}
"""Number → function of Results that yields (words, trials, good): good in all trials."""


def always_so(number):
    """The claim that an event of ALWAYS always happens, as a function that yields Parts."""
    return lambda results, counts: (all_of(results, *rule) for rule in ALWAYS[number](results))


def contradicting(results, number):
    """Flags (type, vertices, delta, replicate) of what contradicts a claim of ALWAYS."""
    exceptions = [trials & ~good for _, trials, good in ALWAYS[number](results)]
    return np.any(exceptions, axis=0)


def all_classes(results, counts):
    """(11) Type I, N = 64, δ = 0: all four classes."""
    outcome = results.replicates["outcome"]
    chosen = outcome[only(results, types=["I"], vertices=[64], delta=[0.0])]
    decided = int(np.sum(chosen < len(CLASSES)))
    for code, name in enumerate(CLASSES):
        yield occurs(f"class {name}, Type I, N = 64, δ = 0", int(np.sum(chosen == code)), decided)
