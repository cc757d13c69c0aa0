"""How smooth the gap of two outlines may be: lengths of change, and the line below them."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Fluid
from flocsim.forces import DoubleLayer, SurfaceForce, VanDerWaals
from flocsim.forces.outline import decay_lengths, smoothness

GAPS = np.geomspace(1e-11, 1e-3, 160)


@pytest.mark.parametrize("force", [
    DoubleLayer(debye_length=0.98e-6, gap="surface"), DoubleLayer(debye_length=3e-9, gap="surface"),
])  # fmt: skip
def test_an_exponential_changes_over_its_decay_length(force):
    found = decay_lengths(force, Fluid())[GAPS[:-1] < 0.4 * force.reach]
    assert found == pytest.approx(force.debye_length, rel=0.05)


@attrs.frozen
class Even(SurfaceForce):
    """The same at all gaps."""

    @staticmethod
    def kernel(pair):
        return 1e-9


@attrs.frozen
class Film(SurfaceForce):
    """In proportion to the gap's rate, in either direction, and falling with it over 50 nm."""

    @staticmethod
    def kernel(pair):
        return -1e-3 * pair.gap_rate * math.exp(-pair.gap / 5e-8)


@pytest.mark.parametrize("forces", [
    [VanDerWaals(gap="surface")],
    [DoubleLayer(debye_length=3e-8, gap="surface")],
    [VanDerWaals(d_min=1e-10, gap="surface"), DoubleLayer(debye_length=1e-7, gap="surface")],
    [Film(), Even()],
])  # fmt: skip
def test_the_line_stays_below_the_lengths_of_all_forces(forces):
    least, slope, most = smoothness(forces, Fluid())
    line = np.minimum(least + slope * GAPS[:-1], most)
    for force in forces:
        within = GAPS[:-1] < min(force.reach, 1e-4)
        assert np.all(line[within] <= decay_lengths(force, Fluid())[within] * (1.0 + 1e-9))
    assert line.min() > 0.0
