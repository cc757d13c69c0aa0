"""What the stages say about a contact's overlap."""

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.forces import Contact
from flocsim.integrators import DormandPrince54, Implicit
from flocsim.integrators.radau.carried_error import overlap_error
from flocsim.integrators.radau.tableau import NODES
from flocsim.integrators.rhs import stated_error

STIFFNESS = 20.0


def error_of(overlaps, turns):
    """overlap_error behind a step of so many 1/ω0 whose stages had these overlaps [m]."""
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
    return overlap_error(scene, work, clock, 0)


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


def test_explicit_methods_have_no_such_doubts():
    assert stated_error.overlap_error in Implicit().replaces
    assert stated_error.overlap_error not in DormandPrince54().replaces
    assert stated_error.overlap_error(None, None, None, 0) == 0.0
