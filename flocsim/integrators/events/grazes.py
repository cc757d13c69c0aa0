"""Beginning and end of grazing, decided from the forces at the end of a step.

A pair that has just parted goes on grazing (rhs/friction.py) instead of opening if its own
tangential force has lifted it and the consequences are far below the tolerance: how high it would
fly, and the displacement that its tangential spring would lose. The force that the spring releases
must be negligible, too, unless the pair chatters, having parted and touched again several times
like that: a first graze in an impact caused errors of fifty tolerances. Two contacts that throw
each other open in turn do not graze: they are followed, as is the contact law itself where the
tolerance resolves all this.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.constants import SHALLOWEST_TOUCH, TINY
from flocsim.geometry.contact.points import contact_point, length_of
from flocsim.hooks import contact_derivatives, contact_force
from flocsim.integrators.events.resolution import RESOLUTION
from flocsim.integrators.rhs.error import NEGLIGIBLE, at_least_rounding
from flocsim.integrators.rhs.friction import (
    GRAZING_STIFFNESS_RATIO,
    gap_responses,
    grazing_force,
)
from flocsim.integrators.rhs.views import (
    contact_view,
    normal_rate,
    tangential_rate,
    velocity_lifetime_of,
    view_without_slip,
)
from flocsim.state.contacts import CLOSED, GRAZING, OPEN
from flocsim.state.work import NEW, NOW

FIRST_RELEASE = 30.0
"""Largest displacement, in tolerances, by the speed that its tangential spring releases, with which
a pair grazes that does not chatter yet."""

CHATTER_COUNT = 5
"""A pair chatters after this many flights in a row of no more than NEGLIGIBLE."""

START_FRACTION = 0.02
"""Grazing that ends within this fraction of a step ends at its start; a step that may not pass the
end of grazing ends this much after it."""


def begins_grazing(scene, work, clock, row):
    """Return True if a pair that has just parted grazes from now on."""
    # Neither sliding pairs (there is a Coulomb limit) nor two that throw each other open.
    if work.candidates[row].slide_direction != 0 or chatters_in_turn(work, row):
        return False
    # Height of the flight: v²/(2 a), with the acceleration a that its own tangential force causes.
    # A pair that does not chatter yet must stay below what switches are located to.
    view = contact_view(scene, work, NOW, row)
    _, force = contact_force(scene, view)
    _, by_tangential = gap_responses(scene, work, row)
    speed, pull = normal_rate(work, NOW, row), abs(force * by_tangential)
    share = NEGLIGIBLE if chatters(work, row) else RESOLUTION
    if speed * speed > 2.0 * pull * share * clock.tolerance:
        return False
    # A normal force that acts without overlap, such as cohesion, holds or opens the pair by itself.
    pull, _ = contact_force(scene, view_without_slip(view, 0.0, 0.0))
    if pull != 0.0:
        return False
    # Effects of the spring that is lost: the speed it releases, and its displacement.
    spring = tangential_stiffness(scene, view)
    if spring > 0.0 and not chatters(work, row):
        kick = abs(force) / math.sqrt(spring * view.effective_mass)
        if kick * velocity_lifetime_of(work, row) > FIRST_RELEASE * clock.tolerance:
            return False
    return spring == 0.0 or abs(force) <= clock.tolerance * spring


def tangential_stiffness(scene, view):
    """Return −∂T/∂ξ of a contact [N/m]."""
    return max(-contact_derivatives(scene, view)[7], 0.0)


def same_point(work, row, other):
    """Return True if two rows have the same contact point."""
    body = work.candidates[row].vertex_body
    x, y = contact_point(work, row, body)
    other_x, other_y = contact_point(work, other, body)
    return length_of(other_x - x, other_y - y) < SHALLOWEST_TOUCH


def coincides(work, row, other):
    """Return True if two rows of the same two bodies have one contact point and gap.

    Two corners that touch are up to four rows, with edges of both bodies.
    """
    if work.candidates[row].pair != work.candidates[other].pair:
        return False
    if abs(work.geometry[NOW, row].gap - work.geometry[NOW, other].gap) > at_least_rounding(
        work, NOW, 0.0
    ):
        return False
    return same_point(work, row, other)


def start_grazing(scene, work, row):
    """Let a pair graze, with its present tangential force, so that no force jumps."""
    contact = work.contacts[row]
    _, force = contact_force(scene, contact_view(scene, work, NOW, row))
    work.candidates[row].contact_mode = GRAZING
    contact.grazing_force = force
    contact.newly_grazing = 1.0


def redefine_gap(work, row, gap):
    """Let the present gap of a pair count as ``gap`` [m]; the difference is stored as an offset."""
    geometry = work.geometry[NOW, row]
    work.contacts[row].gap_offset += geometry.gap - gap
    geometry.gap = gap


def sliding_speed(work, row):
    """Return the speed at which the bodies of a grazing pair slide against its tangential force
    [m/s]."""
    speed = tangential_rate(work, NOW, row)
    return -speed if work.contacts[row].grazing_force > 0.0 else speed


def resticks(scene, work, row):
    """Return True if a grazing pair has ceased to slide; then its spring takes the force over.

    It does so only as far as it bore that before, so no energy is gained. Without a spring, the
    pair sticks once the law's whole force is no more than it needs.
    """
    view = contact_view(scene, work, NOW, row)
    force, spring = work.contacts[row].grazing_force, tangential_stiffness(scene, view)
    if spring == 0.0:
        _, whole = contact_force(scene, view)
        return whole * force <= force * force
    if sliding_speed(work, row) >= 0.0:
        return False
    # Displacement that would give T, and the one stored.
    required, stored = -force / spring, work.slip[NOW, row]
    if required * stored <= 0.0:
        work.slip[NOW, row] = 0.0
    elif abs(required) < abs(stored):
        work.slip[NOW, row] = required
    return True


def end_grazing(work, row, mode, gap):
    """Let a pair cease to graze, with a mode and a gap [m] from which it continues."""
    work.candidates[row].contact_mode = mode
    redefine_gap(work, row, gap)


def continues_grazing(scene, work, row):
    """Return True if a pair goes on grazing after a step; otherwise set its mode."""
    contact = work.contacts[row]
    if contact.newly_grazing != 0.0:
        # The first step removes the gap rate with which the pair parted; T says nothing of the load
        # yet.
        contact.newly_grazing = 0.0
        return True
    # T at the end of the step, from the rate of the gap.
    before, rate = contact.grazing_force, normal_rate(work, NOW, row)
    after = before - contact.grazing_resistance * rate
    contact.grazing_force = after
    # T has passed through zero: the pair opens.
    if after * before <= 0.0:
        end_grazing(work, row, OPEN, 0.0)
        return False
    # It no longer slides: the spring takes over.
    if resticks(scene, work, row):
        # It touches without overlap: only the sign of its gap matters.
        end_grazing(work, row, CLOSED, -TINY)
        return False
    return True


def drop_gap_offset(work, clock, row):
    """Drop the gap offset of a pair that is far from where it grazed."""
    geometry = work.geometry[NOW, row]
    contact = work.contacts[row]
    if contact.gap_offset != 0.0 and geometry.gap > clock.tolerance:
        geometry.gap += contact.gap_offset
        contact.gap_offset = 0.0


def chatters(work, row):
    """Return True if a pair has parted and touched again and again, by far less than the
    tolerance."""
    return work.contacts[row].short_flights >= CHATTER_COUNT


def chatters_in_turn(work, row):
    """Return True if another contact of the same bodies has chattered since this one last touched
    again: they throw each other open in turn."""
    if not chatters(work, row):
        return False
    for other in range(work.tally.candidates):
        same = work.candidates[other].pair == work.candidates[row].pair
        later = work.contacts[other].landing_time > work.contacts[row].landing_time
        if same and later and chatters(work, other) and not same_point(work, row, other):
            return True
    return False


def count_short_flight(work, clock, step, row):
    """Count the flights of a pair that has touched again and was apart by far less than the
    tolerance.

    If a single step led from parting to touching again, no end of a step has seen the pair apart: a
    parabola reaches a quarter of step · rate.
    """
    contact = work.contacts[row]
    flight = contact.flight_gap
    if flight == 0.0:
        flight = 0.25 * step * abs(normal_rate(work, NOW, row))
    if flight > NEGLIGIBLE * clock.tolerance:
        contact.short_flights = 0.0
    elif flight > 0.0:
        contact.short_flights += 1.0
        contact.landing_time = clock.time
    contact.flight_gap = 0.0


def track_flight(work, clock, row):
    """Track the largest gap of a pair since it parted; a long flight ends its chattering."""
    contact = work.contacts[row]
    flight = max(contact.flight_gap, work.geometry[NOW, row].gap)
    contact.flight_gap = flight
    if flight > NEGLIGIBLE * clock.tolerance:
        contact.short_flights = 0.0


@apart
def update_grazing_pairs(scene, work, clock, step):
    """Let pairs begin and cease to graze at the end of a step; return True if any has."""
    # Grazing pairs continue or end; open ones update their flights.
    changed, entered = False, False
    for row in range(work.tally.candidates):
        mode = work.candidates[row].contact_mode
        if mode == GRAZING:
            changed = not continues_grazing(scene, work, row) or changed
        elif mode == OPEN:
            drop_gap_offset(work, clock, row)
            track_flight(work, clock, row)
            if work.geometry[NOW, row].gap < 0.0:
                count_short_flight(work, clock, step, row)
    # Closed pairs that have parted may begin to graze, with all rows of their contact point.
    for row in range(work.tally.candidates):
        parted = work.candidates[row].contact_mode == CLOSED and work.geometry[NOW, row].gap >= 0.0
        if parted and begins_grazing(scene, work, clock, row):
            entered = True
            for other in range(work.tally.candidates):
                if work.candidates[other].contact_mode == CLOSED and coincides(work, row, other):
                    start_grazing(scene, work, other)
    # All gaps count as zero from here, so that none is closed by rounding.
    if entered:
        for row in range(work.tally.candidates):
            if work.candidates[row].contact_mode == GRAZING:
                redefine_gap(work, row, 0.0)
    return changed or entered


def final_force(work, row):
    """Return T of a grazing pair at the end of a step [N].

    In its first step without the part that removes the rate with which the pair parted.
    """
    contact = work.contacts[row]
    after = grazing_force(work, NEW, row)
    if contact.newly_grazing != 0.0:
        resistance = contact.grazing_resistance
        after += resistance / GRAZING_STIFFNESS_RATIO * normal_rate(work, NOW, row)
    return after


def grazing_end_share(work, clock, step, row):
    """Return the fraction of the step at which a pair ceases to graze.

    That is where T passes through zero or the pair ceases to slide; both are interpolated linearly.
    inf if it does not happen, or matters little: a step may pass the end of grazing if that
    displaces bodies by less than NEGLIGIBLE of the tolerance, as the force is zero there.
    """
    contact = work.contacts[row]
    resistance = abs(contact.grazing_resistance)
    if resistance == 0.0:
        return math.inf
    before, after = contact.grazing_force, final_force(work, row)
    # Displacement of the gap per unit force, in the step and later.
    lever = GRAZING_STIFFNESS_RATIO / resistance * (step + velocity_lifetime_of(work, row))
    if abs(after) * lever < NEGLIGIBLE * clock.tolerance:
        return math.inf
    # Zero of T.
    share = before / (before - after) if before * after < 0.0 else math.inf
    # Zero of the sliding speed, counted against T.
    side = 1.0 if before > 0.0 else -1.0
    start_speed = -side * tangential_rate(work, NOW, row)
    end_speed = -side * tangential_rate(work, NEW, row)
    if contact.newly_grazing != 0.0 and -end_speed * step > NEGLIGIBLE * clock.tolerance:
        # It may have stuck before, and parted by rounding.
        start_speed = max(start_speed, 0.0)
    if start_speed >= 0.0 > end_speed:
        share = min(share, start_speed / (start_speed - end_speed))
    return share


def end_grazing_early(scene, work, clock, step):
    """Let pairs cease to graze whose grazing ends right after the start of a step; return True if
    any has."""
    changed = False
    for row in range(work.tally.candidates):
        if (
            work.candidates[row].contact_mode == GRAZING
            and grazing_end_share(work, clock, step, row) < START_FRACTION
        ):
            contact = work.contacts[row]
            # Open where T changes sign, else stick.
            fresh = contact.newly_grazing != 0.0
            if fresh or contact.grazing_force * final_force(work, row) < 0.0:
                end_grazing(work, row, OPEN, 0.0)
            else:
                end_grazing(work, row, CLOSED, -TINY)
            changed = True
    return changed
