"""What the paper claims, each claim a small pure function of results: `check_claims`."""

from . import fits, robust, several, soft
from .resampling import counts_of
from .verdicts import Finding, MissingData

__all__ = ["COLLISION_CLAIMS", "FIT_CLAIMS", "check_claims"]

FEWEST = 30
"""Replicates below which resamples of them say too little about how they spread."""

FIT_CLAIMS = {
    1: ("sphere RE ≥ 32 % as a class mean", fits.sphere_error),
    2: ("spheropolygon RE < sphere RE", fits.polygon_error),
    3: ("RE(r=1) < RE(r=2) < RE(r=4)", fits.radius_error),
    4: ("r_eq > 5 µm: RE falls with N", fits.error_trend),
    5: ("best RE < 1 % (N = 64, r = 1)", fits.best_error),
    20: ("RE of spheropolygons from 0.5 to 20 %", fits.range_of_errors),
    21: ("r_eq ≤ 5 µm, r = 1: RE least at N = 28", fits.least_error_at),
    22: ("r_eq ≤ 5 µm, r = 2 and 4: RE constant over N", fits.constant_error),
    25: ("sizes: mean r_eq above the median", fits.sizes),
}
"""Number → (words, function of a shape library's entries that yields Parts)."""

COLLISION_CLAIMS = {
    6: ("spheres: Pr[C inside] = 1 and Pr[A] = 1", robust.always_so(6)),
    7: ("Type III: Pr[C inside] = 1", robust.always_so(7)),
    8: ("Pr[C inside]: I ≤ II ≤ III", robust.type_order),
    9: ("A + B = Pr[C inside]; A + B + C + D = 1", robust.always_so(9)),
    10: ("Type III has only A and B", robust.always_so(10)),
    11: ("all classes occur: Type I, N = 64, δ = 0", robust.all_classes),
    12: ("Pr[C inside] of I, II falls with N and δ", soft.inside_falls),
    13: ("Pr[A|inside] < 1, falls with N and δ", soft.aggregation_inside),
    14: ("Type II has the highest Pr[A|inside]", soft.middle_highest),
    15: ("Pr[A|outside] > 0 in I, II, falls with N, δ; 0 for I at δ_max", soft.aggregation_outside),
    16: ("Pr[A|outside] < Pr[A|inside]", soft.outside_below_inside),
    17: ("Type I: D ≈ 50 %, rising with N", soft.half_depart),
    18: ("Type II: A most frequent, falling with N", soft.most_frequent),
    19: ("Pr[A] at δ = 0 falls asymptotically with N, further at δ > 0", soft.asymptotic),
    23: ("Pr[C inside] of Type I depends most on δ", soft.most_sensitive),
    24: ("Pr[A|outside] of I and II alike", soft.alike_outside),
}
"""Number → (words, function of Results and their Counts that yields Parts)."""

SWARM_CLAIMS = {
    26: ("several collisions are a sequence of binary ones", several.sequence),
}
"""Number → (words, function of the first touches in swarms, several.py's rows)."""


def check_claims(results=None, entries=None, touches=None):
    """The Findings of all claims, in the order of their numbers.

    ``results``: Results that hold their replicates; ``entries``: a shape library's; ``touches``:
    those of swarms, as several.read_touches has them. A claim about what is not there has no parts,
    a note that says so, and is undecided.
    """
    fitted = (entries,) if entries else None
    together = (touches,) if touches else None
    enough = results is not None and results.count >= FEWEST
    collided = (results, counts_of(results)) if enough else None
    found = [check(number, *claim, fitted) for number, claim in FIT_CLAIMS.items()]
    found += [check(number, *claim, collided) for number, claim in COLLISION_CLAIMS.items()]
    found += [check(number, *claim, together) for number, claim in SWARM_CLAIMS.items()]
    return sorted(found, key=lambda finding: finding.number)


def check(number, claim, parts_of, data):
    """The Finding of one claim on ``data``, the arguments of its function; None for no data."""
    try:
        if data is None:
            what = "a shape library" if number in FIT_CLAIMS else f"{FEWEST} replicates at least"
            raise MissingData(f"needs {'swarms' if number in SWARM_CLAIMS else what}")
        return Finding(number, claim, tuple(parts_of(*data)))
    except MissingData as lack:
        return Finding(number, claim, (), str(lack))
