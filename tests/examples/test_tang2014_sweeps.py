"""The parts of examples/tang2014 that compute: transitions, and filling the page."""

import numpy as np

from tests.helpers.small_study import ROOT

FOLDER = ROOT / "examples" / "tang2014"


def step_sweep(sweeps, values, thresholds):
    """A Sweep in which replicate k aggregates from the value thresholds[k] on, for one type."""
    aggregated = (np.asarray(values)[:, None] >= np.asarray(thresholds))[:, None]
    return sweeps.Sweep("x", np.asarray(values), np.ones_like(aggregated), aggregated,
                        np.zeros_like(aggregated))  # fmt: skip


def test_a_transition_is_where_the_replicates_change(example):
    sweeps = example("sweeps")
    rng = np.random.default_rng(0)
    values = np.geomspace(1e-3, 1e3, 61)
    found = step_sweep(sweeps, values, 10.0 ** rng.normal(0.0, 0.5, 400))
    for level, exact in ((0.5, 1.0), (0.05, 10 ** (-0.5 * 1.645)), (0.95, 10 ** (0.5 * 1.645))):
        value, low, high = sweeps.transition(found, 0, level)
        assert low < value < high
        assert low / 1.1 < exact < high * 1.1
        assert high / low < 2.0


def test_open_replicates_are_told_apart(example):
    sweeps = example("sweeps")
    outcomes = iter(np.array([[0, 1, 4, 5], [2, 3, 6, 6]])[:, None, None, None])

    class Fake:
        def __init__(self):
            self.replicates = {"outcome": next(outcomes)}

    sweeps.run = lambda config: Fake()
    found = sweeps.sweep("x", [1.0, 2.0], lambda value: value)
    assert found.bands[0].tolist() == [[0.5], [0.5]]
    np.testing.assert_allclose(found.open_share, [[1 / 3], [0.5]])


def test_the_page_is_filled_by_names(example, tmp_path):
    page = example("fill_page")
    (tmp_path / "summary.md").write_text("<!-- a -->\n\nnew\n\n<!-- end -->\n")
    text = "x\n<!-- a -->\nold\n<!-- end -->\ny\n<!-- b-c -->\nkept\n<!-- end -->\n"
    assert page.filled(text, page.parts_of(tmp_path)) == text.replace("old", "\nnew\n")


def test_every_part_of_the_page_has_a_writer(example):
    page = example("fill_page")
    text = page.PAGE.read_text("utf-8")
    written = "".join(path.read_text("utf-8") for path in FOLDER.glob("*.py"))
    for match in page.PART.finditer(text):
        assert f'"{match[1]}"' in written or f"<!-- {match[1]} -->" in written
    for name in page.FIGURE.findall(text):
        assert (page.PAGE.parents[1] / "figures" / f"tang2014-{name}").exists()
