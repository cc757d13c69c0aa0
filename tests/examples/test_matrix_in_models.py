"""Exported matrices in other models: read back, and a kernel whose numbers are known."""

import sys

import numpy as np
import pytest

from flocsim.io.results.kernel_tables import efficiency_for, kernel_matrix
from tests.helpers.example_script import example_script
from tests.helpers.small_rates import some_kernel
from tests.helpers.small_study import ROOT

RADII = np.array([5e-6, 1e-5, 2e-5])
TIMES = np.linspace(0.0, 60.0, 61)
START, BETA = 1e12, 1.0 / 30e12


@pytest.fixture(scope="module")
def models():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(ROOT / "examples"), *sys.path])
        yield example_script("matrix_in_models")


def test_a_matrix_is_read_as_it_was_written(models, tmp_path):
    kernel = some_kernel()
    (tmp_path / "matrix.csv").write_text(kernel_matrix(kernel, "shear", 32, model="flocmod"))
    radii, values = models.read_matrix(tmp_path / "matrix.csv")
    assert radii == pytest.approx(kernel.radii)
    assert values == pytest.approx(efficiency_for(kernel, "shear", 32, "flocmod", "efficiency"))
    beta = models.between_classes(radii, values)
    assert beta(radii[:, None], radii) == pytest.approx(values)
    assert beta(0.1 * radii[0], 9.0 * radii[-1]) == pytest.approx(values[0, -1])


def test_flocmods_number_falls_as_its_kernel_says(models):
    # Flocs of one size, before there are others: dN/dt = −½ β N², β = G (2 D)³/6 times the matrix.
    times = np.array([0.0, 1e-3])
    n = models.flocmod(RADII, np.full((3, 3), 0.4), START, times, 10.0)
    beta = 0.4 * 10.0 / 6.0 * (4.0 * RADII[0]) ** 3
    assert (n[0] - n[1]) / times[1] == pytest.approx(0.5 * beta * START**2, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("model", "package"), [("pysdm", "PySDM"), ("particula", "particula")])
def test_a_constant_kernel_halves_the_number_in_its_time(models, model, package):
    pytest.importorskip(package)
    n = models.MODELS[model](RADII, np.full((3, 3), BETA), START, TIMES)
    assert n == pytest.approx(START / (1.0 + 0.5 * BETA * START * TIMES), rel=0.05)
    assert n[-1] < 0.55 * n[0]
