"""Figures show the numbers of the results, and say where there are none."""

from itertools import product

import attrs
import numpy as np
import pytest

from flocsim.io.confidence import wilson
from flocsim.io.plots.results import FIGURES, against_size, figure_4, figure_8
from flocsim.io.plots.style import save
from flocsim.io.results.events import FEW
from flocsim.io.results.schema import POOLED
from tests.helpers.synthetic_results import bonds_of, make_results
from tests.helpers.tabulate import tabulate
from tests.helpers.tiers import rest_slow

OF_COLLISIONS = ("4", "5", "6", "8", "delta", "overview")
"""Figures that have nothing to show where bodies miss each other."""


def panels(figure):
    """The panels of a figure, without the place of the grid in which its legend stands."""
    return [axes for axes in figure.axes if axes.axison]


def texts(axes):
    """All that is written inside a panel."""
    return " ".join(text.get_text() for text in axes.texts)


def inner(axes):
    """The lines of a panel with their interval bars."""
    return [container for container in axes.containers if container.lines[0] is not None]


def outer(axes):
    """(low, high) of the outer bars of every line in a panel."""
    found = [container for container in axes.containers if container.lines[0] is None]
    ends = (np.array(container.lines[2][0].get_segments())[:, :, 1] for container in found)
    return [(each[:, 0], each[:, 1]) for each in ends]


def bars(axes):
    """(value, low, high) of every line with interval bars in a panel, as lists."""
    found = []
    for container in inner(axes):
        segments = np.array(container.lines[2][0].get_segments())
        found.append((container.lines[0].get_ydata(), segments[:, 0, 1], segments[:, 1, 1]))
    return found


def with_outcomes(results, outcome, inside):
    """The same conditions with one outcome everywhere."""
    shape = results.replicates["outcome"].shape
    codes = {"outcome": np.full(shape, outcome, "u1"), "inside": np.full(shape, inside, "u1")}
    codes["bond"] = bonds_of(codes["outcome"]).astype("u1")
    table = tabulate(**codes)
    return attrs.evolve(results, probabilities=table, replicates=results.replicates | codes)


def test_figure_4_shows_every_probability_and_interval():
    results = make_results()
    shown = panels(figure_4(results))
    assert [axes.get_title("left") for axes in shown] == [
        "(a) Type I",
        "(b) Type II",
        "(c) Type III",
    ]
    for number, axes in enumerate(shown):
        lines = bars(axes)
        assert len(lines) == 5
        for index, line in enumerate(lines):
            for end, drawn in zip(("", "_low", "_high"), line, strict=True):
                expected = results.probabilities["pr_inside" + end][number, :, index]
                np.testing.assert_allclose(drawn, expected, atol=1e-12)


def test_outer_bars_have_the_numerical_error_on_either_side():
    results = make_results()
    table = results.probabilities
    for number, axes in enumerate(panels(figure_4(results, numerics=True))):
        lines = outer(axes)
        assert len(lines) == 5
        for index, (low, high) in enumerate(lines):
            ends = (table[f"pr_inside_{end}"][number, :, index] for end in ("low", "high"))
            error = table["pr_inside_numerical"][number, :, index]
            least, most = ends
            np.testing.assert_allclose(low, np.maximum(least - error, 0.0), atol=1e-12)
            np.testing.assert_allclose(high, np.minimum(most + error, 1.0), atol=1e-12)


def quiet(results):
    """The same results with a numerical error that is small beside the sampling error."""
    small = {name: 0.01 * each for name, each in results.probabilities.items()
             if name.endswith("_numerical")}  # fmt: skip
    return attrs.evolve(results, probabilities=results.probabilities | small)


def test_a_small_numerical_error_is_drawn_on_request_only():
    for draw in (figure_4, figure_8, FIGURES["delta"], FIGURES["overview"]):
        results = quiet(make_results())
        plain, asked = draw(results), draw(results, numerics=True)
        assert not any(map(outer, panels(plain))) and any(map(outer, panels(asked)))
        notes = [figure._supxlabel.get_text().replace("\n", " ") for figure in (plain, asked)]
        assert ["numerical error" in note for note in notes] == [False, True]


def test_a_large_numerical_error_is_drawn_and_said():
    figure = figure_4(make_results())
    assert any(map(outer, panels(figure)))
    assert "large somewhere" in figure._supxlabel.get_text().replace("\n", " ")


def test_without_second_runs_there_are_no_outer_bars():
    results = make_results()
    codes = (results.replicates[name] for name in ("outcome", "inside", "bond"))
    plain = attrs.evolve(results, probabilities=tabulate(*codes))
    assert not any(outer(axes) for draw in (figure_4, figure_8) for axes in draw(plain).axes)
    assert any(outer(axes) for axes in figure_8(results).axes)


def test_figure_8_pools_the_counts_of_all_displacements():
    results = make_results()
    counts = results.probabilities["n_class"].sum(axis=2)
    for number, axes in enumerate(panels(figure_8(results))):
        for index, (value, low, high) in enumerate(bars(axes)):
            successes, trials = counts[number, :, index], counts[number].sum(axis=-1)
            np.testing.assert_allclose(value, successes / trials)
            assert (low <= value).all() and (value <= high).all()


def test_bonds_are_shares_of_the_aggregations():
    results = make_results()
    counts = results.probabilities["n_bond"].sum(axis=2)
    for number, axes in enumerate(FIGURES["overview"](results).axes[-3:]):
        lines = bars(axes)
        assert len(lines) == 3
        for index, (value, low, high) in enumerate(lines):
            trials = counts[number].sum(axis=-1)
            np.testing.assert_allclose(value, counts[number, :, index] / trials)
            assert (low <= value).all() and (value <= high).all()


def test_without_its_rows_a_file_gives_the_same_shares():
    results = make_results()
    for one, other in zip(
        FIGURES["overview"](results).axes,
        FIGURES["overview"](attrs.evolve(results, replicates=None, count=results.count)).axes,
        strict=True,
    ):
        for mine, theirs in zip(bars(one), bars(other), strict=True):
            np.testing.assert_allclose(mine[0], theirs[0])


def test_replicates_that_agree_at_all_displacements_count_once():
    results = make_results()
    outcome = results.replicates["outcome"].copy()
    outcome[:] = np.arange(outcome.shape[-1]) % 4
    inside = np.where(outcome < 2, 1, 0)
    same = attrs.evolve(
        results, probabilities=tabulate(outcome, inside, bonds_of(outcome)),
        replicates=results.replicates
        | {"outcome": outcome, "inside": inside.astype("u1"), "bond": bonds_of(outcome)},
    )  # fmt: skip
    count = outcome.shape[-1]
    for index, (_, low, high) in enumerate(bars(figure_8(same).axes[0])):
        once = wilson(np.sum(np.arange(count) % 4 == index), count)
        np.testing.assert_allclose((low[0], high[0]), once, rtol=0.02)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", rest_slow(OF_COLLISIONS, lambda name: name == "4"))
def test_nothing_but_misses_gives_figures_that_say_so(name, tmp_path):
    figure = FIGURES[name](with_outcomes(make_results(), 4, 255))
    assert name == "outcomes" or all("no " in texts(axes) for axes in panels(figure))
    save(figure, tmp_path / "empty.png")


def test_many_vertex_counts_are_thinned_but_keep_both_ends():
    results = make_results(types=("I",), vertices=(1, *range(4, 65, 4)), delta=(0.0,), count=4)
    labels = [text.get_text() for text in figure_4(results).axes[0].get_xticklabels()]
    assert (labels[0], labels[-1]) == ("sphere", "64")
    assert sum(map(bool, labels)) <= 9


CONDITIONS = [
    {"types": ("I",), "vertices": (1,), "delta": (0.0,)},
    {"types": ("16.4/23 µm", "a$\\b$", "II", "III"), "vertices": (4, 5, 7)},
    {"delta": tuple(np.linspace(0.0, 1.0, 12)), "types": ("I", "II"), "vertices": (1, 16)},
]


def is_next(number, name):
    """One of the conditions for each figure, in turns."""
    return list(FIGURES).index(name) % 3 == number


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("number", "name"), rest_slow(product(range(3), FIGURES), is_next))
def test_any_number_of_conditions_can_be_drawn(name, number):
    results = make_results(**CONDITIONS[number], count=5)
    figure = FIGURES[name](results)
    figure.canvas.draw()
    if name in OF_COLLISIONS or name == "size":  # others need not have a panel for each type
        assert len([axes for axes in panels(figure) if axes.get_visible()]) in (
            len(results.vertices) if name == "size" else len(results.types),
            4 * len(results.types),
        )


def pooled_sizes():
    """Four types: two receiving sizes, each met by two approaching ones, Pr[A] pooled."""
    results = make_results(("a", "b", "c", "d"), vertices=(1, 8))
    radii = dict(results.radii)
    radii |= {
        "r_i": np.array([5e-6, 5e-6, 9e-6, 9e-6]),
        "r_j": np.array([8e-6, 6e-6, 20e-6, 10e-6]),
    }
    pooled = {name: np.zeros(results.shape[:2]) for name in POOLED}
    pooled["pr_a"] = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6], [0.7, 0.8]])
    pooled["pr_a_high"] = np.ones((4, 2))
    return attrs.evolve(results, radii=radii, pooled=pooled)


def test_sizes_are_a_numeric_axis():
    figure = against_size(pooled_sizes())
    sphere, eight = figure.axes
    [legend] = figure.legends
    assert sphere.get_xscale() == "log" and "receiving" in legend.get_title().get_text()
    assert (sphere.get_title(loc="left"), eight.get_title(loc="left")) == ("sphere", "$N$ = 8")
    lines = [container.lines[0].get_xydata() for container in eight.containers]
    np.testing.assert_allclose(lines[0], [[6.0, 0.4], [8.0, 0.2]])
    np.testing.assert_allclose(lines[1], [[10.0, 0.8], [20.0, 0.6]])


@pytest.mark.parametrize(
    ("change", "said"), [("pooled", "not yet pooled"), ("radii", "sizes unknown")]
)
def test_without_sizes_or_pooled_numbers_the_figure_says_so(change, said):
    made = pooled_sizes()
    unknown = {"pooled": {}, "radii": make_results(made.types, vertices=(1, 8)).radii}[change]
    figure = against_size(attrs.evolve(made, **{change: unknown}))
    assert all(said in texts(axes) for axes in figure.axes)


def test_points_of_few_trials_are_hollow():
    results = make_results()
    hollow = [line for axes in figure_4(results).axes for line in hollows(axes)]
    assert not hollow  # every condition has ten collisions or more
    counts = results.probabilities["n_collided"].copy()
    counts[1, 2, 3] = FEW - 1
    made = attrs.evolve(results, probabilities=results.probabilities | {"n_collided": counts})
    found = [hollows(axes) for axes in panels(figure_4(made))]
    assert [len(each) for each in found] == [0, 1, 0]
    assert found[1][0].get_ydata() == results.probabilities["pr_inside"][1, 2, 3]


def hollows(axes):
    """The points of a panel that are hollow."""
    return [line for line in axes.get_lines() if str(line.get_markerfacecolor()) == "white"]
