"""Stiffness of a contact's normal law, and whether a step resolves its vibration."""

import math

from flocsim.hooks import CONTACT_FORCE, contact_force, has
from flocsim.integrators.rhs.views import contact_view, view_without_slip
from flocsim.state.clock import SERIES
from flocsim.state.work import NOW

RESOLVED_PHASE = 1.0
"""Phase ω h [rad] up to which a step follows a vibration: its path has one direction."""

UNRESOLVED_PHASE = 50.0
"""ω0 h from which a step leaves a contact's vibration out; shorter steps do so partly."""


def normal_force_at(scene, view, overlap, overlap_rate):
    """Return the normal force of a contact at an overlap [m] and rate [m/s], 0 without a contact
    law [N]."""
    if not has(scene, CONTACT_FORCE):
        return 0.0
    force, _ = contact_force(scene, view_without_slip(view, overlap, overlap_rate))
    return force


def secant_stiffness(scene, view, overlap):
    """Return the normal force of a static contact over its overlap [N/m]."""
    return normal_force_at(scene, view, overlap, 0.0) / overlap


def unresolved_fraction(scene, work, clock, step, row):
    """Return min(1, (ω0 h/UNRESOLVED_PHASE)²): 1 if a step leaves the contact's vibration out.

    Such a contact only balances its load, which then decides whether it touches.
    """
    # A series resolves every vibration.
    if work.tally.kind == SERIES:
        return 0.0
    view = contact_view(scene, work, NOW, row)
    stiffness = secant_stiffness(scene, view, clock.tolerance)
    if not stiffness > 0.0:
        return 0.0
    phase = step * math.sqrt(stiffness / view.effective_mass) / UNRESOLVED_PHASE
    return min(1.0, phase * phase)
