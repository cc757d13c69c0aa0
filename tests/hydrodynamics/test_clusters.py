"""How clusters move through slow flow: pairs, boundary elements, and what no numbering changes."""

import numpy as np
import pytest

from flocsim.hydrodynamics import SpherePair, rigid_bodies
from flocsim.hydrodynamics.panels import panels_of
from flocsim.hydrodynamics.rigid_bodies import (
    RIGID_REDUCTION_ACROSS,
    RIGID_REDUCTION_ALONG,
    mobilities,
)
from tests.helpers.prisms import loads_of
from tests.helpers.tiers import rest_slow

RADIUS = 2.0e-6
ALONE = 1.0 / (6.0 * np.pi)
TURN = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
DISC = np.column_stack([np.cos(TURN), np.sin(TURN)])
SHAPES = {
    "doublet": [(0, 0), (2, 0)],
    "row": [(0, 0), (2, 0), (4, 0)],
    "elbow": [(0, 0), (2, 0), (2, 2)],
    "triangle": [(0, 0), (2, 0), (1, 3.0**0.5)],
}


def mobility(places, radii=None):
    """The tensor (2, 2) of one cluster of spheres, over that of a sphere of radius 1."""
    places = np.array(places, dtype=float)
    n = len(places)
    radii = np.ones(n) if radii is None else np.array(radii, dtype=float)
    own = np.column_stack([ALONE / radii, 0.0 * radii, ALONE / radii])
    found = mobilities(np.zeros(n, dtype=int), places, radii, own)
    xx, xy, yy = found[0] / ALONE
    return np.array([[xx, xy], [xy, yy]])


def by_boundary_elements(places, count=80):
    """(the same of disc prisms, and the radius of the sphere with the drag of one of them)."""
    size = np.sqrt((0.5 * 4.0 / 3.0 * 2.0 * np.pi + np.pi) / count)
    middle = np.mean(places, axis=0)
    several, alone = (
        np.linalg.inv(
            loads_of([panels_of([DISC + place - middle], 4.0 / 3.0, size) for place in each])
        )[:2, :2]
        / ALONE
        for each in (np.array(places), [middle])
    )
    return several, 2.0 / np.trace(alone)


def test_two_that_touch_are_exact():
    pair = SpherePair((1.0, 1.0), ALONE)
    along = 2.0 / pair.along(1e-6)[0][0].sum()
    across = 2.0 / pair.across(1e-6)[0][0, :2, :2].sum()
    assert 2.0 * np.diag(mobility(SHAPES["doublet"])) == pytest.approx([along, across], rel=1e-3)
    assert along == pytest.approx(1.5497, abs=1e-3)
    plain = [0.625, 0.4375]
    assert 1.0 - (np.array([along, across]) - 1.0) / plain == pytest.approx(
        [RIGID_REDUCTION_ALONG, RIGID_REDUCTION_ACROSS], abs=2e-3
    )


@pytest.mark.parametrize("ratio", [1.0, 0.5])
@pytest.mark.parametrize("gap", rest_slow([0.05, 0.3, 1.0, 4.0], lambda gap: gap == 0.3))
def test_two_apart_are_nearly_exact(gap, ratio):
    pair = SpherePair((1.0, ratio), ALONE)
    along = 1.0 / pair.along(gap)[0][0].sum()
    across = 1.0 / pair.across(gap)[0][0, :2, :2].sum()
    found = mobility([(0, 0), (1.0 + ratio + gap, 0)], [1.0, ratio])
    assert np.diag(found) == pytest.approx([along, across], rel=0.02)


@pytest.mark.parametrize("shape", SHAPES)
def test_doublets_and_triplets_move_as_boundary_elements_do(shape):
    exact, radius = by_boundary_elements(SHAPES[shape])
    found = mobility(SHAPES[shape], [radius] * len(SHAPES[shape]))
    assert np.linalg.eigvalsh(found) == pytest.approx(np.linalg.eigvalsh(exact), rel=0.02)


@pytest.fixture(scope="module")
def drawn():
    """A walk of spheres of several sizes, some of which overlap."""
    rng = np.random.default_rng(3)
    turns = rng.normal(size=40).cumsum()
    places = np.cumsum(1.9 * np.column_stack([np.cos(turns), np.sin(turns)]), axis=0)
    return places, rng.uniform(0.5, 1.5, 40)


def test_a_cluster_may_be_turned_moved_renumbered_and_scaled(drawn):
    places, radii = drawn
    there = mobility(places, radii)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s], [s, c]])
    assert mobility(places @ turn.T + [5, -3], radii) == pytest.approx(
        turn @ there @ turn.T, rel=1e-9
    )
    order = np.random.default_rng(0).permutation(40)
    assert mobility(places[order], radii[order]) == pytest.approx(there, rel=1e-9)
    assert mobility(3.0 * places, 3.0 * radii) == pytest.approx(there / 3.0, rel=1e-9)
    assert mobility(places * [1, -1], radii) == pytest.approx(there * [[1, -1], [-1, 1]], rel=1e-9)


def test_a_cluster_resists_less_than_its_bodies_alone_and_more_than_any(drawn):
    places, radii = drawn
    for count in (2, 5, 40):
        values = np.linalg.eigvalsh(mobility(places[:count], radii[:count]))
        assert 1.0 / radii[:count].sum() < values[0] <= values[1] < 1.0 / radii[:count].max()


def test_cells_of_many_bodies_count_as_the_bodies_do(monkeypatch):
    rng = np.random.default_rng(4)
    turns = 0.5 * rng.normal(size=400).cumsum()
    places = np.cumsum(2.0 * np.column_stack([np.cos(turns), np.sin(turns)]), axis=0)
    radii = rng.uniform(0.7, 1.0, 400)
    by_cells = mobility(places, radii)
    monkeypatch.setattr(rigid_bodies, "ALL_PAIRS_UP_TO", 1000)
    assert by_cells == pytest.approx(mobility(places, radii), rel=1e-2, abs=1e-3)
