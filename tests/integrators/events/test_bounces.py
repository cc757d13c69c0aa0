"""No bounce that is to be seen is left out."""

import math

import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.forces import Contact, Gravity
from flocsim.integrators import Implicit, Status


def test_no_bounce_is_left_out():
    """A disc that bounces for ever, and gives nothing away: every bounce is in the record."""
    floor = Body(SpheroPolygon([(-2e-5, 0.0), (2e-5, 0.0)], 1e-6), fixed=True, density=1e3)
    disc = Body(Sphere(4e-6), (0.0, 1.5e-5), density=2650.0)
    contact = Contact(k_n=20.0, k_t=0.0, damping_n=0.0, damping_t=0.0)
    run = System([floor, disc], [Gravity(), contact], Implicit()).run(0.06, jit=False)
    rises = np.diff(np.sign(run.velocity[:, 1, 1])) > 0
    fall = math.sqrt(2.0 * 1e-5 / 9.81)
    assert run.status == Status.FINISHED
    assert abs(rises.sum() - round(0.5 * (0.06 / fall + 1.0))) <= 1
    assert run.position[:, 1, 1].max() == pytest.approx(1.5e-5, abs=2e-8)
