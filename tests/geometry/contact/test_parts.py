"""Contact of cores of several rings: which pairs are listed, how near they are, where they act."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flocsim import Body, Fluid, Sphere, SpheroPolygon
from flocsim.body import scene_of
from flocsim.geometry.contact.near_pairs import (
    core_distance,
    list_polygons,
    pose_of,
)
from flocsim.geometry.contact.points import overlap_fault, placed_contacts
from flocsim.geometry.shapes.cores import segment_distance2
from flocsim.state.work import work_of
from tests.helpers.compound_shapes import MAKERS, SQUARE, beads, framed

SHAPES = [*(make() for make in MAKERS), Sphere(0.8), SpheroPolygon(2.0 * SQUARE, 0.3)]


def features(shape, place):
    """(points, lone points, edges) of a placed shape, each with its radius."""
    points, lone, edges = [], [], []
    for part in shape.placed_parts(*place):
        for ring in part.rings:
            first = len(points)
            points += [(point, part.radius) for point in ring]
            if len(ring) == 1:
                lone.append(first)
            count = len(ring) - 1 if len(ring) < 3 else len(ring)
            edges += [(first + k, first + (k + 1) % len(ring)) for k in range(count)]
    return points, lone, edges


def pairs_between(a, b, place_a, place_b):
    """{(is of a, vertex, start, end): gap} of all pairs of features, b the later body."""
    own, other = features(a, place_a), features(b, place_b)
    found = {}
    for of_a, (points, lone, _), (others, lone_there, edges) in (
        (True, own, other), (False, other, own),
    ):  # fmt: skip
        known = [*product(range(len(points)), edges)]
        known += [(p, (q, q)) for p in lone for q in lone_there if not of_a]
        for point, (start, end) in known:
            (p, r), (q, s), (t, _) = points[point], others[start], others[end]
            apart = math.sqrt(segment_distance2(*p, *q, *t))
            found[of_a, point, start, end] = apart - r - s
    return found


def placed(a, b, x, y, turn_a, turn_b):
    """(scene, work) of two bodies, the later one at (x, y)."""
    scene = scene_of([Body(a, density=1.0), Body(b, density=1.0)], Fluid())
    position = np.array([[0.0, 0.0, turn_a], [x, y, turn_b]])
    return scene, work_of(scene, position, np.zeros((2, 3)), 4096)


DRAWN = (st.sampled_from(SHAPES), st.sampled_from(SHAPES), st.floats(-14.0, 14.0),
         st.floats(-14.0, 14.0), st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))  # fmt: skip


@given(*DRAWN, st.floats(0.01, 6.0))
def test_all_pairs_below_a_gap_are_listed(a, b, x, y, turn_a, turn_b, cutoff):
    scene, work = placed(a, b, x, y, turn_a, turn_b)
    assert work.tally.pairs == 1 and list_polygons(scene, work, 0, cutoff)
    rows = work.candidates[: work.tally.candidates]
    names = ["vertex_body", "vertex", "edge_start", "edge_end"]
    first = scene.first
    found = set()
    for of, vertex, start, end in rows[names].tolist():
        found.add((of == 0, vertex - first[of], start - first[1 - of], end - first[1 - of]))
    assert np.all(rows["edge_body"] == 1 - rows["vertex_body"]) and len(found) == len(rows)
    gaps = pairs_between(a, b, (0.0, 0.0, turn_a), (x, y, turn_b))
    clear = {key for key, gap in gaps.items() if gap < cutoff - 1e-9}
    assert clear <= found <= {key for key, gap in gaps.items() if gap < cutoff + 1e-9}


@given(*DRAWN)
def test_the_gap_is_the_least_of_all(a, b, x, y, turn_a, turn_b):
    scene, work = placed(a, b, x, y, turn_a, turn_b)
    contact = scene.bodies["radius"].sum()
    gaps = pairs_between(a, b, (0.0, 0.0, turn_a), (x, y, turn_b))
    both = [(0, 1), (1, 0)]
    for one, other in both:
        pose = pose_of(scene, work, one, other)
        gap = core_distance(scene, one, other, pose) - contact
        assert gap == pytest.approx(min(gaps.values()), abs=1e-9)


def test_a_disk_in_a_hole_starts_there():
    frame, disk = framed(), Sphere(1.5)
    for x, fault in ((0.0, None), (0.45, None), (1.0, None), (2.6, "one core"), (4.0, "one core")):
        found = overlap_fault(frame.placed_parts(), disk.placed_parts(x, 0.0, 0.0))
        # The core of the frame begins at 3, that of the disk is a point: 1.5 + 1 - (3 - x) deep.
        deep = x > 0.5 + 0.5 * 2.5
        assert (found is not None) == deep, (x, fault)


def test_contacts_of_parts_are_seen():
    beads_there = beads()
    tip = beads_there.parts[1].points[0]
    touching = np.array([[0.0, 0.0, 0.0], [tip[0], tip[1] - 2.5 + 1e-3, 0.0]])
    found = placed_contacts([beads_there, Sphere(0.5)], touching)
    assert len(found) > 0 and np.ptp(found, axis=0).max() < 1e-12  # once from either side
    assert found[0] == pytest.approx([tip[0], tip[1] - 2.0], abs=2e-3)
