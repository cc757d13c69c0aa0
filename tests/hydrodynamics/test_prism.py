"""Drag of outlines: spheroids and prisms whose drag is known, symmetry, and real flocs."""

import numpy as np
import pytest

from flocsim.errors import UsageError
from flocsim.hydrodynamics import prism_drag, rigid_bodies
from tests.helpers.real_images import silhouettes

TURN = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
DISC = np.column_stack([np.cos(TURN), np.sin(TURN)])
ELLIPSE = DISC * [2.0**0.5, 0.5**0.5]
HOOK = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]], dtype=float) - [1.3, 0.9]


def test_a_disc_prism():
    drag = prism_drag([DISC])
    assert drag.mobility == pytest.approx(0.976, rel=0.015)
    assert drag.turning == pytest.approx(0.830, rel=0.02)
    assert drag.elongation < 2e-3 and drag.radius == pytest.approx(1.0, rel=1e-3)
    assert np.abs(drag.resistance[2, :2]).max() < 3e-2


def test_an_ellipse_of_two_to_one():
    drag = prism_drag([ELLIPSE])
    assert drag.mobility == pytest.approx([1.007, 0.886], rel=0.015)
    # Of an ellipsoid (a² − b²)/(a² + b²).
    assert drag.elongation == pytest.approx(0.6, rel=0.03)


@pytest.mark.slow
def test_the_stated_error_covers_a_finer_covering(monkeypatch):
    usual = prism_drag([HOOK])
    monkeypatch.setattr(rigid_bodies, "SPHERES", (300, 600, 1200))
    finer = prism_drag([HOOK])
    assert np.all(np.abs(finer.mobility / usual.mobility - 1.0) < usual.error)
    assert abs(finer.turning / usual.turning - 1.0) < usual.error < 0.05


def test_resistance_is_positive_symmetric_and_scales():
    drag, large = prism_drag([HOOK]), prism_drag([3.0 * HOOK])
    assert np.array_equal(drag.resistance, drag.resistance.T)
    assert np.linalg.eigvalsh(drag.resistance).min() > 0.0
    powers = np.array([1.0, 1.0, 2.0])
    scale = 3.0 ** (powers[:, None] + powers - 1.0)
    assert large.resistance == pytest.approx(scale * drag.resistance, rel=1e-6, abs=1e-6)
    assert large.strain == pytest.approx(3.0 ** (powers[:, None] + 1.0) * drag.strain, rel=1e-6)


def test_elsewhere_the_resistance_is_that_of_the_same_body():
    away = np.array([2.0, -1.0])
    shift = np.eye(3)
    # v at the old origin by v and spin at the new one.
    shift[:2, 2] = -away[1], away[0]
    drag, moved = prism_drag([HOOK]), prism_drag([HOOK + away])
    expected = shift.T @ drag.resistance @ shift
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((moved.resistance - expected) / scale).max() < 0.01


def test_holes_count():
    ring = prism_drag([DISC, 0.6 * DISC[::-1]])
    assert ring.radius == pytest.approx(0.8, rel=1e-3)
    # What is let through and what is not: less area, as wide.
    assert ring.mobility.max() < prism_drag([DISC]).mobility.min()


@pytest.mark.slow
def test_real_flocs():
    found = []
    for mask, _ in silhouettes()[:8]:
        # The runs of its pixels as an outline: the marching of the mask's corners.
        import shapely

        rows, columns = np.nonzero(mask)
        squares = shapely.box(columns, rows, columns + 1.0, rows + 1.0)
        whole = shapely.union_all(squares)
        largest = max(getattr(whole, "geoms", [whole]), key=lambda each: each.area)
        ring = np.asarray(largest.exterior.coords)
        found.append(prism_drag([ring - ring.mean(axis=0)]))
    sinking = np.mean([np.mean(each.mobility) for each in found])
    assert sinking == pytest.approx(0.923, abs=0.03)
    assert np.mean([each.turning for each in found]) == pytest.approx(0.60, abs=0.09)


@pytest.mark.parametrize(("rings", "depth", "words"), [
    ([np.zeros((3, 2))], None, "must hold an area above 0"),
    ([DISC], 0.0, "depth of a prism must be above 0 m, found 0.0"),
    ([DISC], float("nan"), "depth of a prism"),
])  # fmt: skip
def test_what_is_no_prism(rings, depth, words):
    with pytest.raises(UsageError, match=words):
        prism_drag(rings, depth)
