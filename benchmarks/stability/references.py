"""Judges for scenes without a closed form: the plain model of tests/reference for small scenes of
contacts, and an explicit method at a tight tolerance, with the same forces, for the others."""

from dataclasses import dataclass, field

import attrs
import numpy as np

from benchmarks.stability.case import Answer, ReferenceGaveUpError, distance_of
from flocsim.constants import DEEPEST_OVERLAP
from flocsim.integrators import DormandPrince54, Status
from tests.reference.contacts import OverlapTooDeepError
from tests.reference.forces import Contact as PlainContact
from tests.reference.integrate import simulate
from tests.reference.shapes import Scene, make_body

TIGHT, LOOSE = 1e-11, 1e-9
MOST_RATES = 12_000
"""Evaluations of the right-hand side after which the reference gives up."""


@dataclass(frozen=True)
class CountedContact(PlainContact):
    """The plain contact law, which gives up after so many evaluations of the forces."""

    calls: list = field(default_factory=list)

    def loads_at(self, scene, pairs, displacements):
        """As the law's own, counted."""
        self.calls.append(1)
        if len(self.calls) > MOST_RATES:
            raise ReferenceGaveUpError
        return super().loads_at(scene, pairs, displacements)


def scale_of(case):
    """By how much lengths are multiplied so that the smallest body measures a micrometre.

    The equations of contact alone are linear in length where masses, k and λ stay as they are, and
    the reference's absolute tolerances are meant for micrometres.
    """
    return 1e-6 / min(body.shape.equivalent_radius for body in case.bodies)


def plain_scene(case, scale=1.0, nudge=0.0):
    """The reference's Scene of the bodies in scaled lengths, the last one moved by a nudge [m]."""
    bodies = tuple(
        make_body(
            scale * np.array(body.shape.vertices),
            scale * body.shape.radius,
            density=body.density / scale**3,
        )
        for body in case.bodies
    )
    lengths = np.array([scale, scale, 1.0])
    places = lengths * [(*body.position, body.angle) for body in case.bodies]
    speeds = lengths * [(*body.velocity, body.spin) for body in case.bodies]
    places[-1, :2] += scale * nudge * np.array([0.6, 0.8])
    return Scene(bodies, places, speeds)


def plain_run(case, rtol, nudge=0.0):
    """End position (n, 3) by the reference, of a case of contacts alone."""
    law, scale = case.forces[-1], scale_of(case)
    plain = CountedContact(law.k_n, law.k_t, law.damping_n, None, None, law.tension)
    try:
        found = simulate(plain_scene(case, scale, nudge), [plain], case.until, rtol=rtol)
    except RuntimeError:
        raise ReferenceGaveUpError from None
    return found.positions[-1] / [scale, scale, 1.0]


def plain_answer(case):
    """The Answer of the plain model."""
    smallest = min(body.shape.equivalent_radius for body in case.bodies)
    nudge = max(case.tolerance, 1e-7 * smallest)
    try:
        tight = plain_run(case, TIGHT)
        loose = plain_run(case, LOOSE)
        nudged = plain_run(case, LOOSE, nudge)
    except OverlapTooDeepError:
        starts = np.array([(*body.position, body.angle) for body in case.bodies])
        return Answer(starts, deepest=2.0 * DEEPEST_OVERLAP)
    growth = distance_of(case.bodies, nudged, loose) / nudge
    # Two runs may agree by chance, but not to less than their own tolerance.
    error = distance_of(case.bodies, tight, loose) + 10.0 * TIGHT * smallest
    return Answer(tight, error, max(1.0, growth), np.abs(tight[:, :2]).max())


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
