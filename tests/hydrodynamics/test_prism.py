"""Drag of outlines: spheroids and prisms whose drag is known, symmetry, and real flocs."""

import numpy as np
import pytest

from benchmarks.accuracy.prism_drag import SHAPES, reference, regular, turned
from flocsim import SpheroPolygon
from flocsim.errors import UsageError
from flocsim.hydrodynamics import prism_drag, rigid_bodies
from tests.helpers.real_images import silhouettes

TURN = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
DISC = np.column_stack([np.cos(TURN), np.sin(TURN)])
ELLIPSE = DISC * [2.0**0.5, 0.5**0.5]
HOOK = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]], dtype=float) - [1.3, 0.9]


RECTANGLE = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
HEXAGON = regular(6)


def test_a_disc_prism():
    drag = prism_drag([DISC])
    assert drag.mobility == pytest.approx(0.9615, rel=2e-3)
    # The torque is twice the polarisability of a conducting cylinder across its axis, as each
    # component of the swirl is harmonic: 30.99 from a charge equation.
    assert drag.turning == pytest.approx(8.0 * np.pi / 30.99, rel=5e-3)
    assert drag.elongation < 1e-9 and drag.radius == pytest.approx(1.0, rel=1e-3)
    assert np.abs(drag.resistance[2, :2]).max() < 1e-9


def test_a_thin_disc_has_the_exact_drag_of_a_disc():
    drag = prism_drag([DISC], 1e-3)
    # 32/3 for motion in its plane and for spin; Happel and Brenner (1983), sections 5-11 and 6-10.
    assert np.diag(drag.resistance) == pytest.approx(np.full(3, 32.0 / 3.0), rel=drag.error)
    assert drag.error < 0.02


def off_by(drag, wanted):
    """The largest error of an element of R and Γ over √(R_ii R_jj)."""
    scale = np.sqrt(np.diag(wanted[:, :3]))
    off = (np.hstack([drag.resistance, drag.strain]) - wanted) / scale[:, None]
    return np.abs(off / scale[[0, 1, 2, 2, 2]]).max()


# R_xx, R_yy, R_ss and the largest |Γ| of a strain by spin, by python -m
# benchmarks.accuracy.prism_drag.
@pytest.mark.parametrize("angle", [0.0, 0.7])
@pytest.mark.parametrize(("ring", "depth", "wanted"), [
    (RECTANGLE * [1, 1], 1.0, (12.716, 12.716, 8.057, 0.0)),
    (RECTANGLE * [2, 1], 1.0, (15.435, 17.153, 22.092, 10.942)),
    (RECTANGLE * [4, 1], 2.0, (25.255, 30.877, 121.40, 96.18)),
    (HEXAGON, 1.0, (16.898, 16.898, 22.126, 0.0)),
], ids=["square", "2:1", "4:1", "hexagon"])  # fmt: skip
def test_symmetric_prisms_are_right_within_the_stated_error(ring, depth, wanted, angle):
    loads = np.zeros((3, 5))
    loads[range(3), range(3)], loads[2, 4] = wanted[:3], wanted[3]
    ring, loads = turned(ring, loads, angle)
    drag = prism_drag([ring], depth)
    assert off_by(drag, loads) < drag.error < 0.015
    # No motion goes with another unless symmetry allows it.
    zero = np.abs(loads) < 1e-9
    assert np.abs(np.hstack([drag.resistance, drag.strain])[zero]).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["triangle of three sides", "L", "square, depth 0.2"])
def test_prisms_are_right_within_the_stated_error(name):
    ring, depth = SHAPES[name]
    wanted = reference(ring, depth, (4, 6))
    for angle in (0.0, 1.0, 2.5):
        place, loads = turned(ring, wanted, angle)
        drag = prism_drag([place], depth)
        assert off_by(drag, loads) < drag.error < 0.015


def test_a_triangle_with_a_mirror_line_drifts_and_turns_as_it_may():
    drag = prism_drag([np.array([[0.0, -1.0], [3.0, 0.0], [0.0, 1.0]])])
    rest = np.hstack([drag.resistance, drag.strain])
    # Mirrored in y: v_x and E_xx belong together, and v_y, spin and E_xy.
    assert np.abs(rest[[0, 0, 0, 1, 2, 1, 2], [1, 2, 4, 0, 0, 3, 3]]).max() < 1e-9 * rest.max()


def test_rounded_corners_leave_a_shape_symmetric():
    drag = prism_drag(SpheroPolygon(HEXAGON, 0.2).outline())
    rest = np.hstack([drag.resistance, drag.strain])
    assert np.abs(rest - np.diag(np.diag(drag.resistance)) @ np.eye(3, 5)).max() < 1e-9


def test_panels_with_their_middle_at_a_vertex_have_finite_loads():
    """Rounded to so many decimals, the middle is next to a line of an edge and not on it."""
    for decimals in (7, 9, 11, 13):
        for count in (16, 28, 40):
            turn = 2.0 * np.pi * np.arange(count) / count
            drag = prism_drag([np.round(np.column_stack([np.cos(turn), np.sin(turn)]), decimals)])
            assert np.isfinite(drag.resistance).all() and drag.error < 0.1


def test_a_ring_that_crosses_itself_is_refused():
    with pytest.raises(UsageError, match="not simple"):
        prism_drag([np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 1.0]])])


def test_an_ellipse_of_two_to_one():
    drag = prism_drag([ELLIPSE])
    assert drag.mobility == pytest.approx([0.9952, 0.8722], rel=5e-3)
    # Of an ellipsoid (a² − b²)/(a² + b²).
    assert drag.elongation == pytest.approx(0.6, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_stated_error_covers_finer_panels(monkeypatch, seed):
    rng = np.random.default_rng(seed)
    turn = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    modes = sum(0.3 * rng.normal() / k * np.cos(k * turn + rng.uniform(0, 7)) for k in range(2, 9))
    ring = np.maximum(1.0 + modes, 0.3)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    usual = prism_drag([ring])
    monkeypatch.setattr(rigid_bodies, "PANELS", 72)
    finer = prism_drag([ring])
    assert off_by(usual, np.hstack([finer.resistance, finer.strain])) < usual.error < 0.1


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
