"""Group `kernel` of a results file: written, read, refused, and as matrices."""

import csv

import numpy as np
import pytest

from flocsim.errors import UsageError
from flocsim.io.results.kernel_tables import (
    curvilinear_factor,
    efficiency_for,
    kernel_matrix,
)
from tests.helpers.small_rates import some_kernel


def test_arrays_have_axes_units_and_meanings():
    labelled = some_kernel().labelled()
    assert labelled.columns["alpha"].axes == ("mechanism", "vertices", "i", "j")
    assert labelled.columns["beta3"].about["units"] == "m3 s-1"
    assert labelled.axes["r_eq"].values.tolist() == [5e-6, 1e-5]
    assert all(column.about["long_name"] for column in labelled.columns.values())


def test_a_matrix_names_what_it_multiplies():
    lines = kernel_matrix(some_kernel(), "shear", 32).splitlines()
    told = [line for line in lines if line.startswith("#")]
    assert "4/3 G (r_i + r_j)^3" in told[0] and "upper bound" in told[-1]
    rows = list(csv.reader(lines[len(told) :]))
    assert [float(each) for each in rows[0][1:]] == [5e-6, 1e-5]
    values = np.array([[float(each) for each in row[1:]] for row in rows[1:]])
    assert np.array_equal(values, some_kernel().arrays["efficiency3"][1, 1])


def numbers_of(text):
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return np.array([[float(each) for each in row[1:]] for row in csv.reader(lines[1:])])


@pytest.mark.parametrize("mechanism", ["settling", "shear"])
@pytest.mark.parametrize("model", ["spheres", "flocmod"])
def test_a_matrix_has_the_factor_that_was_asked_for_and_says_so(mechanism, model):
    kernel = some_kernel()
    text = kernel_matrix(kernel, mechanism, 32, model=model, curvilinear="hill")
    plain = efficiency_for(kernel, mechanism, 32, model)
    factor = curvilinear_factor("hill", mechanism, kernel.radii[:, None], kernel.radii)
    assert numbers_of(text) == pytest.approx(plain * factor, rel=1e-15, abs=0.0)
    assert np.array_equal(numbers_of(text), numbers_of(text).T)
    told = [line for line in text.splitlines() if line.startswith("#")]
    assert told[0].startswith(f"# efficiency times curvilinear factor in {mechanism}: multiplies")
    assert "upper bound" not in text and "Hill (1992)" in text
    assert any("solid spheres" in line and "not known" in line for line in told)
    assert "curvilinear" not in kernel_matrix(kernel, mechanism, 32, model=model)


def test_a_factor_multiplies_efficiencies_alone():
    kernel = some_kernel()
    with pytest.raises(UsageError, match="multiplies the kernels of spheres, not alpha"):
        kernel_matrix(kernel, "shear", 32, "alpha", curvilinear="hill")


def test_flocmods_settling_kernel_lacks_an_eighteenth():
    kernel = some_kernel()
    plain = efficiency_for(kernel, "settling", 32, "spheres")
    flocmod = efficiency_for(kernel, "settling", 32, "flocmod")
    assert flocmod == pytest.approx(plain / 18.0)
    assert plain[0, 0] == 0.0, "bodies of one size do not meet"
    assert np.array_equal(
        efficiency_for(kernel, "shear", 1, "spheres"), efficiency_for(kernel, "shear", 1, "flocmod")
    )
    assert "1/18" in kernel_matrix(kernel, "settling", 1, model="flocmod")
