"""Core points of shapes: where an outline goes straight on there is none."""

import numpy as np
import pytest

from flocsim import SpheroPolygon
from flocsim.geometry.contact.core_points import core_points

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]) * 1e-5


def count(vertices):
    return len(core_points(SpheroPolygon(vertices, 1e-6)))


@pytest.mark.parametrize("share", [0.5, 1e-3, 1.0 / 3.0])
def test_a_joint_of_two_edges_in_one_line_is_no_corner(share):
    joint = SQUARE[0] + share * (SQUARE[1] - SQUARE[0])
    assert count(np.insert(SQUARE, 1, joint, axis=0)) == 4


@pytest.mark.parametrize("height", [1e-12, -1e-12])
def test_the_least_bend_is_a_corner(height):
    assert count(np.insert(SQUARE, 1, (5e-6, height), axis=0)) == 5


def test_a_triangle_keeps_its_corners():
    assert count(SQUARE[:3]) == 3
