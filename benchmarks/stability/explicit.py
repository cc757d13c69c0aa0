"""An explicit method at a tight tolerance as the judge: the same forces, another method."""

import attrs
import numpy as np

from benchmarks.stability.case import Answer, ReferenceGaveUpError, distance_of
from flocsim.integrators import DormandPrince54, Status

MOST_STEPS = 20_000
"""More explicit steps than these are not taken; the invariants alone decide."""

TIGHTER, FINEST = 1e-2, 1e-12
"""The reference's tolerance: this share of the case's, but no less than this share of a radius."""


def end_of(case, tolerance, bodies=None):
    """End position (n, 3) at a tolerance [m]; None where the bodies get too deep."""
    found = case.run(DormandPrince54(tolerance=tolerance), bodies, MOST_STEPS, record=False)
    if found.status == Status.TOO_DEEP:
        return None
    if found.status != Status.FINISHED or not np.isfinite(found.position[-1]).all():
        raise ReferenceGaveUpError
    return found.position[-1]


def nudged_bodies(case, nudge):
    """The bodies, the last one moved aside [m]."""
    last = case.bodies[-1]
    x, y = last.position
    return [*case.bodies[:-1], attrs.evolve(last, position=(x + 0.6 * nudge, y + 0.8 * nudge))]


def explicit_answer(case):
    """The Answer of an explicit method, its uncertainty from a second, looser run."""
    smallest = min(body.shape.equivalent_radius for body in case.bodies)
    tolerance = max(TIGHTER * case.tolerance, FINEST * smallest)
    nudge = max(case.tolerance, 1e-6 * smallest)
    tight, loose = end_of(case, tolerance), end_of(case, 30.0 * tolerance)
    aside = end_of(case, 30.0 * tolerance, nudged_bodies(case, nudge))
    if tight is None:
        return Answer(np.zeros((len(case.bodies), 3)), deepest=np.inf)
    if loose is None or aside is None:
        raise ReferenceGaveUpError
    error = distance_of(case.bodies, tight, loose) + 10.0 * tolerance
    growth = distance_of(case.bodies, aside, loose) / nudge
    return Answer(tight, error, max(1.0, growth), np.abs(tight[:, :2]).max())
