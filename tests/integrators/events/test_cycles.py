"""Cycles of switches that are left out: what a pair is described by, and how it goes on."""

import math

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.forces import Contact, Gravity
from flocsim.integrators import Implicit, Status
from flocsim.integrators.events import cycles
from flocsim.integrators.events.grazes import MANY
from tests.helpers.fast_scene import flagged

TURN, PERIOD = 1e-4, 1e-6
"""By how much the doublet turns in a cycle [rad], and how long that takes [s]."""


def doublet(turn=0.0, fixed=False):
    """A box and a disc that touch, turned about the origin as one."""
    box = SpheroPolygon(1e-6 * np.array([(-3, -2), (3, -2), (3, 2), (-3, 2)]), 1e-6)
    c, s = math.cos(turn), math.sin(turn)
    spin, x, y = TURN / PERIOD, 0.5e-6, 7e-6 - 1e-13
    place = (c * x - s * y, s * x + c * y)
    bodies = [
        Body(box, angle=turn, spin=0.0 if fixed else spin, fixed=fixed, surface_density=2.0),
        Body(Sphere(4e-6), place, angle=turn, velocity=(-spin * place[1], spin * place[0]),
             spin=spin, surface_density=2.0),
    ]  # fmt: skip
    return System(bodies, [Contact()], Implicit())


def motion_of(turn, fixed=False):
    places, velocities = doublet(turn, fixed).motion()
    return np.hstack([places, velocities])


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("turn", [0.0, 0.7, -2.0])
def test_coordinates_say_where_the_pair_is(turn, fixed):
    scene, work = flagged(doublet(turn, fixed))
    before = work.motion[at.NOW].copy()
    for which in range(cycles.COORDINATES):
        work.motion[at.TRIAL, which // 6, which % 6] = cycles.coordinate(scene, work, at.NOW, which)
    work.motion[at.NOW] = 0.0
    cycles.place_by(scene, work)
    assert work.motion[at.NOW] == pytest.approx(before, rel=1e-12, abs=1e-20)


def after_two_cycles(change=0.0):
    """A doublet that turns evenly, at the end of a cycle, and what there was at the ends before;
    ``change``: of the gap in a cycle [m]."""
    scene, work = flagged(doublet(2.0 * TURN))
    work.motion[at.CYCLE_LAST], work.motion[at.CYCLE_BEFORE] = motion_of(TURN), motion_of(0.0)
    gap = work.geometry[at.NOW, :, at.GAP]
    work.slip[at.NOW] = work.slip[at.CYCLE_SLIP] = work.slip[at.CYCLE_SLIP_BEFORE] = 2e-13
    work.slip[at.CYCLE_GAP], work.slip[at.CYCLE_GAP_BEFORE] = gap - change, gap - 2.0 * change
    clock = Implicit().fresh_clock()
    clock[at.TIME], clock[at.CYCLE_AT], clock[at.CYCLE_AT_BEFORE] = 2.0 * PERIOD, PERIOD, 0.0
    return scene, work, clock


@pytest.mark.parametrize("many", [10.0, 300.0])
def test_a_doublet_goes_on_turning_as_one(many):
    scene, work, clock = after_two_cycles()
    gap = work.geometry[at.NOW, 0, at.GAP]
    cycles.leave_out(scene, work, clock, many)
    cycles.restore_gaps(work)
    assert clock[at.TIME] == pytest.approx((2.0 + many) * PERIOD, rel=1e-12)
    exact = motion_of((2.0 + many) * TURN)
    # Its middle goes along a parabola, where it turns: an arc, of which that is the beginning.
    middle = cycles.share_of_second(scene)
    off = work.motion[at.NOW, :, :2] - exact[:, :2]
    assert np.abs(off[0] - off[1]).max() < 1e-16
    radius = middle * math.hypot(0.5e-6, 7e-6)
    assert np.abs(off).max() <= radius * (many * TURN) ** 3
    assert work.geometry[at.NOW, 0, at.GAP] == gap
    assert work.slip[at.NOW, 0] == 2e-13


def test_so_many_cycles_are_left_out_as_leave_their_form():
    """A twentieth of what the gap changes by a fifth in, and none of it where it bends."""
    _, work, _ = after_two_cycles(change=1e-15)
    closed = [row for row in range(work.tally[at.CANDIDATES]) if work.candidates[row, at.CLOSED]]
    gap = max(abs(work.geometry[at.NOW, row, at.GAP]) for row in closed)
    assert cycles.cycles_of_form(work) == pytest.approx(cycles.FORM * gap / 1e-15, rel=1e-3)
    _, work, _ = after_two_cycles()
    assert cycles.cycles_of_form(work) == cycles.MOST_AT_ONCE
    work.slip[at.CYCLE_SLIP] = 1e-13
    assert cycles.cycles_of_form(work) < 1.0


def test_what_changes_by_chance_stays_as_it_is():
    """Switches are found to a hundredth of an overlap: a displacement scatters by as much."""
    size, least = 1e-13, 1e-20
    for now, last, before in ((1.004, 1.0, 1.003), (1.003, 1.004, 1.0), (1.0, 1.003, 1.0)):
        lengths = now * size, last * size, before * size
        assert cycles.trend(*lengths, size, least) == 0.0
        assert 20.0 < cycles.allowed(1e5, *lengths, size, least) < 100.0
    even = 1.006 * size, 1.003 * size, size
    assert cycles.trend(*even, size, least) == pytest.approx(0.003 * size)
    assert cycles.allowed(1e5, *even, size, least) == pytest.approx(cycles.FORM / 0.003)
    bent = 1.06 * size, 1.04 * size, 1.0 * size
    assert cycles.trend(*bent, size, least) == pytest.approx(0.02 * size)


@pytest.mark.parametrize(("last", "before"), [(1.008, 0.0), (0.99, -0.005), (1.0, 0.009)])
def test_a_cycle_that_is_found_to_end_late_by_chance_leads_nowhere_else(last, before):
    scene, work, clock = after_two_cycles()
    clock[at.CYCLE_AT], clock[at.CYCLE_AT_BEFORE] = last * PERIOD, before * PERIOD
    work.motion[at.CYCLE_LAST] = motion_of(last * TURN)
    work.motion[at.CYCLE_BEFORE] = motion_of(before * TURN)
    cycles.leave_out(scene, work, clock, 50.0)
    exact = motion_of(clock[at.TIME] / PERIOD * TURN)
    assert clock[at.TIME] == pytest.approx((2.0 + 50.0 * (2.0 - before) / 2.0) * PERIOD, rel=1e-9)
    assert np.abs(work.motion[at.NOW, :, :2] - exact[:, :2]).max() <= 7e-6 * (52.0 * TURN) ** 3
    assert work.motion[at.NOW, :, 2] == pytest.approx(exact[:, 2], rel=1e-9)


def test_a_turn_and_the_end_of_the_run_bound_them():
    scene, work, clock = after_two_cycles()
    many = cycles.cycles_of_motion(scene, work, clock, math.inf)
    assert many * TURN <= cycles.MOST_TURN * (1.0 + 1e-9)
    until = clock[at.TIME] + 8.0 * PERIOD
    assert cycles.cycles_of_motion(scene, work, clock, until) == pytest.approx(4.0)


def test_rounding_is_no_change():
    assert cycles.known(3e-20, 1e-19) == 0.0 and cycles.known(-3e-18, 1e-19) == -3e-18


def test_a_cycle_begins_with_any_switch_and_ends_where_its_modes_are_back():
    scene, work = flagged(doublet())
    clock, counts = Implicit().fresh_clock(), Implicit().fresh_counts(10)
    work.slip[at.FLIGHTS] = MANY
    for touches in (1, 0, 1, 0, 1):
        work.candidates[0, at.CLOSED] = touches
        clock[at.TIME] += PERIOD
        cycles.leave_out_cycles(scene, work, clock, counts, math.inf)
    assert counts[at.CYCLE_MODES] == cycles.modes_of(work)
    assert clock[at.CYCLE_AT] == pytest.approx(5.0 * PERIOD)


def test_no_bounce_is_left_out():
    """A disc that bounces for ever, and gives nothing away: every bounce is in the record."""
    floor = Body(SpheroPolygon([(-2e-5, 0.0), (2e-5, 0.0)], 1e-6), fixed=True, density=1e3)
    disc = Body(Sphere(4e-6), (0.0, 1.5e-5), density=2650.0)
    contact = Contact(k_n=20.0, k_t=0.0, damping_n=0.0, damping_t=0.0)
    run = System([floor, disc], [Gravity(), contact], Implicit()).run(0.06, jit=False)
    rises = np.diff(np.sign(run.velocity[:, 1, 1])) > 0
    fall = math.sqrt(2.0 * 1e-5 / 9.81)
    assert run.status == Status.FINISHED
    assert abs(rises.sum() - round(0.5 * (0.06 / fall + 1.0))) <= 1
    assert run.position[:, 1, 1].max() == pytest.approx(1.5e-5, abs=2e-8)
