"""System and Trajectory: arguments, records, what is left out. Every run is uncompiled."""

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.errors import FlocsimError, UsageError
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag, VanDerWaals
from flocsim.geometry.contact import points as contacts
from flocsim.hooks import HOOKS, compiled_calls
from flocsim.integrators import DormandPrince54, Implicit, Status, VelocityVerlet
from flocsim.run import known_error
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import ELASTIC, PolygonSystem, head_on, hook, star

BALL = Body(Sphere(5e-6), surface_density=2.0)
NAN, INF = float("nan"), float("inf")

REFUSED = {
    "no bodies": (lambda: System([]), "at least one Body"),
    "a class for a body": (lambda: System([Body]), "must be flocsim Body objects"),
    "a shape for a body": (lambda: System([Sphere(1e-6)]), "must be flocsim Body objects"),
    "a class for a force": (lambda: System([BALL], [Gravity]), r"write Gravity\(…\)"),
    "a word for a force": (lambda: System([BALL], ["gravity"]), "'gravity'"),
    "a class for an integrator": (lambda: System([BALL], [], Implicit), "Integrator object"),
    "a word for an integrator": (lambda: System([BALL], [], "implicit"), "'implicit'"),
    "until 0": (lambda: System([BALL]).run(0.0), "above 0 s, found 0"),
    "until negative": (lambda: System([BALL]).run(-1.0), "found -1"),
    "until not a number": (lambda: System([BALL]).run(NAN), "found nan"),
    "too deep a start": (lambda: System(head_on(gap=-6e-6)).run(1e-3), "bodies 0 and 1 start"),
    "a body that is not in a list": (lambda: System(BALL), "."),
    "a force that is not in a list": (lambda: System([BALL], Gravity()), "."),
    "a number for the fluid": (lambda: System([BALL], fluid=3), "."),
    "until without its unit": (lambda: System([BALL]).run("1e-3"), "."),
    "max_steps a word": (lambda: System([BALL]).run(1e-3, max_steps="many"), "."),
    "the same place": (lambda: System([BALL, BALL]).run(1e-3), "move them apart"),
    "one core inside another": (
        lambda: System([Body(star(size=4e-5), surface_density=2.0), BALL]).run(1e-3),
        "one core inside",
    ),
}


@pytest.mark.parametrize(("make", "says"), REFUSED.values(), ids=list(REFUSED))
def test_wrong_arguments_get_one_line(make, says):
    with pytest.raises(FlocsimError, match=says) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("max_steps", [0, 1, 5])
def test_the_step_budget_is_kept(max_steps):
    system = System([BALL], [Gravity(), StokesDrag()], VelocityVerlet(1e-6))
    found = system.run(1.0, max_steps=max_steps, jit=False)
    assert found.status is Status.STEP_BUDGET
    assert found.steps == max_steps
    assert len(found.t) == max_steps + 1


def falling(integrator, **options):
    """Two sand grains that fall side by side, one of them a hook."""
    bodies = [
        Body(Sphere(5e-6), (0.0, 0.0), 0.1, (1e-3, 0.0), 5.0, density=2650.0),
        Body(hook(), (50e-6, 1e-6), -0.2, (0.0, 2e-3), -5.0, density=2650.0),
    ]
    return System(bodies, [Gravity(), StokesDrag()], integrator).run(2e-5, jit=False, **options)


@pytest.mark.parametrize(
    "integrator", [VelocityVerlet(1e-6), DormandPrince54(1e-11), Implicit(1e-11)]
)
def test_fields_and_shapes_of_a_trajectory(integrator):
    found = falling(integrator)
    k = len(found.t)
    assert found.status is Status.FINISHED
    assert found.position.shape == found.velocity.shape == (k, 2, 3)
    assert k == found.steps + 1
    assert found.t[0] == 0.0
    assert found.t[-1] == pytest.approx(2e-5, rel=1e-14)
    assert np.all(np.diff(found.t) > 0.0)
    assert found.position[0].tolist() == [[0.0, 0.0, 0.1], [50e-6, 1e-6, -0.2]]
    assert found.velocity[0].tolist() == [[1e-3, 0.0, 5.0], [0.0, 2e-3, -5.0]]
    assert found.rejected >= 0
    assert found.wall_time > 0.0


def test_evaluations_and_errors():
    fixed, explicit, implicit = (
        falling(method)
        for method in (VelocityVerlet(1e-6), DormandPrince54(1e-11), Implicit(1e-11))
    )
    assert fixed.evaluations == 2 * fixed.steps
    assert explicit.evaluations == 7 * (explicit.steps + explicit.rejected)
    # One at the start, and three in each of Newton's iterations.
    tried = implicit.steps + implicit.rejected
    assert 4 * tried <= implicit.evaluations <= 20 * tried
    assert np.isnan(fixed.error)
    for adaptive in (explicit, implicit):
        assert 0.0 < adaptive.error <= adaptive.steps * 1e-11


def test_a_system_can_be_run_again():
    system = System([BALL], [Gravity()], Implicit())
    first, again = system.run(1e-3, jit=False), system.run(1e-3, jit=False)
    assert np.array_equal(first.position, again.position)
    assert BALL.position == (0.0, 0.0)


def test_no_force_at_all_is_free_flight():
    body = attrs.evolve(BALL, velocity=(1e-3, -2e-3), spin=3.0)
    found = System([body]).run(0.5, jit=False)
    assert found.position[-1, 0] == pytest.approx([5e-4, -1e-3, 1.5], rel=1e-12)


def test_absent_forces_are_not_called():
    """The same run, bit for bit, with and without forces of zero strength."""
    bodies = head_on()
    absent = [Gravity(g=0.0), VanDerWaals(hamaker=0.0), DoubleLayer(potential=0.0)]
    ends = [System(bodies, [ELASTIC, *more]).run(2e-4, jit=False) for more in ([], absent)]
    assert np.array_equal(ends[0].position, ends[1].position)
    assert (
        System(bodies, [ELASTIC, *absent]).pieces.parameters
        == System(bodies, [ELASTIC]).pieces.parameters
    )


CLOSE_FORCES = [
    Gravity(), StokesDrag(), VanDerWaals(1e-18, gap="surface"), VanDerWaals(1e-18),
    DoubleLayer(15e-3, 1e-8, gap="surface"), Contact(k_n=20.0, k_t=2.0, friction=0.3),
]  # fmt: skip


@pytest.mark.parametrize(
    "integrator",
    rest_slow(
        [VelocityVerlet(4e-8), DormandPrince54(1e-10), Implicit(1e-10)],
        lambda integrator: isinstance(integrator, Implicit),
    ),
)
def test_spheres_by_their_own_code_and_by_that_of_polygons(integrator):
    bodies = [attrs.evolve(b, spin=300.0) for b in head_on(1e-2)]
    bodies[1] = attrs.evolve(bodies[1], position=(5e-6, 2e-6))
    own, general = (
        kind(bodies, CLOSE_FORCES, integrator).run(6e-5, jit=False)
        for kind in (System, PolygonSystem)
    )
    assert len(own.t) == len(general.t)
    # A core point at a hair's breadth from the centroid is turned, that of a sphere is not.
    assert np.abs(own.position - general.position).max() < 1e-14
    gap = np.hypot(*(own.position[:, 0] - own.position[:, 1])[:, :2].T) - 1e-5
    assert gap.min() < 0.0


@attrs.frozen
class Meddling(VelocityVerlet):
    @property
    def replaces(self):
        return {contacts.least_listed_gap: contacts.least_listed_gap}


def test_only_hooks_can_be_replaced():
    with pytest.raises(UsageError, match=r"points\.least_listed_gap cannot be replaced: flocsim"):
        System(head_on(), [ELASTIC], Meddling()).run(1e-6)
    marked = set(System(head_on(), [ELASTIC]).fillings()) | set(compiled_calls(True))
    assert marked <= set(HOOKS.values())
    assert "flocsim.hooks.attempt" in HOOKS


def test_an_error_beyond_the_reach_of_the_bodies_is_not_known():
    velocity = np.zeros((2, 1, 3))
    velocity[1, 0] = 3e-3, 4e-3, 10.0
    # 2 s at 5 mm/s and 10 rad/s of 10 µm, and these.
    stated = known_error(np.array([0.0102, 0.0103]), velocity, np.array([1e-5]), 2.0)
    assert stated.tolist() == [0.0102, np.inf]
