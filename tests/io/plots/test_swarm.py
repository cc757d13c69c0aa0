"""Figures of swarms: bodies with holes and of parts as the file says, none of what has left."""

import attrs
import numpy as np
import pytest

from flocsim.errors import FileError
from flocsim.geometry.shapes.cores import table_of
from flocsim.io.plots.style import new_figure
from flocsim.io.plots.swarm import SWARM_FIGURES, draw_bodies, last_known, outlines_of, shape_of
from flocsim.io.results.swarm_file import GONE, SWARMS
from tests.helpers.compound_shapes import beads, framed
from tests.helpers.swarm_study import make_swarm_results

SHAPES = [framed(1e-6), beads(1e-6)]


def compound_results():
    """The small results, every other body a frame, the others beads."""
    results = make_swarm_results()
    bodies = dict(results.groups["bodies"])
    tables = [table_of(SHAPES[k % 2].parts) for k in range(4)]
    counts = [len(table.place) for table in tables]
    columns = {
        "points": np.concatenate([table.place for table in tables]),
        "point_part": np.concatenate([table.part for table in tables]).astype("i4"),
        "point_ring": np.concatenate([table.ring for table in tables]).astype("i4"),
        "point_radius": np.concatenate([table.radius for table in tables]),
        "first_point": np.cumsum([0, *counts[:-1]]), "point_count": np.array(counts),
        "spheroradius": np.array([SHAPES[k % 2].radius for k in range(4)]),
    }  # fmt: skip
    bodies |= {name: np.array([column] * 2) for name, column in columns.items()}
    bodies["point"] = np.arange(sum(counts))
    return attrs.evolve(results, groups=results.groups | {"bodies": bodies})


def test_shapes_come_back_from_the_file(tmp_path):
    compound_results().write(tmp_path / "s.h5")
    results = SWARMS.read(tmp_path / "s.h5")
    for body in range(4):
        shape = shape_of(results, 1, body)
        assert shape.area == pytest.approx(SHAPES[body % 2].area, rel=1e-12)
        assert len(shape.parts) == len(SHAPES[body % 2].parts)
    assert [len(rings) for rings in outlines_of(results, 0)][:1] == [2]


def test_parts_that_cannot_be_are_refused():
    results = compound_results()
    results.groups["bodies"]["point_ring"][1, 5] = 7
    with pytest.raises(FileError, match="body 0 of swarm 1 is no readable shape"):
        outlines_of(results, 1)


@pytest.mark.parametrize(
    "results", [compound_results(), pytest.param(make_swarm_results(), marks=pytest.mark.slow)]
)
def test_all_figures_are_drawn(results):
    for draw in SWARM_FIGURES.values():
        draw(results).canvas.draw()


def test_holes_stay_open_in_a_picture():
    """A pixel in the hole of a frame has the colour of the paper, one of its wall has not."""
    results = compound_results()
    results.groups["snapshots"]["position"][0, 0, :, :2] = [[1e-5, 1e-5], *[[9.0, 9.0]] * 3]
    figure = new_figure(3.0, 3.0)
    axes = figure.subplots()
    draw_bodies(axes, results, 0, 0)
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[:, :, :3].astype(int)

    def colour(x, y):
        column, row = axes.transData.transform((x, y))
        return pixels[len(pixels) - 1 - int(row), int(column)].sum()

    assert colour(10.0, 10.0) == 3 * 255
    assert colour(10.0, 14.0) < 3 * 250


@pytest.mark.slow
def test_what_has_left_is_not_drawn():
    results = make_swarm_results()
    results.groups["snapshots"]["cluster"][0, 1:, 0] = GONE
    results.groups["snapshots"]["position"][0, 1:, 0] = np.nan
    assert last_known(results) == 2
    for draw in SWARM_FIGURES.values():
        draw(results).canvas.draw()
