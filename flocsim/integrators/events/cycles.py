"""Skipping of equal cycles in which two contacts of a doublet throw each other open in turn.

If no state of rest satisfies the contact law, such a doublet rattles for ever, in cycles of some
microseconds and 1e-13 m, by which it creeps very slowly. Its long-term motion is the change per
cycle, times their number. So once switches and all changes were the same in two consecutive cycles,
the pair advances by as many cycles at once as leave their shape unchanged (envelope following, or
multirevolution methods: Petzold 1981; Calvo, Montijano and Rández 2007).

The pair is described in the frame of its first body: relative position and velocities, which a
cycle reproduces almost exactly, and the position of the whole pair, which it moves steadily.
Changes per cycle are extrapolated linearly for the first, quadratically for the second, both in
time, since the end of a cycle is located slightly early or late at random. Gaps and displacements
at its end scatter for the same reason; if they do no more than that, they are left as they are.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.constants import TINY
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.events.grazes import chatters, touched_recently
from flocsim.integrators.rhs.error import at_least_rounding
from flocsim.integrators.rhs.forces import copy_motion
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import CYCLE_BEFORE, CYCLE_LAST, NOW, PROPAGATED

MOST_SWITCHES = 64
"""A sequence of more switches is not taken for a cycle."""

FEWEST, MOST_AT_ONCE = 4.0, 1e5
"""Fewest cycles that are worth a jump, and the most in one."""

SHAPE_CHANGE = 0.2
"""Gaps and displacements may change by this fraction over the skipped cycles, …"""

SHAPE_ERROR = 0.02
"""… with an error of this fraction; …"""

MOTION_CHANGE = 0.1
"""… the motion of the pair as a whole may change by this fraction, …"""

MOST_TURN = 0.05
"""… and it may turn by so much [rad]. Its error has to stay below the tolerance."""

SCATTER_RATIO = 3.0
"""A trend differs from one cycle to the next by less than 1/3 of itself; a small change that does
not is scatter."""

RETURNS = 2
"""The initial modes must recur this often until a cycle ends, so that whatever alternates has done
so once."""

BASE, MODULUS = 31, 2147483647
"""Base and modulus of the hash of contact modes, and of sequences of them."""

RELATIVE_ANGLE, PAIR_MOTION = 2, 9
"""Indices of coordinates: the relative angle; and the first of those of the whole pair (angle, x,
y)."""

COORDINATES = 12


def mass_fraction_of_second(scene):
    """Return where the reference point of the pair lies between its bodies: their centre of mass,
    or a fixed body."""
    if scene.bodies[0].free == 0.0:
        return 0.0
    if scene.bodies[1].free == 0.0:
        return 1.0
    return scene.bodies[1].mass / (scene.bodies[0].mass + scene.bodies[1].mass)


def coordinate(scene, work, state, which):
    """Return one coordinate of the pair.

    In order: position (x, y) and angle of the second body relative to the first, velocities (x, y,
    spin) of both along its axes, its angle, and the position of the pair.
    """
    # Axes of the first body.
    turn = work.place[state, 0, ANGLE]
    c, s = math.cos(turn), math.sin(turn)
    dx, dy = (
        work.place[state, 1, X] - work.place[state, 0, X],
        work.place[state, 1, Y] - work.place[state, 0, Y],
    )
    # Relative position and angle.
    if which == 0:
        return c * dx + s * dy
    if which == 1:
        return c * dy - s * dx
    if which == 2:
        return work.place[state, 1, ANGLE] - turn
    # Velocities of both bodies along these axes.
    if which < PAIR_MOTION:
        body, axis = (which - 3) // 3, (which - 3) % 3
        if axis == 0:
            return c * work.velocity[state, body, X] + s * work.velocity[state, body, Y]
        if axis == 1:
            return c * work.velocity[state, body, Y] - s * work.velocity[state, body, X]
        return work.velocity[state, body, ANGLE]
    if which == PAIR_MOTION:
        return turn
    # Reference point of the pair.
    share = mass_fraction_of_second(scene)
    if which == PAIR_MOTION + 1:
        return work.place[state, 0, X] + share * dx
    return work.place[state, 0, Y] + share * dy


def write_motion(scene, work):
    """Write the motion given by ``work.cycle_coordinates`` to NOW."""
    q = work.cycle_coordinates
    turn, share = q[9], mass_fraction_of_second(scene)
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


def mode_code(work):
    """Return a hash of the modes of all listed pairs."""
    code = 1
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        mode = 3 * candidate.contact_mode + candidate.slide_direction + 1
        code = (code * BASE + mode + 1) % MODULUS
    return code


def any_chatters(work):
    """Return True if a pair chatters. Otherwise the cycles are bounces, which are to be
    followed."""
    for row in range(work.tally.candidates):
        if chatters(work, row):
            return True
    return False


def restart_cycles(counts, modes):
    """Begin to count cycles from these modes."""
    counts.cycle_modes, counts.cycles_seen, counts.cycle_switches = modes, 0, 0
    counts.cycle_code = counts.previous_cycle_code = 0


def end_cycle(work, clock, counts):
    """Store the state at the end of a cycle, next to that of the cycle before."""
    copy_motion(work, CYCLE_LAST, CYCLE_BEFORE)
    copy_motion(work, NOW, CYCLE_LAST)
    for row in range(work.tally.candidates):
        contact = work.contacts[row]
        contact.cycle_slip_before = contact.cycle_slip
        contact.cycle_slip = work.slip[NOW, row]
        contact.cycle_gap_before = contact.cycle_gap
        contact.cycle_gap = work.geometry[NOW, row].gap
    clock.previous_cycle_end, clock.cycle_end = clock.cycle_end, clock.time
    clock.cycle_error = clock.error
    counts.previous_cycle_code, counts.cycle_code = counts.cycle_code, 0
    counts.cycle_switches = counts.cycle_returns = 0
    counts.cycles_seen += 1


def above_noise(change, least):
    """Return a change, 0 if it may be rounding."""
    return change if abs(change) > least else 0.0


def differences(now, last, before, least):
    """Return first and second differences over the last two cycles, 0 where they may be
    rounding."""
    return above_noise(now - last, least), above_noise(now - 2.0 * last + before, 2.0 * least)


def is_scatter(change, curvature, size):
    """Return True if a change comes from where switches happened to be located: small, and
    different each time."""
    # A real trend keeps its sign and size; the scatter of located switches does not.
    return max(abs(change), abs(curvature)) <= SHAPE_ERROR * size and abs(
        change
    ) <= SCATTER_RATIO * abs(curvature)


def trend(now, last, before, size, least):
    """Return the change per cycle of a length of a given size; 0 if it is rounding or scatter."""
    change, curvature = differences(now, last, before, least)
    return 0.0 if is_scatter(change, curvature, size) else change


def allowed_cycles(most, now, last, before, size, least):
    """Return how many cycles, at most ``most``, a length of a given size may be extrapolated
    over."""
    change, curvature = differences(now, last, before, least)
    chance = is_scatter(change, curvature, size)
    largest = max(abs(change), abs(curvature)) if chance else abs(change)
    # Linear change below SHAPE_CHANGE.
    if largest * most > SHAPE_CHANGE * size:
        most = SHAPE_CHANGE * size / largest
    # Quadratic error below SHAPE_ERROR.
    if not chance and abs(curvature) * most * most > 2.0 * SHAPE_ERROR * size:
        most = math.sqrt(2.0 * SHAPE_ERROR * size / abs(curvature))
    return most


def sizes_of(work):
    """Return the largest gap and tangential displacement of the contacts that take part [m]."""
    gaps = slips = 0.0
    for row in range(work.tally.candidates):
        if touched_recently(work, row):
            gaps = max(gaps, abs(work.geometry[NOW, row].gap))
            slips = max(slips, abs(work.slip[NOW, row]))
    return gaps, slips


def cycles_keeping_shape(work):
    """Return how many cycles leave gaps and displacements nearly unchanged."""
    least, most = at_least_rounding(work, NOW, 0.0), MOST_AT_ONCE
    gaps, slips = sizes_of(work)
    for row in range(work.tally.candidates):
        contact = work.contacts[row]
        now, last = work.geometry[NOW, row].gap, contact.cycle_gap
        # An open pair that takes no part only must not close: its own gap is its size.
        size = gaps if touched_recently(work, row) else now
        most = allowed_cycles(most, now, last, contact.cycle_gap_before, size, least)
        if touched_recently(work, row):
            now, last = work.slip[NOW, row], contact.cycle_slip
            most = allowed_cycles(most, now, last, contact.cycle_slip_before, slips, least)
    return most


def cycle_durations(clock):
    """Return the durations of the last cycle and the one before [s]."""
    at_last, at_before = clock.cycle_end, clock.previous_cycle_end
    return clock.time - at_last, at_last - at_before


def cycle_period(clock):
    """Return the duration of the next cycle [s], and its growth per cycle."""
    last, before = cycle_durations(clock)
    if abs(last - before) <= SHAPE_ERROR * last:
        return 0.5 * (last + before), 0.0
    return last, last - before


def coordinate_rates(scene, work, clock, which):
    """Return the rate of a coordinate over the last cycle [1/s], and the derivative of that rate
    [1/s²].

    Steady motion is steady in time, wherever in it the end of a cycle was located.
    """
    last_duration, previous_duration = cycle_durations(clock)
    now = coordinate(scene, work, NOW, which)
    last = coordinate(scene, work, CYCLE_LAST, which)
    before = coordinate(scene, work, CYCLE_BEFORE, which)
    rate = (now - last) / last_duration
    return rate, 2.0 * (rate - (last - before) / previous_duration) / (
        last_duration + previous_duration
    )


def largest_change(scene, work, clock, first):
    """Return the largest change per cycle of three coordinates, and the change of that [m].

    Angles count as displacements of an outline.
    """
    size = scene.bodies[0].bounding_radius + scene.bodies[1].bounding_radius
    displacement_per_cycle = curvature = 0.0
    period, _ = cycle_period(clock)
    for which in range(first, first + 3):
        lever = size if which in (RELATIVE_ANGLE, PAIR_MOTION) else 1.0
        rate, more = coordinate_rates(scene, work, clock, which)
        displacement_per_cycle = max(displacement_per_cycle, lever * abs(rate) * period)
        curvature = max(curvature, lever * abs(more) * period * period)
    return displacement_per_cycle, curvature


def extrapolation_error(scene, work, clock, many):
    """Return the error of a body's position [m] if ``many`` cycles are skipped: the next term of
    the linear extrapolation of the relative position, and of the quadratic one of the whole
    pair."""
    _, relative_curvature = largest_change(scene, work, clock, 0)
    displacement_per_cycle, curvature = largest_change(scene, work, clock, PAIR_MOTION)
    beyond = many * curvature / max(displacement_per_cycle, TINY) / 3.0
    return 0.5 * many * many * (relative_curvature + beyond * curvature)


def cycles_within_tolerance(scene, work, clock, until):
    """Return how many cycles keep the motion of the pair nearly unchanged, and its error below the
    tolerance."""
    displacement_per_cycle, curvature = largest_change(scene, work, clock, PAIR_MOTION)
    period, growth = cycle_period(clock)
    turn = coordinate_rates(scene, work, clock, PAIR_MOTION)[0] * period
    # Bounds of speed, turn and period.
    most = MOST_AT_ONCE
    if curvature * most > MOTION_CHANGE * displacement_per_cycle:
        most = MOTION_CHANGE * displacement_per_cycle / curvature
    if abs(turn) * most > MOST_TURN:
        most = MOST_TURN / abs(turn)
    if abs(growth) * most > MOTION_CHANGE * period:
        most = MOTION_CHANGE * period / abs(growth)
    for power in (3.0, 3.0, 2.0):
        # The error grows with the second to third power of their number.
        error = extrapolation_error(scene, work, clock, most)
        if error > clock.tolerance:
            most *= (clock.tolerance / error) ** (1.0 / power)
    return min(most, 0.5 * (until - clock.time) / period)


def extrapolate_cycles(scene, work, clock, many):
    """Advance by ``many`` cycles."""
    # Time: an arithmetic series.
    period, growth = cycle_period(clock)
    time = many * period + 0.5 * many * (many + 1.0) * growth
    half_square = 0.5 * time * (time + cycle_durations(clock)[0])
    # Motion.
    for which in range(COORDINATES):
        rate, more = coordinate_rates(scene, work, clock, which)
        now = coordinate(scene, work, NOW, which) + rate * time
        work.cycle_coordinates[which] = now + half_square * more if which >= PAIR_MOTION else now
    write_motion(scene, work)
    # Contacts: displacements now, gaps after they have been located anew.
    gaps, slips = sizes_of(work)
    least = at_least_rounding(work, NOW, 0.0)
    for row in range(work.tally.candidates):
        if touched_recently(work, row):
            contact = work.contacts[row]
            slip, gap = work.slip[NOW, row], work.geometry[NOW, row].gap
            last, before = contact.cycle_slip, contact.cycle_slip_before
            work.slip[NOW, row] += many * trend(slip, last, before, slips, least)
            last, before = contact.cycle_gap, contact.cycle_gap_before
            contact.cycle_gap = gap + many * trend(gap, last, before, gaps, least)
    clock.time += time
    locate_contacts(scene, work, NOW)


def restore_gaps(work):
    """Set the gaps of the contacts that take part to those that a cycle leaves, by an offset: the
    pair's turn changes them by far more than their own size."""
    for row in range(work.tally.candidates):
        if touched_recently(work, row):
            geometry = work.geometry[NOW, row]
            contact = work.contacts[row]
            contact.gap_offset += geometry.gap - contact.cycle_gap
            geometry.gap = contact.cycle_gap


def extrapolate_errors(work, clock, many, more):
    """Let the stated errors grow as in the last cycle, for ``many`` cycles, and by ``more`` [m]."""
    grown = many * max(clock.error - clock.cycle_error, 0.0) + more
    if grown > 0.0:
        # All sums and the propagated vector grow by the same factor as the stated error.
        factor = 1.0 + grown / max(clock.error, TINY)
        for body in range(2):
            errors = work.errors[body]
            errors.displacement *= factor
            errors.switch_displacement *= factor
            errors.uncertain_displacement *= factor
            errors.stated *= factor
            for axis in range(3):
                work.place[PROPAGATED, body, axis] *= factor
                work.velocity[PROPAGATED, body, axis] *= factor
        clock.error *= factor


@apart
def skip_equal_cycles(scene, work, clock, counts, until):
    """Follow the switches of two bodies; at the end of a cycle skip many, if the last ones were
    equal.

    Called after every step in which contacts have switched.
    """
    if work.poses.shape[0] != 2 or not any_chatters(work):
        counts.cycle_modes = 0
        return
    # Hash the modes since the cycle began; start again if none appears within MOST_SWITCHES.
    modes = mode_code(work)
    counts.cycle_code = (counts.cycle_code * BASE + modes) % MODULUS
    counts.cycle_switches += 1
    if counts.cycle_switches > MOST_SWITCHES or counts.cycle_modes == 0:
        restart_cycles(counts, modes)
    # A cycle ends when its initial modes have recurred RETURNS times.
    if modes != counts.cycle_modes:
        return
    counts.cycle_returns += 1
    if counts.cycles_seen > 0 and counts.cycle_returns < RETURNS:
        return
    # Two cycles with the same sequence of modes: how many may be skipped?
    many = 0.0
    if counts.cycles_seen >= 2:
        if counts.cycle_code != counts.previous_cycle_code:
            counts.cycle_modes = 0
            return
        many = math.floor(
            min(cycles_keeping_shape(work), cycles_within_tolerance(scene, work, clock, until))
        )
    # Skip them, then count cycles from here.
    if many >= FEWEST:
        error = extrapolation_error(scene, work, clock, many)
        extrapolate_cycles(scene, work, clock, many)
        restore_gaps(work)
        extrapolate_errors(work, clock, many, error)
        set_modes(scene, work)
        restart_cycles(counts, mode_code(work))
    end_cycle(work, clock, counts)
