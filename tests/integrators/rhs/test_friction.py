"""Stick and slide: where a displacement stops growing, when it goes back, what is derived of it."""

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.arrays import work_of
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators import DormandPrince54, Implicit, Status
from flocsim.integrators.events.first_event import OTHER_CONTACTS, OTHER_FRICTION, SAME, set_modes
from flocsim.integrators.rhs.forces import locate_and_rate, sum_forces
from flocsim.integrators.rhs.friction import beyond, slip_in
from flocsim.integrators.rhs.jacobian import assemble_jacobian
from tests.helpers.matrices import whole_matrix

OVERLAP, RADIUS, BALL, MU = 5e-8, 1e-6, 2e-6, 0.3
LAW = Contact(k_n=20.0, k_t=2.0, damping_n=1e4, friction=MU)
LIMIT = MU * 20.0 * OVERLAP / 2.0
FLOOR = SpheroPolygon([(-1e-4, 0.0), (1e-4, 0.0)], RADIUS)


def ball_on_floor(speed, sinking=0.0, law=LAW):
    """Scene and work arrays of a ball pressed on a floor, moving along it; uncompiled."""
    floor = Body(FLOOR, fixed=True, surface_density=2.0)
    height = RADIUS + BALL - OVERLAP
    ball = Body(Sphere(BALL), (0.0, height), velocity=(speed, -sinking), surface_density=2.0)
    system = System([floor, ball], [law], Implicit())
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    assert list_candidates(scene, work)
    locate_contacts(scene, work, at.NOW)
    return scene, work


def row_of(work):
    """The one closed row."""
    (row,) = np.flatnonzero(work.candidates[: work.tally[at.CANDIDATES], at.CLOSED] == 1)
    return int(row)


@pytest.mark.parametrize(
    ("share", "speed", "sinking", "slides"),
    [
        (0.5, 1e-3, 0.0, False),  # below the limit
        (1.0, -1e-3, 0.0, True),  # at it, and on: along t, ξ grows against the velocity in x
        (1.0, 1e-3, 0.0, False),  # at it, and back
        (1.0, 0.0, 0.0, False),  # at it, and still
        (1.0, -1e-3, 1e-3, False),  # the limit grows faster
        (1.0, -1e-3, -1e-3, True),  # and falls
    ],
)
def test_a_contact_slides_where_its_displacement_would_outgrow_its_limit(
    share, speed, sinking, slides
):
    scene, work = ball_on_floor(speed, sinking)
    assert set_modes(scene, work) == OTHER_CONTACTS
    row = row_of(work)
    work.slip[at.NOW, row] = share * LIMIT
    set_modes(scene, work)
    assert work.candidates[row, at.SLIDING] == (1 if slides else 0)
    assert work.slip[at.NOW, row] == pytest.approx(share * LIMIT, rel=1e-9)
    assert set_modes(scene, work) == SAME
    held = slip_in(scene, work, at.NOW, row, 7.0)
    assert held == (pytest.approx(LIMIT, rel=1e-9) if slides else 7.0)


def test_it_sticks_again_when_it_goes_back_and_an_open_pair_forgets():
    scene, work = ball_on_floor(-1e-3)
    set_modes(scene, work)
    row = row_of(work)
    work.slip[at.NOW, row] = LIMIT
    assert set_modes(scene, work) == OTHER_FRICTION and work.candidates[row, at.SLIDING] == 1
    work.motion[at.NOW, 1, at.VX] = 1e-3
    assert set_modes(scene, work) == OTHER_FRICTION and work.candidates[row, at.SLIDING] == 0
    work.motion[at.NOW, 1, at.VX] = -1e-3
    set_modes(scene, work)
    work.motion[at.NOW, 1, 1] += 2.0 * OVERLAP
    locate_contacts(scene, work, at.NOW)
    assert set_modes(scene, work) == OTHER_CONTACTS
    assert work.candidates[row, at.SLIDING] == 0


@pytest.mark.parametrize("used", [0.2, 0.7])
def test_where_in_a_step_a_contact_begins_to_slide(used):
    """At a constant speed the displacement passes its limit after a known share of the step."""
    step, speed = 1e-7, 0.5
    scene, work = ball_on_floor(-speed)
    set_modes(scene, work)
    row = row_of(work)
    work.slip[at.NOW, row] = LIMIT - used * speed * step
    work.motion[at.NEW] = work.motion[at.NOW]
    locate_contacts(scene, work, at.NEW)
    work.slip[at.NEW, row] = work.slip[at.NOW, row] + speed * step
    distance, share = beyond(scene, work, row, step)
    assert distance == pytest.approx((1.0 - used) * speed * step, rel=1e-6)
    assert share == pytest.approx(used, rel=1e-6)


def test_where_in_a_step_a_contact_ceases_to_slide():
    scene, work = ball_on_floor(-0.5)
    set_modes(scene, work)
    row = row_of(work)
    work.slip[at.NOW, row] = LIMIT
    set_modes(scene, work)
    work.motion[at.NEW] = work.motion[at.NOW]
    work.motion[at.NEW, 1, at.VX] = 0.25
    locate_contacts(scene, work, at.NEW)
    distance, share = beyond(scene, work, row, 1e-6)
    assert share == pytest.approx(2.0 / 3.0, rel=1e-9)
    # What it would have gone back by: the triangle under the velocity.
    assert distance == pytest.approx(0.5 * 0.25 * 1e-6 / 3.0, rel=1e-9)


def test_stiffness_while_it_slides():
    """ξ then goes with the overlap, and not with the way along the floor."""
    scene, work = ball_on_floor(-1e-9, law=Contact(k_n=20.0, k_t=2.0, damping_n=1e3, friction=MU))
    set_modes(scene, work)
    row = row_of(work)
    work.slip[at.NOW, row] = LIMIT
    set_modes(scene, work)
    assert work.candidates[row, at.SLIDING] == 1
    locate_and_rate(scene, work, at.NOW)
    assemble_jacobian(scene, work, 0.0, 1.0)
    found = whole_matrix(work, at.STIFFNESS)[3:5, 3:5]

    def loads(axis, by):
        work.motion[at.NOW, 1, axis] += by
        locate_and_rate(scene, work, at.NOW)
        work.slip[at.NOW, row] = slip_in(scene, work, at.NOW, row, 0.0)
        sum_forces(scene, work, 0.0, at.NOW)
        work.motion[at.NOW, 1, axis] -= by
        return work.rates[at.NOW, 1, 3:5].copy()

    columns = [(loads(axis, -1e-12) - loads(axis, 1e-12)) / 2e-12 for axis in range(2)]
    assert found == pytest.approx(np.array(columns).T, abs=1e-3 * 20.0)
    assert abs(found[0, 1]) == pytest.approx(MU * 20.0, rel=1e-3)
    assert abs(found[0, 0]) < 1e-3 * 20.0


@pytest.mark.parametrize(
    "method", [Implicit(1e-9), pytest.param(DormandPrince54(1e-10), marks=pytest.mark.slow)]
)
def test_a_pushed_ball_slides_as_coulomb_says(method):
    """Thrown along a floor in water without rolling resistance it slides until it rolls: the same
    for both methods, and the same mirrored."""
    ends = []
    for side in (1.0, -1.0):
        floor = Body(FLOOR, fixed=True, surface_density=2.0)
        rest = RADIUS + BALL - np.pi * BALL**2 * 2.0 * 9.81 / 20.0
        ball = Body(Sphere(BALL), (0.0, rest), velocity=(side * 0.01, 0.0), surface_density=2.0)
        law = Contact(k_n=20.0, k_t=2.0, friction=MU)
        run = System([floor, ball], [Gravity(), law], method).run(2e-3, max_steps=200_000)
        assert run.status == Status.FINISHED
        ends.append(run.position[-1, 1, 0] * side)
        rolling = run.velocity[-1, 1, 0] + BALL * run.velocity[-1, 1, 2]
        assert abs(rolling) < 1e-4
        # A disk that slides until it rolls keeps two thirds of its speed.
        assert run.velocity[-1, 1, 0] == pytest.approx(side * 0.01 * 2.0 / 3.0, rel=2e-3)
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)


def test_drag_and_friction_together_come_to_rest():
    floor = Body(FLOOR, fixed=True, surface_density=2.0)
    box = SpheroPolygon([(-3e-6, -1e-6), (3e-6, -1e-6), (3e-6, 1e-6), (-3e-6, 1e-6)], 5e-7)
    body = Body(box, (0.0, RADIUS + 1.5e-6), velocity=(5e-3, 0.0), surface_density=2.0)
    forces = [Gravity(), StokesDrag(), Contact(friction=MU)]
    run = System([floor, body], forces, Implicit()).run(5e-3, max_steps=5000)
    assert run.status == Status.FINISHED
    assert np.abs(run.velocity[-1, 1, [0, 1]]).max() < 1e-8 and at.VY == 4
