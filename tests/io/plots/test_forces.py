"""The figure of forces against time."""

import numpy as np
import pytest

from flocsim.errors import UsageError
from flocsim.io.plots.collision import draw_forces
from flocsim.io.plots.style import save


def test_what_pushes_is_solid_and_what_pulls_is_dashed():
    times = np.linspace(0.0, 1e-3, 4)
    forces = {"push": np.full(4, 1e-9), "pull": np.full(4, -2e-9)}
    axes = draw_forces(times, forces, 5e-4).axes[0]
    drawn = [np.nan_to_num(line.get_ydata()).max() for line in axes.get_lines()[:4]]
    assert drawn == pytest.approx([1.0, 0.0, 0.0, 2.0])
    assert axes.get_yscale() == "log"


def test_forces_of_nothing_can_be_drawn(tmp_path):
    save(draw_forces([0.0, 1.0], {"none": np.zeros(2)}), tmp_path / "f.png")
    assert (tmp_path / "f.png").stat().st_size > 0


def test_lengths_must_agree():
    with pytest.raises(UsageError, match="one force per time"):
        draw_forces([0.0], {"two": np.zeros(2)})
