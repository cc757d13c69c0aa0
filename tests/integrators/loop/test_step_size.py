"""The next step: by the trend of errors, and behind a touch by its speed and stiffness."""

import math

import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.arrays import work_of
from flocsim.compiler.composer import compose
from flocsim.forces import Contact, StokesDrag, VanDerWaals
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.hooks import step_to_switch
from flocsim.integrators import DormandPrince54, Implicit
from flocsim.integrators.events.first_event import SAME
from flocsim.integrators.loop.driver import plan_flight
from flocsim.integrators.loop.step_size import (
    adaptive_factor,
    plan,
    reject,
    step_behind_touch,
    step_to_landing,
)
from tests.helpers.fast_scene import flagged
from tests.helpers.one_step import Stage

R = 10e-6


def first_step(speed, method=Implicit, k_n=20.0, tolerance=1e-9):
    """Behind the touch of two spheres at a speed [m/s], which is remembered for 0.1 ms."""
    bodies = [
        Body(Sphere(R), (0.0, 0.0), velocity=(speed, 0.0), density=2650.0),
        Body(Sphere(R), (2.0 * R - 1e-13, 0.0), density=2650.0),
    ]
    integrator = method(tolerance=tolerance)
    system = System(bodies, [Contact(k_n=k_n)], integrator)
    linked = {
        each: compose(each, system.fillings(), jit=False)
        for each in (list_candidates, locate_contacts, step_behind_touch)
    }
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    assert linked[list_candidates](scene, work)
    linked[locate_contacts](scene, work, at.NOW)
    work.bodies[:, at.MEMORY] = 1e-4
    work.candidates[: work.tally[at.CANDIDATES], at.CLOSED] = at.TOUCHES
    return linked[step_behind_touch](scene, work, integrator.fresh_clock())


def test_it_is_a_share_of_the_contacts_vibration():
    mass = 2650.0 * 4.0 / 3.0 * math.pi * R**3
    frequency = math.sqrt(20.0 / (0.5 * mass))
    # v T = 1 µm, of which the tolerance is a thousandth: (h ω0)⁴ = 1e-4
    assert first_step(0.01, DormandPrince54) * frequency == pytest.approx(0.1, rel=1e-6)
    # A tenth of the tolerance over v/ω0: (h ω0)⁵.
    turns = first_step(0.01) * frequency
    assert turns**5 == pytest.approx(0.1 * 1e-9 * frequency / 0.01, rel=1e-6)


def test_it_goes_with_the_root_of_the_stiffness_and_the_fourth_root_of_what_is_allowed():
    step = first_step(0.01, DormandPrince54)
    assert first_step(0.01, DormandPrince54, k_n=2000.0) == pytest.approx(0.1 * step)
    assert first_step(0.16, DormandPrince54) == pytest.approx(0.5 * step)
    assert first_step(0.01, DormandPrince54, tolerance=16e-9) == pytest.approx(2.0 * step)


def test_behind_a_step_that_may_be_a_series_it_goes_with_the_fifth_root():
    step = first_step(0.01)
    assert first_step(0.01, k_n=2000.0) == pytest.approx(0.1 * 10.0**0.2 * step)
    assert first_step(0.32) == pytest.approx(0.5 * step)
    assert first_step(0.01, tolerance=32e-9) == pytest.approx(2.0 * step)


def test_contacts_that_part_need_none():
    assert first_step(-0.01) == math.inf


@pytest.mark.parametrize("terms", [0, 20])
@pytest.mark.parametrize("method", [Implicit, DormandPrince54])
def test_a_switch_in_a_step_that_leaves_vibrations_out_is_sought_in_one_that_shows_them(
    method, terms
):
    bodies = [Body(Sphere(R), (x, 0.0), density=2650.0) for x in (0.0, 2.0 * R - 1e-12)]
    system = System(bodies, [Contact()], method())
    linked = compose(step_to_switch, system.fillings(), jit=False)
    scene, work = system.scene(jit=False), work_of(system.scene(jit=False), *system.motion())
    work.tally[at.SERIES_TERMS] = terms
    for body in range(2):
        work.jacobian[at.STIFFNESS, body, 0, 0] = 1e10 * scene.bodies[body, at.MASS]
    series = method is Implicit and terms == 0
    assert linked(scene, work, 1e-3, 1e-4) == pytest.approx(4e-5 if series else 1e-7)
    assert linked(scene, work, 1e-3, 0.6) == pytest.approx(6e-4)
    assert linked(scene, work, 6e-5, 1e-4) == pytest.approx(3e-5 if series else 6e-9)


def test_a_flight_begins_with_the_step_that_was_planned_where_the_last_one_has_ended():
    bodies = [Body(Sphere(R), (x, 0.0), density=2650.0) for x in (0.0, 2.0 * R - 1e-12)]
    _, work = flagged(System(bodies, [Contact()]))
    clock = Implicit().fresh_clock()
    clock[at.STEP] = 1e-7
    plan_flight(work, clock, 3e-5, flew=True)
    assert clock[at.STEP] == 1e-7
    work.candidates[0, at.CLOSED] = at.OPEN
    plan_flight(work, clock, 2e-6, flew=False)
    assert clock[at.STEP] == 3e-5


def landing(gap, speed, step):
    """The step across switches of two spheres a gap [m] apart that meet at a speed [m/s]."""
    bodies = [
        Body(Sphere(R), (0.0, 0.0), velocity=(speed, 0.0), density=2650.0),
        Body(Sphere(R), (2.0 * R + gap, 0.0), density=2650.0),
    ]
    stage = Stage(bodies, [Contact()])
    return stage.linked(step_to_landing)(stage.work, stage.clock, step)


def test_a_step_across_switches_ends_just_before_a_pair_lands_and_lands_it_at_once():
    assert landing(1e-6, 1e-3, 1e-4) == 1e-4
    assert landing(1e-6, -1e-3, 1e-2) == 1e-2
    assert landing(1e-6, 1e-3, 1e-2) == pytest.approx((1e-6 - 0.05e-9) / 1e-3, rel=1e-6)
    assert landing(0.05e-9, 1e-3, 1e-2) == pytest.approx(0.5e-9 / 1e-3, rel=1e-6)
    # Slower than the tolerance a step.
    assert landing(1e-10, 1e-8, 1e-2) == 1e-2


def approach(order=5.0):
    """(steps, rejected trials) of a motion whose error is (h/left)^order over a tolerance, until
    what is left of the time to a singular force is a millionth."""
    method = Implicit(tolerance=1e-9)
    linked = {each: compose(each, dict(method.fillings), jit=False) for each in (reject, plan)}
    clock, counts = method.fresh_clock(), method.fresh_counts(1000)
    left, steps = 1.0, 0
    clock[at.STEP] = 0.1
    while left > 1e-6:
        step = clock[at.STEP]
        ratio = (step / (0.2 * left)) ** order
        if ratio > 1.0:
            linked[reject](clock, counts, step, ratio, False)
            continue
        left -= step
        steps += 1
        linked[plan](clock, step, ratio, False, SAME)
    return steps, counts[at.REJECTED]


def test_towards_a_singular_force_steps_shrink_without_being_rejected():
    steps, rejected = approach()
    assert rejected <= 1 and steps < 90  # 62 of a fifth of what is left


def test_two_spheres_that_pull_each_other_together_try_few_steps_in_vain():
    bodies = [Body(Sphere(R), (x, 0.0), density=2650.0) for x in (0.0, 2.2 * R)]
    laws = [StokesDrag(), VanDerWaals(hamaker=1e-18, d_min=1e-9), Contact(k_n=20.0)]
    found = System(bodies, laws, Implicit()).run(until=1.0)
    assert found.status.name == "FINISHED"
    assert found.rejected < 0.3 * found.steps


def test_a_step_behind_a_rejected_one_does_not_grow():
    clock = Implicit().fresh_clock()
    clock[at.PREVIOUS_STEP], clock[at.PREVIOUS_RATIO] = 1e-5, 1.0
    clock[at.REJECTED_STEP] = 2e-5
    assert adaptive_factor(clock, 1e-5, 1e-6, 5.0) == 1.0
    clock[at.REJECTED_STEP] = 0.0
    assert adaptive_factor(clock, 1e-5, 1e-6, 5.0) > 1.0
