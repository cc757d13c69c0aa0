"""The loop around the integrators: how runs end, lists that grow, events, many bodies."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.forces import BodyForce, Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import DormandPrince54, Implicit, Status, VelocityVerlet
from flocsim.state.bodies import X
from flocsim.state.work import NOW
from tests.helpers.methods import by_adaptive, by_method, is_adaptive
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import (
    ELASTIC,
    PolygonSystem,
    Spring,
    comb,
    encounter,
    head_on,
    watched,
)

ROUGH = Contact(k_n=20.0, k_t=2.0, damping_n=3e4, friction=0.4)


@attrs.frozen
class Undefined(BodyForce):
    """A force that is NaN from some time on."""

    since: float = 1e-6

    @staticmethod
    def kernel(body, since):
        return (math.nan if body.time > since else 0.0), 0.0, 0.0


@attrs.frozen
class Relay(BodyForce):
    """A force of one strength that always points to x = 0, where it jumps."""

    size: float = 1e-6

    @staticmethod
    def kernel(body, size):
        return (-size if body.x > 0.0 else size), 0.0, 0.0


def pair(bodies, integrator, law=ELASTIC):
    return PolygonSystem(bodies, [law, Spring()], integrator)


@by_method
def test_a_run_to_its_end_finishes_at_the_very_time(integrator):
    end = watched(pair(encounter(), integrator), 1e-4)
    assert end.status is Status.FINISHED
    assert end.time == pytest.approx(1e-4, rel=1e-14)


@by_method
def test_step_budget(integrator):
    end = watched(pair(encounter(), integrator), 1e-3, max_steps=7)
    assert end.status is Status.STEP_BUDGET
    # Steps tried to end at a switch count, too.
    assert 1 <= end.steps + end.rejected <= 7
    assert end.time < 1e-3


@by_method
@pytest.mark.parametrize(("speed", "k_n"), [(1.0, 1e-3), (1e3, 20.0)])
def test_bodies_shot_into_each_other_are_reported_not_passed_through(speed, k_n, integrator):
    soft = attrs.evolve(ELASTIC, k_n=k_n)
    end = watched(pair(head_on(speed), integrator, soft), 1e-3)
    assert end.status is Status.TOO_DEEP
    # The right one is still on the right: nothing tunnelled.
    assert end.position[1, 0] > end.position[0, 0]
    assert end.time < 1e-3


def test_too_large_an_explicit_step_is_reported():
    """Drag with τ = 17 µs at steps of 100 µs grows without bound."""
    body = Body(Sphere(5e-6), velocity=(1e-3, 0.0), density=2650.0)
    with np.errstate(over="ignore", invalid="ignore"):
        found = System([body], [StokesDrag()], VelocityVerlet(1e-4)).run(1.0, jit=False)
    assert found.status is Status.NOT_FINITE
    assert np.isfinite(found.position).all() and np.isfinite(found.velocity).all()


@by_method
def test_a_force_that_is_not_a_number_ends_the_run(integrator):
    body = Body(Sphere(5e-6), surface_density=2.0)
    found = System([body], [Undefined()], integrator).run(1e-3, jit=False)
    assert found.status in (Status.NOT_FINITE, Status.STALLED)
    assert found.rejected < 100
    assert np.isfinite(found.position).all()


@by_adaptive
def test_a_jumping_force_cannot_hold_up_an_adaptive_run(integrator):
    body = Body(Sphere(5e-6), (1e-7, 0.0), surface_density=2.0)
    system = System([body], [Relay()], attrs.evolve(integrator, tolerance=1e-9))
    found = system.run(2e-4, max_steps=2_000, jit=False)
    assert found.status in (Status.FINISHED, Status.STALLED)
    assert np.abs(found.position[:, 0, 0]).max() < 2e-6


@attrs.frozen
class Creeping(DormandPrince54):
    """A method whose steps are accepted, and far too short for time to go by."""

    @staticmethod
    def next_step(clock, step, ratio):
        return 1e-9 * step


def test_accepted_steps_by_which_no_time_goes_by_end_the_run():
    body = Body(Sphere(5e-6), velocity=(1e-3, 0.0), surface_density=2.0)
    found = System([body], [StokesDrag()], Creeping(1e-9)).run(1e-3, jit=False)
    assert found.status is Status.STALLED
    assert 100 < found.steps < 120
    # Each of them takes the time to another number all the same.
    assert np.diff(found.t).min() > 0.0


def test_a_fixed_step_that_is_lost_in_the_time_ends_the_run():
    """Behind 1 s, 1e-17 s are nothing."""
    system = System([Body(Sphere(5e-6), surface_density=2.0)], [], VelocityVerlet(1e-17))
    run = system.begin(2.0, jit=False)
    run.clock.time = 1.0
    assert run.to_end() is Status.STALLED
    assert run.steps < 120


@by_adaptive
def test_pairs_that_switch_within_rounding_of_the_time_switch_together(integrator):
    """Two bodies that hit a third at once, after 1 s: rounding alone tells which comes first."""
    shape, speed = Sphere(5e-6), 0.01
    bodies = [Body(shape, surface_density=2.0)]
    for side in (-1.0, 1.0):
        start = side * (1.05e-5 + speed * 1e-5 * (1.0 + 1e-12 * side))
        bodies.append(Body(shape, (start, 0.0), velocity=(-side * speed, 0.0), surface_density=2.0))
    run = System(bodies, [ELASTIC], integrator).begin(1.0 + 1e-4, jit=False)
    run.clock.time = 1.0
    assert run.to_end() is Status.FINISHED
    assert run.steps + run.rejected < 1000
    assert run.work.velocity[NOW, 1:, X] == pytest.approx([-speed, speed], rel=1e-3)


def test_every_status_says_what_happened_in_one_line():
    reasons = [status.reason for status in Status]
    assert len(set(reasons)) == len(Status)
    assert all(reason and "\n" not in reason for reason in reasons)


def combs():
    """Two combs of 202 vertices whose teeth interlock; one slides against the flanks."""
    shape = comb()
    middle = shape.centroid[0] - 0.625e-6
    x = math.remainder(2.5e-6 - 2.0 * middle, 5e-6)
    height = 2.0 * (8e-6 - shape.centroid[1]) - 5e-6
    other = Body(shape, (x + 0.3e-6, height), np.pi, (0.04, -0.004), surface_density=2.0)
    return [Body(shape, surface_density=2.0), other]


@by_method
@pytest.mark.parametrize("bodies", [combs, encounter])
def test_a_candidate_list_that_grows_changes_nothing(bodies, integrator):
    """From room for one pair, and for 100, as from room for all: to the last bit."""
    system = pair(bodies(), integrator, ROUGH)
    ends = [watched(system, 1.5e-4, capacity=c) for c in (8192, 1, 100)]
    assert ends[0].contacts >= 1
    for end in ends[1:]:
        assert np.array_equal(end.motion, ends[0].motion)
        assert end.steps == ends[0].steps


@by_method
def test_fixed_bodies_do_not_move(integrator):
    bodies = [attrs.evolve(b, fixed=k == 1) for k, b in enumerate(encounter())]
    bodies[1] = attrs.evolve(bodies[1], velocity=(0.0, 0.0))
    start = [*bodies[1].position, bodies[1].angle]
    end = watched(PolygonSystem(bodies, [ROUGH, Spring(1e-2)], integrator), 4e-4)
    assert end.contacts >= 1
    assert end.position[1].tolist() == start
    assert end.velocity[1].tolist() == [0.0, 0.0, 0.0]
    assert np.abs(end.velocity[0] - [0.05, 0.0, 2e3]).max() > 1e-3


@by_method
def test_a_fixed_body_keeps_the_velocity_it_is_given(integrator):
    body = Body(Sphere(5e-6), velocity=(1e-3, 0.0), fixed=True, surface_density=2.0)
    end = System([body], [Gravity(), StokesDrag()], integrator).run(1e-6, jit=False)
    assert end.velocity[-1].tolist() == [[1e-3, 0.0, 0.0]]
    assert end.position[-1, 0] == pytest.approx([1e-9, 0.0, 0.0], rel=1e-12)


@by_method
def test_two_fixed_bodies_may_overlap(integrator):
    post = [attrs.evolve(b, fixed=True, velocity=(0.0, 0.0)) for b in head_on(gap=-1e-6)]
    end = watched(pair(post, integrator), 1e-5)
    assert end.status is Status.FINISHED
    assert not end.velocity.any()


def flight_to_touch(speed, gap, integrator):
    """(located instant of the touch, gap there) of two spheres in free flight."""
    end = watched(pair(head_on(speed, gap), integrator), 2.0 * gap / speed, awaited=True)
    return end.touch_time, end.touch_gap


@pytest.mark.parametrize(
    ("integrator", "accuracy"),
    rest_slow(
        [
            (VelocityVerlet(1.3e-7), 1e-13),
            (DormandPrince54(1e-9), 1e-12),
            (Implicit(1e-9), 1e-12),
            (Implicit(1e-11), 1e-13),
        ],
        is_adaptive,
    ),
)
@pytest.mark.parametrize(("speed", "gap"), [(1e-3, 1e-7), (0.2, 3e-6)])
def test_the_touch_is_located(integrator, accuracy, speed, gap):
    """To a thousandth of the tolerance, at least 0.1 pm; its instant to the tolerance."""
    instant, gap_there = flight_to_touch(speed, gap, integrator)
    assert abs(gap_there) <= accuracy
    off = min(integrator.tolerance, 1e-10)
    assert instant == pytest.approx(gap / speed, abs=off / speed)


@pytest.mark.slow
def test_the_instant_of_a_touch_does_not_depend_on_the_method():
    """Two turning ragged bodies on free paths, whose touch is between any two steps."""
    methods = [VelocityVerlet(1e-7), VelocityVerlet(3e-8), DormandPrince54(1e-10)]
    methods += [Implicit(1e-9), Implicit(1e-11)]
    ends = [watched(pair(encounter(), m), 3e-4, awaited=True) for m in methods]
    instants = [end.touch_time for end in ends]
    # At 0.1 m/s, 2e-11 s are 2 pm.
    assert instants == pytest.approx([instants[-1]] * len(methods), abs=2e-11)
    assert max(abs(end.touch_gap) for end in ends) <= 1e-12


def test_two_spheres_that_pull_each_other_together_try_few_steps_in_vain():
    bodies = [Body(Sphere(1e-5), (x, 0.0), density=2650.0) for x in (0.0, 2.2e-5)]
    laws = [StokesDrag(), VanDerWaals(hamaker=1e-18, d_min=1e-9), Contact(k_n=20.0)]
    found = System(bodies, laws, Implicit()).run(until=1.0)
    assert found.status.name == "FINISHED"
    assert found.rejected < 0.3 * found.steps
