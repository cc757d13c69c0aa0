"""The stated error: what a vector of errors becomes, and that sums and vectors cover the truth."""

import attrs
import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.arrays import work_of
from flocsim.forces import BodyForce, Contact, Gravity, StokesDrag
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators import Implicit
from flocsim.integrators.amplification import end_distance
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.radau.carried_error import carry_error
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.systems import factorise_systems
from flocsim.integrators.rhs import stated_error
from flocsim.integrators.rhs.jacobian import assemble_jacobian
from flocsim.integrators.rhs.stated_error import forget_offsets
from tests.helpers.fast_scene import flagged
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
    clock[at.STAGED_STEP] = step
    gather_clusters(scene, work)
    assert factorise_systems(scene, work, step)
    return clock


def carried(forces, place, speed, until, steps):
    """(x, vx) of an error that starts as such, carried on with no error of the steps' own."""
    scene, work = at_start(forces)
    # No sum stands in the way.
    work.bodies[0, at.ERROR_PLACE] = work.bodies[0, at.ERROR_SPEED] = 1.0
    work.motion[at.CARRIED, 0, [0, 3]] = place, speed
    clock = stepped(scene, work, until / steps)
    for _ in range(steps):
        carry_error(scene, work, clock, until / steps)
    return work.motion[at.CARRIED, 0, [0, 3]]


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
    tau = scene.bodies[0, at.MASS] / work.jacobian[at.DAMPING, 0, 0, 0]
    place, speed = carried([StokesDrag()], 0.0, 1e-6, 30.0 * tau, 300)
    assert place == pytest.approx(1e-6 * tau, rel=1e-3)
    assert abs(speed) < 1e-12


def touching(error, sticks_since):
    """(x, y) that an error of place of a sphere on a fixed slab becomes over a hundred steps that
    are long against the contact; ``sticks_since``: whether it was there when the contact stuck."""
    slab = SpheroPolygon([(-2e-5, 0.0), (-2e-5, -5e-6), (2e-5, -5e-6), (2e-5, 0.0)], 1e-6)
    bodies = [
        Body(slab, (0.0, -2.5e-6), surface_density=2.0, fixed=True),
        Body(Sphere(5e-6), (0.0, 6e-6 - 1e-9), surface_density=2.0),
    ]
    system = System(bodies, [Contact(), StokesDrag()])
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    assert list_candidates(scene, work)
    locate_contacts(scene, work, at.NOW)
    work.bodies[:, at.ERROR_PLACE] = work.bodies[:, at.ERROR_SPEED] = 1.0
    work.motion[at.CARRIED, 1, :2] = error
    if sticks_since:
        forget_offsets(work)
    set_modes(scene, work)
    forget_offsets(work)  # which leaves those that stick alone
    for _ in range(100):
        assemble_jacobian(scene, work, 0.0, 1.0)
        clock = stepped(scene, work, 1e-5)
        carry_error(scene, work, clock, 1e-5)
    return work.motion[at.CARRIED, 1, :2]


def test_a_contact_takes_up_what_is_wrong_along_its_normal_but_not_where_it_has_stuck():
    x, y = touching((1e-9, 1e-9), sticks_since=True)
    assert x == pytest.approx(1e-9, rel=1e-3) and abs(y) < 1e-12
    x, y = touching((1e-9, 1e-9), sticks_since=False)
    assert x < 0.8e-9 and abs(y) < 1e-12


def test_a_vector_is_kept_within_the_sums():
    """The sums of this body's errors are nought, and so is what is carried on."""
    scene, work = at_start([StokesDrag()])
    work.motion[at.CARRIED, 0] = 1e-3
    assert carry_error(scene, work, stepped(scene, work, 1e-5), 1e-5) == 0.0
    assert not work.motion[at.CARRIED].any()


def test_shortening_gives_a_cluster_no_momentum():
    """Errors that a contact has given two bodies, which can be wrong by less than that."""
    bodies = [
        Body(Sphere(radius), (x, 0.0), surface_density=2.0)
        for radius, x in ((5e-6, 0.0), (8e-6, 1.3e-5 - 1e-9))
    ]
    system = System(bodies, [Contact()])
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    work.cluster[:] = 0
    masses = scene.bodies[:, at.MASS]
    work.motion[at.CARRIED, :, 0] = work.motion[at.CARRIED, :, 3] = 1e-9 / masses * masses.min()
    work.motion[at.CARRIED, 1] *= -1.0
    work.bodies[:, at.ERROR_PLACE] = 1e-12, 1e-10
    assert stated_error.bound_carried(scene, work) == pytest.approx(1e-10)
    for axis in (0, 3):
        moved = masses * work.motion[at.CARRIED, :, axis]
        assert moved[0] != 0.0
        assert moved[0] == pytest.approx(-moved[1], rel=1e-12, abs=0.0)


def test_a_body_takes_over_what_others_hand_on_to_it():
    """One that joins a cluster with no error of its own neither shortens that of the others nor
    forgets its share of it when it leaves."""
    bodies = [Body(Sphere(5e-6), (x, 0.0), surface_density=2.0) for x in (0.0, 1e-5 - 1e-9, 3e-5)]
    system = System(bodies, [Contact()])
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    work.cluster[:] = 0, 0, 2
    work.motion[at.CARRIED, :, 0] = 3e-9, 2e-9, 1e-9
    work.bodies[:, at.ERROR_PLACE] = 4e-9, 0.0, 5e-10
    assert stated_error.bound_carried(scene, work) == pytest.approx(3e-9)
    assert work.motion[at.CARRIED, :, 0] == pytest.approx([3e-9, 2e-9, 5e-10])
    assert work.bodies[:, at.ERROR_PLACE] == pytest.approx([4e-9, 2e-9, 5e-10])


def test_a_doubt_counts_for_its_own_body_alone():
    """A contact that hardly overlaps may have opened; that is no error of others until it has."""
    bodies = [Body(Sphere(5e-6), (x, 0.0), surface_density=2.0) for x in (0.0, 1e-5 - 1e-13)]
    scene, work = flagged(System(bodies, [Contact(), StokesDrag()]))
    clock = Implicit(1e-9).fresh_clock()
    stated_error.add_switch_errors(scene, work, clock, 1e-4, 1e-12)
    assert not work.bodies[:, [at.SWITCH_SPEED, at.DOUBT_SPEED]].any()
    work.motion[at.DEVIATION, 0, 0] = 1e-12
    stated_error.add_switch_errors(scene, work, clock, 1e-4, 1e-12)
    assert (
        not work.bodies[:, at.SWITCH_SPEED].any() and (work.bodies[:, at.DOUBT_SPEED] > 0.0).all()
    )
    work.candidates[0, at.CLOSED] = at.OPEN
    work.motion[at.NOW, 0, at.VX] = 1e-6
    stated_error.add_switch_errors(scene, work, clock, 1e-4, 1e-12)
    assert (work.bodies[:, at.SWITCH_SPEED] > 0.0).all()
    work.motion[at.CARRIED] = 0.0
    work.motion[at.CARRIED, :, 0] = 1e-9
    work.bodies[:, at.DOUBT_PLACE] = 1e-6, 0.0
    work.bodies[:, at.ERROR_PLACE] = 0.0, 1e-10
    work.cluster[:] = 0
    assert stated_error.bound_carried(scene, work) == pytest.approx(1e-10)


def test_the_load_tells_whether_a_contact_is_there_that_a_long_step_only_holds():
    """What a step estimates for places is no doubt of a contact whose vibration it leaves out; that
    its stages' overlaps lie on no line is (radau/overlap_error.py)."""
    bodies = [Body(Sphere(5e-6), (x, 0.0), surface_density=2.0) for x in (0.0, 1e-5 - 1e-13)]
    scene, work = flagged(System(bodies, [Contact(), StokesDrag()]))
    clock = Implicit(1e-9).fresh_clock()
    work.motion[at.DEVIATION, 0, 0] = 1e-12
    clock[at.STAGED_STEP] = 1e-2
    stated_error.add_switch_errors(scene, work, clock, 1e-2, 1e-14)
    assert not work.bodies[:, at.DOUBT_SPEED].any()
    clock[at.STAGED_STEP] = 1e-6
    stated_error.add_switch_errors(scene, work, clock, 1e-6, 1e-14)
    assert (work.bodies[:, at.DOUBT_SPEED] > 0.0).all()


def corner_on_slab(force):
    """(scene, work, row) of a rod that stands aslant on a fixed slab with its lower end, of which a
    tangential force acts on the contact [N]."""
    slab = SpheroPolygon([(-2e-5, 0.0), (-2e-5, -5e-6), (2e-5, -5e-6), (2e-5, 0.0)], 1e-6)
    rod = SpheroPolygon([(-4e-6, -4e-6), (4e-6, 4e-6)], 1e-6)
    bodies = [
        Body(slab, (0.0, -2.5e-6), surface_density=2.0, fixed=True),
        Body(rod, (0.0, 6e-6 - 1e-12), surface_density=2.0),
    ]
    scene, work = flagged(System(bodies, [Contact(), StokesDrag()]))
    (row,) = np.flatnonzero(work.candidates[: work.tally[at.CANDIDATES], at.CLOSED] == at.TOUCHES)
    assert work.candidates[row, at.VERTEX_BODY] == 1
    work.slip[at.NOW, row] = -force / 2.0  # k_t is 2 N/m
    return scene, work, row


def test_what_a_pair_that_grazes_has_lost_counts_as_an_error():
    """By the law it parts again and again, and its tangential force is lost each time."""
    force, step = 1e-11, 1e-4
    scene, work, row = corner_on_slab(force)
    clock = Implicit(1e-9).fresh_clock()
    work.candidates[row, at.CLOSED] = at.GRAZES
    work.slip[at.GRAZING_FORCE, row] = force
    stated_error.add_switch_errors(scene, work, clock, step, 1e-12)
    least = force * step / scene.bodies[1, at.MASS]
    assert least < work.bodies[1, at.SWITCH_SPEED] < 40.0 * least


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_grazing_force_that_may_be_lost_moves_the_error_along_the_gap_and_enlarges_it(side):
    force = 1e-11
    scene, work, row = corner_on_slab(force)
    work.candidates[row, at.CLOSED] = at.GRAZES
    work.slip[at.GRAZING_FORCE, row] = force
    work.motion[at.CARRIED, 1, at.VX] = side * 1e-6
    assemble_jacobian(scene, work, 0.0, 1.0)
    pushed = work.motion[at.FORCING, 1, 3:]
    assert pushed[0] * side > 0.0
    assert abs(pushed[0]) == pytest.approx(stated_error.OF_BOUNDS * force, rel=1e-6)
    # What presses instead of it keeps the gap as it is.
    arm = work.geometry[at.NOW, row, at.VERTEX_ARM_N]
    opening = pushed[1] / scene.bodies[1, at.MASS] + arm * pushed[2] / scene.bodies[1, at.INERTIA]
    assert abs(opening) < 1e-6 * abs(pushed[0]) / scene.bodies[1, at.MASS]


def test_every_body_states_an_error_of_its_own(monkeypatch):
    """Within its island's sums, by its own vector."""
    monkeypatch.setattr(stated_error, "carry_vector", carry_error)
    bodies = [Body(Sphere(5e-6), (x, 0.0), surface_density=2.0) for x in (0.0, 2e-5, 4e-5)]
    system = System(bodies, [StokesDrag()], Implicit(1e-9))
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    assemble_jacobian(scene, work, 0.0, 1.0)
    clock = stepped(scene, work, 1e-9)
    work.bodies[:, at.ERROR_PLACE] = 1e-8, 1e-8, 2e-6
    work.bodies[:, at.STEP_PLACE] = 1e-30
    work.motion[at.CARRIED, :, 0] = 1e-9, 1e-9, 3e-7
    stated_error.carry_errors(scene, work, clock, 1e-9)
    own = stated_error.OF_VECTOR * 1e-9
    sums = Implicit.estimate_share * 2e-6
    assert work.bodies[:, at.STATED] == pytest.approx([own, own, sums])
    assert clock[at.ERROR] == work.bodies[:, at.STATED].max()


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
    states = run.work.bodies
    sums = system.integrator.estimate_share * states[:, at.ERROR_PLACE]
    sums += stated_error.OF_SWITCHES * states[:, at.SWITCH_PLACE]
    true = end_distance(bodies, run.motion()[1][-1], exact.position[-1])
    assert abs(run.work.motion[at.CARRIED, 1, at.Y]) < 0.05 * sums.max()
    assert true <= run.error <= sums.max()
