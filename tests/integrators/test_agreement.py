"""Different methods, one motion: at tight settings they end at the same place.

And how honest the estimate of the error is, on scenes whose true end is known from there.
"""

from functools import cache

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon
from flocsim.forces import Contact
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.methods import by_adaptive
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import ELASTIC, PolygonSystem, Spring, encounter, head_on, watched

STICKY = [Contact(k_n=20.0, k_t=2.0, damping_n=4e5), Spring(5e-2, -1e-6)]
LOOSE = [ELASTIC, Spring(1e-2, -2e-6)]
SPHERE = Sphere(6e-6)


def octagon():
    """A regular octagon of the size of the sphere."""
    angles = 2.0 * np.pi * np.arange(8) / 8
    return SpheroPolygon(5e-6 * np.column_stack([np.cos(angles), np.sin(angles)]), 1e-6)


def doublet(shape, height):
    """Two turning bodies that are pulled together, slide, and roll on each other."""
    lower = Body(shape, (0.0, 0.0), 0.1, (2e-3, 0.0), 400.0, surface_density=2.0)
    upper = Body(shape, (0.4e-6, height), 0.35, (-2e-3, 0.0), 280.0, surface_density=2.0)
    return [lower, upper]


SCENES = {
    "spheres": (lambda: doublet(SPHERE, 11.95e-6), STICKY, 1e-3),
    "octagons": (lambda: doublet(octagon(), 11.6e-6), STICKY, 1e-3),
    "bounce": (lambda: head_on(1e-2, 1e-7), LOOSE, 6e-5),
    "encounter": (encounter, LOOSE, 1.5e-4),
}


@cache
def run(scene, integrator):
    """The end of a scene."""
    bodies, forces, until = SCENES[scene]
    end = watched(PolygonSystem(bodies(), forces, integrator), until)
    assert end.status.name == "FINISHED"
    return end


def apart(end, other):
    """How far two ends lie apart [m], turns as paths at 10 µm."""
    return np.abs((end.position - other.position) * [1.0, 1.0, 1e-5]).max()


@pytest.mark.parametrize(
    ("integrator", "allowed"),
    [
        pytest.param(VelocityVerlet(2e-9), 5e-10, id="VelocityVerlet", marks=pytest.mark.slow),
        pytest.param(DormandPrince54(1e-13), 1e-11, id="DormandPrince54"),
    ],
)
@pytest.mark.parametrize(
    "scene", rest_slow(["spheres", "octagons"], lambda scene: scene == "spheres")
)
def test_a_sticky_rolling_doublet_is_the_same_for_all_methods(scene, integrator, allowed):
    exact = run(scene, Implicit(1e-14))
    assert apart(run(scene, integrator), exact) < allowed


@pytest.mark.parametrize("scene", ["spheres", "octagons"])
def test_the_doublet_has_stuck_and_turned(scene):
    end = run(scene, Implicit(1e-14))
    assert end.contacts <= 2
    assert np.abs(np.diff(end.position[:, 2])) < 0.25
    start = SCENES[scene][0]()
    assert np.abs(end.position[:, 2] - [body.angle for body in start]).min() > 0.2


ROUNDING = 1e-17
"""What rounding alone does to places [m]: forces without friction or turning are followed to it."""


@by_adaptive
@pytest.mark.parametrize("tolerance", [1e-9, 1e-10, 1e-12])
@pytest.mark.parametrize("scene", SCENES)
def test_the_estimated_error_is_no_less_than_a_tenth_of_the_true_one(scene, tolerance, integrator):
    end = run(scene, attrs.evolve(integrator, tolerance=tolerance))
    assert apart(end, run(scene, Implicit(1e-14))) <= 10.0 * end.error + ROUNDING


@by_adaptive
@pytest.mark.parametrize("scene", SCENES)
def test_a_finer_tolerance_is_nearer_to_the_truth(scene, integrator):
    exact = run(scene, Implicit(1e-14))
    coarse, fine = (
        apart(run(scene, attrs.evolve(integrator, tolerance=each)), exact) for each in (1e-9, 1e-12)
    )
    assert fine < 0.1 * coarse or fine < 1e-14
