"""Replicates of kernel studies: one point of the sequence each."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from flocsim.ensembles.collision.draw import point, points_of
from flocsim.ensembles.collision.mechanisms import settling_interval
from flocsim.ensembles.collision.start import half_extent, half_widths
from flocsim.ensembles.kind import study_of
from flocsim.geometry.contact.core_points import outlines_of
from flocsim.geometry.shapes.shape import Sphere
from flocsim.geometry.shapes.spheropolygon import Composite, SpheroPolygon
from tests.helpers.kernel_study import kernel_config
from tests.helpers.placed_pairs import grazing, place_pair


@pytest.fixture
def study(tmp_path):
    return study_of(kernel_config(tmp_path))


def test_a_replicate_has_an_offset_of_its_own(study):
    encounter = study.encounter(0, 1, study.numbers(0))
    shares = [study.share_of(encounter, 1.0, study.numbers(k)) for k in range(32)]
    largest = 1.0 + encounter.reach / encounter.outer
    assert min(shares) < -0.8 * largest and max(shares) > 0.8 * largest
    assert np.abs(shares).max() <= largest
    assert len(set(shares)) == 32


def test_the_points_are_part_of_what_rows_follow_from(study, tmp_path):
    points = [
        each.identity_facts()["scene.points"].tolist()
        for each in (study, study_of(kernel_config(tmp_path)),
                     study_of(kernel_config(tmp_path, scrambles=2)))
    ]  # fmt: skip
    assert points[0] == points[1] != points[2]


def test_no_start_is_nearer_than_what_acts_there_is_small(study):
    encounter = study.encounter(0, 1, study.numbers(0))
    for k in range(8):
        share = study.share_of(encounter, 1.0, study.numbers(k))
        place = encounter.motion((0.0, 0.0), share)[0]
        apart = np.hypot(*(place[1, :2] - place[0, :2]))
        assert apart >= (3e-5 + encounter.start_gap) * (1.0 - 1e-6)


def test_offsets_in_a_flow_are_as_frequent_as_the_flow_brings_them(tmp_path):
    study = study_of(kernel_config(tmp_path, meeting='"shear"', scene='rate = "10 1/s"'))
    encounter = study.encounter(0, 1, study.numbers(0))
    low, high = encounter.bounds(np.zeros(4000), np.zeros(4000))
    largest = encounter.outer + encounter.reach
    assert np.all(high == -low) and np.all(high == largest)
    offsets = encounter.offsets(low, high, (np.arange(4000) + 0.5) / 4000) / largest
    assert np.mean(offsets) == pytest.approx(0.0, abs=1e-12)
    # p(b) ∝ |b|: ⟨b²⟩ = b_max²/2, and a quarter within half of it.
    assert np.mean(offsets**2) == pytest.approx(0.5, rel=1e-3)
    assert np.mean(np.abs(offsets) < 0.5) == pytest.approx(0.25, abs=1e-3)


def test_a_replicate_is_the_same_however_it_is_asked_for(study):
    again = study_of(study.config)
    again.run(0, 1, 1.0, 7)
    assert study.run(0, 1, 1.0, 5) == pytest.approx(again.run(0, 1, 1.0, 5), nan_ok=True, abs=0.0)


HOOK = SpheroPolygon(
    1e-6 * np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 5.0], [7.0, 5.0], [7.0, 2.0], [0.0, 3.0]]), 1e-6
)
STAR = SpheroPolygon(
    1e-6 * np.array([[6.0, 0.0], [1.0, 1.5], [-3.0, 5.0], [-1.5, 0.0], [-4.0, -4.0], [1.0, -1.0]]),
    5e-7,
)  # fmt: skip


HEADED = Composite(
    [
        (Sphere(4e-6), (0.0, 0.0)),
        (SpheroPolygon([(-3e-6, 0.0), (3e-6, 0.0)], 5e-7), (6e-6, 1e-6), 0.4),
    ]
)
"""A wide head on a thin stick: the smallest spheroradius is an eighth of the largest."""


def test_points_do_not_change_with_their_number():
    first = points_of(5, 4, 0, 40)
    assert np.array_equal(first, points_of(5, 4, 0, 4000)[:40])
    assert np.array_equal(first[17], point(5, 4, 17))
    assert first.min() >= 0.0 and first.max() < 1.0


def test_scrambles_are_dealt_in_turn_and_differ():
    found = points_of(1, 2, 0, 64)
    for scramble in range(2):
        mine = found[scramble::2]
        # Sobol: each of 32 equal parts of every dimension has one of 32 points.
        for dimension in range(mine.shape[1]):
            assert sorted((32 * mine[:, dimension]).astype(int)) == list(range(32))
    assert not np.any(found[::2] == found[1::2])
    assert not np.any(found == points_of(2, 2, 0, 64))


def hull_perimeter(shape):
    """Of the convex hull of a swept outline: that of the core's hull, and a circle."""
    return ConvexHull(shape.vertices).area + 2.0 * np.pi * shape.radius


def test_the_mean_interval_is_cauchys():
    turns = 2.0 * np.pi * np.arange(4096) / 4096
    low, high = settling_interval((HOOK, STAR), turns, turns[::-1], 0.0, 0.0)
    expected = (hull_perimeter(HOOK) + hull_perimeter(STAR)) / np.pi
    assert np.mean(high - low) == pytest.approx(expected, rel=1e-6, abs=0.0)


def test_parts_of_unlike_spheroradii_reach_as_far_as_their_outline():
    turns = np.linspace(0.0, 2.0 * np.pi, 12)
    left, right = half_widths(HEADED, turns)
    cores = outlines_of([HEADED])
    for place, turn in enumerate(turns):
        outline = np.concatenate(HEADED.outline(angle=turn, points_per_quadrant=500))[:, 0]
        assert left[place] == pytest.approx(-outline.min(), rel=1e-5, abs=0.0)
        assert right[place] == pytest.approx(outline.max(), rel=1e-5, abs=0.0)
        extents = [half_extent(cores, 0, HEADED.radius, turn, side) for side in (-1.0, 1.0)]
        assert (left[place], right[place]) == pytest.approx(extents, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("other", [STAR, HEADED])
@pytest.mark.parametrize("angles", [(0.3, 2.0), (4.0, 5.5), (1.0, 0.1)])
def test_outlines_touch_exactly_within_the_interval(angles, other):
    shapes = (HOOK, other)
    low, high = settling_interval(shapes, np.array([angles[0]]), np.array([angles[1]]), 0.0, 0.0)
    assert high[0] == pytest.approx(grazing(shapes, angles), rel=1e-12, abs=0.0)
    clear = sum(shape.bounding_radius for shape in shapes)
    gap = 1e-9
    for end in (low[0], high[0]):
        inner, outer = 0.999 * end, 1.001 * end
        assert place_pair(shapes, angles, inner, gap)[1, 1] < clear
        # Beyond it j passes, and is put where it is clear.
        assert place_pair(shapes, angles, outer, gap)[1, 1] == pytest.approx(clear + gap)


def test_reach_and_centre_forces_widen_the_interval():
    spheres, turn = (Sphere(1e-5), Sphere(2e-5)), np.zeros(1)
    low, high = settling_interval(spheres, turn, turn, 2e-6, 4e-5)
    assert (low[0], high[0]) == pytest.approx((-4.2e-5, 4.2e-5))
    low, high = settling_interval(spheres, turn, turn, 2e-6, 0.0)
    assert (low[0], high[0]) == pytest.approx((-3.2e-5, 3.2e-5))
