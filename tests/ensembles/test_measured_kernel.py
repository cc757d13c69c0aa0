"""Kernels of measured size distributions, end to end: a study of a library against the same mean
over all pairs of its flocs, each of which has a width that is known."""

import itertools

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from flocsim.__main__ import main
from flocsim.ensembles.collision.flocs import read_flocs
from flocsim.ensembles.config.loader import load_any_config
from flocsim.io.results.file import read_results
from tests.helpers.small_study import write_star_library

STUDY = """\
preset = "si"
seed = 4
replicates = {replicates}
[scene]
kind = "kernel"
meeting = ["settling", "shear"]
rate = "10 1/s"
pairs = "measured"
weight = "volume"
classes = ["13 um"]
scrambles = 8
time_limit = "5 s"
[shapes]
source = "library"
file = "stars.h5"
vertices = [1, 5]
[forces]
van_der_waals = false
double_layer = false
"""
pytestmark = pytest.mark.slow
RATE = 10.0
SPEED = 2.0 / 9.0 * (2650.0 - 997.0) * 9.81 / 8.9e-4
"""Stokes's, over r² [1/(m s)]."""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """(flocs of the library, the Kernel) of a study of four stars in two classes."""
    folder = tmp_path_factory.mktemp("measured")
    write_star_library(folder / "stars.h5", (5,), (6.0, 9.0, 16.0, 21.0, 24.0))
    (folder / "study.toml").write_text(STUDY.format(replicates=256), "utf-8")
    words = ["kernel", str(folder / "study.toml"), "--quiet", "-o", str(folder / "study.h5")]
    assert main(words) == 0
    flocs = read_flocs(load_any_config(folder / "study.toml").shapes)
    kernel = read_results(folder / "study.h5").kernel
    assert kernel is not None
    return flocs, kernel


def pairs_of(flocs, first, second):
    """[(weight, floc i, floc j)] of two classes: both drawn by volume, those of one size left out;
    weights of the sum 1."""
    classes = ([f for f in flocs if f.size < 13e-6], [f for f in flocs if f.size > 13e-6])
    found = [
        (a.size**3 * b.size**3, *sorted((a, b), key=lambda floc: floc.size))
        for a, b in itertools.product(classes[first], classes[second]) if a.size != b.size
    ]  # fmt: skip
    total = sum(weight for weight, _, _ in found)
    return [(weight / total, i, j) for weight, i, j in found]


def width_of(floc, vertices):
    """The mean width of the shadow, by Cauchy: the perimeter of the hull over π [m]."""
    if vertices == 1:
        return 2.0 * floc.size
    shape = floc.measured(vertices)
    return ConvexHull(shape.vertices).area / np.pi + 2.0 * shape.radius


CLASSES = ((0, 0), (0, 1), (1, 1))


def ends_of(kernel, name, place):
    """(estimate, 2.5 times half of its 95 % interval, of which Student's 8 scrambles leave one in a
    thousand beyond)."""
    value, low, high = (float(kernel.arrays[name + end][place]) for end in ("", "_low", "_high"))
    return value, 2.5 * max(value - low, high - value)


@pytest.mark.parametrize("vertices", [1, 5])
@pytest.mark.parametrize("classes", CLASSES)
def test_settling_widths_are_the_means_of_all_pairs(study, classes, vertices):
    flocs, kernel = study
    place = (0, [1, 5].index(vertices), *classes)
    pairs = pairs_of(flocs, *classes)
    width = sum(w * (width_of(i, vertices) + width_of(j, vertices)) for w, i, j in pairs)
    value, error = ends_of(kernel, "width_c", place)
    assert abs(value - width) <= error
    assert error < 0.1 * width
    rate = sum(
        w * (width_of(i, vertices) + width_of(j, vertices)) * SPEED * (j.size**2 - i.size**2)
        for w, i, j in pairs
    )
    value, error = ends_of(kernel, "beta2_c", place)
    assert abs(value - rate) <= error
    assert kernel.arrays["speed"][place] == pytest.approx(
        sum(w * SPEED * (j.size**2 - i.size**2) for w, i, j in pairs), rel=0.1
    )


@pytest.mark.parametrize("classes", CLASSES)
def test_shear_brings_spheres_together_at_the_mean_rate_of_all_pairs(study, classes):
    flocs, kernel = study
    pairs = pairs_of(flocs, *classes)
    plane = sum(w * RATE * (i.size + j.size) ** 2 for w, i, j in pairs)
    space = sum(w * 4.0 / 3.0 * RATE * (i.size + j.size) ** 3 for w, i, j in pairs)
    for name, wanted in (("beta2_c", plane), ("beta3_c", space)):
        value, error = ends_of(kernel, name, (1, 0, *classes))
        assert abs(value - wanted) <= error
        assert error < 0.2 * wanted
    for name, wanted in (("beta2_reference", plane), ("beta3_reference", space)):
        assert kernel.arrays[name][1, 0][classes] == pytest.approx(wanted, rel=0.05)
