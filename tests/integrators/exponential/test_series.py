"""Steps that are power series: exact where forces are linear, cut where something happens."""

import math

import attrs
import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.arrays import work_of
from flocsim.compiler.composer import compose
from flocsim.constants import DEEPEST_OVERLAP
from flocsim.forces import BodyForce, Contact, StokesDrag
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.hooks import attempt, cut
from flocsim.integrators import Implicit, Overdamped
from flocsim.integrators.events.crossings import interpolate
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.exponential.collocation import NODES
from flocsim.integrators.exponential.samples import parts_of
from flocsim.integrators.exponential.series import shorten
from flocsim.integrators.loop.driver import take_new_state
from flocsim.integrators.rhs.stated_error import carry_vector
from tests.helpers.trial_scenes import Spring, Trap

R = 5e-6
MASS = 2.0 * math.pi * R**2
STIFFNESS = 0.02
RATE = math.sqrt(STIFFNESS / MASS)
"""Of a disc in a trap [1/s]."""


class Linked:
    """A system's functions, uncompiled, and its arrays, with contacts as they are."""

    def __init__(self, system):
        self.fillings = system.fillings()
        self.scene = system.scene(jit=False)
        self.work = work_of(self.scene, *system.motion())
        self.clock = system.integrator.fresh_clock()
        self.clock[at.UNTIL] = 1.0
        self.call(list_candidates)
        self.call(locate_contacts, at.NOW)
        self.call(set_modes)

    def linked(self, function):
        return compose(function, self.fillings, jit=False)

    def call(self, function, *arguments):
        return self.linked(function)(self.scene, self.work, *arguments)

    def step(self, length):
        """Take a step of so many seconds: its error over the tolerance."""
        return self.call(attempt, self.clock, length)

    @property
    def terms(self):
        return int(self.work.tally[at.SERIES_TERMS])


def trapped(drag=False, **words):
    """A disc in a harmonic trap, off its middle."""
    body = Body(Sphere(R), (1e-7, 0.0), velocity=(2e-3, 0.0), surface_density=2.0)
    forces = [Trap(STIFFNESS)] + ([StokesDrag()] if drag else [])
    return System([body], forces, Implicit(**words))


def swung(time, damping=0.0):
    """(x [m], v [m/s]) of that disc."""
    slow = damping / (2.0 * MASS)
    turn = math.sqrt(RATE**2 - slow**2)
    x, v = 1e-7, 2e-3
    decay, c, s = math.exp(-slow * time), math.cos(turn * time), math.sin(turn * time)
    pull = (v + slow * x) / turn
    place = decay * (x * c + pull * s)
    return place, decay * (turn * (pull * c - x * s)) - slow * place


@pytest.mark.parametrize("turns", [0.1, 1.0, 3.0, 8.0])
def test_a_linear_swing_is_exact_however_far_it_goes(turns):
    scene = Linked(trapped())
    assert scene.step(turns / RATE) < 1e-3
    assert scene.terms > 0
    found = scene.work.motion[at.NEW, 0]
    place, speed = swung(turns / RATE)
    assert found[at.X] == pytest.approx(place, abs=1e-14)
    assert found[at.VX] == pytest.approx(speed, abs=1e-14 * RATE)


def test_so_is_one_that_drag_slows_down():
    scene = Linked(trapped(drag=True))
    scene.step(3.0 / RATE)
    damping = scene.work.jacobian[at.DAMPING, 0, 0, 0]
    assert damping > 0.01 * MASS * RATE
    place, speed = swung(3.0 / RATE, damping)
    assert scene.work.motion[at.NEW, 0, at.X] == pytest.approx(place, abs=1e-14)
    assert scene.work.motion[at.NEW, 0, at.VX] == pytest.approx(speed, abs=1e-14 * RATE)


def test_the_swing_is_known_everywhere_in_the_step():
    scene = Linked(trapped())
    scene.step(6.0 / RATE)
    within = scene.linked(interpolate)
    for share in (0.0, 0.2, 0.55, 0.9, 1.0):
        within(scene.work, 6.0 / RATE, share, 0)
        place, speed = swung(6.0 * share / RATE)
        assert scene.work.motion[at.TRIAL, 0, at.X] == pytest.approx(place, abs=1e-14)
        assert scene.work.motion[at.TRIAL, 0, at.VX] == pytest.approx(speed, abs=1e-14 * RATE)


@pytest.mark.parametrize("method", [Implicit(), Overdamped()])
def test_steps_that_leave_the_swing_out_are_none(method):
    bodies = [Body(Sphere(R), (1e-7, 0.0), surface_density=2.0)]
    scene = Linked(System(bodies, [Trap(STIFFNESS, 1e-12), StokesDrag()], method))
    scene.step(100.0 / RATE)
    assert scene.terms == 0


def test_what_does_not_move_stays_just_where_it_is():
    bodies = [
        Body(Sphere(R), (0.3e-6, 1e-6), velocity=(0.0, 1e-3), spin=50.0, surface_density=2.0),
        Body(Sphere(R), (40e-6, 0.0), 0.7, fixed=True, surface_density=2.0),
    ]
    scene = Linked(System(bodies, [Trap(STIFFNESS)], Implicit()))
    scene.step(1.0 / RATE)
    assert scene.terms > 0
    assert scene.work.motion[at.NEW, 0, at.SPIN] == 50.0
    assert np.array_equal(scene.work.motion[at.NEW, 1], scene.work.motion[at.NOW, 1])


def test_a_shortened_series_is_that_of_the_shorter_step():
    long, short = Linked(trapped()), Linked(trapped())
    long.step(4.0 / RATE)
    short.step(1.0 / RATE)
    shorten(long.work, long.terms, 0.25)
    count = min(long.terms, short.terms)
    size = np.abs(short.work.series[at.MOTION, :count]).max()
    np.testing.assert_allclose(
        long.work.series[at.MOTION, :count], short.work.series[at.MOTION, :count], atol=1e-9 * size
    )
    np.testing.assert_allclose(long.work.linear, short.work.linear, rtol=1e-12)
    np.testing.assert_allclose(
        long.work.weights[at.MOVED], short.work.weights[at.MOVED], rtol=1e-12
    )


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_an_error_is_carried_as_it_would_swing(share):
    scene, step = Linked(trapped()), 5.0 / RATE
    scene.step(step)
    work = scene.work
    work.motion[at.DEVIATION] = 0.0
    work.motion[at.CARRIED, 0, at.X], work.motion[at.CARRIED, 0, at.VX] = 1e-10, 1e-7
    work.bodies[:, at.ERROR_PLACE] = 1.0  # more than that may be
    scene.call(carry_vector, scene.clock, share * step)
    turn = 5.0 * share
    place = 1e-10 * math.cos(turn) + 1e-7 / RATE * math.sin(turn)
    speed = 1e-7 * math.cos(turn) - 1e-10 * RATE * math.sin(turn)
    assert work.motion[at.CARRIED, 0, at.X] == pytest.approx(place, abs=2e-2 * 1e-10)
    assert work.motion[at.CARRIED, 0, at.VX] == pytest.approx(speed, abs=2e-2 * 1e-10 * RATE)


@attrs.frozen
class Pull(BodyForce):
    """F_x = −PULL m (x/10 µm)⁻³: the steeper, the nearer."""

    @staticmethod
    def kernel(body):
        return -PULL * body.mass * (1e5 * body.x) ** -3.0, 0.0, 0.0


PULL = 10.0
"""[m/s²] at 10 µm."""


def pulled(place, until):
    """Where a body is that was at rest at a place [m]: x ẍ = … has x² fall as the time's square."""
    return math.sqrt(place**2 - PULL * 1e-15 * (until / place) ** 2)


def test_an_error_grows_as_an_attraction_gets_steeper():
    """By forty times here, the attraction getting up to twice as steep in a step; sums of
    errors grow with it."""
    system = System([Body(Sphere(R), (1e-5, 0.0), surface_density=2.0)], [Pull()], Implicit())
    scene, clock = Linked(system), Implicit().fresh_clock()
    scene.clock[:], work, nudge = clock, scene.work, 1e-13
    scene.clock[at.UNTIL] = 1.0
    work.motion[at.CARRIED, 0, at.X], work.bodies[0, at.ERROR_PLACE] = nudge, 10.0 * nudge
    time, end = 0.0, 0.99875e-3
    while time < end:
        here = work.motion[at.NOW, 0]
        step = min(0.15 * here[at.X] / max(-here[at.VX], 1e-2), end - time)
        assert scene.step(step) >= 0.0
        assert scene.terms > 0
        scene.linked(take_new_state)(work)
        scene.clock[at.TIME] = time = time + step
        work.motion[at.DEVIATION] = 0.0
        sums = work.bodies[0]
        sums[at.ERROR_PLACE] += step * sums[at.ERROR_SPEED]
        scene.call(carry_vector, scene.clock, step)
    place = pulled(1e-5, time)
    true = pulled(1e-5 + nudge, time) - place
    assert work.motion[at.NOW, 0, at.X] == pytest.approx(place, rel=1e-3)
    assert true > 30.0 * nudge
    assert work.motion[at.CARRIED, 0, at.X] == pytest.approx(true, rel=0.2)
    assert work.bodies[0, at.ERROR_PLACE] > 5.0 * true


def overlapping(overlap=1e-9, speeds=(0.0, 0.0), pressed=False, **law):
    """Two discs that are pressed into each other, at speeds against each other along and across the
    line between them; ``pressed``: held there by a spring between their centres."""
    half, (along, across) = 0.5 * (2.0 * R - overlap), speeds
    bodies = [
        Body(
            Sphere(R), (side * half, 0.0),
            velocity=(-0.5 * side * along, 0.5 * side * across), surface_density=2.0,
        )
        for side in (-1.0, 1.0)
    ]  # fmt: skip
    forces = [Contact(**{"k_n": K_N, "k_t": K_T, "damping_n": 0.0, "damping_t": 0.0} | law)]
    if pressed:
        forces.append(Spring(K_N * overlap / 1e-6, -1e-6 - overlap))
    return System(bodies, forces, Implicit())


K_N, K_T = 20.0, 2.0
NORMAL_RATE = math.sqrt(2.0 * K_N / MASS)
"""Of two discs on their contact's spring [1/s]."""

TANGENTIAL_RATE = math.sqrt(6.0 * K_T / MASS)
"""Along it, where they turn as well."""


def test_parts_are_short_against_what_swings():
    scene = Linked(overlapping()).scene
    assert [parts_of(scene, turns) for turns in (0.0, 1.5, 3.0)] == [1, 1, 1]
    assert [parts_of(scene, turns) for turns in (3.2, 6.3, 12.6)] == [3, 4, 8]
    assert parts_of(Linked(overlapping(friction=0.4)).scene, 2.9) == 2


@pytest.mark.parametrize("turns", [4.0, 8.0])
def test_a_step_is_cut_where_contacts_have_swung_open_in_it(turns):
    """They part after a quarter of a turn; at its end they overlap again, or are apart again."""
    scene, step = Linked(overlapping()), turns / NORMAL_RATE
    assert scene.work.candidates[0, at.CLOSED] == at.TOUCHES
    scene.step(step)
    parts = parts_of(scene.scene, scene.clock[at.SERIES_TURNS])
    assert scene.clock[at.SERIES_TURNS] == pytest.approx(turns, rel=0.2)
    share = scene.call(cut, scene.clock, step, 1e-12, 1e-12)
    assert 0.5 * math.pi < share * turns < 0.5 * math.pi + turns / parts
    gap = scene.work.motion[at.NEW, 1, at.X] - scene.work.motion[at.NEW, 0, at.X] - 2.0 * R
    assert gap == pytest.approx(-1e-9 * math.cos(share * turns), abs=1e-14)
    assert scene.clock[at.STAGED_STEP] == pytest.approx(share * step, rel=1e-12)


def test_one_in_which_nothing_switches_is_left_whole():
    scene, step = Linked(overlapping()), 1.2 / NORMAL_RATE
    scene.step(step)
    assert scene.call(cut, scene.clock, step, 1e-12, 1e-12) == 1.0


def test_one_that_presses_too_deep_ends_there():
    """As deep as it may be at the start, and deeper within."""
    deep = 0.99 * DEEPEST_OVERLAP * 2.0 * R
    scene = Linked(overlapping(deep, speeds=(deep * NORMAL_RATE, 0.0)))
    step = 2.5 / NORMAL_RATE
    scene.step(step)
    assert scene.terms > 0
    assert scene.call(cut, scene.clock, step, 1e-12, 1e-12) == NODES[0]


@pytest.mark.parametrize(("reach", "seen"), [(3.0, True), (1.05, True), (0.9, False)])
def test_a_contact_that_would_slide_for_a_while_is_seen(reach, seen):
    """Two discs swing along each other for ``reach`` times as far as friction holds, and back again
    before the end of the step: it is not taken, or cut."""
    holds = 1e-3 * K_N * 1e-9 / K_T
    speeds = (0.0, reach * holds * TANGENTIAL_RATE)
    scene = Linked(overlapping(speeds=speeds, pressed=True, friction=1e-3))
    step = 2.9 / TANGENTIAL_RATE
    ratio = scene.step(step)
    whole = 0.0 <= ratio <= 1.0 and scene.call(cut, scene.clock, step, 1e-2 * holds, 0.0) == 1.0
    assert whole != seen
