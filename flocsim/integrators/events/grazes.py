"""When pairs begin and cease to graze: decided by forces at the end of a step.

A pair that has just parted goes on grazing (rhs/friction.py) instead of being apart where its own
tangential force has lifted it and all that comes of it is far below the tolerance: how high it
would fly, and the displacement that its tangential spring would lose. What the spring lets go of
has to be next to nothing, too, unless the pair has parted and touched again several times like
that: then it hums. Two contacts that throw each other open in turn do not graze: their cycles are
followed, and left out (cycles.py). Where the tolerance resolves these, the law is followed.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import contact_point
from flocsim.hooks import contact_derivatives, contact_force
from flocsim.integrators.events.crossings import NEVER
from flocsim.integrators.events.resolution import above_rounding
from flocsim.integrators.rhs.friction import STIFFER, coupling, grazing_force, normal_mobility
from flocsim.integrators.rhs.views import (
    contact_view,
    memory_of,
    normal_rate,
    pressed_view,
    tangential_rate,
)
from flocsim.state.contacts import GRAZES, OPEN, TOUCHES
from flocsim.state.work import NEW, NOW

SHARE_OF_FLIGHT = 0.1
"""The speed with which a pair parts may lift it by this share of the tolerance, where it has done
so before, …"""

SHARE_OF_FIRST = 1e-3
"""… and by this one where it has not, …"""

SHARE_OF_SLIP = 1.0
"""… and the displacement that is lost with its tangential spring be this share of it at most."""

FIRST_KICK = 30.0
"""The speed that a tangential spring lets go of where a contact parts displaces bodies by so many
tolerances at most, or it has to have hummed before."""

MANY = 5
"""So often a pair has parted by no more than SHARE_OF_FLIGHT and touched again that it hums."""

LEAST_COUPLING = 0.1
"""A tangential force is taken to accelerate the gap by this share of what a normal one does, at
least: through other contacts, if not by itself."""

LEAST_PULL = 1e-3
"""A contact force that pulls at no overlap with more than this share of T holds by itself."""

SAME_PLACE = 1e-9
"""Contact points nearer than this [m] may be one."""

FAR = 1e3
"""A gap so many times as large as the one that counted as none is far from it."""

LATE = 0.1
"""A step may go on behind the end of grazing where that leads to less than this share of the
tolerance; …"""

BEHIND = 1.01
"""… one that may not ends that little behind it."""

AT_ONCE = 0.02
"""What ceases within this share of a step ceases at its start."""

TOUCHING_GAP = -1e-30
"""The gap of a pair that touches without overlap [m]: its sign tells."""


def pull_of(scene, work, row):
    """About by how much a newton along the tangent of a pair accelerates the gap [1/kg]."""
    least = LEAST_COUPLING * normal_mobility(scene, work, row)
    return max(abs(coupling(scene, work, row)), least)


def begins(scene, work, clock, row):
    """Whether a pair that has just parted grazes from now on."""
    if work.candidates[row].sliding != 0 or rattles(work, row):
        return False
    view = contact_view(scene, work, NOW, row)
    _, force = contact_force(scene, view)
    speed, pull = normal_rate(work, NOW, row), abs(force) * pull_of(scene, work, row)
    share = SHARE_OF_FLIGHT if hums(work, row) else SHARE_OF_FIRST
    if speed * speed > 2.0 * pull * share * clock.tolerance:
        return False
    pull, _ = contact_force(scene, pressed_view(view, 0.0, 0.0))
    if abs(pull) > LEAST_PULL * abs(force):
        return False
    spring = spring_of(scene, view)
    if spring == 0.0:
        return True
    if not hums(work, row):
        kick = abs(force) / math.sqrt(spring * view.effective_mass)
        if kick * memory_of(work, row) > FIRST_KICK * clock.tolerance:
            return False
    return abs(force) <= SHARE_OF_SLIP * clock.tolerance * spring


def spring_of(scene, view):
    """By how much the tangential force of a contact falls with its displacement [N/m]."""
    return max(-contact_derivatives(scene, view)[7], 0.0)


def near(work, row, other):
    """Whether two rows have one contact point."""
    body = work.candidates[row].vertex_body
    x, y = contact_point(work, row, body)
    other_x, other_y = contact_point(work, other, body)
    return math.hypot(other_x - x, other_y - y) < SAME_PLACE


def shares_point(work, row, other):
    """Whether two rows of the same two bodies have one contact point and gap: two corners that
    touch are up to four rows, of both bodies' edges."""
    if work.candidates[row].pair != work.candidates[other].pair:
        return False
    if abs(work.geometry[NOW, row].gap - work.geometry[NOW, other].gap) > above_rounding(
        work, NOW, 0.0
    ):
        return False
    return near(work, row, other)


def enter(scene, work, row):
    """Let a pair graze."""
    contact = work.contacts[row]
    _, force = contact_force(scene, contact_view(scene, work, NOW, row))
    work.candidates[row].closed = GRAZES
    contact.grazing_force = force
    contact.fresh = 1.0


def share_forces(work):
    """Rows of one contact point bear the same force."""
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == GRAZES:
            total, count = 0.0, 0
            for other in range(work.tally.candidates):
                if work.candidates[other].closed == GRAZES and shares_point(work, row, other):
                    total, count = total + work.contacts[other].grazing_force, count + 1
            work.contacts[row].grazing_resistance = total / max(count, 1)
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == GRAZES:
            contact = work.contacts[row]
            contact.grazing_force = contact.grazing_resistance


def hold_gap(work, row, gap):
    """Count the gap that a pair has now as another one."""
    geometry = work.geometry[NOW, row]
    work.contacts[row].gap_offset += geometry.gap - gap
    geometry.gap = gap


def sliding_speed(work, row):
    """How fast the bodies of a pair that grazes slide against its force [m/s]."""
    speed = tangential_rate(work, NOW, row)
    return -speed if work.contacts[row].grazing_force > 0.0 else speed


def sticks(scene, work, row):
    """Whether a pair that grazes has ceased to slide; its spring takes the force over then, as far
    as it held that before. Without a spring the law's whole force is what it needs then."""
    view = contact_view(scene, work, NOW, row)
    force, spring = work.contacts[row].grazing_force, spring_of(scene, view)
    if spring == 0.0:
        _, whole = contact_force(scene, view)
        return whole * force <= force * force
    if sliding_speed(work, row) >= 0.0:
        return False
    needed, held = -force / spring, work.slip[NOW, row]
    if needed * held <= 0.0:
        work.slip[NOW, row] = 0.0
    elif abs(needed) < abs(held):
        work.slip[NOW, row] = needed
    return True


def leave(work, row, mode, gap):
    """Let a pair cease to graze."""
    work.candidates[row].closed = mode
    hold_gap(work, row, gap)


def go_on(scene, work, row):
    """Whether a pair goes on grazing behind a step."""
    contact = work.contacts[row]
    if contact.fresh != 0.0:
        # Its first step takes what is left of the gap's rate away, of which no load tells.
        contact.fresh = 0.0
        return True
    before, rate = contact.grazing_force, normal_rate(work, NOW, row)
    after = before - contact.grazing_resistance * rate
    contact.grazing_force = after
    if after * before <= 0.0:
        leave(work, row, OPEN, 0.0)
        return False
    if sticks(scene, work, row):
        leave(work, row, TOUCHES, TOUCHING_GAP)
        return False
    return True


def forget_gap(work, row):
    """The gap of a pair that has gone far from where it grazed counts as it is."""
    geometry = work.geometry[NOW, row]
    contact = work.contacts[row]
    offset = contact.gap_offset
    if offset != 0.0 and geometry.gap > FAR * abs(offset):
        geometry.gap += offset
        contact.gap_offset = 0.0


def hums(work, row):
    """Whether a pair has parted and touched again and again, by far less than the tolerance."""
    return work.contacts[row].flights >= MANY


def rattles(work, row):
    """Whether another contact of the same bodies has done that since this one last touched again:
    they throw each other open in turn."""
    if not hums(work, row):
        return False
    for other in range(work.tally.candidates):
        same = work.candidates[other].pair == work.candidates[row].pair
        later = work.contacts[other].flown_at > work.contacts[row].flown_at
        if same and later and hums(work, other) and not near(work, row, other):
            return True
    return False


def takes_part(work, row):
    """Whether a pair touches, or has done so a moment ago."""
    return work.candidates[row].closed != OPEN or work.contacts[row].flights > 0.0


def count_flight(work, clock, step, row):
    """Count how often a pair, which has touched, was apart by far less than the tolerance.

    Where a single step has led from parting to touching again, no end of a step has seen it apart:
    it has flown a quarter of the way that its rate would have led, as on a parabola.
    """
    contact = work.contacts[row]
    flight = contact.flight
    if flight == 0.0:
        flight = 0.25 * step * abs(normal_rate(work, NOW, row))
    if flight > SHARE_OF_FLIGHT * clock.tolerance:
        contact.flights = 0.0
    elif flight > 0.0:
        contact.flights += 1.0
        contact.flown_at = clock.time
    contact.flight = 0.0


def note_flight(work, clock, row):
    """Keep how far a pair that is apart has been since it parted; far enough, it hums no more."""
    contact = work.contacts[row]
    flight = max(contact.flight, work.geometry[NOW, row].gap)
    contact.flight = flight
    if flight > SHARE_OF_FLIGHT * clock.tolerance:
        contact.flights = 0.0


def part(scene, work, clock, row):
    """What becomes of a closed pair that has parted; whether it begins to graze."""
    if not begins(scene, work, clock, row):
        return False
    for other in range(work.tally.candidates):
        if work.candidates[other].closed == TOUCHES and shares_point(work, row, other):
            enter(scene, work, other)
    return True


@apart
def settle(scene, work, clock, step):
    """Let pairs begin and cease to graze at the end of a step; whether any has."""
    changed, entered = False, False
    for row in range(work.tally.candidates):
        mode = work.candidates[row].closed
        if mode == GRAZES:
            changed = not go_on(scene, work, row) or changed
        elif mode == OPEN:
            forget_gap(work, row)
            note_flight(work, clock, row)
            if work.geometry[NOW, row].gap < 0.0:
                count_flight(work, clock, step, row)
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == TOUCHES and work.geometry[NOW, row].gap >= 0.0:
            entered = part(scene, work, clock, row) or entered
    if entered:
        share_forces(work)
        for row in range(work.tally.candidates):
            if work.candidates[row].closed == GRAZES:
                hold_gap(work, row, 0.0)
    return changed or entered


def force_needed(work, row):
    """T of a pair that grazes at the end of a step; in its first one without what takes the rate
    away with which the pair has parted."""
    contact = work.contacts[row]
    after = grazing_force(work, NEW, row)
    if contact.fresh != 0.0:
        resistance = contact.grazing_resistance
        after += resistance / STIFFER * normal_rate(work, NOW, row)
    return after


def share_left(work, clock, step, row):
    """The share of the step at which a pair that grazes ceases to; above 1 where it does not, or
    where it matters little: its force goes through nothing there, or it ceases to slide.

    T and the speed of sliding go along lines.
    """
    contact = work.contacts[row]
    resistance = abs(contact.grazing_resistance)
    if resistance == 0.0:
        return NEVER
    before, after = contact.grazing_force, force_needed(work, row)
    # What a newton does to the gap in a step, and later.
    lever = STIFFER / resistance * (step + memory_of(work, row))
    if abs(after) * lever < LATE * clock.tolerance:
        return NEVER
    share = before / (before - after) if before * after < 0.0 else NEVER
    side = 1.0 if before > 0.0 else -1.0
    slow = -side * tangential_rate(work, NOW, row)
    slower = -side * tangential_rate(work, NEW, row)
    if contact.fresh != 0.0 and -slower * step > LATE * clock.tolerance:
        # It may have stuck before, and parted by rounding.
        slow = max(slow, 0.0)
    if slow >= 0.0 > slower:
        share = min(share, slow / (slow - slower))
    return share


def leave_early(scene, work, clock, step):
    """Let pairs cease to graze that do so right behind the start of a step; whether any has."""
    changed = False
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == GRAZES and share_left(work, clock, step, row) < AT_ONCE:
            contact = work.contacts[row]
            fresh = contact.fresh != 0.0
            if fresh or contact.grazing_force * force_needed(work, row) < 0.0:
                leave(work, row, OPEN, 0.0)
            else:
                leave(work, row, TOUCHES, TOUCHING_GAP)
            changed = True
    return changed


def grazing_share(work, clock, step, share):
    """The share of the step at which the first pair ceases to graze, or the given one before."""
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == GRAZES:
            share = min(share, BEHIND * share_left(work, clock, step, row))
    return share
