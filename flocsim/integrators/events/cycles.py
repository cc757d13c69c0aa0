"""Rattling: many equal cycles of switches are left out at once.

Two contacts of a doublet may throw each other open in turn, for ever, where no state of rest
satisfies the contact law: a cycle of some microseconds and 1e-13 m, by which the doublet creeps by
next to nothing. What comes of it in the long run is what a cycle does, times their number: where
the switches, and all that a cycle changes, have been the same in two cycles on end, the pair goes
on by as many cycles as leave their form as it is (envelope following, or multirevolution: Petzold
1981; Calvo, Montijano and Rández 2007).

A pair is described as it is seen from its first body: by where the other one is and how both move,
which a cycle gives back but for next to nothing, and by where the whole of it is, which it moves
evenly. What a cycle changes is carried on along a line in the first, and along a parabola in the
second: of the time, as a cycle is found to end a little earlier or later by chance. So do gaps and
displacements at its end scatter; where they do no more than that, they stay as they are.
"""

import math

from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.events.grazes import hums, takes_part
from flocsim.integrators.events.resolution import above_rounding
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import CARRIED, CYCLE_BEFORE, CYCLE_LAST, NOW

MOST_SWITCHES = 64
"""A cycle of more switches is none."""

FEWEST, MOST_AT_ONCE = 4.0, 1e5
"""Fewer cycles at once are not worth it; more are never left out."""

FORM = 0.2
"""By that share of what they are gaps and displacements may change over the cycles left out, …"""

FORM_ERROR = 0.02
"""… and be wrong, …"""

PACE = 0.1
"""… so may the motion of the pair as a whole, …"""

MOST_TURN = 0.05
"""… which may turn by so much [rad]; what is wrong of it has to stay below the tolerance."""

CHANCE = 3.0
"""A trend changes by less than one part in so many of itself from one cycle to the next."""

RETURNS = 2
"""So often the modes in which a cycle begins come again until it ends: what changes to and fro from
one time to the next has done so once, then."""

BASE, MODULUS = 31, 2147483647
"""Of the numbers by which modes of contacts, and series of them, are told apart."""

TURNED, WHOLE = 2, 9
"""The coordinate that is the angle of one body against the other; from WHOLE on they say where the
pair as a whole is: angle, place (x, y)."""

COORDINATES = 12

TINY = 1e-300
"""Keeps a quotient finite."""


def share_of_second(scene):
    """Where the point that stands for the pair lies between its bodies: their centre of mass."""
    if scene.bodies[0].free == 0.0:
        return 0.0
    if scene.bodies[1].free == 0.0:
        return 1.0
    return scene.bodies[1].mass / (scene.bodies[0].mass + scene.bodies[1].mass)


def coordinate(scene, work, state, which):
    """A coordinate of the pair: place (x, y) and angle of the second body as seen from the first,
    velocities (x, y, spin) of both along its axes, then its angle, and the place of the pair."""
    turn = work.place[state, 0, ANGLE]
    c, s = math.cos(turn), math.sin(turn)
    dx, dy = (
        work.place[state, 1, X] - work.place[state, 0, X],
        work.place[state, 1, Y] - work.place[state, 0, Y],
    )
    if which == 0:
        return c * dx + s * dy
    if which == 1:
        return c * dy - s * dx
    if which == 2:
        return work.place[state, 1, ANGLE] - turn
    if which < WHOLE:
        body, axis = (which - 3) // 3, (which - 3) % 3
        if axis == 0:
            return c * work.velocity[state, body, X] + s * work.velocity[state, body, Y]
        if axis == 1:
            return c * work.velocity[state, body, Y] - s * work.velocity[state, body, X]
        return work.velocity[state, body, ANGLE]
    if which == WHOLE:
        return turn
    share = share_of_second(scene)
    if which == WHOLE + 1:
        return work.place[state, 0, X] + share * dx
    return work.place[state, 0, Y] + share * dy


def place_by(scene, work):
    """Make ``work.coordinates`` the motion of NOW."""
    q = work.coordinates
    turn, share = q[9], share_of_second(scene)
    c, s = math.cos(turn), math.sin(turn)
    dx, dy = c * q[0] - s * q[1], s * q[0] + c * q[1]
    work.place[NOW, 0, X], work.place[NOW, 0, Y] = (
        q[10] - share * dx,
        q[11] - share * dy,
    )
    work.place[NOW, 1, X], work.place[NOW, 1, Y] = (
        work.place[NOW, 0, X] + dx,
        work.place[NOW, 0, Y] + dy,
    )
    work.place[NOW, 0, ANGLE], work.place[NOW, 1, ANGLE] = turn, turn + q[2]
    work.velocity[NOW, 0, X], work.velocity[NOW, 0, Y] = (
        c * q[3] - s * q[4],
        s * q[3] + c * q[4],
    )
    work.velocity[NOW, 0, ANGLE], work.velocity[NOW, 1, ANGLE] = q[5], q[8]
    work.velocity[NOW, 1, X], work.velocity[NOW, 1, Y] = (
        c * q[6] - s * q[7],
        s * q[6] + c * q[7],
    )


def modes_of(work):
    """A number for how all listed pairs touch."""
    code = 1
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        mode = 3 * candidate.closed + candidate.sliding + 1
        code = (code * BASE + mode + 1) % MODULUS
    return code


def any_hums(work):
    """Whether a pair hums: where none does, the cycles are bounces, which somebody may want to
    see."""
    for row in range(work.tally.candidates):
        if hums(work, row):
            return True
    return False


def begin_at(counts, modes):
    """Let cycles be counted from these modes on."""
    counts.cycle_modes, counts.cycles_seen, counts.cycle_switches = modes, 0, 0
    counts.cycle_code = counts.cycle_code_before = 0


def end_cycle(work, clock, counts):
    """Keep the state at the end of a cycle beside that of the end before."""
    for body in range(2):
        for axis in range(3):
            work.place[CYCLE_BEFORE, body, axis] = work.place[CYCLE_LAST, body, axis]
            work.place[CYCLE_LAST, body, axis] = work.place[NOW, body, axis]
            work.velocity[CYCLE_BEFORE, body, axis] = work.velocity[CYCLE_LAST, body, axis]
            work.velocity[CYCLE_LAST, body, axis] = work.velocity[NOW, body, axis]
    for row in range(work.tally.candidates):
        contact = work.contacts[row]
        contact.cycle_slip_before = contact.cycle_slip
        contact.cycle_slip = work.slip[NOW, row]
        contact.cycle_gap_before = contact.cycle_gap
        contact.cycle_gap = work.geometry[NOW, row].gap
    clock.cycle_at_before, clock.cycle_at = clock.cycle_at, clock.time
    clock.cycle_error = clock.error
    counts.cycle_code_before, counts.cycle_code = counts.cycle_code, 0
    counts.cycle_switches = counts.cycle_returns = 0
    counts.cycles_seen += 1


def known(change, least):
    """A change of a length, nothing where it may be rounding."""
    return change if abs(change) > least else 0.0


def changes_of(now, last, before, least):
    """By how much a length differs from what it was a cycle ago, and that from the same of the
    cycle before; what may be rounding is nothing."""
    return known(now - last, least), known(now - 2.0 * last + before, 2.0 * least)


def is_chance(change, bend, size):
    """Whether a change is due to where switches happen to be found: small, and another one each
    time."""
    return max(abs(change), abs(bend)) <= FORM_ERROR * size and abs(change) <= CHANCE * abs(bend)


def trend(now, last, before, size, least):
    """What a cycle changes of a length of such a size, which was so much behind the last ones;
    nothing where that is rounding, or chance."""
    change, bend = changes_of(now, last, before, least)
    return 0.0 if is_chance(change, bend, size) else change


def allowed(most, now, last, before, size, least):
    """How many cycles may be left out where a length of such a size was so much behind the last
    ones; what is below ``least`` is rounding."""
    change, bend = changes_of(now, last, before, least)
    chance = is_chance(change, bend, size)
    largest = max(abs(change), abs(bend)) if chance else abs(change)
    if largest * most > FORM * size:
        most = FORM * size / largest
    if not chance and abs(bend) * most * most > 2.0 * FORM_ERROR * size:
        most = math.sqrt(2.0 * FORM_ERROR * size / abs(bend))
    return most


def sizes_of(work):
    """The largest (gap, tangential displacement) of the pairs that take part [m]."""
    gaps = slips = 0.0
    for row in range(work.tally.candidates):
        if takes_part(work, row):
            gaps = max(gaps, abs(work.geometry[NOW, row].gap))
            slips = max(slips, abs(work.slip[NOW, row]))
    return gaps, slips


def cycles_of_form(work):
    """How many cycles leave gaps and displacements about as they are."""
    least, most = above_rounding(work, NOW, 0.0), MOST_AT_ONCE
    gaps, slips = sizes_of(work)
    for row in range(work.tally.candidates):
        contact = work.contacts[row]
        now, last = work.geometry[NOW, row].gap, contact.cycle_gap
        size = gaps if takes_part(work, row) else now
        most = allowed(most, now, last, contact.cycle_gap_before, size, least)
        if takes_part(work, row):
            now, last = work.slip[NOW, row], contact.cycle_slip
            most = allowed(most, now, last, contact.cycle_slip_before, slips, least)
    return most


def lasted(clock):
    """How long the last cycle took, and the one before [s]."""
    at_last, at_before = clock.cycle_at, clock.cycle_at_before
    return clock.time - at_last, at_last - at_before


def period_of(clock):
    """(How long the next cycle takes [s], by how much longer each is than the one before)."""
    last, before = lasted(clock)
    if abs(last - before) <= FORM_ERROR * last:
        return 0.5 * (last + before), 0.0
    return last, last - before


def rates_of(scene, work, clock, which):
    """Rate of change of a coordinate over the last cycle [1/s], and of that rate [1/s²]: what moves
    evenly does so in time, wherever in it a cycle has been found to end."""
    late, early = lasted(clock)
    now = coordinate(scene, work, NOW, which)
    last = coordinate(scene, work, CYCLE_LAST, which)
    before = coordinate(scene, work, CYCLE_BEFORE, which)
    rate = (now - last) / late
    return rate, 2.0 * (rate - (last - before) / early) / (late + early)


def way_of(scene, work, clock, first):
    """(Largest change over a cycle in three coordinates from ``first`` on, of which the angle
    counts in the place of an outline, by how much it differs from the one before) [m]."""
    size = scene.bodies[0].bounding_radius + scene.bodies[1].bounding_radius
    way = bend = 0.0
    period, _ = period_of(clock)
    for which in range(first, first + 3):
        lever = size if which in (TURNED, WHOLE) else 1.0
        rate, more = rates_of(scene, work, clock, which)
        way = max(way, lever * abs(rate) * period)
        bend = max(bend, lever * abs(more) * period * period)
    return way, bend


def error_of(scene, work, clock, many):
    """What the place of a body is wrong by where so many cycles are left out [m]: the next term of
    the line that its place against the other one is carried on along, and of the parabola of
    both."""
    _, creep = way_of(scene, work, clock, 0)
    way, bend = way_of(scene, work, clock, WHOLE)
    beyond = many * bend / max(way, TINY) / 3.0
    return 0.5 * many * many * (creep + beyond * bend)


def cycles_of_motion(scene, work, clock, until):
    """How many cycles leave the motion of the pair as a whole about as it is, and its error below
    the tolerance."""
    way, bend = way_of(scene, work, clock, WHOLE)
    period, longer = period_of(clock)
    turn = rates_of(scene, work, clock, WHOLE)[0] * period
    most = MOST_AT_ONCE
    if bend * most > PACE * way:
        most = PACE * way / bend
    if abs(turn) * most > MOST_TURN:
        most = MOST_TURN / abs(turn)
    if abs(longer) * most > PACE * period:
        most = PACE * period / abs(longer)
    for power in (3.0, 3.0, 2.0):
        # It goes with the square of their number at least, and with its third power at most.
        error = error_of(scene, work, clock, most)
        if error > clock.tolerance:
            most *= (clock.tolerance / error) ** (1.0 / power)
    return min(most, 0.5 * (until - clock.time) / period)


def leave_out(scene, work, clock, many):
    """Go on by so many cycles."""
    period, longer = period_of(clock)
    time = many * period + 0.5 * many * (many + 1.0) * longer
    bent = 0.5 * time * (time + lasted(clock)[0])
    for which in range(COORDINATES):
        rate, more = rates_of(scene, work, clock, which)
        now = coordinate(scene, work, NOW, which) + rate * time
        work.coordinates[which] = now + bent * more if which >= WHOLE else now
    place_by(scene, work)
    gaps, slips = sizes_of(work)
    least = above_rounding(work, NOW, 0.0)
    for row in range(work.tally.candidates):
        if takes_part(work, row):
            contact = work.contacts[row]
            slip, gap = work.slip[NOW, row], work.geometry[NOW, row].gap
            last, before = contact.cycle_slip, contact.cycle_slip_before
            work.slip[NOW, row] += many * trend(slip, last, before, slips, least)
            last, before = contact.cycle_gap, contact.cycle_gap_before
            contact.cycle_gap = gap + many * trend(gap, last, before, gaps, least)
    clock.time += time
    locate_contacts(scene, work, NOW)


def restore_gaps(work):
    """Count the gaps of pairs that take part as what a cycle makes of them: what a turn bends them
    by is far below them."""
    for row in range(work.tally.candidates):
        if takes_part(work, row):
            geometry = work.geometry[NOW, row]
            contact = work.contacts[row]
            contact.gap_offset += geometry.gap - contact.cycle_gap
            geometry.gap = contact.cycle_gap


def carry_on_errors(work, clock, many, more):
    """Let what is stated of errors grow on as it has in the last cycle, and by ``more`` [m]."""
    grown = many * max(clock.error - clock.cycle_error, 0.0) + more
    if grown > 0.0:
        factor = 1.0 + grown / max(clock.error, TINY)
        for body in range(2):
            errors = work.errors[body]
            errors.place *= factor
            errors.switch_place *= factor
            errors.doubt_place *= factor
            errors.stated *= factor
            for axis in range(3):
                work.place[CARRIED, body, axis] *= factor
                work.velocity[CARRIED, body, axis] *= factor
        clock.error *= factor


def leave_out_cycles(scene, work, clock, counts, until):
    """Look at a switch of two bodies that has just been, and leave out the cycles that it ends, if
    they have been alike."""
    if work.poses.shape[0] != 2 or not any_hums(work):
        counts.cycle_modes = 0
        return
    modes = modes_of(work)
    counts.cycle_code = (counts.cycle_code * BASE + modes) % MODULUS
    counts.cycle_switches += 1
    if counts.cycle_switches > MOST_SWITCHES or counts.cycle_modes == 0:
        begin_at(counts, modes)
    if modes != counts.cycle_modes:
        return
    counts.cycle_returns += 1
    if counts.cycles_seen > 0 and counts.cycle_returns < RETURNS:
        return
    many = 0.0
    if counts.cycles_seen >= 2:
        if counts.cycle_code != counts.cycle_code_before:
            counts.cycle_modes = 0
            return
        many = math.floor(min(cycles_of_form(work), cycles_of_motion(scene, work, clock, until)))
    if many >= FEWEST:
        error = error_of(scene, work, clock, many)
        leave_out(scene, work, clock, many)
        restore_gaps(work)
        carry_on_errors(work, clock, many, error)
        set_modes(scene, work)
        begin_at(counts, modes_of(work))
    end_cycle(work, clock, counts)
