"""Clusters: what is known of them is the same however bodies are numbered and the box is cut."""

import math

import numpy as np
import pytest

from flocsim import Body, Sphere, Swarm
from flocsim.ensembles.swarms.study import summary_of
from flocsim.forces import Contact
from flocsim.swarms.together.clusters import Clusters

R = 5e-6
STEP = 1.999 * R
SIDE = 12


def together(cells, box=(True, True), order=None, shift=(0.0, 0.0), fixed=()):
    """The Clusters of discs on cells of a square lattice that just touch, SIDE cells wide."""
    length = SIDE * STEP
    order = range(len(cells)) if order is None else order
    places = [(np.array(cells[each]) + 0.5) * STEP + shift for each in order]
    places = [np.where(box, place % length, place) for place in places]
    bodies = [
        Body(Sphere(R), tuple(place), density=2650.0, fixed=each in fixed)
        for each, place in zip(order, places, strict=True)
    ]
    swarm = Swarm(bodies, [Contact()], box=tuple(length if side else None for side in box))
    position, velocity = swarm.system.motion()
    return Clusters.of(swarm.bodies, position, velocity, swarm.gauge().neighbours(position))


def table(clusters):
    """What is known of every cluster, the order of clusters aside."""
    columns = [
        clusters.size, 1e6 * clusters.gyration, clusters.porosity, clusters.percolates,
    ]  # fmt: skip
    rows = np.array(columns, dtype=float).T
    return rows[np.lexsort(np.nan_to_num(rows, nan=-1.0).T)]


ROW = [(k, 3) for k in range(SIDE)]
ALONE = [(1, 8), (1, 9), (2, 9)]
RING = [(k, 0) for k in range(5)] + [(k, 4) for k in range(5)]
RING += [(0, k) for k in range(1, 4)] + [(4, k) for k in range(1, 4)]

SCENES = {
    "a row round the box": (ROW, 1),
    "a row that is open by one": (ROW[:-1], 0),
    "a row and others": (ROW + ALONE, 1),
    "a row and a column": (ROW + [(5, k) for k in range(SIDE) if k != 3], 1),
    "two rows": (ROW + [(k, 6) for k in range(SIDE)], 2),
    "a ring, closed but with an end": (RING, 0),
    "a ring across the seams": ([(a - 2, b - 2) for a, b in RING], 0),
    "a block": ([(a, b) for a in range(3, 8) for b in range(4)], 0),
    "all cells": ([(a, b) for a in range(SIDE) for b in range(SIDE)], 1),
    "a stair that comes back at another height": (
        [(k % SIDE, k // 2 % SIDE) for k in range(2 * SIDE)]
        + [((k + 1) % SIDE, k // 2 % SIDE) for k in range(1, 2 * SIDE, 2)],
        1,
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_clusters_that_percolate_are_found_wherever_the_box_is_cut(name):
    cells, percolating = SCENES[name]
    cells = list(dict.fromkeys(cells))
    expected = table(together(cells))
    assert expected[:, 3].sum() == percolating
    assert np.isnan(expected[:, [1, 2]]).all(axis=1).tolist() == (expected[:, 3] == 1.0).tolist()
    for seed in range(4):
        rng = np.random.default_rng(seed)
        there = together(
            cells, order=rng.permutation(len(cells)), shift=rng.uniform(0.0, SIDE * STEP, 2)
        )
        assert table(there) == pytest.approx(expected, rel=1e-9, nan_ok=True)


@pytest.mark.parametrize("seed", range(3))
def test_open_space_has_none_and_a_box_along_one_axis_those_along_it(seed):
    rng = np.random.default_rng(seed)
    cells = np.argwhere(rng.random((SIDE, SIDE)) < 0.65).tolist()
    assert not together(cells, (False, False)).percolates.any()
    assert together(ROW, (True, False)).percolates.tolist() == [True]
    assert together(ROW, (False, True)).percolates.tolist() == [False]
    assert together([(b, a) for a, b in ROW], (False, True)).percolates.tolist() == [True]


def test_a_cluster_hangs_together_by_free_bodies_alone():
    assert together(ROW, fixed=(4,)).percolates.tolist() == [False]
    assert together(ROW).percolates.tolist() == [True]


def test_means_are_over_the_clusters_that_have_an_end():
    both, alone = together(ROW + ALONE), together(ALONE)
    found = summary_of(both)
    assert found["percolating"] == 1 and found["clusters"] == 2
    assert found["gyration"] == pytest.approx(alone.gyration[0], rel=1e-9)
    assert found["porosity"] == pytest.approx(alone.porosity[0], rel=1e-6)
    none = summary_of(together(ROW))
    assert math.isnan(none["gyration"]) and math.isnan(none["porosity"])
    assert none["percolating"] == 1


def test_a_fractal_dimension_leaves_those_out_that_percolate():
    lines = [[(k, 2 * row) for k in range(4 + row)] for row in range(4)]
    cells = [cell for line in lines for cell in line]
    ends = together(cells)
    more = together(cells + [(k, 9) for k in range(SIDE)])
    assert more.percolates.sum() == 1 and not ends.percolates.any()
    assert more.fractal_dimension() == pytest.approx(ends.fractal_dimension(), rel=1e-12)
