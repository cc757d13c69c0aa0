"""The resolution to which the instant of a touch or release must be located.

A contact detected g too deep gives back a velocity that is wrong by about ω0 g. One that goes on
damping until g past its end is wrong by that force's acceleration times g/speed.
"""

import math

from flocsim.constants import TINY
from flocsim.integrators.rhs.contact_stiffness import normal_force_at, secant_stiffness
from flocsim.integrators.rhs.error import at_least_rounding
from flocsim.integrators.rhs.views import contact_view, normal_rate, velocity_lifetime_of
from flocsim.state.work import NEW, NOW

RESOLUTION = 1e-3
"""A switch is located to this fraction of the tolerance, and to OVERLAP_FRACTION of the deepest
overlap, but not finer than the rounding of coordinates."""

OVERLAP_FRACTION = 0.02
"""Where bodies rebound, their touch is located to this fraction of the depth of the impact,
speed/ω0; while contacts are pressed, switches to this fraction of the deepest overlap."""

SHARE_OF_DAMPED = 0.3
"""Where they do not, to this fraction: their rest may depend on far less than the tolerance, and a
touch noticed deeper than the impact gets has a force that the bodies never caused."""

MOST_LATER = 1e3
"""Touches of bodies that rebound and releases are located so finely that the velocity error leads
to at most this multiple of the resolution: to some tolerance."""

NEARLY = 0.99
"""Margin that tells critical damping from less in spite of rounding. If they counted as bouncing,
critically damped doublets would rattle for ten times the steps."""


def bounces(scene, view, speed, frequency):
    """Return True if bodies rebound: damping is below critical, or it does not pull."""
    # Force of critical damping, 2 M ω0 v.
    drag = 2.0 * NEARLY * frequency * speed * view.effective_mass
    return normal_force_at(scene, view, 0.0, speed) < drag or (
        normal_force_at(scene, view, 0.0, -speed) >= 0.0
    )


def touch_resolution(scene, work, state, row, resolution):
    """Return the overlap that a new contact may have reached before it is noticed [m]."""
    speed = -normal_rate(work, state, row)
    view = contact_view(scene, work, state, row)
    stiffness = secant_stiffness(scene, view, resolution)
    if not (stiffness > 0.0 and speed > 0.0):
        return resolution
    # ω0 of the contact; speed/ω0 is about the depth of the impact.
    frequency = math.sqrt(stiffness / view.effective_mass)
    # Inelastic: a fraction of the depth of the impact.
    if not bounces(scene, view, speed, frequency):
        return at_least_rounding(work, state, min(resolution, SHARE_OF_DAMPED * speed / frequency))
    # Elastic: a smaller one, and the velocity error ω0 g displaces the bodies by ω0 g T.
    by_lifetime = MOST_LATER * resolution / max(frequency * velocity_lifetime_of(work, row), TINY)
    return at_least_rounding(
        work, state, min(resolution, OVERLAP_FRACTION * speed / frequency, by_lifetime)
    )


def release_resolution(scene, work, step, row, resolution):
    """Return by how much a contact may have opened before it is noticed [m], while it pulls.

    Damping pulls in proportion to the speed v of the opening, and a law with tension to the gap g:
    both for the time g/v. A slow opening is therefore located more finely than a fast one.
    """
    rate, opening = normal_rate(work, NEW, row), work.geometry[NEW, row].gap
    # The rate at the end of a long step may be wrong by many times itself.
    speed = min(rate, (opening - work.geometry[NOW, row].gap) / step)
    if not speed > 0.0:
        return resolution
    view = contact_view(scene, work, NEW, row)
    later = max(velocity_lifetime_of(work, row), TINY) / (MOST_LATER * resolution)
    # The velocity error is (pull/M) g/v; it displaces the bodies by that times T.
    pull = abs(normal_force_at(scene, view, 0.0, -speed)) / view.effective_mass
    by_damping = speed / max(pull * later, TINY)
    stretch = abs(normal_force_at(scene, view, -resolution, 0.0)) / view.effective_mass
    by_tension = math.sqrt(speed * resolution / max(stretch * later, TINY))
    return at_least_rounding(work, NEW, min(resolution, by_damping, by_tension))
