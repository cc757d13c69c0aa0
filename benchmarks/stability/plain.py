"""The plain model of tests/reference as the judge of small scenes of contacts."""

from dataclasses import dataclass, field

import numpy as np

from benchmarks.stability.case import Answer, ReferenceGaveUpError, distance_of
from flocsim.constants import DEEPEST_OVERLAP
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
