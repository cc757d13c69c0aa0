"""The efficiency integrated over delta, against integrals by hand."""

import numpy as np
import pytest

from flocsim.io.confidence import efficiency, weights

DELTA = np.array([1.0, 0.0, 0.2, 0.7])


@pytest.mark.parametrize(("axial", "of_linear", "of_one"), [(False, 0.5, 1.0), (True, 2 / 3, 1.0)])
def test_weights_integrate_what_is_linear_exactly_in_any_order(axial, of_linear, of_one):
    share = weights(DELTA, axial)
    assert share @ DELTA == pytest.approx(of_linear)
    assert share.sum() == pytest.approx(of_one)


def table(aggregated, missed, undecided):
    """Counts of 100 approaches at each delta."""
    classes = np.zeros((1, 1, len(aggregated), 4), int)
    classes[0, 0, :, 2] = aggregated
    classes[0, 0, :, 3] = 100 - np.add(aggregated, missed) - undecided
    total = np.full((1, 1, len(aggregated)), 100)
    return {"n_class": classes, "n_total": total, "n_undecided": 0 * total + undecided,
            "n_failed": 0 * total}  # fmt: skip


def test_misses_count_against_it_and_what_is_undecided_does_not():
    value, low, high = efficiency(table([50, 50], [50, 0], 0), np.array([0.0, 1.0]), False)
    assert value[0, 0] == pytest.approx(0.5) and low[0, 0] < 0.5 < high[0, 0]
    value, *_ = efficiency(table([40, 40], [0, 40], 20), np.array([0.0, 1.0]), True)
    assert value[0, 0] == pytest.approx(0.5)


def test_a_step_at_half_the_offset_is_a_quarter_of_the_area():
    places = np.array([0.0, 0.4999, 0.5001, 1.0])
    found = table([100, 100, 0, 0], [0, 0, 100, 100], 0)
    assert efficiency(found, places, True)[0][0, 0] == pytest.approx(0.25, abs=1e-4)
    assert efficiency(found, places, False)[0][0, 0] == pytest.approx(0.5, abs=1e-4)


def test_there_is_none_where_the_offsets_do_not_reach():
    assert efficiency(table([1, 1], [0, 0], 0), np.array([0.0, 0.9]), True) is None
