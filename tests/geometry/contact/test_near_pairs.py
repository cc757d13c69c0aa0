"""The hierarchy of circles: it must keep all that is near, and find the smallest distance."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import strategies as st

from flocsim import Body, Fluid, Sphere, SpheroPolygon
from flocsim.body import scene_of
from flocsim.compiler.composer import compose
from flocsim.geometry.contact.near_pairs import (
    gap_between,
    list_polygons,
)
from flocsim.geometry.shapes.cores import edges_of, from_edges
from flocsim.state.work import work_of
from tests.helpers.tiers import given_often

COUNTS = (1, 2, 3, 4, 5, 7, 16, 33, 64, 512)


@cache
def shape(points, seed):
    """A core of that many points: a star with deep bays, a sliver or a comb, of any size."""
    rng = np.random.default_rng([points, seed])
    size = 1e-5 * 10.0 ** rng.uniform(-1.5, 1.0)
    radius = size * rng.uniform(0.02, 0.2)
    if points == 1:
        return Sphere(size)
    if points == 2:
        return SpheroPolygon([[-size, 0.0], [size, 0.0]], radius)
    angles = (np.arange(points) + rng.uniform(-0.4, 0.4, points)) * 2.0 * np.pi / points
    rays = size * rng.uniform(0.15, 1.0, points) if seed % 3 else np.full(points, size)
    core = rays[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    if seed % 4 == 1:
        core = core * (1.0, 0.02)
    return SpheroPolygon(core, radius)


def numbers_for(counts):
    """Strategy of what `placed` needs: points and seed of two shapes, three angles, a distance."""
    kinds = [st.tuples(st.sampled_from(counts), st.integers(0, 11)) for _ in range(2)]
    return st.tuples(*kinds, *[st.floats(-7.0, 7.0) for _ in range(3)], st.floats(0.2, 1.5))


numbers = numbers_for(COUNTS)
fewer = numbers_for([count for count in COUNTS if count <= 64])
ROOM = 2 * 64 * 64
"""For all pairs of two shapes of the fewer points."""


def placed(drawn):
    """(two shapes, their places (2, 3)), near each other as a rule, at times one in the other.

    Shapes are made here, not while hypothesis draws: it gives up on what is slow to draw.
    """
    *kinds, heading, angle, turn, share = drawn
    shapes = [shape(*kind) for kind in kinds]
    distance = share * sum(shape.bounding_radius for shape in shapes)
    x, y = distance * math.cos(heading), distance * math.sin(heading)
    return shapes, np.array([[1e-6, -2e-6, angle], [x + 1e-6, y - 2e-6, turn]])


def arrays(shapes, places, capacity=4):
    """Scene and work arrays of two bodies."""
    scene = scene_of([Body(shape, surface_density=2.0) for shape in shapes], Fluid())
    return scene, work_of(scene, places, np.zeros((2, 3)), capacity=capacity)


def one_way_distances(shapes, places, a, b):
    """Distances (points of a, edges of b) by all pairs; a sphere is one edge against a sphere."""
    points, core = (shapes[k].placed_vertices(*places[k]) for k in (a, b))
    starts, ends = edges_of(core)
    if len(points) == len(core) == 1:
        return np.hypot(*(points - core).T)[:, None]
    return np.linalg.norm(from_edges(points, starts, ends), axis=-1)


def all_distances(shapes, places):
    """{(vertex's body, edge's body): distances}; two spheres are one pair."""
    ways = (
        ((1, 0),) if len(shapes[0].vertices) == len(shapes[1].vertices) == 1 else ((0, 1), (1, 0))
    )
    return {way: one_way_distances(shapes, places, *way) for way in ways}


def least_of(distances):
    """The smallest of all distances."""
    return min(table.min() for table in distances.values() if table.size)


def listed(scene, work, cutoff, a=1, b=0):
    """The pairs listed up to a gap, in order, as (vertex's body, edge's body, vertex, edge)."""
    work.tally.candidates = 0
    work.pairs[0].later, work.pairs[0].earlier = a, b
    assert compose(list_polygons, {})(scene, work, 0, cutoff)
    rows = work.candidates[: work.tally.candidates]
    first = scene.first
    return [
        (
            int(row.vertex_body),
            int(row.edge_body),
            int(row.vertex - first[row.vertex_body]),
            int(row.edge_start - first[row.edge_body]),
        )
        for row in rows
    ]


@given_often(8, 100, numbers, st.floats(0.0, 1.0))
def test_just_the_pairs_nearer_than_the_cut_off_are_listed(drawn, share):
    shapes, places = placed(drawn)
    distances = all_distances(shapes, places)
    contact = sum(shape.radius for shape in shapes)
    furthest = max(table.max() for table in distances.values() if table.size)
    cutoff = (least_of(distances) + share**4 * (furthest - least_of(distances))) - contact
    grain = 1e-12 * (furthest + np.abs(places[:, :2]).max())
    room = sum(np.count_nonzero(table < contact + cutoff + grain) for table in distances.values())
    found = listed(*arrays(shapes, places, room), cutoff)
    assert len(set(found)) == len(found)
    for way, table in distances.items():
        chosen = np.zeros(table.shape, dtype=bool)
        for key in found:
            if key[:2] == way:
                chosen[key[2:]] = True
        assert not np.any(chosen & (table >= contact + cutoff + grain))
        assert np.all(chosen | (table >= contact + cutoff - grain))


@given_often(20, 60, fewer, st.floats(0.0, 1e-6))
def test_the_list_does_not_depend_on_which_body_is_named_first(drawn, cutoff):
    shapes, places = placed(drawn)
    scene, work = arrays(shapes, places, capacity=ROOM)
    spheres = all(len(shape.vertices) == 1 for shape in shapes)
    one, other = listed(scene, work, cutoff, 1, 0), listed(scene, work, cutoff, 0, 1)
    if not spheres:
        assert set(one) == set(other)
    assert len(one) == len(other)


@given_often(15, 250, numbers)
def test_the_gap_is_that_of_all_pairs(drawn):
    shapes, places = placed(drawn)
    scene, work = arrays(shapes, places)
    gap = compose(gap_between, {})
    expected = least_of(all_distances(shapes, places)) - sum(shape.radius for shape in shapes)
    grain = 1e-15 * max(shape.bounding_radius for shape in shapes) + 1e-15 * np.abs(places).max()
    for a, b in ((0, 1), (1, 0)):
        assert gap(scene, work, a, b) == pytest.approx(expected, rel=1e-12, abs=10 * grain)
