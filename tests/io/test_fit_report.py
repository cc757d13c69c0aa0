"""What `flocsim fit` tells a person of its fits."""

import pytest

from flocsim.geometry.shapes.shape import Sphere
from flocsim.io.fit_report import coarse_lines
from flocsim.io.shape_library import ShapeEntry, StoredFit


def entry(name, errors, spheroradius=1.0):
    fits = {n: StoredFit(Sphere(5e-6).parts, error) for n, error in errors.items()}
    return ShapeEntry(name, "a.png", 1e-6, (3.0, 4.0), 80, 5.0, spheroradius, fits)


@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ({"a": {1: 40.0, 16: 9.0, 64: 4.9}}, ""),
        ({"a": {1: 40.0}}, ""),
        # Above 5 % at the largest N alone counts.
        (
            {"a": {8: 20.0, 16: 10.0}},
            "N = 16 is too small for 1 of 1 floc: RE is above 5 %, for a even 10 %",
        ),
        (
            {"a": {16: 10.0}, "b": {16: 20.0}, "c": {16: 1.0}},
            "2 of 3 flocs: RE is above 5 %, for b even 20 %",
        ),
    ],
)
def test_an_n_too_small_is_reported_with_the_worst_floc(errors, said):
    lines = coarse_lines([entry(name, of_floc) for name, of_floc in errors.items()])
    assert said in lines[0] if said else lines == []


def test_a_disk_as_large_as_a_floc_is_reported_and_its_error_is_not():
    [line] = coarse_lines([entry("a", {16: 50.0}, 5.0), entry("b", {16: 1.0}, 5.0)])
    assert line.startswith("warning: the spheroradius is too large to fit 2 of 2 flocs")
