"""Steps that are power series: exact where forces are linear, their errors propagated."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.compiler.composer import compose
from flocsim.forces import BodyForce, StokesDrag
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.hooks import attempt
from flocsim.integrators import Implicit
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.loop.driver import adopt_new_state
from flocsim.integrators.loop.stated_error import propagate_vector
from flocsim.state.bodies import ANGLE, X
from flocsim.state.work import DAMPING, NEW, NOW, PROPAGATED, STEP_ERROR, motion_of, work_of
from tests.helpers.trial_scenes import Trap

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
        self.clock.until = 1.0
        self.call(rebuild_list)
        self.call(locate_contacts, NOW)
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
        return int(self.work.tally.series_terms)


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
    found = motion_of(scene.work, NEW)[0]
    place, speed = swung(turns / RATE)
    assert found[X] == pytest.approx(place, abs=1e-14)
    assert found[3] == pytest.approx(speed, abs=1e-14 * RATE)


def test_so_is_one_that_drag_slows_down():
    scene = Linked(trapped(drag=True))
    scene.step(3.0 / RATE)
    damping = scene.work.jacobian[DAMPING, 0, 0, 0]
    assert damping > 0.01 * MASS * RATE
    place, speed = swung(3.0 / RATE, damping)
    assert scene.work.place[NEW, 0, X] == pytest.approx(place, abs=1e-14)
    assert scene.work.velocity[NEW, 0, X] == pytest.approx(speed, abs=1e-14 * RATE)


def test_what_does_not_move_stays_just_where_it_is():
    bodies = [
        Body(Sphere(R), (0.3e-6, 1e-6), velocity=(0.0, 1e-3), spin=50.0, surface_density=2.0),
        Body(Sphere(R), (40e-6, 0.0), 0.7, fixed=True, surface_density=2.0),
    ]
    scene = Linked(System(bodies, [Trap(STIFFNESS)], Implicit()))
    scene.step(1.0 / RATE)
    assert scene.terms > 0
    assert scene.work.velocity[NEW, 0, ANGLE] == 50.0
    assert np.array_equal(motion_of(scene.work, NEW)[1], motion_of(scene.work, NOW)[1])


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
    scene.clock, work, nudge = clock, scene.work, 1e-13
    scene.clock.until = 1.0
    work.place[PROPAGATED, 0, X], work.errors[0].displacement = nudge, 10.0 * nudge
    time, end = 0.0, 0.99875e-3
    while time < end:
        x, speed = work.place[NOW, 0, X], work.velocity[NOW, 0, X]
        step = min(0.15 * x / max(-speed, 1e-2), end - time)
        assert scene.step(step) >= 0.0
        assert scene.terms > 0
        scene.linked(adopt_new_state)(work)
        scene.clock.time = time = time + step
        work.place[STEP_ERROR] = work.velocity[STEP_ERROR] = 0.0
        sums = work.errors[0]
        sums.displacement += step * sums.velocity
        scene.call(propagate_vector, scene.clock, step)
    place = pulled(1e-5, time)
    true = pulled(1e-5 + nudge, time) - place
    assert work.place[NOW, 0, X] == pytest.approx(place, rel=1e-3)
    assert true > 30.0 * nudge
    assert work.place[PROPAGATED, 0, X] == pytest.approx(true, rel=0.2)
    assert work.errors[0].displacement > 5.0 * true
