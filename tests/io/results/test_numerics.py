"""Where the numerical error is worth a column, a bar, or a line alone."""

import attrs
import numpy as np
import pytest

from flocsim.io.results.numerics import numerics_matter
from tests.helpers.synthetic_results import make_results


def with_error(error, name="pr_a"):
    """Results of 96 collisions in each condition, with a numerical error in one of them."""
    made = make_results(count=8)
    changed = {f"{each}_numerical": np.zeros(made.shape) for each in ("pr_a", "pr_inside")}
    changed |= {"n_collided": np.full(made.shape, 96)}
    changed[f"{name}_numerical"][1, 2, 3] = error
    return attrs.evolve(made, probabilities=made.probabilities | changed)


@pytest.mark.parametrize("name", ["pr_a", "pr_inside"])
def test_an_error_above_half_of_the_widest_interval_matters(name):
    # Wilson's interval of 48 of 96 is 0.196 wide.
    assert numerics_matter(with_error(0.099, name))
    assert not numerics_matter(with_error(0.097, name))


def test_conditions_without_re_runs_do_not_count():
    assert not numerics_matter(with_error(np.nan))
