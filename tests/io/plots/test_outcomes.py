"""Bars of outcomes, and the axis of a sweep."""

from pathlib import Path

import attrs
import numpy as np
import pytest

from flocsim.io.labelled import Column
from flocsim.io.plots.curves import against_key
from flocsim.io.plots.outcomes import COLOURS
from flocsim.io.plots.results import FIGURES
from flocsim.io.plots.style import save
from flocsim.io.results.events import ends_of
from flocsim.io.results.schema import NOT_APPLICABLE, OUTCOMES
from flocsim.io.results.sweep_file import SweepResults, Swept
from tests.helpers.synthetic_results import make_results
from tests.helpers.tabulate import tabulate
from tests.helpers.tiers import rest_slow

HELD = OUTCOMES.index("held")


def held_at_last(results, values, unit="V"):
    """A SweepResults of these results at each value; at the last all replicates are held."""
    found = results.labelled("probabilities")
    codes = results.replicates["outcome"]
    none = np.full(codes.shape, NOT_APPLICABLE)
    last = tabulate(np.full(codes.shape, HELD), none, none)
    tables = [found] * (len(values) - 1)
    swept = Swept("forces.double_layer.potential", list(values), unit)
    columns = {}
    for name, column in found.columns.items():
        stacked = np.stack([*(each.columns[name].values for each in tables), last[name]])
        columns[name] = Column(("potential", *column.axes), stacked, column.about)
    axes = {"potential": swept.column("potential"), **found.axes}
    group = attrs.evolve(found, axes=axes, columns=columns)
    return SweepResults(Path("s.h5"), {"potential": swept}, {"probabilities": group})


def stacks(axes, number):
    """[(bottom, top)] of the ends of a bar's place, of each kind, in order."""
    return [np.array(each.get_segments())[:, :, 1][number]
            for each in axes.collections[: len(COLOURS)]]  # fmt: skip


def test_bars_are_shares_of_all_replicates_and_add_up_to_1():
    results = make_results()
    figure = FIGURES["outcomes"](results)
    ends = ends_of(results.probabilities)
    assert np.all(sum(ends.values()) == results.count)
    for number, axes in enumerate(axes for axes in figure.axes if axes.axison):
        for k, n in enumerate(np.argsort(results.vertices)):
            drawn = stacks(axes, k)
            assert drawn[0][0] == 0.0 and drawn[-1][1] == pytest.approx(1.0)
            for (low, high), count in zip(drawn, ends.values(), strict=True):
                assert high - low == pytest.approx(count[number, n, 0] / results.count)


@pytest.mark.parametrize(
    ("values", "scale"),
    rest_slow(
        [((10e-3, 25e-3, 50e-3), "linear"), ((1e-3, 1e-2, 1.0), "log")],
        lambda values, scale: scale == "log",
    ),
)
def test_every_value_is_on_the_axis_whatever_has_no_value(values, scale, tmp_path):
    found = held_at_last(make_results(types=("I", "II"), vertices=(1, 16)), values)
    figure = against_key(found)
    save(figure, tmp_path / "sweep.png")
    for axes in figure.axes:
        low, high = axes.get_xlim()
        assert axes.get_xscale() == scale
        assert all(low < value < high for value in values)
        np.testing.assert_allclose(axes.get_xticks(), values)
    for below in figure.axes[2:]:
        # Points stand at their values, and beside them by points of the page alone.
        for container in (c for c in below.containers if c.lines[0] is not None):
            np.testing.assert_allclose(container.lines[0].get_xdata(), values)
