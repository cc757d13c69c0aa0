"""The stated error: how an error is propagated, and that it covers the true one."""

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.forces import BodyForce, Contact, Gravity, StokesDrag
from flocsim.integrators import Implicit
from flocsim.integrators.amplification import end_distance
from flocsim.integrators.loop import stated_error
from flocsim.integrators.radau.carried_error import propagate_error
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.systems import factorise_systems
from flocsim.integrators.rhs.jacobian import assemble_jacobian
from flocsim.state.bodies import Y
from flocsim.state.work import DAMPING, PROPAGATED, work_of
from tests.helpers.tiers import rest_slow

RATE = 2e3
"""Of the trial forces [1/s]."""


@attrs.frozen
class Linear(BodyForce):
    """F_x = ``sign`` m RATE² x: an error of place turns around, or grows."""

    sign: float = -1.0

    @staticmethod
    def kernel(body, sign):
        return sign * body.mass * RATE * RATE * body.x, 0.0, 0.0


def at_start(forces):
    """(scene, work) of one sphere off the middle, its derivatives assembled."""
    system = System([Body(Sphere(5e-6), (1e-5, 0.0), surface_density=2.0)], forces)
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    assemble_jacobian(scene, work, 0.0, 1.0)
    return scene, work


def stepped(scene, work, step):
    """The clock behind a step of this length [s], whose matrices are factorised."""
    clock = Implicit(1e-9).fresh_clock()
    clock.stages_step = step
    gather_clusters(scene, work)
    assert factorise_systems(scene, work, step)
    return clock


def carried(forces, place, speed, until, steps):
    """(x, vx) of an error that starts as such, carried on with no error of the steps' own."""
    scene, work = at_start(forces)
    # No sum stands in the way.
    work.errors[0].displacement = work.errors[0].velocity = 1.0
    work.place[PROPAGATED, 0, 0], work.velocity[PROPAGATED, 0, 0] = place, speed
    clock = stepped(scene, work, until / steps)
    for _ in range(steps):
        propagate_error(scene, work, clock, until / steps)
    return np.array([work.place[PROPAGATED, 0, 0], work.velocity[PROPAGATED, 0, 0]])


@pytest.mark.parametrize(("steps", "precision"), [(5, 0.1), (50, 2e-3)])
def test_an_error_goes_on_as_the_motion_does(steps, precision):
    until = 1.0 / RATE
    turned = np.array([np.cos(1.0), -RATE * np.sin(1.0)])
    grown = np.array([np.cosh(1.0), RATE * np.sinh(1.0)])
    for sign, right in ((-1.0, turned), (1.0, grown)):
        found = carried([Linear(sign)], 1e-9, 0.0, until, steps)
        assert found == pytest.approx(1e-9 * right, rel=precision)


def test_drag_uses_up_an_error_of_velocity():
    scene, work = at_start([StokesDrag()])
    tau = scene.bodies[0].mass / work.jacobian[DAMPING, 0, 0, 0]
    place, speed = carried([StokesDrag()], 0.0, 1e-6, 30.0 * tau, 300)
    assert place == pytest.approx(1e-6 * tau, rel=1e-3)
    assert abs(speed) < 1e-12


def head_on(damping):
    """Two spheres that meet a little off the middle, and their run until well behind that."""
    bodies = [
        Body(Sphere(5e-6), (0.0, 0.0), velocity=(0.05, 0.0), surface_density=2.0),
        Body(Sphere(5e-6), (1.2e-5, 2e-6), velocity=(-0.05, 0.0), surface_density=2.0),
    ]
    return System(bodies, [Contact(damping_n=damping), StokesDrag()]), 6e-5


@pytest.mark.parametrize("damping", [0.0, 1e5])
@pytest.mark.parametrize("tolerance", rest_slow([1e-8, 1e-9], lambda tolerance: tolerance == 1e-8))
def test_the_stated_error_of_a_bounce_is_above_the_true_one_and_not_far(damping, tolerance):
    system, until = head_on(damping)
    run, exact = (
        attrs.evolve(system, integrator=Implicit(each)).run(until, record=False, jit=False)
        for each in (tolerance, 1e-13)
    )
    true = end_distance(system.bodies, run.position[-1], exact.position[-1])
    assert 0.0 < true <= run.error < 3e3 * true


@pytest.mark.parametrize("number", rest_slow([34, 11, 39, 1], lambda number: number == 34))
def test_it_covers_what_a_kink_of_a_law_leads_to(number):
    """Discs that bounce with friction and without tension, and leave each other before they part:
    the derivatives at the kink are those before it."""
    rng = np.random.default_rng(number)
    across = float(rng.uniform(-6e-6, 6e-6))
    bodies = [
        Body(
            Sphere(size), (-side * 1.5e-5, y), float(rng.uniform(0, 6)), (side * 0.03, 0.0),
            float(rng.normal() * 1e3), surface_density=2.0,
        )
        for side, size, y in ((1.0, 8e-6, 0.0), (-1.0, 5e-6, across))
    ]  # fmt: skip
    forces = [StokesDrag(), Contact(tension=False, friction=0.3)]
    system = System(bodies, forces, Implicit(1e-9))
    run, exact = (
        attrs.evolve(system, integrator=Implicit(each)).run(1e-3, record=False)
        for each in (1e-9, 1e-12)
    )
    true = end_distance(bodies, run.position[-1], exact.position[-1])
    assert true <= run.error


def test_what_a_contact_takes_up_is_no_longer_stated():
    """A ball falls on a fixed one and lies there: the sums alone go on for ever."""
    bodies = [
        Body(Sphere(5e-6), fixed=True, surface_density=2.0),
        Body(Sphere(5e-6), (0.0, 1.01e-5), velocity=(0.0, -1e-2), surface_density=2.0),
    ]
    system = System(bodies, [Gravity(), Contact()], Implicit(1e-9))
    run = system.begin(2e-4, jit=False)
    run.to_end()
    exact = attrs.evolve(system, integrator=Implicit(1e-13)).run(2e-4, jit=False)
    errors = run.work.errors
    sums = system.integrator.estimate_share * errors["displacement"]
    sums += stated_error.SWITCH_AMPLIFICATION * errors["switch_displacement"]
    true = end_distance(bodies, run.motion()[1][-1], exact.position[-1])
    assert abs(run.work.place[PROPAGATED, 1, Y]) < 0.05 * sums.max()
    assert true <= run.error <= max(sums.max(), stated_error.LEAST_STATED * 1e-9)
