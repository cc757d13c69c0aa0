"""What `flocsim fit` tells a person of its fits."""

import pytest

from flocsim.io.fit_report import coarse_line


@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ({"a": {1: 40.0, 16: 9.0, 64: 4.9}}, ""),
        ({"a": {1: 40.0}}, ""),
        ({}, ""),
        # Above 5 % at the largest N alone counts.
        (
            {"a": {8: 20.0, 16: 10.0}},
            "N = 16 is too small for 1 of 1 floc: RE is above 5 %, and 10 %",
        ),
        (
            {"a": {16: 10.0}, "b": {16: 20.0}, "c": {16: 1.0}},
            "2 of 3 flocs: RE is above 5 %, and 20 %",
        ),
    ],
)
def test_an_n_too_small_is_reported_with_the_worst_floc(errors, said):
    line = coarse_line(errors)
    assert said in line if said else line == ""
