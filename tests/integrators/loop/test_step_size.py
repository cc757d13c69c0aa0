"""The first step behind a touch, told by the speed of it and by how stiff the contact is."""

import math

import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.arrays import work_of
from flocsim.compiler.composer import compose
from flocsim.forces import Contact
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators import Implicit
from flocsim.integrators.loop.step_size import step_behind_touch

R = 10e-6


def first_step(speed, k_n=20.0, tolerance=1e-9):
    """Behind the touch of two spheres at a speed [m/s], which is remembered for 0.1 ms."""
    bodies = [
        Body(Sphere(R), (0.0, 0.0), velocity=(speed, 0.0), density=2650.0),
        Body(Sphere(R), (2.0 * R - 1e-13, 0.0), density=2650.0),
    ]
    integrator = Implicit(tolerance=tolerance)
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
    assert first_step(0.01) * frequency == pytest.approx(0.1, rel=1e-6)


def test_it_goes_with_the_root_of_the_stiffness_and_the_fourth_root_of_what_is_allowed():
    step = first_step(0.01)
    assert first_step(0.01, k_n=2000.0) == pytest.approx(0.1 * step)
    assert first_step(0.16) == pytest.approx(0.5 * step)
    assert first_step(0.01, tolerance=16e-9) == pytest.approx(2.0 * step)


def test_contacts_that_part_need_none():
    assert first_step(-0.01) == math.inf
