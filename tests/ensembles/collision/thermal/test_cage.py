"""Secondary minima that kicks do not lead out of."""

import numpy as np

from flocsim.ensembles.collision.meetings import GAPS, speeds_of
from flocsim.ensembles.collision.thermal.cage import caged_between
from flocsim.forces import DoubleLayer, StokesDrag, VanDerWaals

FORCES = (VanDerWaals(2e-19), DoubleLayer(50e-3, 20e-9))
"""A secondary minimum of hundreds of k_B T behind a barrier."""


def test_a_cage_has_the_barrier_on_both_sides():
    radii, mobility = (5e-6, 5e-6), 1e7
    speeds = speeds_of((*FORCES, StokesDrag()), None, radii, mobility)
    potential = np.append(0.0, -np.cumsum(
        0.5 * (speeds[1, 1:] + speeds[1, :-1]) * np.diff(GAPS)
    )) / mobility  # fmt: skip
    place = int(np.argmin(np.where(GAPS > 2e-8, potential, np.inf)))
    depth = potential[-1] - potential[place]
    low, high = caged_between(speeds, mobility, 0.0, 0.5 * depth)
    assert low < GAPS[place] < high
    for end in (low, high):
        assert potential[-1] - potential[end == GAPS][0] >= 0.5 * depth
    assert caged_between(speeds, mobility, 0.0, 1.1 * depth) == (0.0, 0.0)


def test_a_load_may_open_a_cage():
    speeds = speeds_of((*FORCES, StokesDrag()), None, (5e-6, 5e-6), 1e7)
    strongest = -speeds[1][GAPS > 2e-8].min() / 1e7
    assert caged_between(speeds, 1e7, 0.0, 1e-20)[1] > 0.0
    assert caged_between(speeds, 1e7, 2.0 * strongest, 1e-20) == (0.0, 0.0)


def test_what_attracts_everywhere_is_no_cage():
    speeds = speeds_of((VanDerWaals(1e-18),), None, (5e-6, 5e-6), 1e7)
    assert caged_between(speeds, 1e7, 0.0, 1e-21) == (0.0, 0.0)
