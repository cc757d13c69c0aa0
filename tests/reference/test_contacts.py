"""Contact pairs and the random scenes that they are tried on."""

import numpy as np
import pytest

from tests.reference.contacts import OverlapTooDeepError, contacts, surface_gap
from tests.reference.outline import core_geometry
from tests.reference.samples import SEEDS, scene_of, spheres
from tests.reference.shapes import Scene, make_body, world_vertices


def test_random_scenes_keep_their_promises():
    touching = [len(contacts(scene_of(seed)).overlap) for seed in SEEDS[:15]]
    assert np.mean(np.array(touching) > 1) > 0.5
    for seed in SEEDS[:15]:
        scene = scene_of(seed)
        pairs = contacts(scene)
        assert np.all(pairs.overlap <= 0.3001 * (pairs.overlap + pairs.distance))
        cores = [
            core_geometry(world_vertices(*b))
            for b in zip(scene.bodies, scene.positions, strict=True)
        ]
        assert all(a.disjoint(b) for a in cores for b in cores if a is not b)


@pytest.mark.parametrize("seed", SEEDS)
def test_surface_gap_is_shapelys_distance(seed):
    scene = scene_of(seed)
    a, b = (core_geometry(world_vertices(scene.bodies[k], scene.positions[k])) for k in (0, 1))
    expected = a.distance(b) - scene.bodies[0].radius - scene.bodies[1].radius
    assert surface_gap(scene, 0, 1) == pytest.approx(expected, abs=1e-18)


def test_pair_conventions_on_a_sphere_above_a_bar():
    bar = make_body([[-5e-6, 0.0], [5e-6, 0.0]], 1e-6, surface_density=2.0)
    ball = make_body([[0.0, 0.0]], 2e-6, surface_density=2.0)
    positions = np.array([[0.0, 0.0, 0.0], [1e-6, 2.6e-6, 0.4]])
    velocities = np.array([[0.0, 0.0, 10.0], [1e-3, -2e-3, 0.0]])
    pair = contacts(Scene((bar, ball), positions, velocities))
    assert pair.pair_keys() == [(1, 0, 0, 0)]
    assert pair.overlap == pytest.approx([0.4e-6])
    assert pair.normal[0] == pytest.approx([0.0, 1.0], abs=1e-12)
    assert pair.tangent[0] == pytest.approx([-1.0, 0.0], abs=1e-12)
    assert pair.point[0] == pytest.approx([1e-6, 0.8e-6])
    assert pair.normal_velocity == pytest.approx([-2e-3 - 10.0 * 1e-6])
    assert pair.tangential_velocity == pytest.approx([-(1e-3 + 10.0 * 0.8e-6)])


def test_too_deep_is_refused():
    with pytest.raises(OverlapTooDeepError, match="half"):
        contacts(spheres(4.9e-6, 0.0))
    plate = make_body([[0, 0], [9e-6, 0], [9e-6, 9e-6], [0, 9e-6]], 1e-6, surface_density=2.0)
    speck = make_body([[0.0, 0.0]], 1e-7, surface_density=2.0)
    with pytest.raises(OverlapTooDeepError, match="inside"):
        contacts(Scene((plate, speck), np.zeros((2, 3)), np.zeros((2, 3))))


def test_crossing_bars_are_refused_though_no_vertex_is_near():
    bar = make_body([[-9e-6, 0.0], [9e-6, 0.0]], 1e-6, surface_density=2.0)
    crossed = Scene((bar, bar), np.array([[0, 0, 0], [0, 0, 1.5]]), np.zeros((2, 3)))
    for ask in (contacts, lambda scene: surface_gap(scene, 0, 1)):
        with pytest.raises(OverlapTooDeepError, match="cross"):
            ask(crossed)
