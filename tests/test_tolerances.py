"""Comparisons of small numbers can fail: see conftest.py."""

import numpy as np
import pytest


def test_numbers_far_below_a_picometre_are_told_apart():
    assert pytest.approx(2e-14, rel=1e-6) != 1e-14
    assert pytest.approx([2e-14], rel=1e-6) != [1e-14]
    assert np.array([1e-14]) != pytest.approx(np.array([2e-14]), rel=1e-6)
    assert pytest.approx({"mass": 2e-14}, rel=1e-6) != {"mass": 1e-14}
    assert pytest.approx(1e-14, rel=1e-6) == 1e-14 * (1.0 + 1e-7)
    assert pytest.approx(1e-14, rel=1e-6, abs=1e-12) == 2e-14
