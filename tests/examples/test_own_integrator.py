"""The worked example of an integrator of one's own, in a System and against VelocityVerlet."""

import numpy as np
import pytest

from examples.own_integrator import SemiImplicitEuler
from flocsim import Body, Sphere, System
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators import Implicit, VelocityVerlet

FORCES = [Gravity(), StokesDrag(), Contact(k_n=20.0, k_t=2.0, damping_n=2e4)]


def thrown():
    """A spinning sphere that falls on a fixed one, off its middle."""
    still = Body(Sphere(5e-6), fixed=True, surface_density=2.0)
    falling = Body(
        Sphere(5e-6), (2e-6, 10.2e-6), velocity=(0.0, -0.05), spin=500.0, surface_density=2.0
    )
    return [still, falling]


def end(integrator, jit):
    found = System(thrown(), FORCES, integrator).run(3e-5, record=False, jit=jit)
    assert found.status.name == "FINISHED"
    return found.position[-1, 1]


def test_it_converges_to_the_truth_with_order_one():
    exact = end(Implicit(1e-12), False)
    errors = [
        np.abs(end(SemiImplicitEuler(step), False) - exact)[:2].max() for step in (4e-8, 2e-8)
    ]
    assert errors[1] < 2e-9
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.4)


def test_it_is_no_longer_than_forty_lines_and_imports_nothing_private():
    from pathlib import Path

    import examples.own_integrator as example

    text = Path(example.__file__).read_text("utf-8")
    imported = [line for line in text.splitlines() if line.startswith(("import", "from"))]
    assert len(text.splitlines()) <= 40
    assert imported == ["import attrs", "from flocsim.integrators.parts import ("]
    assert np.abs(end(VelocityVerlet(4e-8), False) - end(Implicit(1e-12), False))[:2].max() < 2e-9
