"""What the stages say about a contact's overlap."""

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.forces import Contact
from flocsim.integrators import DormandPrince54, Implicit
from flocsim.integrators.radau.carried_error import doubt_of_release, overlap_error
from flocsim.integrators.radau.tableau import NODES
from flocsim.integrators.rhs import stated_error

STIFFNESS = 20.0


def behind(overlaps, turns):
    """(scene, work, clock) behind a step of so many 1/ω0 whose stages had these overlaps [m]."""
    bodies = [Body(Sphere(5e-6), (x, 0.0), surface_density=2.0) for x in (0.0, 1e-5 - 1e-10)]
    system = System(bodies, [Contact(k_n=STIFFNESS)])
    scene = system.scene(jit=False)
    run = system.begin(1e-9, jit=False)
    run.to_end()
    work = run.work
    work.tally[at.SERIES_TERMS] = 0
    assert work.geometry[at.NOW, 0, at.GAP] < 0.0
    work.geometry[at.FIRST_STAGE : at.FIRST_STAGE + 3, 0, at.GAP] = -np.asarray(overlaps)
    clock = Implicit(1e-9).fresh_clock()
    clock[at.STAGED_STEP] = turns / np.sqrt(STIFFNESS / (0.5 * scene.bodies[0, at.MASS]))
    return scene, work, clock


def error_of(overlaps, turns):
    return overlap_error(*behind(overlaps, turns), 0)


def doubt(before, overlaps):
    """Whether a contact of an overlap [m] is released, in a long step to these."""
    scene, work, clock = behind(overlaps, 1e3)
    work.geometry[at.NOW, 0, at.GAP] = -before
    work.candidates[0, at.CLOSED] = at.TOUCHES
    return doubt_of_release(scene, work, clock, clock[at.STAGED_STEP])


def on_a_line(at_end, slope):
    return [at_end + slope * (node - 1.0) for node in NODES]


@pytest.mark.parametrize("slope", [0.0, 1e-12, -3e-11])
def test_stages_on_a_line_leave_no_doubt(slope):
    assert error_of(on_a_line(1e-11, slope), 1e3) == pytest.approx(0.0, abs=1e-24)


@pytest.mark.parametrize("off", [1e-12, -4e-13])
def test_the_doubt_is_twice_how_far_the_end_lies_off_the_line(off):
    stages = on_a_line(1e-11, 5e-12)
    stages[2] += off
    assert error_of(stages, 1e3) == pytest.approx(2.0 * abs(off), rel=1e-9, abs=0.0)


def test_a_step_that_resolves_the_vibration_has_it_right():
    stages = on_a_line(1e-11, 0.0)
    stages[2] += 1e-12
    tenth = 0.1 * stated_error.UNRESOLVED
    assert error_of(stages, tenth) == pytest.approx(2e-14, rel=1e-6, abs=0.0)
    assert error_of(stages, 0.1) < 1e-17


@pytest.mark.parametrize("at_end", [0.6e-12, 1.1e-12, 1.5e-12])
def test_a_contact_may_let_go_where_its_overlap_falls_or_may_fall_for_all_that_is_known(at_end):
    """The end of one of 1 pm lies off the line of its stages by .5 pm: more than .4 of it."""
    stages = on_a_line(at_end + 0.5e-12, 0.0)
    stages[2] = at_end
    assert doubt(1e-12, stages) == pytest.approx(0.5 / 0.4)


def test_one_that_is_pressed_more_and_more_does_not():
    assert doubt(1e-12, on_a_line(4e-12, 3e-12)) == 0.0
    stages = on_a_line(4e-12, 3e-12)
    stages[2] += 0.5e-12
    assert doubt(1e-12, stages) == 0.0


def test_explicit_methods_have_no_such_doubts():
    assert stated_error.overlap_error in Implicit().replaces
    assert stated_error.overlap_error not in DormandPrince54().replaces
    assert stated_error.overlap_error(None, None, None, 0) == 0.0
