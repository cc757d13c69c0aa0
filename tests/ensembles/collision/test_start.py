"""How a replicate starts: its random numbers; gaps, grazing and missing, measured with shapely."""

import numpy as np
import pytest
from scipy.stats import kstest
from shapely.geometry import LineString, Point, Polygon

from flocsim import Sphere, SpheroPolygon
from flocsim.ensembles.collision.draw import draws
from flocsim.io.results.schema import OUTCOMES
from tests.helpers.placed_pairs import grazing, place_pair
from tests.helpers.small_study import small_study

GAP = 2e-6


def star(rng):
    """A star of 2 to 12 vertices with very unequal rays, or a sphere."""
    count = int(rng.integers(1, 13))
    size = rng.uniform(4e-6, 25e-6)
    if count == 1:
        return Sphere(size)
    angles = (np.arange(count) + rng.uniform(-0.3, 0.3, count)) * 2.0 * np.pi / count
    rays = size * rng.uniform(0.2, 1.0, count)
    core = np.column_stack([rays * np.cos(angles), rays * np.sin(angles)])
    return SpheroPolygon(core, rng.uniform(0.2e-6, 2e-6))


def pairs(count):
    """(shapes, angles) of random pairs."""
    rng = np.random.default_rng(3)
    return [((star(rng), star(rng)), rng.uniform(0.0, 2.0 * np.pi, 2)) for _ in range(count)]


def core_of(shape, place):
    """The placed core as a shapely geometry, in µm."""
    points = 1e6 * shape.placed_vertices(*place)
    kind = {1: Point, 2: LineString}.get(len(points), Polygon)
    return kind(points[0] if len(points) == 1 else points)


def gap_of(shapes, places):
    """Distance of the two outlines [m], negative where they overlap."""
    cores = [core_of(shape, place) for shape, place in zip(shapes, places, strict=True)]
    return 1e-6 * cores[0].distance(cores[1]) - shapes[0].radius - shapes[1].radius


def slide(shapes, angles, displacement, heights):
    """Gaps as j goes straight down past i."""
    i = (0.0, 0.0, angles[0])
    return [gap_of(shapes, (i, (displacement, height, angles[1]))) for height in heights]


def facing_heights(shapes, angles):
    """Height of j at which the vertices that face each other are level, and heights around it."""
    core_i = shapes[0].placed_vertices(angle=angles[0])
    core_j = shapes[1].placed_vertices(angle=angles[1])
    level = core_i[core_i[:, 0].argmax(), 1] - core_j[core_j[:, 0].argmin(), 1]
    reach = sum(shape.bounding_radius for shape in shapes)
    return level, np.linspace(-reach, reach, 200)


@pytest.mark.parametrize(
    ("share", "gap"), [(0.0, 1e-9), (0.0, 1e-4), (0.3, GAP), (0.7, GAP), (0.95, 1e-7), (1.0, GAP)]
)
def test_the_outlines_start_a_gap_apart(share, gap):
    for shapes, angles in pairs(30):
        largest = grazing(shapes, angles)
        places = place_pair(shapes, angles, share * largest, gap)
        assert gap_of(shapes, places) == pytest.approx(gap, rel=2e-6, abs=1e-15)
        assert places[1, :2].tolist() == pytest.approx([share * largest, places[1, 1]])
        assert places[:, 2].tolist() == list(angles)
        # Nothing lies above: from the start upwards the pair only comes apart.
        above = slide(shapes, angles, share * largest, places[1, 1] + np.linspace(1e-9, 5e-5, 20))
        assert min(above) > gap


def test_one_just_grazes():
    for shapes, angles in pairs(40):
        largest = grazing(shapes, angles)
        level, heights = facing_heights(shapes, angles)
        assert slide(shapes, angles, largest, [level])[0] == pytest.approx(0.0, abs=1e-15)
        assert min(slide(shapes, angles, 1.0001 * largest, [level, *heights])) > 0.0
        assert slide(shapes, angles, 0.9999 * largest, [level])[0] < 0.0


def test_a_pair_that_passes_by_starts_clear_above():
    for shapes, angles in pairs(30):
        largest = sum(shape.bounding_radius for shape in shapes)
        places = place_pair(shapes, angles, 2.0 * largest, GAP)
        assert gap_of(shapes, places) >= GAP
        assert places[1, 1] >= largest


@pytest.mark.parametrize(
    ("more", "outcome"),
    [({}, "A"), ({"forces": {"van_der_waals": {"hamaker": 0.0}}, "zone": {"distance": 1e-6}},
                 "missed")],
)  # fmt: skip
def test_at_the_radius_rules_end_attraction_alone_brings_spheres_together(tmp_path, more, outcome):
    scene = {"types": ["III"], "delta": [1.0], "delta_max": "radius"}
    study = small_study(tmp_path, {"scene": scene, "shapes": {"vertices": [1]}} | more)
    assert OUTCOMES[study.run(0, 1, 1.0, 0)["outcome"]] == outcome


def test_the_radius_rule_counts_displacements_in_bounding_radii(tmp_path):
    study = small_study(tmp_path, {"scene": {"delta_max": "radius"}})
    encounter = study.draw(0, 16, 0.5, 0).encounter
    place, _ = encounter.motion((0.3, 2.0), 0.5)
    assert place[1, 0] == 0.5 * sum(shape.bounding_radius for shape in encounter.shapes)


def test_by_the_radius_rule_a_straight_fall_never_overlaps():
    for shapes, angles in pairs(30):
        largest = sum(shape.bounding_radius for shape in shapes)
        heights = facing_heights(shapes, angles)[1]
        assert min(slide(shapes, angles, largest, heights)) > -1e-15


def test_draws_repeat_and_do_not_depend_on_what_was_drawn_before():
    first = draws(5, 17)
    np.random.default_rng(0).random(3)
    draws(5, 18)
    assert draws(5, 17).tolist() == first.tolist()
    assert first.shape == (5,)


@pytest.mark.parametrize("seed", [0, 2**63 - 1])
def test_the_ends_of_the_range_of_seeds(seed):
    numbers = draws(seed, 10**7)
    assert np.all((numbers >= 0.0) & (numbers < 1.0))


def test_draws_are_uniform_and_independent():
    table = np.array([draws(1, replicate) for replicate in range(3000)])
    for column in table.T:
        assert kstest(column, "uniform").pvalue > 1e-3
    assert np.abs(np.corrcoef(table.T) - np.eye(5)).max() < 0.07


def test_one_replicate_has_the_same_angles_and_flocs_everywhere(tmp_path):
    study = small_study(tmp_path)
    for replicate in range(3):
        numbers = draws(study.config.seed, replicate)
        flocs = set()
        for condition in range(2):
            for vertices in (4, 16):
                encounter = study.encounter(condition, vertices, numbers)
                key = next(k for k, value in study.encounters.items() if value is encounter)
                flocs.add(key[2:])
        assert len(flocs) == 1
