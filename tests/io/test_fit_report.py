"""What `flocsim fit` tells a person of its fits."""

import pytest

from flocsim.io.fit_report import coarse_line


@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ({"a": {1: 40.0, 16: 9.0, 64: 4.9}}, ""),
        ({"a": {1: 40.0}}, ""),
        # Above 5 % at the largest N alone counts; a fall by half for twice the vertices goes on.
        ({"a": {8: 20.0, 16: 10.0}}, "N = 16 is too small for the floc: RE is above 5 %, and 10 %"),
        ({"a": {8: 20.0, 16: 10.0}}, "which needs about 32 vertices"),
        ({"a": {8: 40.0, 16: 10.0}}, "which needs about 23 vertices"),
        ({"a": {16: 10.0}}, "which needs about 32 vertices"),  # nothing known of how it falls
        ({"a": {16: 10.0}, "b\n": {16: 20.0}, "c": {16: 1.0}}, "2 of 3 flocs"),
    ],
)
def test_an_n_too_small_is_said_with_one_that_would_do(errors, said):
    line = coarse_line(errors)
    assert said in line if said else line == ""
    assert "\n" not in line
