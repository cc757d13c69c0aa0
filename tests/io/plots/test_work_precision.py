"""The picture of a ladder: every rung has its place, what never flipped has one, too."""

import numpy as np

from flocsim.commands.work_precision import COLOURS, Rung, draw_ladders


def rung(method, tolerance, flips, cpu):
    return Rung(method, tolerance, 50, flips, 0.0, 0.1, tolerance, 10 * tolerance, cpu, 0)


PANELS = {
    "I": [rung("Implicit", 1e-6, 5, 1.0), rung("Implicit", 1e-7, 0, 2.0),
          rung("DormandPrince54", 1e-6, 4, 4.0), rung("DormandPrince54", 1e-7, 1, 3.0)],
    "III": [rung("Implicit", 1e-6, 0, 1.0), rung("Implicit", 1e-7, 0, 2.0)],
}  # fmt: skip


def lines_of(axes):
    """{label: (x, y)} of the lines of an axes."""
    found = {each.get_label(): each[0] for each in axes.containers}
    return {name: np.array(found[name].get_data(), float) for name in COLOURS}


def test_what_flips_is_drawn_where_it_was_measured():
    figure = draw_ladders(PANELS, {"I": ("Implicit", 1e-7)}, 0.01)
    axes = figure.axes
    assert [each.get_title(loc="left") for each in axes[:2]] == ["(a) Type I", "(b) Type III"]
    lines = lines_of(axes[0])
    np.testing.assert_allclose(lines["Implicit"], [[1.0], [10.0]])
    np.testing.assert_allclose(lines["DormandPrince54"], [[4.0, 3.0], [8.0, 2.0]])
    assert all(each.get_xscale() == each.get_yscale() == "log" for each in axes)


def test_what_is_recommended_has_a_ring_in_both_panels():
    figure = draw_ladders(PANELS, {"I": ("Implicit", 1e-7), "III": ("Implicit", 3e-7)}, 0.01)
    rings = [sum(line.get_markersize() == 11 for line in each.lines) for each in figure.axes]
    assert rings == [1, 0, 1, 0]
