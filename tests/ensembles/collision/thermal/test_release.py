"""Where two bodies are let go, and which of them cannot be."""

import math

import pytest

from flocsim import Sphere, SpheroPolygon
from flocsim.ensembles.collision.thermal.release import ends_of, refuse_release, start_apart
from flocsim.ensembles.config.pair_scene import BrownianScene
from flocsim.errors import UsageError

SPHERES = (Sphere(1e-6), Sphere(3e-6))
SCENE = BrownianScene(release=1.5, escape=5.0)


def test_distances_are_multiples_of_the_sum_of_radii():
    assert ends_of(SCENE, SPHERES) == pytest.approx((6e-6, 2e-5))
    usual = BrownianScene()
    assert (usual.release, usual.escape, usual.delta) == (2.0, 4.0, (0.0,))


def test_a_start_is_as_far_away_in_any_direction():
    for share in (0.0, 0.3, 0.9):
        places = start_apart((1.0, 2.0), share, 6e-6)
        assert places[:, 2].tolist() == [1.0, 2.0] and places[0, :2].tolist() == [0.0, 0.0]
        assert math.hypot(*places[1, :2]) == pytest.approx(6e-6)
        turn = math.atan2(places[1, 1], places[1, 0]) / (2.0 * math.pi)
        assert turn % 1.0 == pytest.approx(share)


def test_what_never_meets_or_touches_at_first_is_refused():
    refuse_release(SCENE, SPHERES, 1e-13)
    with pytest.raises(UsageError, match="do not diffuse never meet"):
        refuse_release(SCENE, SPHERES, 0.0)
    rod = SpheroPolygon([(-9e-6, 0.0), (9e-6, 0.0)], 5e-7)
    with pytest.raises(UsageError, match=r"scene.release = 1.5 \(r_i \+ r_j\) lets outlines"):
        refuse_release(SCENE, (rod, rod), 1e-13)
