"""Where rays meet pieces of outlines, and what lies beside them."""

import math

import numpy as np
import pytest

from flocsim.geometry.shapes.pieces import Placed, at_parameter, parameter_before


def segment(x, y, angle, half):
    return Placed(x, y, math.cos(angle), math.sin(angle), half, 0.0, x, y, half, 0.0)


def arc(x, y, angle, radius, half):
    way = math.cos(angle), math.sin(angle)
    return Placed(x, y, *way, math.tan(0.5 * half), radius, x, y, radius, radius)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("kind", [segment, arc])
def test_a_ray_meets_a_piece_where_it_began(kind, seed):
    """From a point that a piece has before it, straight or askew, it is met where it was left."""
    random = np.random.default_rng(seed)
    angle = random.uniform(0.0, 6.28)
    piece = segment(0.3, -0.2, angle, 1.0) if kind is segment else arc(0.3, -0.2, angle, 0.7, 1.2)
    wanted = random.uniform(-0.6, 0.6)
    x, y, nx, ny, _ = at_parameter(piece, wanted)
    askew, away = random.uniform(-0.5, 0.5), random.uniform(0.1, 2.0)
    way = nx * math.cos(askew) - ny * math.sin(askew), ny * math.cos(askew) + nx * math.sin(askew)
    start, back = (x + away * way[0], y + away * way[1]), (-way[0], -way[1])
    assert parameter_before(piece, *start, back, 1.01 * away) == pytest.approx(wanted, abs=1e-12)
    assert parameter_before(piece, *start, back, 0.99 * away) == math.inf
    assert parameter_before(piece, *start, way, 10.0 * away) == math.inf


def test_a_ray_that_passes_a_circle_meets_nothing():
    assert parameter_before(arc(0.0, 0.0, 0.0, 1.0, 1.0), 2.0, 1.1, (-1.0, 0.0), 9.0) == math.inf
    assert parameter_before(segment(0.0, 0.0, 0.0, 1.0), 0.0, 1.0, (1.0, 0.0), 9.0) == math.inf
