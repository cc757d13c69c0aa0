"""The page on which flocs are chosen by eye: its pictures."""

import numpy as np
import pytest

from flocsim.io.plots.review import stretched


def test_a_dim_picture_becomes_visible():
    y, x = np.mgrid[:120, :160]
    shown = stretched(0.05 * (np.hypot(x - 60, y - 60) <= 15))
    assert shown.max() == 1.0 and shown.min() == 0.0
    light = np.linspace(0.01, 0.5, 100)[None] * np.ones((50, 1))
    assert np.percentile(stretched(light**3), 20) > 0.12
    assert np.percentile(stretched(light), 20) == pytest.approx(0.35, abs=0.01)
    for flat in (np.zeros((5, 5)), np.ones((5, 5)), np.full((5, 5), 0.3)):
        assert np.isfinite(stretched(flat)).all()
